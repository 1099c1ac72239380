//! The choice of recordings by note, date, bead, flag and verdict.

use std::collections::BTreeSet;
use std::str::FromStr;

use crate::recording::{LoggedRecording, LoggedStrike};

/// Recordings and strikes that are wanted. Everything that is given must hold.
#[derive(Clone, Debug, Default)]
pub struct Filter {
    /// Notes that the recording has.
    pub notes: Vec<NotePattern>,
    /// Earliest date, ns since 1970.
    pub since_ns: Option<i64>,
    /// Date before which it is, ns since 1970.
    pub before_ns: Option<i64>,
    /// Addresses of beads, of which the recording has one at least; `None` for any.
    pub beads: Option<BTreeSet<usize>>,
    /// Flags, each of which one of its strikes has.
    pub flags: Vec<String>,
    /// The verdict that was noted last; `none` for a recording without one.
    pub verdict: Option<String>,
}

/// The verdict of a recording that was not judged.
pub const NO_VERDICT: &str = "none";

impl Filter {
    /// True if a recording is wanted.
    pub fn takes(&self, recording: &LoggedRecording) -> bool {
        let date = recording.date.unix_ns;
        let flags = recording.flags();
        let verdict = recording.verdict().unwrap_or(NO_VERDICT);
        recording.problem.is_none()
            && self.notes.iter().all(|note| note.takes(recording))
            && self.since_ns.is_none_or(|since| date >= since)
            && self.before_ns.is_none_or(|before| date < before)
            && self.flags.iter().all(|flag| flags.contains(flag.as_str()))
            && self.verdict.as_deref().is_none_or(|wanted| wanted == verdict)
            && (self.beads.is_none() || recording.beads.iter().any(|bead| self.takes_bead(*bead)))
    }

    /// True if a bead is wanted.
    pub fn takes_bead(&self, address: u8) -> bool {
        let beads = self.beads.as_ref();
        beads.is_none_or(|beads| beads.contains(&usize::from(address)))
    }

    /// The strikes of a recording whose beads are wanted.
    pub fn strikes<'a>(&'a self, recording: &'a LoggedRecording) -> impl Iterator<Item = &'a LoggedStrike> {
        let strikes = recording.strikes.iter();
        strikes.filter(|strike| self.takes_bead(strike.address))
    }
}

/// A note that is looked for: `KEY` for any text, or `KEY=TEXT`, in which `*` stands for any letters.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NotePattern {
    key: String,
    text: Option<String>,
}

impl FromStr for NotePattern {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (key, value) = match text.split_once('=') {
            Some((key, value)) => (key, Some(value.trim().to_lowercase())),
            None => (text, None),
        };
        if key.trim().is_empty() {
            return Err(
                "give the key of a note, or KEY=TEXT, such as specimen=A12 or operator=An*".to_owned(),
            );
        }
        Ok(Self {
            key: key.trim().to_lowercase(),
            text: value,
        })
    }
}

impl NotePattern {
    fn takes(&self, recording: &LoggedRecording) -> bool {
        let of_key = recording
            .notes
            .iter()
            .filter(|(key, _)| key.to_lowercase() == self.key);
        of_key.into_iter().any(|(_, found)| {
            let wanted = self.text.as_deref();
            wanted.is_none_or(|wanted| matches(wanted, &found.to_lowercase()))
        })
    }
}

/// True if a text is a pattern in which `*` stands for any letters.
fn matches(pattern: &str, text: &str) -> bool {
    let mut parts = pattern.split('*');
    // A pattern has one part at least.
    let first = parts.next().unwrap_or_default();
    let Some(mut rest) = text.strip_prefix(first) else {
        return false;
    };
    let mut parts: Vec<&str> = parts.collect();
    let Some(last) = parts.pop() else {
        return rest.is_empty();
    };
    for part in parts {
        match rest.find(part) {
            Some(at) => rest = &rest[at + part.len()..],
            None => return false,
        }
    }
    rest.ends_with(last)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::date::parse;
    use crate::recording::FileStamp;

    #[test]
    fn a_star_stands_for_any_letters() {
        for (pattern, text, is_it) in [
            ("a12", "a12", true),
            ("a12", "a1", false),
            ("a12", "a123", false),
            ("a*", "a12", true),
            ("*2", "a12", true),
            ("a*2*4", "a12-34", true),
            ("a*2*4", "a14-34", false),
            ("*", "", true),
            ("a*a", "a", false),
            ("", "a", false),
        ] {
            assert_eq!(matches(pattern, text), is_it, "{pattern} {text}");
        }
    }

    #[test]
    fn everything_that_is_asked_for_must_hold() {
        let stamp = FileStamp {
            size: 1,
            modified_ns: None,
        };
        let mut one = LoggedRecording::empty("x.mcap", stamp, parse("2026-11-28").unwrap());
        one.beads = BTreeSet::from([7, 8]);
        one.notes.extend([
            ("Operator".into(), "Ana Lima".into()),
            ("verdict".into(), "fail".into()),
        ]);
        fn note(text: &str) -> Vec<NotePattern> {
            vec![text.parse().unwrap()]
        }
        let all = Filter {
            notes: note("operator=ana*"),
            since_ns: parse("2026-11-28"),
            before_ns: parse("2026-11-29"),
            beads: Some(BTreeSet::from([8, 9])),
            flags: Vec::new(),
            verdict: Some("fail".to_owned()),
        };
        assert!(all.takes(&one));
        let changes: [fn(&mut Filter); 7] = [
            |filter| filter.notes = note("operator=Ana"),
            |filter| filter.notes = note("specimen"),
            |filter| filter.since_ns = parse("2026-11-29"),
            |filter| filter.before_ns = parse("2026-11-28"),
            |filter| filter.beads = Some(BTreeSet::from([9])),
            |filter| filter.flags = vec!["wave_train".to_owned()],
            |filter| filter.verdict = Some(NO_VERDICT.to_owned()),
        ];
        for change in changes {
            let mut wrong = all.clone();
            change(&mut wrong);
            assert!(!wrong.takes(&one), "{wrong:?}");
        }
        one.problem = Some("is no recording".to_owned());
        assert!(!all.takes(&one));
    }
}
