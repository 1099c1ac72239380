//! Standard errors, correlations and intervals of a fit.

use bead_recording::clock::QUARTZ;
use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, FisherSnedecor, StudentsT};

use crate::fit::{Fit, fit, part};
use crate::normal::Normal;
use crate::quantity::{COUNT, QUANTITIES, Quantity};

/// Least probability of the residuals for a model to fit.
pub const LEAST_PROBABILITY: f64 = 0.01;
/// Coverage of intervals.
const COVERAGE: f64 = 0.95;
/// Standard uncertainty of the bead's clock, as a part, from a rectangular distribution.
const CLOCK_U: f64 = QUARTZ * 0.577_350_269_189_625_8;
/// Greatest number of strikes for a profile. With more, the fit is linear over the small standard errors.
pub const MOST_PROFILED: usize = 8;

/// Agreement of the residuals with the noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Goodness {
    /// Sum of squared whitened residuals.
    pub chi_squared: f64,
    /// Residuals less fitted numbers.
    pub free: f64,
    /// Probability of a sum that is as great or greater (distribution F, since the noise is estimated too).
    pub probability: f64,
}

impl Goodness {
    /// The agreement of a fit, for noise that is known with `noise_free` degrees of freedom.
    pub fn of(normal: &Normal, fitted: usize, noise_free: f64) -> Self {
        let free = (normal.free - fitted as f64).max(1.0);
        let ratio = normal.squares / free;
        // For exactly known noise the distribution tends to chi-squared.
        let distribution = FisherSnedecor::new(free, noise_free.clamp(1.0, 1e7));
        let probability = distribution.map_or(0.0, |distribution| distribution.sf(ratio));
        Self {
            chi_squared: normal.squares,
            free,
            probability,
        }
    }

    /// Factor of standard errors: 1 where the model fits, else the root of χ²/ν (Birge's ratio).
    pub fn scale(&self) -> f64 {
        if self.probability < LEAST_PROBABILITY {
            (self.chi_squared / self.free).sqrt().max(1.0)
        } else {
            1.0
        }
    }
}

/// Student's t for intervals of 95 %.
pub fn coverage_factor(free: f64) -> f64 {
    let distribution = StudentsT::new(0.0, 1.0, free.clamp(1.0, 1e7));
    distribution.map_or(f64::INFINITY, |distribution| {
        distribution.inverse_cdf(0.5 + 0.5 * COVERAGE)
    })
}

/// Covariance of the logarithms of free quantities; `None` if they cannot be told apart.
pub fn covariance(normal: &Normal, free: &[Quantity]) -> Option<DMatrix<f64>> {
    let (information, _) = part(normal, free);
    if free.is_empty() {
        return Some(information);
    }
    Some(information.cholesky()?.inverse())
}

/// Change of the logarithm of each free quantity with that of a held one. `covariance` is due to noise.
fn by_held(normal: &Normal, free: &[Quantity], covariance: &DMatrix<f64>, held: Quantity) -> DVector<f64> {
    let mixed = DVector::from_fn(free.len(), |at, _| {
        normal.information[(free[at].place(), held.place())]
    });
    -(covariance * mixed)
}

/// Covariance of the logarithms of all quantities, by the scatter (`unscaled` is that by the noise, and
/// `scale` the factor in standard errors), by relative standard uncertainties of the held ones, and by that
/// of the bead's clock. A held quantity without one counts as exact.
pub fn combined(
    normal: &Normal,
    free: &[Quantity],
    (unscaled, scale): (&DMatrix<f64>, f64),
    held: &[Option<f64>; COUNT],
) -> DMatrix<f64> {
    let mut all = DMatrix::zeros(COUNT, COUNT);
    let mut of_clock = DVector::zeros(COUNT);
    for (a, one) in free.iter().enumerate() {
        of_clock[one.place()] = one.by_clock();
        for (b, other) in free.iter().enumerate() {
            all[(one.place(), other.place())] = unscaled[(a, b)] * scale * scale;
        }
    }
    for quantity in QUANTITIES.into_iter().filter(|one| !free.contains(one)) {
        let mut slopes = DVector::zeros(COUNT);
        slopes[quantity.place()] = 1.0;
        let by = by_held(normal, free, unscaled, quantity);
        for (at, one) in free.iter().enumerate() {
            slopes[one.place()] = by[at];
            // A held value does not scale with the clock, so it deviates from the value that fits the
            // samples.
            of_clock[one.place()] -= by[at] * quantity.by_clock();
        }
        let part = held[quantity.place()].unwrap_or(0.0);
        all += &slopes * slopes.transpose() * (part * part);
    }
    all + &of_clock * of_clock.transpose() * (CLOCK_U * CLOCK_U)
}

/// Ends of the profile interval of a quantity: where the sum of squares, with all else refitted, is greater
/// by `rise`. `None` if a fit fails, or gives a sum that is no greater.
pub fn profile(best: &Fit<'_>, of: Quantity, covariance: &DMatrix<f64>, rise: f64) -> Option<[f64; 2]> {
    let place = best.free.iter().position(|one| *one == of)?;
    let error = covariance[(place, place)].sqrt();
    let others: Vec<Quantity> = best.free.iter().copied().filter(|one| *one != of).collect();
    let strikes = best.starts();
    let risen = |log: f64| -> Option<f64> {
        let mut values = best.values;
        for (at, one) in best.free.iter().enumerate() {
            // Start the others on the line of least squares.
            values[one.place()] *= (log * covariance[(at, place)] / covariance[(place, place)]).exp();
        }
        let there = fit(&strikes, &values, &others).ok()?;
        Some(there.normal.squares - best.normal.squares)
    };
    let end = |sign: f64| -> Option<f64> {
        let mut log = sign * rise.sqrt() * error;
        for _ in 0..3 {
            let now = risen(log)?;
            if now <= 0.0 {
                return None;
            }
            let factor = (rise / now).sqrt();
            log *= factor;
            if (factor - 1.0).abs() < 0.01 {
                break;
            }
        }
        Some(best.values[of.place()] * log.exp())
    };
    Some([end(-1.0)?, end(1.0)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The data determine k/m, as a ringing does.
    #[test]
    fn a_clock_moves_what_is_fitted_also_through_what_is_held() {
        use Quantity::{IntruderMass, Stiffness};
        let mut normal = Normal::default();
        for (one, a) in [(Stiffness, 1.0), (IntruderMass, -1.0)] {
            for (other, b) in [(Stiffness, 1.0), (IntruderMass, -1.0)] {
                normal.information[(one.place(), other.place())] = 1e10 * a * b;
            }
        }
        for (free, held, stated) in [(Stiffness, IntruderMass, 1e-4), (IntruderMass, Stiffness, 0.0)] {
            let unscaled = DMatrix::from_element(1, 1, 1e-10);
            let mut known = [None; COUNT];
            known[held.place()] = Some(stated);
            let all = combined(&normal, &[free], (&unscaled, 3.0), &known);
            let u = all[(free.place(), free.place())].sqrt();
            // The scale applies only to the scatter.
            let expected = (9e-10_f64 + stated * stated + (2.0 * CLOCK_U).powi(2)).sqrt();
            assert!(
                (u / expected - 1.0).abs() < 1e-12,
                "{free:?}: {u:e}, not {expected:e}"
            );
        }
    }
}
