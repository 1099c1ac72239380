//! Quantities as people write and read them: a file, a change on a command line, a difference.

use std::fmt::{self, Write};

use bead_model::settings::Settings;
use hertz_chain::{InputError, TomlFile};
use serde::Serialize;
use serde_json::Value;

use crate::recording::physical::keys::{KEYS, Key, TABLES};
use crate::recording::physical::quantities::Physical;

/// A change of one key.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    /// Its path.
    pub key: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// What it was.
    pub from: Value,
    /// What it is.
    pub to: Value,
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { key, unit, from, to } = self;
        let space = if unit.is_empty() { "" } else { " " };
        write!(f, "{key}: {} -> {}{space}{unit}", shown(from), shown(to))
    }
}

impl Physical {
    /// Reads the text of a file; `name` is what messages call it.
    ///
    /// # Errors
    /// One line with file, line, key, what is wrong and what would do.
    pub fn parse(text: &str, name: &str) -> Result<(Self, Settings), InputError> {
        let file = TomlFile::parse(text, name)?;
        let physical: Self = file.read()?;
        let settings = physical.settings().map_err(|error| file.locate(error))?;
        Ok((physical, settings))
    }

    /// Sets a key as on a command line: `intruder.stiffness=4e5`, `k=4e5`.
    ///
    /// # Errors
    /// One line: no such key, or a value of another kind.
    pub fn set(&mut self, assignment: &str) -> Result<(), InputError> {
        let (name, text) = assignment.split_once('=').ok_or_else(|| {
            InputError::at(
                "",
                format!("`{assignment}` sets nothing"),
                "write KEY=VALUE, such as name=left or k=3.9e5",
            )
        })?;
        let (name, text) = (name.trim(), text.trim());
        let key = find(name)?;
        let value = match (key.path, text.parse::<u64>(), text.parse::<f64>()) {
            ("name", ..) => text.into(),
            (path, Ok(whole), _) if is_whole(path) => whole.into(),
            (_, _, Ok(number)) if number.is_finite() => number.into(),
            _ => Value::Null,
        };
        *self = self.with(key, value).map_err(|_| {
            let unit = if key.unit.is_empty() {
                String::new()
            } else {
                format!(", in {}", key.unit)
            };
            InputError::at(
                key.path,
                format!("`{text}` is no value of it"),
                format!("give {}{unit}", kind(key)),
            )
        })?;
        Ok(())
    }

    /// What differs from `self` in `other`.
    pub fn changes(&self, other: &Self) -> Vec<Change> {
        let change = |key: &'static Key| {
            let (from, to) = (self.get(key), other.get(key));
            (from != to).then_some(Change {
                key: key.path,
                unit: key.unit,
                from,
                to,
            })
        };
        KEYS.iter().filter_map(change).collect()
    }

    /// The file, with every key explained.
    pub fn to_toml(&self) -> String {
        let mut text = String::from(
            "# A bead in physical quantities, SI units. `bead settings make` makes its settings of it,\n\
             # `bead settings write` gives them to the bead.\n\n",
        );
        let mut table = "";
        for key in KEYS {
            let (of, name) = key.path.split_once('.').unwrap_or(("", key.path));
            if of != table {
                table = of;
                let what = TABLES
                    .iter()
                    .find(|(name, _)| *name == of)
                    .map_or("", |(_, what)| what);
                // Writing to a string cannot fail.
                let _ = write!(text, "\n# {what}\n[{of}]\n");
            }
            let entry = format!("{name} = {}", shown(&self.get(key)));
            let unit = if key.unit.is_empty() {
                String::new()
            } else {
                format!("{}  ", key.unit)
            };
            let letter = if key.letter.is_empty() {
                String::new()
            } else {
                format!("{}: ", key.letter)
            };
            let _ = writeln!(text, "{entry:<34} # {unit}{letter}{}", key.what);
        }
        text
    }
}

/// A key by its path or by its letter.
fn find(name: &str) -> Result<&'static Key, InputError> {
    let named = |key: &&Key| key.path == name || key.letter == name && !name.is_empty();
    KEYS.iter().find(named).ok_or_else(|| {
        let known: Vec<_> = KEYS.iter().map(|key| key.path).collect();
        InputError::at(
            name,
            "no such key",
            format!("keys are {}, and M, m, k, c, kappa, tau", known.join(", ")),
        )
    })
}

fn is_whole(path: &str) -> bool {
    matches!(
        path,
        "address" | "capture.sample_rate" | "company.behind" | "company.elsewhere"
    )
}

fn kind(key: &Key) -> &'static str {
    match is_whole(key.path) {
        true => "a whole number",
        false => "a number",
    }
}

/// A value as TOML, and as people read it.
fn shown(value: &Value) -> String {
    match value {
        Value::Number(number) if number.is_f64() => match number.as_f64() {
            Some(float) if float != 0.0 && !(1e-3..1e6).contains(&float.abs()) => format!("{float:e}"),
            Some(float) => format!("{float:?}"),
            None => number.to_string(),
        },
        // As in TOML: quotes and control characters escaped.
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bead_model::design::{Bead, FrontEnd, Neighbours};

    fn paper() -> Physical {
        Physical {
            name: "left".into(),
            address: 3,
            ..Physical::new(&Bead::paper(), &Neighbours::default(), &FrontEnd::reference())
        }
    }

    #[test]
    fn a_file_that_was_written_is_read_to_the_same_bits() {
        let bead = paper();
        let text = bead.to_toml();
        let (read, settings) = Physical::parse(&text, "bead.toml").unwrap();
        assert_eq!(read, bead, "{text}");
        assert_eq!(settings, bead.settings().unwrap());
        assert_eq!(settings.name.as_str(), "left");
        for key in KEYS {
            let name = format!("{} =", key.path.rsplit('.').next().unwrap());
            let explained = |line: &str| line.starts_with(&name) && line.ends_with(key.what);
            assert!(text.lines().any(explained), "{}", key.path);
        }
    }

    #[test]
    fn a_block_comes_back_as_the_numbers_that_it_was_made_of() {
        let bead = paper();
        let settings = bead.settings().unwrap();
        let back = Physical::of(&settings);
        let near = |key: &Key| {
            let [a, b] = [bead.get(key), back.get(key)].map(|value| value.as_f64().unwrap_or(0.0));
            (a - b).abs() <= 1e-7 * a.abs()
        };
        // The block has no noise of the acceleration: the bead measures it.
        for key in KEYS.iter().filter(|key| key.path != "acceleration.noise") {
            assert!(near(key), "{}: {} and {}", key.path, bead.get(key), back.get(key));
        }
        assert_eq!((back.intruder.stiffness, back.force.pole), (3.95e5, 40e3));
        let again = back.settings().unwrap();
        assert_eq!(
            (
                again.bead,
                again.force,
                again.acceleration,
                again.window,
                again.chain.gate
            ),
            (
                settings.bead,
                settings.force,
                settings.acceleration,
                settings.window,
                settings.chain.gate
            )
        );
    }

    #[test]
    fn a_change_is_told_with_its_unit_and_changes_nothing_else() {
        let bead = Physical::of(&paper().settings().unwrap());
        let mut other = bead.clone();
        other.set("k=4.1e5").unwrap();
        other.set("name = right one").unwrap();
        let told: Vec<_> = bead.changes(&other).iter().map(Change::to_string).collect();
        assert_eq!(
            told,
            [
                "name: \"left\" -> \"right one\"",
                "intruder.stiffness: 395000.0 -> 410000.0 N/m"
            ]
        );
        let (before, after) = (bead.settings().unwrap(), other.settings().unwrap());
        assert_eq!(after.bead.stiffness, 4.1e5);
        assert_eq!(
            (before.force, before.chain.contact),
            (after.force, after.chain.contact)
        );
    }

    #[test]
    fn what_is_wrong_is_told_with_line_and_key() {
        let text = paper().to_toml();
        let refused = |from: &str, to: &str| {
            let changed = text.replacen(from, to, 1);
            assert_ne!(changed, text);
            Physical::parse(&changed, "bead.toml").unwrap_err().to_string()
        };
        let line = |of: &str| 1 + text.lines().position(|line| line.starts_with(of)).unwrap();
        let begins = |found: String, of: &str, rest: &str| {
            let expected = format!("bead.toml:{}: {rest}", line(of));
            assert!(found.starts_with(&expected), "{found}\n{expected}");
            assert_eq!(found.lines().count(), 1);
        };
        begins(
            refused("stiffness =", "stifness ="),
            "stiffness =",
            "intruder.stifness: unknown key; did you mean `stiffness`?",
        );
        begins(
            refused("damping = 12.0", "damping = -12.0"),
            "damping =",
            "intruder.damping: -12 is out of range",
        );
        begins(
            refused("damping = 12.0", "damping = \"x\""),
            "damping =",
            "intruder.damping: the text",
        );
        begins(
            refused("\"left\"", "\"a name that is too long\""),
            "name =",
            "name: `a name that is too long` is no name",
        );
        begins(
            refused("address = 3", "address = 255"),
            "address =",
            "address: 255 is",
        );
        begins(
            refused("damping = 12.0", "#"),
            "[intruder]",
            "intruder: the key `damping` is missing",
        );
        for (from, to, of, rest) in [
            (
                "pole = 40000.0",
                "pole = -1.0",
                "pole =",
                "force.pole: -1 is out of range; give 0 for no filter, or a value that is positive",
            ),
            (
                "history = 0.0016",
                "history = 0.01",
                "history =",
                "capture.history: history is longer than 256 samples; give 1.28e-3 to 2.56e-3 s",
            ),
            (
                "length = 0.00672",
                "length = 1e-3",
                "length =",
                "capture.length: window is not longer than its history; give more than capture.history",
            ),
            (
                "lookback = 5e-4",
                "lookback = 0.5",
                "lookback =",
                "capture.lookback: lookback is 0 or not shorter than the history; give more than 0, and less",
            ),
            (
                "threshold = 0.1",
                "threshold = 1e-3",
                "threshold =",
                "capture.threshold: threshold is ",
            ),
            (
                "sample_rate = 100000",
                "sample_rate = 1",
                "sample_rate =",
                "capture.sample_rate: 1 Hz, and the image samples at 100000 Hz alone; give 100000, or leave it out",
            ),
            (
                "sample_rate = 100000",
                "sample_rate = 99999",
                "sample_rate =",
                "capture.sample_rate: 99999 Hz, and",
            ),
            (
                "relaxation = 4.2e-6",
                "relaxation = 1e-12",
                "relaxation =",
                "contact.relaxation: relaxation time of the contacts over 2/3 of a sample: 1.500e-7 in the units of the sample \
                 rate, and ",
            ),
            (
                "ring_frequency_tolerance = 0.03",
                "ring_frequency_tolerance = 0",
                "ring_frequency_tolerance =",
                "capture.ring_frequency_tolerance: 0 is out of range; give a value that is from 0.001 to 10000",
            ),
            (
                "ring_decay_tolerance = 0.3",
                "ring_decay_tolerance = -0.25",
                "ring_decay_tolerance =",
                "capture.ring_decay_tolerance: -0.25 is out of range; give a value that is from",
            ),
            (
                "disagreement = 0.03",
                "disagreement = 0",
                "disagreement =",
                "capture.disagreement: 0 is out of range; give a value that is from 0.001 to 10000",
            ),
            (
                "stiffness = 395000.0",
                "stiffness = 1e12",
                "stiffness =",
                "intruder.stiffness: stiffness of the intruder's springs: ",
            ),
            (
                "per_code = 0.00390625",
                "per_code = 1e3",
                "per_code =",
                "force.per_code: force per code: 1.000e3, and 4.7e-6 to 2.0e0 can be computed with; give what a code",
            ),
        ] {
            begins(refused(from, to), of, rest);
        }
        let long = refused("\"left\"", &format!("\"{}\"", "µ".repeat(100_000)));
        begins(
            long.clone(),
            "name =",
            &format!("name: `{}…` is no name", "µ".repeat(32)),
        );
        assert!(long.len() < 200, "{long}");
        for wrong in [
            "k",
            "k=much",
            "x=3",
            "address=300",
            "address=1.5",
            "k=nan",
            "=3",
            "",
        ] {
            let error = paper().set(wrong).unwrap_err().to_string();
            assert_eq!(error.lines().count(), 1, "{error}");
        }
    }
}
