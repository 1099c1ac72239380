//! Shewhart's control chart of individual values.
//!
//! # Design
//! ISO 7870-2: the centre is the mean of the values of a base, and the limits are three standard deviations
//! to either side, estimated from the mean moving range of two values: MR/d₂ with d₂ = 2/√π. A slow drift
//! widens these limits less than it widens the scatter of all values, so the chart shows it. Of the values
//! in control, 0.27 % are beyond the limits, if they are normal and the base is long.

use std::f64::consts::PI;

use schemars::JsonSchema;
use serde::Serialize;

/// Least number of values of a base: with fewer, the limits say next to nothing.
pub const BASE_LEAST: usize = 5;
/// Number of values that a base needs for limits as good as the standard asks.
pub const BASE_GOOD: usize = 20;
/// Limits are this many standard deviations from the centre.
pub const SIGMAS: f64 = 3.0;

/// Limits of a quantity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ControlLimits {
    /// Mean of the base.
    pub centre: f64,
    /// Lower limit.
    pub lower: f64,
    /// Upper limit.
    pub upper: f64,
    /// Standard deviation by the mean moving range.
    pub sigma: f64,
    /// Number of values of the base.
    pub base: usize,
}

impl ControlLimits {
    /// Limits by the first `base` of these values in the order of their times, or by all. `None` for fewer
    /// than [`BASE_LEAST`].
    pub fn of(values: &[f64], base: Option<usize>) -> Option<Self> {
        let base = base.map_or(values, |base| &values[..base.min(values.len())]);
        if base.len() < BASE_LEAST {
            return None;
        }
        let count = base.len() as f64;
        let centre = base.iter().sum::<f64>() / count;
        let ranges = base.windows(2).map(|pair| (pair[1] - pair[0]).abs());
        let sigma = ranges.sum::<f64>() / (count - 1.0) / (2.0 / PI.sqrt());
        Some(Self {
            centre,
            lower: centre - SIGMAS * sigma,
            upper: centre + SIGMAS * sigma,
            sigma,
            base: base.len(),
        })
    }

    /// True if a value is beyond a limit by more than rounding.
    pub fn is_beyond(&self, value: f64) -> bool {
        let slack = 1e-12 * self.centre.abs();
        value < self.lower - slack || value > self.upper + slack
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Costs of twenty weeks: D. C. Montgomery, "Introduction to Statistical Quality Control", where the
    /// chart of individuals has the mean 300.5, the mean moving range 7.79, and limits of 321.22 and 279.78.
    #[test]
    fn limits_are_those_of_a_textbook() {
        let weeks = [
            310, 288, 297, 298, 307, 303, 294, 297, 308, 306, 294, 299, 297, 299, 314, 295, 293, 306, 301,
            304,
        ];
        let limits = ControlLimits::of(&weeks.map(f64::from), None).unwrap();
        assert_eq!((limits.centre, limits.base), (300.5, 20));
        // The book rounds the range, and d₂ to 1.128.
        assert!((limits.upper - 321.22).abs() < 0.02, "{limits:?}");
        assert!((limits.lower - 279.78).abs() < 0.02, "{limits:?}");
        assert!(limits.is_beyond(321.3) && !limits.is_beyond(321.1) && limits.is_beyond(279.7));
    }

    #[test]
    fn the_base_is_the_first_values_and_a_short_one_has_no_limits() {
        let values = [1.0, 2.0, 1.0, 2.0, 1.0, 50.0];
        let limits = ControlLimits::of(&values, Some(5)).unwrap();
        assert_eq!((limits.centre, limits.base), (1.4, 5));
        assert!(limits.is_beyond(50.0));
        assert_eq!(ControlLimits::of(&values, Some(4)), None);
        assert_eq!(ControlLimits::of(&values, Some(9)).unwrap().base, 6);
        // Equal values have no range, and rounding does not count as one.
        let same = ControlLimits::of(&[0.1; 7], None).unwrap();
        assert!(!same.is_beyond(0.1) && same.is_beyond(0.1001));
    }
}
