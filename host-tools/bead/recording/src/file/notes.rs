//! Notes of people in a recording: who struck, what hung on the rig, where.
//!
//! # Design
//! A note is a separate metadata record with a key, a value, its author and the time at which it was written.
//! Notes are only ever added. The last one of a key counts, and those before it stay as its history; an empty
//! value withdraws a key.

use std::collections::BTreeMap;

use bead_tables::printable::{beginning, one_line};
use chrono::{DateTime, SecondsFormat, Utc};
use mcap::records::Metadata;

use crate::file::layout::{NOTE, known};

/// Greatest number of notes of a recording.
pub const NOTES_MOST: usize = 1000;
/// Greatest length of a key, of an author and of a value, in characters.
const KEY_MOST: usize = 40;
const AUTHOR_MOST: usize = 60;
const VALUE_MOST: usize = 1000;

/// A note of a person.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Note {
    /// Its subject, such as `operator` or `specimen`.
    pub key: String,
    /// Its text; empty to withdraw the key.
    pub value: String,
    /// The person who wrote it, if that is known.
    pub author: Option<String>,
    /// The time at which it was written, if that is known.
    pub written: Option<DateTime<Utc>>,
}

impl Note {
    /// Reads `KEY=VALUE` as a person types it, without author and time.
    ///
    /// # Errors
    /// There is no `=`, or key or value cannot be noted: the message says what would do.
    pub fn parse(text: &str) -> Result<Self, String> {
        let (key, value) = text
            .split_once('=')
            .ok_or_else(|| format!("{text:?} is not a note; give KEY=VALUE, such as operator=Ana"))?;
        let (key, value) = (key.trim(), value.trim());
        let is_key = |letter: char| letter.is_alphanumeric() || matches!(letter, '_' | '-' | '.');
        if key.is_empty() || key.chars().count() > KEY_MOST || !key.chars().all(is_key) {
            return Err(format!(
                "{:?} cannot be the key of a note; give up to {KEY_MOST} letters, digits, _, - and ., such as specimen",
                beginning(key, KEY_MOST)
            ));
        }
        if value.chars().count() > VALUE_MOST {
            return Err(format!(
                "the note {key} is longer than {VALUE_MOST} characters; put the text in a file and note the file's name"
            ));
        }
        if one_line(value) != value {
            return Err(format!(
                "the note {key} contains control characters or line breaks; give one line of text"
            ));
        }
        Ok(Self {
            key: key.to_owned(),
            value: value.to_owned(),
            author: None,
            written: None,
        })
    }

    /// This note as written by a person now. An author who cannot be shown in a line is shortened and
    /// escaped.
    #[must_use]
    pub fn signed(self, author: Option<&str>, written: DateTime<Utc>) -> Self {
        Self {
            author: author
                .filter(|name| !name.is_empty())
                .map(|name| shown(name, AUTHOR_MOST)),
            written: Some(written),
            ..self
        }
    }

    /// The time at which it was written as text in seconds of UTC (RFC 3339).
    pub fn written_text(&self) -> Option<String> {
        let text = |time: DateTime<Utc>| time.to_rfc3339_opts(SecondsFormat::Secs, true);
        self.written.map(text)
    }

    pub(super) fn to_record(&self) -> Metadata {
        Metadata {
            name: NOTE.into(),
            metadata: known([
                ("key", Some(self.key.clone())),
                ("value", Some(self.value.clone())),
                ("author", self.author.clone()),
                ("written", self.written_text()),
            ]),
        }
    }

    /// The note in a metadata record, `None` for one without a key. Another program may have written it, so
    /// its texts are shortened, and made safe to print.
    pub(super) fn from_map(mut map: BTreeMap<String, String>) -> Option<Self> {
        let mut take = |name: &str, most| map.remove(name).map(|text| shown(&text, most));
        let (key, value) = (take("key", KEY_MOST)?, take("value", VALUE_MOST));
        let (author, written) = (take("author", AUTHOR_MOST), take("written", KEY_MOST));
        let written = written.and_then(|text| DateTime::parse_from_rfc3339(&text).ok());
        Some(Self {
            key,
            value: value.unwrap_or_default(),
            author,
            written: written.map(|time| time.to_utc()),
        })
    }
}

fn shown(text: &str, most: usize) -> String {
    one_line(&beginning(text, most)).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_note_that_cannot_be_shown_in_a_line_is_refused_with_what_would_do() {
        let note = Note::parse("specimen = A 12 = left").unwrap();
        assert_eq!(
            (note.key.as_str(), note.value.as_str()),
            ("specimen", "A 12 = left")
        );
        let long = format!("x={}", "µ".repeat(1001));
        for (text, advice) in [
            ("Ana", "give KEY=VALUE"),
            ("=Ana", "give up to 40 letters"),
            ("who is it=Ana", "give up to 40 letters"),
            ("x=a\nb", "give one line"),
            ("x=\u{1b}[2J", "give one line"),
            (&long, "longer than 1000 characters"),
        ] {
            let refused = Note::parse(text).unwrap_err();
            assert!(refused.contains(advice), "{refused}");
            assert_eq!(refused.lines().count(), 1);
        }
    }

    #[test]
    fn notes_of_another_program_are_made_safe_and_one_without_a_key_is_none() {
        let map = |pairs: &[(&str, &str)]| {
            let owned = pairs
                .iter()
                .map(|(name, text)| ((*name).to_owned(), (*text).to_owned()));
            Note::from_map(owned.collect())
        };
        let long = "k".repeat(1 << 20);
        let note = map(&[("key", &long), ("value", "\u{1b}[2J"), ("written", "yesterday")]).unwrap();
        assert_eq!(
            (note.key.chars().count(), note.value.as_str()),
            (41, "\\u001b[2J")
        );
        assert_eq!((note.author, note.written), (None, None));
        assert_eq!(map(&[("value", "x")]), None);
    }
}
