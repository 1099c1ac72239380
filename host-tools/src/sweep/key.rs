//! Keys of a scenario, as a sweep names them: `striker.velocity`, `intruder.0.mass`.

use toml::{Table, Value};

/// A dotted key. Tables of an array, such as `[[intruder]]`, are counted from 0.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Key {
    segments: Vec<String>,
}

/// What each key is measured in, as it ends the name of a column.
const UNITS: [(&str, &str); 11] = [
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

/// Parts of a key. Those of a scenario have four at most.
const MOST_PARTS: usize = 8;

impl Key {
    /// Reads a dotted key.
    ///
    /// # Errors
    /// What is wrong, and what would do.
    pub fn parse(text: &str) -> Result<Self, String> {
        let count = text.split('.').count();
        if count > MOST_PARTS {
            // A scenario with tables so deep in each other cannot even be dropped.
            return Err(format!(
                "a key of {count} parts is in no scenario; write it like intruder.0.mass"
            ));
        }
        let segments: Vec<String> = text.split('.').map(str::to_owned).collect();
        let word =
            |part: &String| !part.is_empty() && part.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
        if segments.iter().all(word) {
            return Ok(Self { segments });
        }
        Err(format!(
            "`{text}` is no key; write it like striker.velocity or intruder.0.mass (tables of a list are counted from 0)"
        ))
    }

    /// Whether its value counts or names beads.
    pub fn of_beads(&self) -> bool {
        self.segments.iter().any(|part| part == "beads")
    }

    /// The name of its column: the key, and its unit.
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
    /// There is no such place.
    pub fn set(&self, scenario: &mut Table, value: Value) -> Result<(), String> {
        let (first, rest) = self.segments.split_first().expect("a key has a segment");
        if rest.is_empty() {
            scenario.insert(first.clone(), value);
            return Ok(());
        }
        let mut at = scenario
            .entry(first.clone())
            .or_insert_with(|| Value::Table(Table::new()));
        let (last, between) = rest.split_last().expect("it is not empty");
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

    fn inside<'a>(&self, at: &'a mut Value, part: &str, path: &str) -> Result<&'a mut Value, String> {
        match at {
            Value::Table(table) => Ok(table
                .entry(part.to_owned())
                .or_insert_with(|| Value::Table(Table::new()))),
            Value::Array(list) => {
                let count = list.len();
                let place = part.parse::<usize>().ok();
                place.and_then(|place| list.get_mut(place)).ok_or_else(|| {
                    format!(
                        "{self} is not in the scenario: `{path}` has {count} there, counted from 0, and `{part}` is none of them; \
                         write it like {path}.0, or add it to the scenario"
                    )
                })
            }
            _ => Err(format!(
                "{self} is not in the scenario: `{path}` is a single value; leave `.{part}` out"
            )),
        }
    }
}

impl std::fmt::Display for Key {
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
        let mut set = |key: &str, value: Value| Key::parse(key).unwrap().set(&mut scenario, value);
        set("duration", 0.003.into()).unwrap();
        set("intruder.0.mass", 0.002.into()).unwrap();
        set("intruder.0.beads", 7.into()).unwrap();
        set("intruder.0.beads.0", 9.into()).unwrap();
        set("striker.mass", 0.001.into()).unwrap();
        set("chain.beads", 20.into()).unwrap();
        assert!(
            set("intruder.1.mass", 1.0.into())
                .unwrap_err()
                .contains("counted from 0")
        );
        assert!(
            set("intruder.mass", 1.0.into())
                .unwrap_err()
                .contains("intruder.0")
        );
        assert!(
            set("duration.s", 1.0.into())
                .unwrap_err()
                .contains("single value")
        );
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
        let column = |key: &str| Key::parse(key).unwrap().column();
        assert_eq!(column("intruder.0.mass"), "intruder_0_mass_kg");
        assert_eq!(column("chain.poisson"), "chain_poisson");
        for wrong in ["", "a..b", "intruder[0].mass", "a b", "chain."] {
            assert!(Key::parse(wrong).is_err(), "{wrong}");
        }
        let deep = vec!["a"; 100_000].join(".");
        assert!(
            Key::parse(&deep)
                .unwrap_err()
                .starts_with("a key of 100000 parts")
        );
    }
}
