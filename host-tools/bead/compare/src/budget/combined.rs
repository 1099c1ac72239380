//! The law of propagation of uncertainty (JCGM 100, 5.1 and 5.2), and the expanded uncertainty (6 and G.4).

use serde::Serialize;

use crate::student::student;

/// More degrees of freedom than this are infinitely many.
const FREE_MOST: f64 = 1e6;

/// Part of one input in the uncertainty of a result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contribution {
    /// Standard uncertainty of the input times the sensitivity of the result, with its sign.
    pub amount: f64,
    /// Degrees of freedom of that uncertainty; `None` for infinitely many.
    pub free: Option<f64>,
}

/// Correlation of two inputs, by their places.
pub type Correlated = (usize, usize, f64);

/// A result with its combined and expanded uncertainty.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Combined {
    /// The result, in its unit.
    pub value: f64,
    /// u_c, its combined standard uncertainty, in the same unit.
    pub u: f64,
    /// ν_eff, effective degrees of freedom by Welch and Satterthwaite; none for infinitely many.
    pub degrees_of_freedom: Option<f64>,
    /// k, for a coverage of 95 %: Student's t.
    pub coverage_factor: f64,
    /// U = k u_c.
    pub expanded: f64,
}

impl Combined {
    /// Combines contributions to the uncertainty of `value`.
    ///
    /// # Panics
    /// A correlation names a place that no contribution has.
    pub fn of(value: f64, contributions: &[Contribution], correlated: &[Correlated]) -> Self {
        let amounts = || contributions.iter().map(|one| one.amount);
        let squares: f64 = amounts().map(|amount| amount * amount).sum();
        let crossed: f64 = correlated.iter().map(|one| crossed(contributions, *one)).sum();
        // With full correlation, rounding may leave less than nothing.
        let variance = (squares + crossed).max(0.0);
        let quartic = |one: &Contribution| Some(one.amount.powi(4) / one.free?);
        let quartics: f64 = contributions.iter().filter_map(quartic).sum();
        // Where no contribution has any, the sum is -0.
        let degrees_of_freedom = (quartics > 0.0)
            .then(|| variance * variance / quartics)
            .filter(|free| *free < FREE_MOST);
        let coverage_factor = student(degrees_of_freedom.unwrap_or(f64::INFINITY).max(1.0));
        let u = variance.sqrt();
        Self {
            value,
            u,
            degrees_of_freedom,
            coverage_factor,
            expanded: coverage_factor * u,
        }
    }

    /// The share of a variance in that of the result, in per cent; 0 if the result has none.
    pub fn share_percent(&self, variance: f64) -> f64 {
        if self.u > 0.0 {
            100.0 * variance / (self.u * self.u)
        } else {
            0.0
        }
    }
}

/// The variance that a correlation adds, or takes away.
pub(super) fn crossed(contributions: &[Contribution], (one, other, correlation): Correlated) -> f64 {
    2.0 * correlation * contributions[one].amount * contributions[other].amount
}
