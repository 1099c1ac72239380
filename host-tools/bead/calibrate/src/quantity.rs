//! Quantities with their standard uncertainty, as an operator writes them: `3.046g±1mg`, `100mm±0.3%`.

use bead_tables::printable::beginning;

/// A quantity that an operator states.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stated {
    /// Value, SI unit.
    pub value: f64,
    /// Standard uncertainty (k = 1), SI unit.
    pub u: f64,
}

/// Dimension of a stated quantity.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[expect(missing_docs, reason = "each is what it is called")]
pub enum Dimension {
    Mass,
    Length,
    Time,
    Acceleration,
    Angle,
    Voltage,
    Stiffness,
    Damping,
    Number,
}

/// An example of each dimension, and its units with their size in the SI unit. The first is the SI unit.
const UNITS: [(&str, &[(&str, f64)]); 9] = [
    ("3.046g±1mg", &[("kg", 1.0), ("g", 1e-3), ("mg", 1e-6)]),
    (
        "100mm±0.3mm",
        &[("m", 1.0), ("cm", 1e-2), ("mm", 1e-3), ("um", 1e-6)],
    ),
    (
        "1.03s±20%",
        &[("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)],
    ),
    ("9.812±0.001", &[("m/s2", 1.0)]),
    (
        "0deg±1deg",
        &[("rad", 1.0), ("deg", std::f64::consts::PI / 180.0)],
    ),
    ("3.300V±0.1%", &[("V", 1.0), ("mV", 1e-3)]),
    ("3.95e5N/m±1%", &[("N/m", 1.0), ("N/mm", 1e3)]),
    ("12Ns/m±3%", &[("Ns/m", 1.0), ("N.s/m", 1.0)]),
    ("0.322±0.1%", &[("", 1.0)]),
];

/// Marks before the standard uncertainty.
const MARKS: [&str; 3] = ["±", "+/-", "+-"];

impl Dimension {
    /// Size of a unit in the SI unit; an empty text is the SI unit.
    fn size(self, name: &str) -> Option<f64> {
        let plain = name
            .trim()
            .replace(['µ', 'μ'], "u")
            .replace('²', "2")
            .replace('°', "deg")
            .replace("N·s", "Ns");
        if plain.is_empty() {
            return Some(1.0);
        }
        let found = UNITS[self as usize].1.iter().find(|(unit, _)| *unit == plain);
        found.map(|(_, size)| *size)
    }

    /// Parses `VALUE±U`. A unit follows each number; U without a unit has that of the value, and U in per
    /// cent is a part of the value.
    ///
    /// # Errors
    /// One line: what is wrong, and an example.
    pub fn parse(self, text: &str) -> Result<Stated, String> {
        let wrong = |why: &str| {
            format!(
                "`{}` {why}; give a value and its standard uncertainty, such as {}",
                beginning(text, 40),
                UNITS[self as usize].0
            )
        };
        let (mark, at) = MARKS
            .iter()
            .find_map(|mark| Some((mark, text.find(mark)?)))
            .ok_or_else(|| wrong("has no uncertainty"))?;
        let (value, unit) = number(&text[..at]).ok_or_else(|| wrong("has no number"))?;
        let (u, of_u) = number(&text[at + mark.len()..]).ok_or_else(|| wrong("has no number after ±"))?;
        let size = self.size(unit).ok_or_else(|| wrong("has an unknown unit"))?;
        let value = value * size;
        let u = match of_u.trim() {
            "%" => u / 100.0 * value.abs(),
            "" => u * size,
            unit => {
                u * self
                    .size(unit)
                    .ok_or_else(|| wrong("has an unknown unit after ±"))?
            }
        };
        if !(value.is_finite() && u.is_finite() && u >= 0.0) {
            return Err(wrong("is not a finite number with an uncertainty of 0 or more"));
        }
        Ok(Stated { value, u })
    }
}

impl Stated {
    /// Refuses this quantity unless it is positive and its uncertainty is less than half of it.
    ///
    /// # Errors
    /// One line: what is wrong, and what would do.
    pub fn positive(self) -> Result<Self, String> {
        if self.value > 0.0 && self.u < 0.5 * self.value {
            return Ok(self);
        }
        Err("give a value above 0 and an uncertainty below half of it".to_owned())
    }

    /// Refuses this quantity above `most`: a number that lacks its unit usually is. `such_as` is the limit
    /// with its unit, and an example.
    ///
    /// # Errors
    /// One line: what would do.
    pub fn at_most(self, most: f64, such_as: &str) -> Result<Self, String> {
        if self.value <= most {
            return Ok(self);
        }
        Err(format!(
            "give at most {such_as}; a number without a unit is in SI units"
        ))
    }

    /// u over the value.
    pub fn relative(self) -> f64 {
        self.u / self.value.abs()
    }
}

/// The number at the beginning of a text, and the rest.
fn number(text: &str) -> Option<(f64, &str)> {
    let text = text.trim();
    let is_part = |letter: char| letter.is_ascii_digit() || "+-.eE".contains(letter);
    let longest = text.find(|letter| !is_part(letter)).unwrap_or(text.len());
    // An `e` may begin the unit.
    (1..=longest)
        .rev()
        .find_map(|end| Some((text.get(..end)?.parse().ok()?, text.get(end..)?)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quantity_is_read_with_its_units_and_refused_without_its_uncertainty() {
        let close = |dimension: Dimension, text: &str, value: f64, u: f64| {
            let found = dimension.parse(text).unwrap();
            let is_close = |found: f64, expected: f64| (found - expected).abs() <= 1e-12 * expected.abs();
            assert!(
                is_close(found.value, value) && is_close(found.u, u),
                "{text}: {found:?}"
            );
        };
        close(Dimension::Mass, "3.046g±1mg", 3.046e-3, 1e-6);
        close(Dimension::Mass, "3.046 g +- 0.001", 3.046e-3, 1e-6);
        close(Dimension::Length, "100mm±0.3%", 0.1, 3e-4);
        close(Dimension::Length, "0.1+/-3e-4", 0.1, 3e-4);
        close(Dimension::Time, "1.03s±20%", 1.03, 0.206);
        close(Dimension::Angle, "0±1°", 0.0, std::f64::consts::PI / 180.0);
        close(Dimension::Acceleration, "9.812m/s²±1e-3", 9.812, 1e-3);
        close(Dimension::Stiffness, "3.95e5N/m±1%", 3.95e5, 3950.0);
        for (text, why) in [
            ("3.046g", "has no uncertainty"),
            ("g±1mg", "has no number"),
            ("3mm±1", "has an unknown unit"),
            ("3g±1mm", "has an unknown unit after ±"),
            ("3g±", "has no number after ±"),
            ("3g±-1mg", "is not a finite number"),
            ("nan±1", "has no number"),
            ("1e999±1", "is not a finite number"),
        ] {
            let refused = Dimension::Mass.parse(text).unwrap_err();
            assert!(refused.contains(why), "{text}: {refused}");
        }
        assert!(Dimension::Mass.parse("1g±0.6g").unwrap().positive().is_err());
    }
}
