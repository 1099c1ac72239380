//! What must be true of a figure, with the number that says whether it is.

use serde::Serialize;

/// How a value stands to what is expected.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Relation {
    /// Within the tolerance of it.
    Near,
    /// Not above it.
    AtMost,
    /// Not below it.
    AtLeast,
}

/// One statement about a figure.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Check {
    /// What was measured.
    pub what: String,
    /// Unit of the numbers; empty for a pure number.
    pub unit: &'static str,
    /// What came out.
    pub value: f64,
    /// How it is to stand to `expected`.
    pub relation: Relation,
    /// What is expected, or the bound.
    pub expected: f64,
    /// How far off it may be, in the same unit; 0 for a bound.
    pub tolerance: f64,
    /// Whether it is so.
    pub pass: bool,
    /// What the paper says, where the equations say otherwise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub paper: Option<&'static str>,
    /// The conservation law that it checks over all runs of a figure, if it does.
    #[serde(skip)]
    pub law: Option<&'static str>,
}

impl Check {
    /// `value` is `expected` to within `tolerance`, all in `unit`.
    pub fn near(
        what: impl Into<String>,
        unit: &'static str,
        value: f64,
        expected: f64,
        tolerance: f64,
    ) -> Self {
        Self {
            what: what.into(),
            unit,
            value,
            relation: Relation::Near,
            expected,
            tolerance,
            pass: (value - expected).abs() <= tolerance,
            paper: None,
            law: None,
        }
    }

    /// `value` is `expected` to within this part of it.
    pub fn close(what: impl Into<String>, unit: &'static str, value: f64, expected: f64, part: f64) -> Self {
        Self::near(what, unit, value, expected, part * expected.abs())
    }

    /// `value` is not above `bound`.
    pub fn at_most(what: impl Into<String>, unit: &'static str, value: f64, bound: f64) -> Self {
        Self {
            relation: Relation::AtMost,
            pass: value <= bound,
            ..Self::near(what, unit, value, bound, 0.0)
        }
    }

    /// `value` is not below `bound`.
    pub fn at_least(what: impl Into<String>, unit: &'static str, value: f64, bound: f64) -> Self {
        Self {
            relation: Relation::AtLeast,
            pass: value >= bound,
            ..Self::near(what, unit, value, bound, 0.0)
        }
    }

    /// Marks it as the check of a conservation law.
    pub fn of_law(self, law: &'static str) -> Self {
        Self {
            law: Some(law),
            ..self
        }
    }

    /// Sets beside it what the paper says instead.
    pub fn but_paper(self, says: &'static str) -> Self {
        Self {
            paper: Some(says),
            ..self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_that_is_no_number_passes_no_check() {
        assert!(!Check::near("x", "", f64::NAN, 1.0, 1e9).pass);
        assert!(!Check::at_most("x", "", f64::NAN, 1.0).pass);
        assert!(!Check::at_least("x", "", f64::NAN, 1.0).pass);
    }

    #[test]
    fn a_check_fails_just_outside_its_tolerance() {
        assert!(Check::close("x", "N", 1.0009, 1.0, 1e-3).pass);
        assert!(!Check::close("x", "N", 1.0011, 1.0, 1e-3).pass);
        assert!(!Check::close("x", "N", -0.9989, -1.0, 1e-3).pass);
        assert!(Check::at_most("x", "", 1.0, 1.0).pass);
        assert!(!Check::at_least("x", "", 0.999, 1.0).pass);
    }
}
