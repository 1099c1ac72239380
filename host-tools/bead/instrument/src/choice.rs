//! Options that choose columns of a file and their units.

use std::fmt;
use std::str::FromStr;

use bead_tables::unit::{Quantity, parse_size};

/// The columns to read. Those that are left out are found by their names.
#[derive(Debug, Clone, Default)]
pub struct Choice {
    /// Column of the time.
    pub time: Option<Wanted>,
    /// Column or channel of the force.
    pub force: Option<Wanted>,
    /// Column or channel of the acceleration.
    pub acceleration: Option<Wanted>,
    /// Rows a second, Hz, in place of a column of time.
    pub rate_hz: Option<f64>,
    /// Strike of a file with several, from 0.
    pub strike: Option<usize>,
}

impl Choice {
    pub(super) fn names_a_column(&self) -> bool {
        self.time.is_some() || self.force.is_some() || self.acceleration.is_some()
    }

    pub(super) fn of(&self, quantity: Quantity) -> Option<&Wanted> {
        match quantity {
            Quantity::Time => self.time.as_ref(),
            Quantity::Force => self.force.as_ref(),
            _ => self.acceleration.as_ref(),
        }
    }
}

/// Beginning of the option that names the column of a quantity.
pub(super) const fn option(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Time => "--read time=",
        Quantity::Force => "--read force=",
        _ => "--read acceleration=",
    }
}

/// A column, and the size of its unit: `CH1`, `CH1:mN`, `CH1:8.9N`, `2:8.9N`, `name=2:8.9N`.
#[derive(Debug, Clone, PartialEq)]
pub struct Wanted {
    /// The column.
    pub column: ColumnAddress,
    /// Quantity and size in its SI unit of 1 in the column, if given.
    pub size: Option<(Quantity, f64)>,
    /// True if the size is per volt: `8.9N/V`.
    pub per_volt: bool,
}

/// A way to name a column.
#[derive(Debug, Clone, PartialEq)]
pub enum ColumnAddress {
    /// A name or, if no column has that name, a number from 1.
    Either(String),
    /// A name.
    Name(String),
    /// A number from 1.
    Number(String),
}

impl FromStr for Wanted {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (column, unit) = match text.rsplit_once(':') {
            Some((column, unit)) => (column, Some(unit)),
            None => (text, None),
        };
        let size = unit.map(|unit| {
            parse_size(unit).ok_or_else(|| {
                format!("`{unit}` is not a known unit; give one as in CH1:N, CH1:8.9N or CH2:98m/s2")
            })
        });
        let column = match column.trim().split_once('=') {
            Some(("name", name)) => ColumnAddress::Name(name.to_owned()),
            Some(("number", number)) => ColumnAddress::Number(number.to_owned()),
            _ => ColumnAddress::Either(column.trim().to_owned()),
        };
        let (ColumnAddress::Either(name) | ColumnAddress::Name(name) | ColumnAddress::Number(name)) = &column;
        if name.is_empty() {
            return Err("give a column by its name or number, as in CH1:8.9N or 2:8.9N".to_owned());
        }
        let size = size.transpose()?;
        let per_volt = unit.is_some_and(|unit| unit.trim().to_lowercase().ends_with("/v"));
        Ok(Self {
            column,
            size,
            per_volt,
        })
    }
}

impl fmt::Display for ColumnAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Either(text) => f.write_str(text),
            Self::Name(name) => write!(f, "name={name}"),
            Self::Number(number) => write!(f, "number={number}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_without_a_name_or_with_another_unit_is_refused_with_an_example() {
        let refused = |text: &str| text.parse::<Wanted>().unwrap_err();
        assert!(refused("CH1:8.9").contains("`8.9` is not a known unit; give one as in CH1:N"));
        assert!(refused(":N").contains("as in CH1:8.9N or 2:8.9N"));
    }
}
