//! Keys of a scenario in a sweep: `striker.velocity`, `intruder.1.mass`.

use hertz_chain::InputError;
use toml::{Table, Value};

/// A dotted key. Entries of a list, such as `[[intruder]]`, are counted from 1.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ScenarioKey {
    segments: Vec<String>,
}

/// Units of keys, as endings of columns ([`bead_tables::unit`]).
const UNITS: [(&str, &str); 12] = [
    ("cubic_stiffness", "n_per_m3"),
    ("damping", "n_s_per_m"),
    ("density", "kg_per_m3"),
    ("duration", "s"),
    ("gap", "m"),
    ("mass", "kg"),
    ("precompression", "n"),
    ("radius", "m"),
    ("relaxation", "s"),
    ("stiffness", "n_per_m"),
    ("velocity", "mps"),
    ("young", "pa"),
];

/// Greatest number of parts of a key. A scenario's keys have up to four.
const MOST_PARTS: usize = 8;

impl ScenarioKey {
    /// Reads a dotted key.
    ///
    /// # Errors
    /// The text is no key.
    pub fn parse(text: &str) -> Result<Self, InputError> {
        let count = text.split('.').count();
        if count > MOST_PARTS {
            // A scenario with tables nested this deeply cannot even be dropped.
            let what = format!("no scenario has a key of {count} parts");
            return Err(InputError::at("", what, "write it like intruder.1.mass"));
        }
        let segments: Vec<String> = text.split('.').map(str::to_owned).collect();
        let word =
            |part: &String| !part.is_empty() && part.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
        if segments.iter().all(word) {
            return Ok(Self { segments });
        }
        let advice =
            "write it like striker.velocity or intruder.1.mass (tables of a list are counted from 1)";
        Err(InputError::at("", format!("`{text}` is not a key"), advice))
    }

    /// True if its value is a number of beads, or names beads.
    pub fn of_beads(&self) -> bool {
        self.segments.iter().any(|part| part == "beads")
    }

    /// Name of its column: the key and its unit.
    pub fn column(&self) -> String {
        let name = self.segments.join("_");
        let last = self.segments.last().map_or("", String::as_str);
        match UNITS.iter().find(|(key, _)| *key == last) {
            Some((_, unit)) => format!("{name}_{unit}"),
            None => name,
        }
    }

    /// Sets the value in a scenario. One bead stands for a list of one.
    ///
    /// # Errors
    /// The scenario has no such place.
    pub fn set(&self, scenario: &mut Table, value: Value) -> Result<(), InputError> {
        let (last, before) = self.segments.split_last().expect("a key has a segment");
        let Some((first, between)) = before.split_first() else {
            scenario.insert(last.clone(), value);
            return Ok(());
        };
        let mut at = scenario
            .entry(first.clone())
            .or_insert_with(|| Value::Table(Table::new()));
        let mut path = first.clone();
        for part in between {
            at = self.inside(at, part, &path)?;
            path = format!("{path}.{part}");
        }
        match at {
            Value::Table(table) => {
                let lone = last == "beads" && path != "chain" && value.is_integer();
                let value = if lone { Value::Array(vec![value]) } else { value };
                table.insert(last.clone(), value);
            }
            other => *self.inside(other, last, &path)? = value,
        }
        Ok(())
    }

    fn inside<'a>(&self, at: &'a mut Value, part: &str, path: &str) -> Result<&'a mut Value, InputError> {
        match at {
            Value::Table(table) => Ok(table
                .entry(part.to_owned())
                .or_insert_with(|| Value::Table(Table::new()))),
            Value::Array(list) => {
                let count = list.len();
                let number: Option<usize> = part.parse().ok();
                let place = number.and_then(|number| number.checked_sub(1));
                place.and_then(|place| list.get_mut(place)).ok_or_else(|| {
                    let what = format!(
                        "{self} is not in the scenario: `{path}` has {count} entries, counted from 1, and `{part}` is not one \
                         of them"
                    );
                    let advice = format!("write it like {path}.1, or add it to the scenario");
                    InputError::at("", what, advice)
                })
            }
            _ => {
                let what = format!("{self} is not in the scenario: `{path}` is a single value");
                Err(InputError::at("", what, format!("leave `.{part}` out")))
            }
        }
    }
}

impl std::fmt::Display for ScenarioKey {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.segments.join("."))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_reaches_into_tables_and_lists() {
        let mut scenario: Table = toml::from_str(&hertz_chain::Scenario::paper().to_toml()).unwrap();
        let mut set = |key: &str, value: Value| ScenarioKey::parse(key).unwrap().set(&mut scenario, value);
        set("duration", 0.003.into()).unwrap();
        set("intruder.1.mass", 0.002.into()).unwrap();
        set("intruder.1.beads", 7.into()).unwrap();
        set("intruder.1.beads.1", 9.into()).unwrap();
        set("striker.mass", 0.001.into()).unwrap();
        set("chain.beads", 20.into()).unwrap();
        for (key, why) in [
            ("intruder.0.mass", "counted from 1"),
            ("intruder.mass", "write it like intruder.1"),
            ("duration.s", "single value"),
        ] {
            let refusal = set(key, 1.0.into()).unwrap_err().to_string();
            assert!(refusal.contains(why), "{refusal}");
        }
        let scenario: hertz_chain::Scenario = scenario.try_into().unwrap();
        assert_eq!((scenario.duration, scenario.chain.beads), (0.003, 20));
        assert_eq!(scenario.intruders[0].beads, [9]);
        assert_eq!(
            (scenario.intruders[0].mass, scenario.striker.mass),
            (0.002, Some(0.001))
        );
    }

    #[test]
    fn a_column_is_named_by_key_and_unit() {
        let column = |key: &str| ScenarioKey::parse(key).unwrap().column();
        assert_eq!(column("intruder.1.mass"), "intruder_1_mass_kg");
        assert_eq!(column("chain.poisson"), "chain_poisson");
        for wrong in ["", "a..b", "intruder[0].mass", "a b", "chain."] {
            assert!(ScenarioKey::parse(wrong).is_err(), "{wrong}");
        }
        let deep = ScenarioKey::parse(&vec!["a"; 100_000].join(".")).unwrap_err();
        assert!(deep.what.ends_with("a key of 100000 parts"));
    }
}
