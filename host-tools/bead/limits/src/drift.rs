//! The drift of a value over strikes.
//!
//! # Design
//! The line of least squares through the values over the number of the strike: its rise from the first strike
//! to the last, as a part of the mean. Its uncertainty follows from the scatter around the line, by Student's
//! t with n − 2 degrees of freedom; the calibration, which all strikes share, cancels.

use bead_compare::student::student;

/// Least number of strikes for a drift.
pub const STRIKES_LEAST: usize = 5;

/// A drift over strikes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StrikeDrift {
    /// Rise from the first strike to the last, as a part of the mean.
    pub part: f64,
    /// Its expanded uncertainty, 95 %.
    pub expanded: f64,
}

impl StrikeDrift {
    /// The drift of values in the order of their strikes. `None` for fewer than [`STRIKES_LEAST`], or for a
    /// mean of 0.
    pub fn of(values: &[f64]) -> Option<Self> {
        if values.len() < STRIKES_LEAST {
            return None;
        }
        let count = values.len() as f64;
        let (mean, middle) = (values.iter().sum::<f64>() / count, 0.5 * (count - 1.0));
        let at = |place: usize| place as f64 - middle;
        let squares = (0..values.len()).map(|place| at(place).powi(2)).sum::<f64>();
        let products = values
            .iter()
            .enumerate()
            .map(|(place, value)| at(place) * (value - mean));
        let slope = products.sum::<f64>() / squares;
        let residuals = values
            .iter()
            .enumerate()
            .map(|(place, value)| value - mean - slope * at(place));
        let free = count - 2.0;
        let scatter = (residuals.map(|residual| residual * residual).sum::<f64>() / free).sqrt();
        let rise = (count - 1.0) / mean.abs();
        let drift = Self {
            part: slope * rise,
            expanded: student(free) * scatter / squares.sqrt() * rise,
        };
        (drift.part.is_finite() && drift.expanded.is_finite()).then_some(drift)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_drifts_by_its_rise_and_scatter_is_its_uncertainty() {
        let line: Vec<f64> = (0..11).map(|n| 2.0 + 0.02 * f64::from(n)).collect();
        let drift = StrikeDrift::of(&line).unwrap();
        assert!(
            (drift.part - 0.2 / 2.1).abs() < 1e-12 && drift.expanded < 1e-12,
            "{drift:?}"
        );
        // By the textbook formulas in Python with t = 2.7764451051978 for four degrees of freedom.
        let values = [1.0, 1.2, 0.9, 1.1, 1.3, 1.1];
        let drift = StrikeDrift::of(&values).unwrap();
        assert!((drift.part - 0.129_870_129_870_13).abs() < 1e-9, "{drift:?}");
        assert!((drift.expanded - 0.441_615_182_25).abs() < 1e-9, "{drift:?}");
        assert_eq!(StrikeDrift::of(&values[..4]), None);
        assert_eq!(StrikeDrift::of(&[0.0; 6]), None);
    }
}
