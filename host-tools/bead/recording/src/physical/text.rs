//! Settings as people write and read them: a file, a change on a command line, a difference.

use std::fmt::{self, Write};

use bead_model::design::{Capture, Description};
use bead_model::settings::Settings;
use bead_model::violation::SettingKey;
use hertz_chain::{InputError, TomlFile};
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;

use crate::physical::keys::{KEYS, KeyRow, TABLES};
use crate::physical::refusal::refusal;
use crate::physical::values::{shown, value};

/// A key of the settings that changed.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Change {
    /// Its path.
    pub key: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// The value before; null if it was unknown.
    pub from: Value,
    /// The value now.
    pub to: Value,
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { key, unit, from, to } = self;
        let space = if unit.is_empty() { "" } else { " " };
        write!(f, "{key}: {} -> {}{space}{unit}", shown(from), shown(to))
    }
}

/// Derives the settings of a file with a description; `name` is what messages call it.
///
/// # Errors
/// One line with file, line, key, what is wrong and what would do.
pub fn parse(text: &str, name: &str) -> Result<Settings, InputError> {
    let file = TomlFile::parse(text, name)?;
    let description: Description = file.read()?;
    derived(&description).map_err(|error| file.locate(error))
}

/// The settings that the image takes with this description.
///
/// # Errors
/// The key that no bead has, what is wrong, and what would do.
pub fn derived(description: &Description) -> Result<Settings, InputError> {
    let (rate, of_image) = (
        description.capture.sample_rate_hz,
        Capture::default().sample_rate_hz,
    );
    if rate != of_image {
        let what = format!("{rate} Hz, but the image samples only at {of_image} Hz");
        let advice = format!("give {of_image}, or leave it out");
        return Err(InputError::at(SettingKey::SampleRate.path(), what, advice));
    }
    Settings::new(description).map_err(|violation| refusal(description, violation))
}

/// Sets a key as on a command line: `intruder.stiffness=4e5`, `k=4e5`.
///
/// # Errors
/// One line: no such key, or a value of another kind.
pub fn set(description: &mut Description, assignment: &str) -> Result<(), InputError> {
    let (name, text) = assignment.split_once('=').ok_or_else(|| {
        InputError::at(
            "",
            format!("`{assignment}` sets no key"),
            "write KEY=VALUE, such as name=left or k=3.9e5",
        )
    })?;
    let (name, text) = (name.trim(), text.trim());
    let row = find(name)?;
    let value = match (row.key, text.parse::<u64>(), text.parse::<f64>()) {
        (SettingKey::Name | SettingKey::Calibration, ..) => text.into(),
        (key, Ok(whole), _) if is_whole(key) => whole.into(),
        (_, _, Ok(number)) if number.is_finite() => number.into(),
        _ if text == UNKNOWN => Value::Null,
        _ if text.starts_with('[') => serde_json::from_str(text).unwrap_or_else(|_| text.into()),
        _ => text.into(),
    };
    let mut all = serde_json::to_value(*description).unwrap_or_default();
    // A section that is absent is made.
    match row.path().split_once('.') {
        Some((section, name)) => all[section][name] = value,
        None => all[row.path()] = value,
    }
    *description = serde_json::from_value(all).map_err(|_| {
        let unit = if row.unit.is_empty() {
            String::new()
        } else {
            format!(", in {}", row.unit)
        };
        InputError::at(
            row.path(),
            format!("`{text}` is not a value of this key"),
            format!("give {}{unit}", kind(row.key)),
        )
    })?;
    Ok(())
}

/// The keys whose values differ.
pub fn changes(before: &Description, after: &Description) -> Vec<Change> {
    let change = |row: &'static KeyRow| {
        let (from, to) = (value(before, row.key), value(after, row.key));
        (from != to).then_some(Change {
            key: row.path(),
            unit: row.unit,
            from,
            to,
        })
    };
    KEYS.iter().filter_map(change).collect()
}

/// The text of a file with every key explained.
pub fn to_toml(description: &Description) -> String {
    let mut text = String::from(
        "# A bead in physical quantities, SI units. `bead settings make` makes settings from this file,\n\
         # `bead settings write` writes them to the bead.\n\n",
    );
    let mut table = "";
    // A struct of numbers and texts is always JSON.
    let all = serde_json::to_value(description).unwrap_or_default();
    let comment = |is_known: bool| if is_known { "" } else { "# " };
    for row in KEYS {
        let (of, name) = row.path().split_once('.').unwrap_or(("", row.path()));
        if of != table {
            table = of;
            let what = TABLES.iter().find(|(name, _)| *name == of);
            let what = what.map_or("", |(_, what)| what);
            // Writing to a string cannot fail.
            let absent = comment(!all[of].is_null());
            let _ = write!(text, "\n# {what}\n{absent}[{of}]\n");
        }
        let value = value(description, row.key);
        let entry = match value {
            Value::Null => format!("# {name} = ?"),
            known => format!("{name} = {}", shown(&known)),
        };
        let before = |text: &str, end: &str| match text {
            "" => String::new(),
            _ => format!("{text}{end}"),
        };
        let (unit, letter) = (before(row.unit, "  "), before(row.letter, ": "));
        let _ = writeln!(text, "{entry:<34} # {unit}{letter}{}", row.what);
    }
    text
}

/// Text of a value that is not known.
const UNKNOWN: &str = "unknown";

fn find(name: &str) -> Result<&'static KeyRow, InputError> {
    let named = |row: &&KeyRow| row.path() == name || row.letter == name && !name.is_empty();
    KEYS.iter().find(named).ok_or_else(|| {
        let known: Vec<_> = KEYS.iter().map(KeyRow::path).collect();
        InputError::at(
            name,
            "no such key",
            format!("keys are {}, and M, m, k, c, kappa, tau", known.join(", ")),
        )
    })
}

fn is_whole(key: SettingKey) -> bool {
    matches!(
        key,
        SettingKey::Address
            | SettingKey::SampleRate
            | SettingKey::Behind
            | SettingKey::Elsewhere
            | SettingKey::Wall
    )
}

fn kind(key: SettingKey) -> &'static str {
    match key {
        SettingKey::Name | SettingKey::Calibration => "up to 16 bytes of text without control characters",
        SettingKey::Calibrated | SettingKey::ValidUntil => "a date, such as 2026-11-24, or `unknown`",
        SettingKey::FollowersMass | SettingKey::FollowersStiffness | SettingKey::FollowersRelaxation => {
            "six numbers, such as [1, 1, 1, 1, 1, 1]"
        }
        key if is_whole(key) => "a whole number",
        _ => "a number",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bead_model::design::{Day, Relative, Supply, Uncertainty};
    use bead_model::name::Name;
    use bead_testing::paper_settings;

    fn paper() -> Description {
        let half = Some(Relative::new(0.005));
        let uncertainty = Uncertainty {
            calibration: Name::new("shaker 17").unwrap(),
            calibrated: Day::parse("2026-11-24"),
            valid_until: Day::parse("2027-11-24"),
            force_gain: half,
            stiffness: half,
            damping: half,
            stiffness_with_mass: Relative::new(0.5),
            damping_with_mass: Relative::new(0.5),
            stiffness_with_damping: Relative::new(-0.25),
            ..Uncertainty::default()
        };
        Description {
            uncertainty: Some(uncertainty),
            name: Name::new("left").unwrap(),
            address: 3,
            supply: Some(Supply { voltage: 3.2985 }),
            ..*paper_settings().description()
        }
    }

    #[test]
    fn a_file_that_was_written_is_read_to_the_same_bits() {
        let mut bead = paper();
        bead.intruder.stiffness = 395_123.456_789_1;
        let text = to_toml(&bead);
        let settings = parse(&text, "bead.toml").unwrap();
        assert_eq!(*settings.description(), bead, "{text}");
        assert_eq!(settings, Settings::new(&bead).unwrap());
        for row in KEYS {
            let name = format!("{} =", row.path().rsplit('.').next().unwrap());
            let explained =
                |line: &str| line.trim_start_matches("# ").starts_with(&name) && line.ends_with(row.what);
            assert!(text.lines().any(explained), "{}", row.path());
        }
    }

    #[test]
    fn a_table_that_is_left_out_is_written_as_a_remark_and_begins_with_its_first_key() {
        let mut bead = Description {
            supply: None,
            ..paper()
        };
        let text = to_toml(&bead);
        assert!(text.contains("\n# [supply]\n# voltage = "), "{text}");
        assert_eq!(*parse(&text, "bead.toml").unwrap().description(), bead);
        set(&mut bead, "supply.voltage=3.2985").unwrap();
        assert_eq!(bead, paper());
    }

    #[test]
    fn a_change_is_shown_with_its_unit_and_changes_nothing_else() {
        let bead = paper();
        let mut other = bead;
        set(&mut other, "k=4.1e5").unwrap();
        set(&mut other, "name = right one").unwrap();
        let changes: Vec<_> = changes(&bead, &other).iter().map(Change::to_string).collect();
        assert_eq!(
            changes,
            [
                "name: \"left\" -> \"right one\"",
                "intruder.stiffness: 395000.0 -> 410000.0 N/m"
            ]
        );
        // Uncertainties may be unknown, and a section that is absent is made.
        let mut stated = Description {
            uncertainty: None,
            ..bead
        };
        for change in ["uncertainty.damping=0.01", "uncertainty.calibrated=2026-11-24"] {
            set(&mut stated, change).unwrap();
        }
        let section = stated.uncertainty.unwrap();
        assert_eq!(
            (section.damping, section.calibrated),
            (Some(Relative::new(0.01)), Day::parse("2026-11-24"))
        );
        set(&mut stated, "uncertainty.damping=unknown").unwrap();
        assert_eq!(stated.uncertainty.unwrap().damping, None);
        let mut expected = bead;
        (expected.name, expected.intruder.stiffness) = (Name::new("right one").unwrap(), 4.1e5);
        assert_eq!(other, expected);
    }

    /// A line of the file, the line in its place, and the refusal.
    const REFUSALS: &str = "
        stiffness = 395000.0 | stifness = 395000.0 | intruder.stifness: unknown key; did you mean `stiffness`?
        damping = 12.0 | damping = -12.0 | intruder.damping: -12 is out of range
        damping = 12.0 | damping = \"x\" | intruder.damping: the text
        damping = 12.0 | # | intruder: the key `damping` is missing
        \"left\" | \"a name that is too long\" | name: `a name that is too long` is not a name
        address = 3 | address = 255 | address: 255 is
        pole = 40000.0 | pole = -1.0 | force.pole: -1 is out of range; give 0 for no filter, or a value that is positive
        history = 0.0016 | history = 0.01 | capture.history: 0.01 is longer than 256 samples; give 1.28e-3 to 2.56e-3 s
        length = 0.00672 | length = 1e-3 | capture.length: 0.001 is not longer than the history; give more than
        lookback = 5e-4 | lookback = 0.5 | capture.lookback: 0.5 is not between 0 and the history; give more than 0,
        threshold = 0.1 | threshold = 1e-3 | capture.threshold: 0.001 is not a rise of 1 to 4095 codes; give a force in N
        sample_rate = 100000 | sample_rate = 1 | capture.sample_rate: 1 Hz, but the image samples only at 100000 Hz;
        sample_rate = 100000 | sample_rate = 99999 | capture.sample_rate: 99999 Hz, but
        relaxation = 4.2e-6 | relaxation = 1e-12 | contact.relaxation: relaxation time of the contacts over 2/3 of a
        ring_frequency_tolerance = 0.03 | ring_frequency_tolerance = 0 | capture.ring_frequency_tolerance: 0 is out of
        ring_decay_tolerance = 0.3 | ring_decay_tolerance = -0.25 | capture.ring_decay_tolerance: -0.25 is out of
        disagreement = 0.03 | disagreement = 0 | capture.disagreement: 0 is out of range; give a value that is from
        stiffness = 395000.0 | stiffness = 1e12 | intruder.stiffness: stiffness of the intruder's springs:
        voltage = 3.2985 | voltage = 33 | supply.voltage: 33 is out of range; give a value that is from 1.8 to 3.6
        per_code = 0.00390625 | per_code = 1e3 | force.per_code: 1000 is outside the usable range, 4.7e-6 to 2.0e0; give
        force_gain = 0.005 | force_gain = 0 | uncertainty.force_gain: 0 is out of range; give a value that is from 0.000001
        force_gain = 0.005 | force_gain = 5 | uncertainty.force_gain: 5 is out of range; give a value that is from 0.000001
        valid_until = \"2027-11-24\" | valid_until = \"2026-11-23\" | uncertainty.valid_until: \"2026-11-23\" is before the
        stiffness_with_damping = -0.25 | stiffness_with_damping = -0.9 | uncertainty.stiffness_with_damping: -0.9 is not possible
        \"2026-11-24\" | \"2026-11-31\" | uncertainty.calibrated: ";

    #[test]
    fn a_refusal_names_line_and_key() {
        let text = to_toml(&paper());
        let refused = |from: &str, to: &str| {
            let changed = text.replacen(from, to, 1);
            assert_ne!(changed, text);
            parse(&changed, "bead.toml").unwrap_err().to_string()
        };
        let line = |of: &str| 1 + text.lines().position(|line| line.contains(of)).unwrap();
        for row in REFUSALS.lines().skip(1) {
            let [from, to, refusal] = row.trim().split(" | ").collect::<Vec<_>>()[..] else {
                panic!("{row}");
            };
            let at = line(if to == "#" { "[intruder]" } else { from });
            let (found, expected) = (refused(from, to), format!("bead.toml:{at}: {refusal}"));
            assert!(found.starts_with(&expected), "{found}\n{expected}");
            assert_eq!(found.lines().count(), 1);
        }
        let long = refused("\"left\"", &format!("\"{}\"", "µ".repeat(100_000)));
        let (at, begin) = (line("name ="), "µ".repeat(32));
        let expected = format!("bead.toml:{at}: name: `{begin}…` is not a name");
        assert!(long.starts_with(&expected) && long.len() < 200, "{long}");
        for wrong in
            "k|k=much|x=3|address=300|address=1.5|k=nan|k=unknown|uncertainty.damping=x|=3|".split('|')
        {
            let error = set(&mut paper(), wrong).unwrap_err().to_string();
            assert_eq!(error.lines().count(), 1, "{error}");
        }
    }
}
