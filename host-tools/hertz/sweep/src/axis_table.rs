//! `[[axis]]` tables of a sweep's file, and the axes that they describe.

use std::ops::RangeInclusive;

use hertz_chain::{InputError, MOST_BEADS};
use serde::Deserialize;
use toml::Value;

use crate::axis::{Along, SweepAxis, Values};
use crate::draw::Method;
use crate::key::ScenarioKey;

/// Places of an axis at most.
const MOST_PLACES: u64 = 1_000_000_000_000;
const GIVE_VALUES: &str = "give one of values = […], range = [first, last, step], linspace = [first, last, how many], logspace = […]";

/// An `[[axis]]`, or an entry of its `zip` or `over`, as the file has it.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct AxisTable {
    name: Option<String>,
    key: Option<String>,
    values: Option<Vec<Value>>,
    range: Option<[f64; 3]>,
    linspace: Option<[f64; 3]>,
    logspace: Option<[f64; 3]>,
    uniform: Option<[f64; 2]>,
    loguniform: Option<[f64; 2]>,
    random: Option<u64>,
    quasirandom: Option<u64>,
    seed: Option<u64>,
    zip: Option<Vec<AxisTable>>,
    over: Option<Vec<AxisTable>>,
}

/// The values of one key as a file describes them.
#[derive(Clone, Copy)]
enum Spacing<'a> {
    List(&'a [Value]),
    Range([f64; 3]),
    Linear([f64; 3]),
    Log([f64; 3]),
    Drawn { bounds: [f64; 2], log: bool },
}

fn refused<T>(at: &str, what: impl Into<String>, advice: impl Into<String>) -> Result<T, InputError> {
    Err(InputError::at(at, what, advice))
}

impl AxisTable {
    /// The axis of the table, which messages call `at`.
    ///
    /// # Errors
    /// A key or a value is not one of a sweep; [`InputError`] without file and line.
    pub(super) fn axis(&self, at: &str) -> Result<SweepAxis, InputError> {
        let is_key = self.key.is_some() || self.spacings().len() == 1;
        let is_drawn = self.random.is_some() || self.quasirandom.is_some();
        if !is_drawn && (self.over.is_some() || self.seed.is_some()) {
            let advice = "add one of them with the number of points to draw";
            return refused(at, "over and seed belong to random or quasirandom", advice);
        }
        let (default_name, along, count) = match (is_key, &self.zip, self.random, self.quasirandom) {
            (true, None, None, None) => return self.key_axis(at),
            (false, Some(tables), None, None) => {
                let (along, count) = zipped(at, tables)?;
                ("zip", along, count)
            }
            (false, None, Some(count), None) => ("sample", self.drawn(at, Method::Random, count)?, count),
            (false, None, None, Some(count)) => {
                ("sample", self.drawn(at, Method::Quasirandom, count)?, count)
            }
            _ => {
                let what = "it must have either a key with its values, or zip, or random, or quasirandom";
                return refused(at, what, "give one of them");
            }
        };
        let name = self.name.as_deref().unwrap_or(default_name);
        if name.is_empty() || !name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') {
            let advice = "use letters, digits and _";
            return refused(&format!("{at}.name"), "it is not a column name", advice);
        }
        let name = Some(name.to_owned());
        Ok(SweepAxis { name, along, count })
    }

    fn key_axis(&self, at: &str) -> Result<SweepAxis, InputError> {
        if self.name.is_some() {
            return refused(
                at,
                "an axis of one key takes its name from the key",
                "leave the name out",
            );
        }
        let (along, count) = self.along(at)?;
        if let Some(value) = along.twice() {
            let what = format!("the value {value} occurs twice");
            return refused(at, what, "give each value once");
        }
        let (name, along) = (None, vec![along]);
        Ok(SweepAxis { name, along, count })
    }

    /// All spacings that the table gives. It must give exactly one.
    fn spacings(&self) -> Vec<Spacing<'_>> {
        let given = [
            self.values.as_deref().map(Spacing::List),
            self.range.map(Spacing::Range),
            self.linspace.map(Spacing::Linear),
            self.logspace.map(Spacing::Log),
            self.uniform.map(|bounds| Spacing::Drawn { bounds, log: false }),
            self.loguniform.map(|bounds| Spacing::Drawn { bounds, log: true }),
        ];
        given.into_iter().flatten().collect()
    }

    /// The keys of the scenario that change along the axis.
    pub(super) fn keys(&self) -> impl Iterator<Item = &str> {
        let inner = self.zip.iter().chain(&self.over).flatten();
        let tables = std::iter::once(self).chain(inner);
        tables.filter_map(|table| table.key.as_deref())
    }

    fn key(&self, at: &str) -> Result<ScenarioKey, InputError> {
        let Some(key) = &self.key else {
            let advice = "give a key such as striker.velocity";
            return refused(at, "it has values but no key", advice);
        };
        let key_at = format!("{at}.key");
        ScenarioKey::parse(key).map_err(|error| InputError { key: key_at, ..error })
    }

    /// The key with its values, and their number.
    fn along(&self, at: &str) -> Result<(Along, u64), InputError> {
        let [spacing] = self.spacings()[..] else {
            let what = format!(
                "{} needs exactly one set of values",
                self.key.as_deref().unwrap_or("it")
            );
            return refused(at, what, GIVE_VALUES);
        };
        let key = self.key(at)?;
        let (values, count) = match spacing {
            Spacing::List(list) => {
                let at = format!("{at}.values");
                let numbers: Vec<f64> = list.iter().filter_map(Value::as_float).collect();
                if list.is_empty() {
                    return refused(&at, "it is empty", "give at least one value");
                }
                check_range(&at, &numbers)?;
                check_list(&at, &key, list)?;
                let values = Values::list(list.to_vec());
                return Ok((Along { key, values }, list.len() as u64));
            }
            Spacing::Range(range) => steps(&format!("{at}.range"), range)?,
            Spacing::Linear([from, to, count]) => space(&format!("{at}.linspace"), [from, to], count, false)?,
            Spacing::Log([from, to, count]) => {
                let at = format!("{at}.logspace");
                let positive = from > 0.0 && to > 0.0;
                if !positive && check_range(&at, &[from, to]).is_ok() {
                    let what = format!("there are no equal factors from {from} to {to}");
                    return refused(&at, what, "give ends above 0, or linspace");
                }
                space(&at, [from, to], count, true)?
            }
            Spacing::Drawn { .. } => {
                let what = format!("{key} has bounds, but no points are drawn between them here");
                return refused(at, what, GIVE_VALUES);
            }
        };
        if key.of_beads() {
            check_spaced_beads(at, &key, &values, count)?;
        }
        Ok((Along { key, values }, count))
    }

    /// The keys of points that are drawn.
    fn drawn(&self, at: &str, method: Method, count: u64) -> Result<Vec<Along>, InputError> {
        check_count(at, count as f64)?;
        let tables = self.over.as_deref().unwrap_or_default();
        if tables.is_empty() {
            let advice = "write over = [{ key = \"striker.velocity\", uniform = [0.2, 1.5] }]";
            return refused(at, "it draws points over no key", advice);
        }
        let mut all = Vec::new();
        for (dimension, table) in tables.iter().enumerate() {
            let at = format!("{at}.over[{}]", dimension + 1);
            let key = table.key(&at)?;
            let [Spacing::Drawn { bounds, log }] = table.spacings()[..] else {
                let advice = "give one of uniform = [least, greatest] and loguniform = [least, greatest]";
                return refused(&at, "it must have bounds", advice);
            };
            let [from, to] = bounds;
            check_range(&at, &bounds)?;
            if key.of_beads() {
                check_beads(&at, &key, bounds)?;
            }
            if from > to || (log && from <= 0.0) {
                let what = format!("there is nothing to draw between {from} and {to}");
                return refused(&at, what, "give the lesser bound first, above 0 for loguniform");
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

/// The values of keys that change together, and their number.
fn zipped(at: &str, tables: &[AxisTable]) -> Result<(Vec<Along>, u64), InputError> {
    let (mut all, mut first) = (Vec::new(), None);
    for (table, number) in tables.iter().zip(1..) {
        let at = format!("{at}.zip[{number}]");
        let (along, count) = table.along(&at)?;
        let first = *first.get_or_insert(count);
        if count != first {
            let what = format!("it has {count} values, but the first key of the zip has {first}");
            return refused(&at, what, "give all keys of a zip equally many values");
        }
        all.push(along);
    }
    match first {
        Some(count) => Ok((all, count)),
        None => refused(&format!("{at}.zip"), "it has no key", GIVE_VALUES),
    }
}

/// Equal steps from the first value to the last.
fn steps(at: &str, [from, to, step]: [f64; 3]) -> Result<(Values, u64), InputError> {
    check_range(at, &[from, to, step])?;
    let steps = (to - from) / step;
    if step == 0.0 || steps < 0.0 {
        let what = format!("the range from {from} to {to} in steps of {step} is empty");
        return refused(at, what, "write [first, last, step], such as [0.1, 1.5, 0.1]");
    }
    // A last value that rounding has moved belongs to the range.
    let count = check_count(at, (steps * (1.0 + 1e-12) + 1e-9).floor() + 1.0)?;
    Ok((Values::Range { from, step }, count))
}

/// Equal steps or factors between two ends, for a number of values.
fn space(at: &str, [from, to]: [f64; 2], count: f64, log: bool) -> Result<(Values, u64), InputError> {
    check_range(at, &[from, to])?;
    let count = check_count(at, count)?;
    if count > 1 && from == to {
        let what = format!("{count} values from {from} to {to} are all the same");
        return refused(at, what, "give two different ends");
    }
    let values = Values::Space { from, to, count, log };
    Ok((values, count))
}

/// Sizes that a scenario takes. Differences and ratios of two such values are finite.
const SIZES: RangeInclusive<f64> = 1e-30..=1e30;

fn check_range(at: &str, numbers: &[f64]) -> Result<(), InputError> {
    let is_wrong = |number: &&f64| **number != 0.0 && !SIZES.contains(&number.abs());
    match numbers.iter().find(is_wrong) {
        Some(number) => {
            let what = format!("{number:e} is out of range");
            refused(at, what, "give 0, or a size from 1e-30 to 1e30")
        }
        None => Ok(()),
    }
}

/// Checks a number of values, which is a float if it was computed or given among other numbers.
fn check_count(at: &str, count: f64) -> Result<u64, InputError> {
    if count >= 1.0 && count.fract() == 0.0 && count <= MOST_PLACES as f64 {
        return Ok(count as u64);
    }
    let what = if count < 1.0 {
        "it is empty".to_owned()
    } else {
        format!("{count} is not a number of values")
    };
    refused(at, what, format!("give a whole number from 1 to {MOST_PLACES}"))
}

/// Checks numbers of beads: whole, but for the rounding of equal steps and factors.
fn check_beads(
    at: &str,
    key: &ScenarioKey,
    numbers: impl IntoIterator<Item = f64>,
) -> Result<(), InputError> {
    let is_bead = |number: f64| {
        (1.0..=MOST_BEADS as f64).contains(&number.round())
            && (number - number.round()).abs() < 1e-9 * number.abs()
    };
    match numbers.into_iter().find(|number| !is_bead(*number)) {
        Some(number) => {
            let what = format!("{key}: {number} is not a bead number");
            refused(at, what, format!("give whole numbers from 1 to {MOST_BEADS}"))
        }
        None => Ok(()),
    }
}

/// Checks numbers of beads that are spaced evenly.
fn check_spaced_beads(at: &str, key: &ScenarioKey, values: &Values, count: u64) -> Result<(), InputError> {
    let number = |place: u64| values.number(place).unwrap_or(f64::NAN);
    let (first, last) = (number(0), number(count - 1));
    check_beads(at, key, [first, last])?;
    if (last - first).abs() + 1.5 < count as f64 {
        let what = format!("{key}: {count} values from {first} to {last} cannot all be beads");
        return refused(at, what, "give fewer values");
    }
    check_beads(at, key, (0..count).map(number))
}

/// Checks the kinds of listed values: numbers or texts, and for beads also lists of numbers.
fn check_list(at: &str, key: &ScenarioKey, list: &[Value]) -> Result<(), InputError> {
    let number = |value: &Value| value.as_float().or(value.as_integer().map(|whole| whole as f64));
    let wrong = |what: &str, advice: &str| refused(at, format!("{key}: {what}"), advice);
    if !key.of_beads() {
        let is_number = |value: &Value| number(value).is_some();
        if list.iter().any(|value| is_number(value) != is_number(&list[0])) {
            let what = "some values are numbers and some are not";
            return wrong(what, "give values of one kind");
        }
        return Ok(());
    }
    for value in list {
        match (value, number(value)) {
            (Value::Array(items), _) => {
                let wholes: Option<Vec<i64>> = items.iter().map(Value::as_integer).collect();
                let Some(wholes) = wholes else {
                    let what = "a list has entries that are not whole numbers";
                    return wrong(what, "name beads by their numbers");
                };
                check_beads(at, key, wholes.into_iter().map(|whole| whole as f64))?;
            }
            (_, Some(number)) => check_beads(at, key, [number])?,
            _ => {
                return wrong(
                    "a value is not a number",
                    "give numbers of beads, or lists of them",
                );
            }
        }
    }
    Ok(())
}
