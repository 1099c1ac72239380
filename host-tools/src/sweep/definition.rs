//! SWEEP.toml: a scenario, axes and outputs.

use std::collections::HashSet;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use hertz_chain::{InputError, MOST_BEADS, Scenario, TomlFile, read_text};
use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use crate::sweep::axis::{Along, Axis, Values};
use crate::sweep::draw::Method;
use crate::sweep::key::Key;
use crate::sweep::outputs::Outputs;

/// What a file of a sweep says, with the scenario in it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Definition {
    /// A title, for people.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub title: String,
    /// The scenario that every point starts from.
    scenario: Base,
    /// What is kept of each run.
    #[serde(default)]
    pub outputs: Outputs,
    /// The axes; the last turns fastest.
    axis: Vec<AxisTable>,
}

/// A scenario in the sweep's file, or in one of its own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
enum Base {
    File(PathBuf),
    Table(Table),
}

/// One `[[axis]]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct AxisTable {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    name: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    key: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    values: Option<Vec<Value>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    range: Option<[f64; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    linspace: Option<[f64; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    logspace: Option<[f64; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    random: Option<u64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    quasirandom: Option<u64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    seed: Option<u64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    zip: Option<Vec<ZipTable>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    over: Option<Vec<OverTable>>,
}

/// A key of an axis on which several go together.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ZipTable {
    key: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    values: Option<Vec<Value>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    range: Option<[f64; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    linspace: Option<[f64; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    logspace: Option<[f64; 3]>,
}

/// A key of an axis of drawn points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct OverTable {
    key: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    uniform: Option<[f64; 2]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    loguniform: Option<[f64; 2]>,
}

/// Places of one axis.
const MOST_PLACES: u64 = 1_000_000_000_000;
const GIVE_VALUES: &str = "give one of values = […], range = [first, last, step], linspace = [first, last, how many], logspace = […]";

impl Definition {
    /// Reads a file, and the scenario that it names, and checks them.
    ///
    /// # Errors
    /// [`InputError`] with file, line, key, what is wrong and what would do.
    pub fn load(path: &Path) -> Result<Self, InputError> {
        let text = read_text(path, "a sweep's file in TOML")?;
        let name = path.display().to_string();
        let file = TomlFile::parse(&text, &name)?;
        let mut definition: Self = file.read()?;
        if let Base::File(scenario) = &definition.scenario {
            let scenario = path.parent().unwrap_or(Path::new("")).join(scenario);
            let text = read_text(&scenario, "a scenario file in TOML").map_err(|error| {
                file.locate(InputError {
                    key: "scenario".to_owned(),
                    ..error
                })
            })?;
            Scenario::from_toml(&text, &scenario.display().to_string())?;
            let mut table: Table = text.parse().expect("it has just been read");
            for name in Scenario::OTHER_TABLES {
                table.remove(name);
            }
            definition.scenario = Base::Table(table);
        }
        definition.axes().map_err(|error| file.locate(error))?;
        Ok(definition)
    }

    /// Reads what [`Definition::to_toml`] wrote.
    ///
    /// # Errors
    /// As [`Definition::load`].
    pub fn from_toml(text: &str, name: &str) -> Result<Self, InputError> {
        let file = TomlFile::parse(text, name)?;
        let definition: Self = file.read()?;
        if let Base::File(_) = definition.scenario {
            let what = "the name of a file, where its tables must be";
            return Err(file.locate(InputError::at("scenario", what, "make the plan anew")));
        }
        definition.axes().map_err(|error| file.locate(error))?;
        Ok(definition)
    }

    /// The sweep as one text, the same for the same sweep.
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("tables, numbers and strings are TOML")
    }

    /// The scenario that every point starts from.
    pub fn scenario(&self) -> &Table {
        match &self.scenario {
            Base::Table(table) => table,
            Base::File(_) => unreachable!("a file is read when the sweep is"),
        }
    }

    /// The axes, checked: each key is one of a scenario's, once, and takes the kind of value given.
    ///
    /// # Errors
    /// [`InputError`] without file and line.
    pub fn axes(&self) -> Result<Vec<Axis>, InputError> {
        let base = self.base()?;
        self.check_outputs(&base)?;
        if self.axis.is_empty() {
            let advice = "write [[axis]] with a key of the scenario and its values";
            return Err(InputError::at("axis", "the sweep has no axis", advice));
        }
        let mut axes = Vec::new();
        let mut columns: HashSet<String> = self
            .outputs
            .columns()
            .into_iter()
            .map(|column| column.name)
            .collect();
        columns.extend(["point", "error"].map(str::to_owned));
        for (table, number) in self.axis.iter().zip(1..) {
            let at = format!("axis[{number}]");
            let axis = table.axis(&at)?;
            for along in &axis.along {
                if !columns.insert(along.key.column()) {
                    let what = format!("{} is swept twice", along.key);
                    return Err(InputError::at(at, what, "give each key one axis"));
                }
            }
            if let Some(name) = &axis.name
                && !columns.insert(name.clone())
            {
                let what = format!("`{name}` is the name of another column");
                return Err(InputError::at(format!("{at}.name"), what, "give another name"));
            }
            axes.push(axis);
        }
        self.check_keys(&axes)?;
        Ok(axes)
    }

    fn base(&self) -> Result<Scenario, InputError> {
        let text = toml::to_string(self.scenario()).expect("a table is TOML");
        Scenario::from_toml(&text, "").map_err(|error| InputError {
            file: None,
            line: None,
            key: format!("scenario.{}", error.key),
            ..error
        })
    }

    fn check_outputs(&self, base: &Scenario) -> Result<(), InputError> {
        if self.outputs.columns().is_empty() {
            let advice = "ask for absorbed, energies, intruders, peaks, arrivals or transmission";
            return Err(InputError::at("outputs", "nothing is kept of the runs", advice));
        }
        let outputs = &self.outputs;
        let swept = self
            .axis
            .iter()
            .any(|table| table.keys().any(|key| key == "chain.beads"));
        let most = if swept { usize::MAX - 1 } else { base.chain.beads };
        let makes_wall = |table: &AxisTable| table.keys().any(|key| key.starts_with("wall."));
        let walled = usize::from(base.wall.is_some() || self.axis.iter().any(makes_wall));
        for (name, of, most) in [
            ("intruders", &outputs.intruders, most),
            ("peaks", &outputs.peaks, most + walled),
            ("arrivals", &outputs.arrivals, most + walled),
            ("transmission", &outputs.transmission, most),
        ] {
            let key = format!("outputs.{name}");
            if let Some(wrong) = of.iter().find(|n| **n < 1 || **n > most) {
                let advice = format!("give numbers from 1 to {most}");
                return Err(InputError::at(
                    key,
                    format!("{wrong} is not in the chain"),
                    advice,
                ));
            }
            let mut seen = HashSet::new();
            if let Some(twice) = of.iter().find(|n| !seen.insert(**n)) {
                return Err(InputError::at(
                    key,
                    format!("{twice} is named twice"),
                    "name it once",
                ));
            }
        }
        Ok(())
    }

    /// Whether a scenario has these keys, and takes these kinds of values. They are tried together, and the
    /// first that is wrong is found by halves: a scenario with thousands of keys, all of them swept, is not
    /// read for each.
    fn check_keys(&self, axes: &[Axis]) -> Result<(), InputError> {
        let axes = axes.iter().zip(1..);
        let keys: Vec<(i32, &Along)> = axes
            .flat_map(|(axis, number)| axis.along.iter().map(move |along| (number, along)))
            .collect();
        let reads = |count: usize| {
            let mut table = self.scenario().clone();
            let mut set = |(_, along): &(i32, &Along)| along.key.set(&mut table, along.value(0)).is_ok();
            keys[..count].iter().all(&mut set) && table.try_into::<Scenario>().is_ok()
        };
        if reads(keys.len()) {
            return Ok(());
        }
        let places: Vec<usize> = (0..keys.len()).collect();
        let wrong = places.partition_point(|place| reads(place + 1));
        keys.get(wrong)
            .map_or(Ok(()), |(number, along)| self.check_key(*number, along))
    }

    fn check_key(&self, number: i32, along: &Along) -> Result<(), InputError> {
        let (key, at) = (&along.key, format!("axis[{number}].key"));
        let mut table = self.scenario().clone();
        key.set(&mut table, along.value(0)).map_err(|what| {
            let (what, advice) = what.split_once("; ").expect("it has advice");
            InputError::at(&at, what, advice)
        })?;
        // Through text, for messages that name the key which is meant.
        let text = toml::to_string(&table).expect("a table is TOML");
        let read = TomlFile::parse(&text, "").and_then(|file| file.read::<Scenario>());
        read.map(drop)
            .map_err(|error| InputError::at(&at, format!("{key}: {}", error.what), error.advice))
    }
}

impl AxisTable {
    fn keys(&self) -> impl Iterator<Item = &str> {
        let zip = self.zip.iter().flatten().map(|table| table.key.as_str());
        let over = self.over.iter().flatten().map(|table| table.key.as_str());
        self.key.as_deref().into_iter().chain(zip).chain(over)
    }

    fn axis(&self, at: &str) -> Result<Axis, InputError> {
        let wrong = |what: &str, advice: &str| Err(InputError::at(at, what, advice));
        let drawn = [
            (Method::Random, self.random),
            (Method::Quasirandom, self.quasirandom),
        ];
        let drawn: Vec<_> = drawn
            .into_iter()
            .filter_map(|(method, count)| Some((method, count?)))
            .collect();
        let single = self.values.is_some()
            || [self.range, self.linspace, self.logspace]
                .iter()
                .any(Option::is_some)
            || self.key.is_some();
        if usize::from(single) + usize::from(self.zip.is_some()) + drawn.len() != 1 {
            return wrong(
                "it must have either a key with its values, or zip, or random, or quasirandom",
                "give one of them",
            );
        }
        if (self.over.is_some() || self.seed.is_some()) && drawn.is_empty() {
            return wrong(
                "over and seed belong to random or quasirandom",
                "give how many points to draw",
            );
        }
        if single {
            if self.name.is_some() {
                return wrong("an axis of one key is named by it", "leave the name out");
            }
            let Some(key) = &self.key else {
                return wrong("it has values and no key", "give a key such as striker.velocity");
            };
            let (along, count) = along(
                at,
                key,
                self.values.as_ref(),
                [self.range, self.linspace, self.logspace],
            )?;
            if let Some(value) = along.twice() {
                return wrong(
                    &format!("the value {value} is there twice"),
                    "give each value once",
                );
            }
            return Ok(Axis {
                name: None,
                along: vec![along],
                count,
            });
        }
        let name = self.name.clone().unwrap_or_else(|| match drawn.is_empty() {
            true => "zip".to_owned(),
            false => "sample".to_owned(),
        });
        let word = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') && !name.is_empty();
        if !word {
            let advice = "letters, digits and _ will do";
            return Err(InputError::at(
                format!("{at}.name"),
                "it is no name of a column",
                advice,
            ));
        }
        let (along, count) = match drawn.first() {
            Some((method, count)) => (self.drawn(at, *method, *count)?, *count),
            None => self.zipped(at)?,
        };
        Ok(Axis {
            name: Some(name),
            along,
            count,
        })
    }

    fn zipped(&self, at: &str) -> Result<(Vec<Along>, u64), InputError> {
        let mut all: Vec<Along> = Vec::new();
        let mut counts = Vec::new();
        for (table, number) in self.zip.iter().flatten().zip(1..) {
            let at = format!("{at}.zip[{number}]");
            let spaces = [table.range, table.linspace, table.logspace];
            let (along, count) = along(&at, &table.key, table.values.as_ref(), spaces)?;
            if counts.first().is_some_and(|first| *first != count) {
                let what = format!("{count} values, and {} for the key before it", counts[0]);
                return Err(InputError::at(
                    at,
                    what,
                    "keys that go together need equally many",
                ));
            }
            counts.push(count);
            all.push(along);
        }
        match counts.first() {
            Some(count) => Ok((all, *count)),
            None => Err(InputError::at(format!("{at}.zip"), "it has no key", GIVE_VALUES)),
        }
    }

    fn drawn(&self, at: &str, method: Method, count: u64) -> Result<Vec<Along>, InputError> {
        number_of_values(at, count as f64)?;
        let tables = self.over.as_deref().unwrap_or_default();
        if tables.is_empty() {
            let advice = "write over = [{ key = \"striker.velocity\", uniform = [0.2, 1.5] }]";
            return Err(InputError::at(at, "it draws points over no key", advice));
        }
        let mut all = Vec::new();
        for (dimension, table) in tables.iter().enumerate() {
            let at = format!("{at}.over[{}]", dimension + 1);
            let key = key(&at, &table.key)?;
            let ([from, to], log) = match (table.uniform, table.loguniform) {
                (Some(bounds), None) => (bounds, false),
                (None, Some(bounds)) => (bounds, true),
                _ => {
                    let advice = "give one of uniform = [least, greatest] and loguniform = [least, greatest]";
                    return Err(InputError::at(at, "it must have bounds", advice));
                }
            };
            in_range(&at, &[from, to])?;
            if key.of_beads() {
                beads(&at, &key, [from, to])?;
            }
            if from > to || (log && from <= 0.0) {
                let what = format!("from {from} to {to} there is nothing to draw from");
                let advice = "give the least first; above 0 for loguniform";
                return Err(InputError::at(at, what, advice));
            }
            let values = Values::Drawn {
                method,
                seed: self.seed.unwrap_or(0),
                dimension,
                dimensions: tables.len(),
                from,
                to: to + f64::from(u8::from(key.of_beads())),
                log,
            };
            all.push(Along { key, values });
        }
        Ok(all)
    }
}

fn key(at: &str, text: &str) -> Result<Key, InputError> {
    Key::parse(text).map_err(|what| {
        let (what, advice) = what.split_once("; ").expect("it has advice");
        InputError::at(format!("{at}.key"), what, advice)
    })
}

/// No scenario takes a value other than 0 whose size is outside of this, and differences and ratios within it
/// are finite.
const SIZES: RangeInclusive<f64> = 1e-30..=1e30;

fn in_range(at: &str, numbers: &[f64]) -> Result<(), InputError> {
    let wrong = |number: &&f64| **number != 0.0 && !SIZES.contains(&number.abs());
    match numbers.iter().find(wrong) {
        Some(number) => Err(InputError::at(
            at,
            format!("{number:e} is out of range"),
            "give 0, or a size from 1e-30 to 1e30",
        )),
        None => Ok(()),
    }
}

/// A number of values as it stands in a list of numbers.
fn number_of_values(at: &str, count: f64) -> Result<u64, InputError> {
    if count >= 1.0 && count.fract() == 0.0 && count <= MOST_PLACES as f64 {
        return Ok(count as u64);
    }
    let what = match count < 1.0 {
        true => "it is empty".to_owned(),
        false => format!("{count} is no number of values"),
    };
    Err(InputError::at(
        at,
        what,
        format!("give a whole number from 1 to {MOST_PLACES}"),
    ))
}

/// Numbers of beads are whole, but for the rounding of equal steps and factors.
fn beads(at: &str, key: &Key, numbers: impl IntoIterator<Item = f64>) -> Result<(), InputError> {
    let is_bead = |number: f64| {
        (1.0..=MOST_BEADS as f64).contains(&number.round())
            && (number - number.round()).abs() < 1e-9 * number.abs()
    };
    match numbers.into_iter().find(|number| !is_bead(*number)) {
        Some(number) => Err(InputError::at(
            at,
            format!("{key}: {number} is no number of a bead"),
            format!("give whole numbers from 1 to {MOST_BEADS}"),
        )),
        None => Ok(()),
    }
}

/// A list has numbers, or texts, and of beads lists of numbers too. What a scenario takes is found by its
/// first value.
fn list_of(at: &str, key: &Key, list: &[Value]) -> Result<(), InputError> {
    let number = |value: &Value| value.as_float().or(value.as_integer().map(|whole| whole as f64));
    let refused = |what: &str, advice: &str| Err(InputError::at(at, format!("{key}: {what}"), advice));
    if !key.of_beads() {
        let same = list
            .iter()
            .all(|value| number(value).is_some() == number(&list[0]).is_some());
        return match same {
            true => Ok(()),
            false => refused(
                "some values are numbers and some are not",
                "give one kind of them",
            ),
        };
    }
    for value in list {
        match (value, number(value)) {
            (Value::Array(items), _) => {
                let wholes = items
                    .iter()
                    .map_while(Value::as_integer)
                    .map(|whole| whole as f64);
                if wholes.clone().count() < items.len() {
                    return refused(
                        "a list has more than whole numbers",
                        "name beads by their numbers",
                    );
                }
                beads(at, key, wholes)?;
            }
            (_, Some(number)) => beads(at, key, [number])?,
            _ => return refused("a value is no number", "give numbers of beads, or lists of them"),
        }
    }
    Ok(())
}

/// The values of one key.
fn along(
    at: &str,
    text: &str,
    list: Option<&Vec<Value>>,
    [range, linspace, logspace]: [Option<[f64; 3]>; 3],
) -> Result<(Along, u64), InputError> {
    let key = key(at, text)?;
    let given = [range, linspace, logspace].into_iter().flatten().count() + usize::from(list.is_some());
    if given != 1 {
        return Err(InputError::at(
            at,
            format!("{key} needs its values, once"),
            GIVE_VALUES,
        ));
    }
    let (values, count) = if let Some(list) = list {
        if list.is_empty() {
            return Err(InputError::at(
                format!("{at}.values"),
                "it is empty",
                "give a value at least",
            ));
        }
        let numbers: Vec<f64> = list.iter().filter_map(Value::as_float).collect();
        let at = format!("{at}.values");
        in_range(&at, &numbers)?;
        list_of(&at, &key, list)?;
        (Values::list(list.clone()), list.len() as u64)
    } else if let Some([from, to, step]) = range {
        let at = format!("{at}.range");
        in_range(&at, &[from, to, step])?;
        let steps = (to - from) / step;
        if step == 0.0 || steps < 0.0 {
            let what = format!("the range from {from} to {to} in steps of {step} is empty");
            return Err(InputError::at(
                at,
                what,
                "write [first, last, step], such as [0.1, 1.5, 0.1]",
            ));
        }
        // A last value that rounding has moved belongs to it.
        let count = number_of_values(&at, (steps * (1.0 + 1e-12) + 1e-9).floor() + 1.0)?;
        (Values::Range { from, step }, count)
    } else {
        let (name, log, [from, to, count]) = match (linspace, logspace) {
            (Some(space), _) => ("linspace", false, space),
            (_, space) => ("logspace", true, space.expect("one of them is given")),
        };
        let at = format!("{at}.{name}");
        in_range(&at, &[from, to])?;
        let count = number_of_values(&at, count)?;
        if log && !(from > 0.0 && to > 0.0) {
            let what = format!("from {from} to {to} has no equal factors");
            return Err(InputError::at(at, what, "give ends above 0, or linspace"));
        }
        if count > 1 && from == to {
            let what = format!("{count} values from {from} to {to} are all the same");
            return Err(InputError::at(at, what, "give two ends"));
        }
        let values = match log {
            true => Values::Log { from, to, count },
            false => Values::Linear { from, to, count },
        };
        (values, count)
    };
    if key.of_beads() && list.is_none() {
        let number = |place: u64| values.number(place).expect("it is no list");
        let (first, last) = (number(0), number(count - 1));
        beads(at, &key, [first, last])?;
        if (last - first).abs() + 1.5 < count as f64 {
            let what = format!("{key}: {count} values from {first} to {last} cannot all be beads");
            return Err(InputError::at(at, what, "give fewer values"));
        }
        beads(at, &key, (0..count).map(number))?;
    }
    Ok((Along { key, values }, count))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(axes: &str) -> Result<Definition, InputError> {
        let text = format!(
            "{axes}\n[scenario]\n{}",
            Scenario::paper()
                .to_toml()
                .replace("[[intruder", "[[scenario.intruder")
                .replace("[chain", "[scenario.chain")
                .replace("[striker", "[scenario.striker")
        );
        Definition::from_toml(&text, "sweep.toml")
    }

    #[test]
    fn a_plan_that_names_a_file_in_place_of_its_scenario_is_refused() {
        let text = "scenario = \"a.toml\"\n[[axis]]\nkey = \"striker.velocity\"\nvalues = [1.0]";
        let refused = Definition::from_toml(text, "plan.toml").unwrap_err().to_string();
        assert_eq!(
            refused,
            "plan.toml:1: scenario: the name of a file, where its tables must be; make the plan anew"
        );
    }

    #[test]
    fn every_kind_of_axis_is_read_and_written() {
        let definition = read(
            r#"
            [[axis]]
            key = "intruder.0.stiffness"
            logspace = [1e4, 1e6, 5]
            [[axis]]
            key = "striker.velocity"
            range = [0.1, 0.7, 0.1]
            [[axis]]
            name = "tuned"
            zip = [{ key = "intruder.0.mass", linspace = [1e-3, 3e-3, 3] }, { key = "intruder.0.beads", values = [7, 8, [9, 10]] }]
            [[axis]]
            quasirandom = 10
            seed = 3
            over = [{ key = "chain.relaxation", uniform = [0, 8e-6] }, { key = "chain.young", loguniform = [1e9, 1e10] }]
            [outputs]
            peaks = [1, 8]
            "#,
        )
        .unwrap();
        let axes = definition.axes().unwrap();
        assert_eq!(
            axes.iter().map(|axis| axis.count).collect::<Vec<_>>(),
            [5, 7, 3, 10]
        );
        let index: Vec<_> = axes.iter().map(Axis::index).collect();
        let names = [
            "intruder_0_stiffness_n_per_m",
            "striker_velocity_mps",
            "tuned",
            "sample",
        ];
        assert_eq!(index, names);
        let again = Definition::from_toml(&definition.to_toml(), "again").unwrap();
        assert_eq!((&again, again.to_toml()), (&definition, definition.to_toml()));
    }

    #[test]
    fn beads_are_drawn_with_both_ends() {
        for bounds in ["uniform", "loguniform"] {
            let axes =
                format!("[[axis]]\nrandom = 1000\nover = [{{ key = \"chain.beads\", {bounds} = [2, 9] }}]");
            let axes = read(&axes).unwrap().axes().unwrap();
            let drawn = (0..1000).map(|place| axes[0].along[0].value(place).as_integer().unwrap());
            let drawn: std::collections::BTreeSet<i64> = drawn.collect();
            assert!(drawn.into_iter().eq(2..=9), "{bounds}");
        }
    }

    #[test]
    fn spaces_and_lists_of_beads_are_whole() {
        for sound in [
            "key = \"chain.beads\"\nlogspace = [1, 1024, 11]",
            "key = \"chain.beads\"\nlinspace = [16, 10, 3]",
            "key = \"chain.beads\"\nvalues = [16.0, 12]",
            "key = \"intruder.0.beads\"\nvalues = [8, [7, 8]]",
        ] {
            read(&format!("[[axis]]\n{sound}")).unwrap();
        }
    }

    #[test]
    fn the_contact_of_a_wall_that_an_axis_makes_can_be_asked_for() {
        let wall = "[[axis]]\nzip = [{ key = \"wall.young\", values = [1e9] }, { key = \"wall.poisson\", values = [0.3] }]";
        assert!(read(&format!("{wall}\n[outputs]\npeaks = [17]")).is_ok());
        assert!(read(&format!("{wall}\n[outputs]\npeaks = [18]")).is_err());
    }

    #[test]
    fn of_many_keys_the_first_that_is_wrong_is_told() {
        let keys = [
            "duration",
            "chain.young",
            "chain.density",
            "striker.velocity",
            "striker.radius",
        ];
        for wrong in 0..keys.len() {
            let axis = |(place, key): (usize, &&str)| {
                let end = if place == wrong || place == wrong + 2 {
                    "_"
                } else {
                    ""
                };
                format!("[[axis]]\nkey = \"{key}{end}\"\nvalues = [1.0]\n")
            };
            let axes: String = keys.iter().enumerate().map(axis).collect();
            let said = read(&axes).unwrap_err().to_string();
            let first = format!("axis[{}].key: {}_: unknown key", wrong + 1, keys[wrong]);
            assert!(said.contains(&first), "{said}");
        }
    }

    /// A table that the scenario may have and does not: each of its keys alone would not do.
    #[test]
    fn keys_may_make_a_table_together() {
        let young = "[[axis]]\nkey = \"wall.young\"\nvalues = [1e9, 2e9]\n";
        let poisson = "[[axis]]\nkey = \"wall.poisson\"\nvalues = [0.3]";
        assert!(read(&format!("{young}{poisson}")).is_ok());
        let said = read(young).unwrap_err().to_string();
        assert!(
            said.contains("axis[1].key: wall.young: the key `poisson` is missing"),
            "{said}"
        );
    }

    #[test]
    fn what_is_wrong_is_told_with_line_key_and_advice() {
        for (axes, parts) in [
            ("", ["sweep.toml:", "the key `axis` is missing"]),
            (
                "axis = []",
                ["sweep.toml:1: axis: the sweep has no axis", "[[axis]]"],
            ),
            (
                "[[axis]]\nkey = \"intruder.0.stifness\"\nvalues = [1.0]",
                [
                    "sweep.toml:2: axis[1].key: intruder.0.stifness: unknown key",
                    "did you mean `stiffness`?",
                ],
            ),
            (
                "[[axis]]\nkey = \"intruder.3.mass\"\nvalues = [1.0]",
                [
                    "axis[1].key: intruder.3.mass is not in the scenario",
                    "intruder.0",
                ],
            ),
            (
                "[[axis]]\nkey = \"duration\"\nrange = [1.0, 0.5, 0.1]",
                [
                    "sweep.toml:3: axis[1].range: the range from 1 to 0.5 in steps of 0.1 is empty",
                    "[first, last, step]",
                ],
            ),
            (
                "[[axis]]\nkey = \"duration\"\nvalues = []",
                ["axis[1].values: it is empty", "give"],
            ),
            (
                "[[axis]]\nkey = \"duration\"\nlinspace = [1, 2, 0]",
                ["axis[1].linspace: it is empty", "whole"],
            ),
            (
                "[[axis]]\nkey = \"duration\"\nlinspace = [1, 2, 1.5]",
                ["1.5 is no number of values", "whole"],
            ),
            (
                "[[axis]]\nkey = \"duration\"\nlogspace = [0, 2, 3]",
                ["no equal factors", "linspace"],
            ),
            (
                "[[axis]]\nkey = \"duration\"\nlinspace = [-1e308, 1e308, 3]",
                ["axis[1].linspace: -1e308 is out of range", "1e30"],
            ),
            (
                "[[axis]]\nkey = \"duration\"\nlogspace = [1e-320, 1, 3]",
                ["axis[1].logspace: 1e-320 is out of range", "1e-30"],
            ),
            (
                "[[axis]]\nkey = \"duration\"\nvalues = [1, inf]",
                ["axis[1].values: inf is out of range", "1e30"],
            ),
            (
                "[[axis]]\nkey = \"duration\"\nvalues = [1, 1.0]",
                ["the value 1.0 is there twice", "once"],
            ),
            (
                "[[axis]]\nkey = \"duration\"",
                ["duration needs its values", "linspace"],
            ),
            ("[[axis]]\nvalues = [1]", ["no key", "striker.velocity"]),
            (
                "[[axis]]\nkey = \"duration\"\nvalues = [\"long\"]",
                ["axis[1].key: duration: the text", "that kind"],
            ),
            (
                "[[axis]]\nkey = \"chain.beads\"\nvalues = [1.5]",
                [
                    "axis[1].values: chain.beads: 1.5 is no number of a bead",
                    "1 to 100000",
                ],
            ),
            (
                "[[axis]]\nkey = \"chain.beads\"\nlinspace = [1, 16, 5]",
                ["axis[1]: chain.beads: 4.75 is no number of a bead", "1 to 100000"],
            ),
            (
                "[[axis]]\nkey = \"chain.beads\"\nlogspace = [1, 2, 1e12]",
                ["1000000000000 values from 1 to 2 cannot all be beads", "fewer"],
            ),
            (
                "[[axis]]\nkey = \"intruder.0.beads\"\nvalues = [8, [7, 0]]",
                [
                    "axis[1].values: intruder.0.beads: 0 is no number of a bead",
                    "1 to 100000",
                ],
            ),
            (
                "[[axis]]\nkey = \"intruder.0.beads\"\nvalues = [8, [7, 8.5]]",
                ["a list has more than whole numbers", "by their numbers"],
            ),
            (
                "[[axis]]\nkey = \"chain.beads\"\nvalues = [8, \"9\"]",
                ["a value is no number", "numbers of beads"],
            ),
            (
                "[[axis]]\nrandom = 9\nover = [{ key = \"chain.beads\", loguniform = [0.5, 30] }]",
                [
                    "axis[1].over[1]: chain.beads: 0.5 is no number of a bead",
                    "1 to 100000",
                ],
            ),
            (
                "[[axis]]\nkey = \"duration\"\nvalues = [0.1, 0.9, \"1.2\"]",
                [
                    "axis[1].values: duration: some values are numbers and some are not",
                    "one kind",
                ],
            ),
            ("[[axis]]\nrandom = 10", ["draws points over no key", "over ="]),
            (
                "[[axis]]\nzip = [{ key = \"duration\", values = [1, 2] }, { key = \"chain.young\", values = [1] }]",
                ["axis[1].zip[2]: 1 values, and 2", "equally many"],
            ),
            (
                "[[axis]]\nkey = \"duration\"\nvalues = [1]\n[[axis]]\nkey = \"duration\"\nvalues = [1]",
                ["sweep.toml:4: axis[2]: duration is swept twice", "one axis"],
            ),
            (
                "[[axis]]\nkey = \"duration\"\nvalues = [1]\n[outputs]\npeaks = [99]",
                ["outputs.peaks: 99 is not in the chain", "1 to 16"],
            ),
            (
                "[[axis]]\nkey = \"duration\"\nvalues = [1]\n[outputs]\npeak = [9]",
                ["outputs.peak: unknown key", "did you mean `peaks`?"],
            ),
        ] {
            let said = read(axes).unwrap_err().to_string();
            assert!(parts.iter().all(|part| said.contains(part)), "{axes}: {said}");
            assert_eq!(said.lines().count(), 1);
        }
    }
}
