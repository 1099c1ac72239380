//! A condition on a figure, and the number that shows whether it holds.

use serde::Serialize;

/// The relation of a value to what is expected.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Relation {
    /// The value is expected to within the tolerance.
    Near,
    /// The value is not above the bound.
    AtMost,
    /// The value is not below the bound.
    AtLeast,
}

/// One statement about a figure.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct FigureCheck {
    /// The measured quantity.
    pub what: String,
    /// Unit of the numbers; empty for a pure number.
    pub unit: &'static str,
    /// The value that was measured.
    pub value: f64,
    /// The relation that the value must have to `expected`.
    pub relation: Relation,
    /// The expected value, or the bound.
    pub expected: f64,
    /// How far off the value may be, in the same unit; 0 for a bound.
    pub tolerance: f64,
    /// True if the check passed.
    pub pass: bool,
    /// The paper's value, where the equations give another.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub paper: Option<&'static str>,
    /// The conservation law that this checks over all runs of a figure; none for other checks.
    #[serde(skip)]
    pub law: Option<&'static str>,
}

impl FigureCheck {
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

    /// `value` is `expected` to within the part `part` of it.
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

    /// Marks the check as that of a conservation law.
    pub fn of_law(self, law: &'static str) -> Self {
        Self {
            law: Some(law),
            ..self
        }
    }

    /// Adds the paper's value, where it differs.
    pub fn but_paper(self, says: &'static str) -> Self {
        Self {
            paper: Some(says),
            ..self
        }
    }
}

/// A list of checks, one in each row: what is checked, its unit (none for a pure number), its value, its
/// relation to what is expected, and what the paper says where the equations give something else.
///
/// ```text
/// checks![
///     "highest acceleration", "m/s²": highest => close(133.23, 1e-3);
///     "lasting loss of the chain's energy", "%": lasting => near(1.3, 1e-4), paper "nearly 4 %";
/// ]
/// ```
///
/// The relation is the name of a function of [`FigureCheck`], and its numbers are the function's last
/// arguments. The text of a row may name variables, as in `format!`.
macro_rules! checks {
    (@unit) => { "" };
    (@unit $unit:literal) => { $unit };
    ($($what:literal $(, $unit:literal)?: $value:expr => $relation:ident($($bound:expr),+) $(, paper $paper:literal)?;)*) => {
        vec![$(
            $crate::check::FigureCheck::$relation(format!($what), checks!(@unit $($unit)?), $value, $($bound),+)
                $(.but_paper($paper))?
        ),*]
    };
}
pub(crate) use checks;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_check_fails_outside_its_tolerance_and_for_what_is_no_number() {
        assert!(!FigureCheck::near("x", "", f64::NAN, 1.0, 1e9).pass);
        assert!(!FigureCheck::at_most("x", "", f64::NAN, 1.0).pass);
        assert!(!FigureCheck::at_least("x", "", f64::NAN, 1.0).pass);
        // Just inside a tolerance, and just outside.
        assert!(FigureCheck::close("x", "N", 1.0009, 1.0, 1e-3).pass);
        assert!(!FigureCheck::close("x", "N", 1.0011, 1.0, 1e-3).pass);
        assert!(!FigureCheck::close("x", "N", -0.9989, -1.0, 1e-3).pass);
        assert!(FigureCheck::at_most("x", "", 1.0, 1.0).pass);
        assert!(!FigureCheck::at_least("x", "", 0.999, 1.0).pass);
    }
}
