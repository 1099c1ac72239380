//! Which columns of a file are meant, and in what units.

use std::str::FromStr;

use crate::waveform::unit::{Quantity, size};

/// What a caller says of a file. What it leaves out, the file has to tell.
#[derive(Debug, Clone, Default)]
pub struct Choice {
    /// The column of time.
    pub time: Option<Wanted>,
    /// The column or channel of the force.
    pub force: Option<Wanted>,
    /// The column or channel of the acceleration.
    pub acceleration: Option<Wanted>,
    /// Rows a second; a column of time is then not looked at.
    pub rate_hz: Option<f64>,
    /// Which strike of a file with several, from 0.
    pub strike: Option<usize>,
}

impl Choice {
    /// What is said of a quantity.
    pub(super) fn of(&self, quantity: Quantity) -> Option<&Wanted> {
        match quantity {
            Quantity::Time => self.time.as_ref(),
            Quantity::Force => self.force.as_ref(),
            Quantity::Acceleration => self.acceleration.as_ref(),
        }
    }
}

/// The option that says which column has a quantity.
pub(super) const fn option(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Time => "--time-column",
        Quantity::Force => "--force-column",
        Quantity::Acceleration => "--acceleration-column",
    }
}

/// A column, and what 1 of it is: `CH1`, `CH1:mN`, `CH1:8.9N`, `2:8.9N`.
#[derive(Debug, Clone, PartialEq)]
pub struct Wanted {
    /// Its name, or its number from 1.
    pub column: String,
    /// The quantity and how much of its SI unit 1 is, if that is said.
    pub size: Option<(Quantity, f64)>,
}

impl FromStr for Wanted {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (column, said) = match text.rsplit_once(':') {
            Some((column, said)) => (column, Some(said)),
            None => (text, None),
        };
        let size = match said {
            None => None,
            Some(said) => Some(size(said).ok_or_else(|| {
                format!("`{said}` is no unit that is known; give one as in CH1:N, CH1:8.9N or CH2:98m/s2")
            })?),
        };
        match column.trim() {
            "" => Err("give a column by its name or number, as in CH1:8.9N or 2:8.9N".to_owned()),
            column => Ok(Self {
                column: column.to_owned(),
                size,
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_may_have_a_unit_behind_a_colon() {
        let read = |text: &str| text.parse::<Wanted>();
        assert_eq!(read("CH1:8.9N").unwrap().size, Some((Quantity::Force, 8.9)));
        assert_eq!(read("force_n").unwrap().size, None);
        assert_eq!(read("2:98m/s2").unwrap().column, "2");
        assert!(read("CH1:8.9").unwrap_err().contains("is no unit"));
        assert!(read(":N").is_err());
    }
}
