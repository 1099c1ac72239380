//! Axes of a sweep: values of one key, of several keys together, or of points that are drawn.

use std::collections::HashSet;

use toml::Value;

use crate::draw::{Method, coordinate};
use crate::key::ScenarioKey;
use bead_tables::{Cell, CellKind};

/// One direction of a sweep.
#[derive(Debug, Clone, PartialEq)]
pub struct SweepAxis {
    /// Name of the column with its places, where several keys change along it.
    pub name: Option<String>,
    /// The keys that change along it.
    pub along: Vec<Along>,
    /// Number of its places.
    pub count: u64,
}

/// A key and its values.
#[derive(Debug, Clone, PartialEq)]
pub struct Along {
    /// The key.
    pub key: ScenarioKey,
    /// Its values.
    pub values: Values,
}

/// Values by place.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// `from + place * step`.
    Range {
        /// First value.
        from: f64,
        /// Step from one to the next.
        step: f64,
    },
    /// Equal steps, or equal factors.
    Space {
        /// First value.
        from: f64,
        /// Last value.
        to: f64,
        /// Number of values.
        count: u64,
        /// True for equal factors.
        log: bool,
    },
    /// Listed values.
    List {
        /// The values.
        values: Vec<Value>,
        /// True if all of them are numbers.
        numeric: bool,
    },
    /// Drawn between two values, evenly or in the logarithm.
    Drawn {
        /// Method.
        method: Method,
        /// Seed of the whole axis.
        seed: u64,
        /// Dimension of the key, from 0.
        dimension: usize,
        /// Number of keys that are drawn together.
        dimensions: usize,
        /// Least value.
        from: f64,
        /// Greatest value; for beads one more, since drawn values are rounded down.
        to: f64,
        /// True if drawn evenly in the logarithm.
        log: bool,
    },
}

impl Values {
    /// Listed values.
    pub fn list(values: Vec<Value>) -> Self {
        let numeric = values.iter().all(|value| value.is_integer() || value.is_float());
        Self::List { values, numeric }
    }

    /// The value at a place; `None` for a list.
    pub fn number(&self, place: u64) -> Option<f64> {
        let between = |part: f64, from: f64, to: f64, log: bool| {
            if log {
                from * (to / from).powf(part)
            } else {
                from + part * (to - from)
            }
        };
        Some(match *self {
            Self::Range { from, step } => from + place as f64 * step,
            // The ends are exact.
            Self::Space { from, count, .. } if place == 0 || count < 2 => from,
            Self::Space { to, count, .. } if place + 1 == count => to,
            Self::Space { from, to, count, log } => between(place as f64 / (count - 1) as f64, from, to, log),
            Self::List { .. } => return None,
            Self::Drawn {
                method,
                seed,
                dimension,
                dimensions,
                from,
                to,
                log,
            } => between(
                coordinate(method, seed, place, dimension, dimensions),
                from,
                to,
                log,
            ),
        })
    }
}

impl Along {
    /// The value at a place of the axis.
    pub fn value(&self, place: u64) -> Value {
        let value = match &self.values {
            Values::List { values, .. } => values[place as usize].clone(),
            other => Value::Float(other.number(place).expect("only lists hold anything but numbers")),
        };
        match value {
            // Numbers of beads are whole but for rounding; drawn values are rounded down.
            Value::Float(number) if self.key.of_beads() => Value::Integer(match self.values {
                Values::Drawn { to, .. } => number.floor().min(to - 1.0),
                _ => number.round(),
            } as i64),
            Value::Integer(number) if !self.key.of_beads() => Value::Float(number as f64),
            other => other,
        }
    }

    /// Kind of its column.
    pub fn kind(&self) -> CellKind {
        match self.values {
            Values::List { numeric: false, .. } => CellKind::Text,
            _ if self.key.of_beads() => CellKind::Whole,
            _ => CellKind::Number,
        }
    }

    /// The value at a place as a cell of its column.
    pub fn cell(&self, place: u64) -> Cell {
        let value = self.value(place);
        match (self.kind(), &value) {
            (CellKind::Text, _) => Cell::Text(shown(&value).into()),
            (CellKind::Number, Value::Float(number)) => Cell::Number(*number),
            (_, Value::Integer(number)) => Cell::Whole(*number),
            _ => Cell::Null,
        }
    }

    /// The first repeated value of the list. A cube cannot hold such an axis.
    pub fn twice(&self) -> Option<String> {
        let Values::List { values, .. } = &self.values else {
            return None;
        };
        let mut seen = HashSet::new();
        let mut shown = (0..values.len()).map(|place| shown(&self.value(place as u64)));
        shown.find(|value| !seen.insert(value.clone()))
    }
}

/// The text of a value. The beads of a list are separated by blanks.
fn shown(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Array(items) => items.iter().map(shown).collect::<Vec<_>>().join(" "),
        other => other.to_string(),
    }
}

impl SweepAxis {
    /// Name of the column that is the axis of a cube.
    pub fn index(&self) -> String {
        self.name.clone().unwrap_or_else(|| self.along[0].key.column())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn along(key: &str, values: Values) -> Along {
        let key = ScenarioKey::parse(key).unwrap();
        Along { key, values }
    }

    #[test]
    fn the_ends_of_a_space_are_exact() {
        let (from, to, count) = (0.1, 0.7, 7);
        for (log, middle) in [(false, 0.4), (true, 0.07_f64.sqrt())] {
            let values = Values::Space { from, to, count, log };
            let value = |place| values.number(place).unwrap();
            assert_eq!((value(0), value(6)), (from, to));
            assert!((value(3) - middle).abs() < 1e-15);
        }
    }

    #[test]
    fn beads_are_whole_and_lists_of_them_are_text() {
        let beads = along("intruder.1.beads", Values::Range { from: 1.0, step: 1.0 });
        assert_eq!(
            (beads.value(6), beads.kind()),
            (Value::Integer(7), CellKind::Whole)
        );
        let lists = vec![Value::Integer(7), Value::Array(vec![7.into(), 8.into()])];
        let lists = along("intruder.1.beads", Values::list(lists));
        assert_eq!(
            (lists.kind(), lists.cell(1)),
            (CellKind::Text, Cell::Text("7 8".into()))
        );
    }
}
