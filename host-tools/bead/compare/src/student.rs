//! Coverage factors: quantiles of Student's t.

use statrs::distribution::{ContinuousCDF, StudentsT};

/// The probability of a coverage interval.
const COVERAGE: f64 = 0.95;
/// The factor of the normal distribution.
const NORMAL: f64 = 1.959_963_984_540_054;
/// Degrees of freedom from which the normal distribution is used.
const MANY: f64 = 1e6;

/// The two-sided 95 % quantile of Student's t with `free` degrees of freedom, 1 or more.
pub fn student(free: f64) -> f64 {
    let t = StudentsT::new(0.0, 1.0, free);
    let t = t.ok().filter(|_| free < MANY);
    t.map_or(NORMAL, |t| t.inverse_cdf(0.5 + 0.5 * COVERAGE))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_scipy() {
        // scipy.stats.t.ppf(0.975, free)
        for (free, t) in [
            (1.0, 12.706_204_736_174_707),
            (2.0, 4.302_652_729_749_462),
            (7.3, 2.345_066_736_547_703),
            (95.0, 1.985_251_003_5),
            (150.0, 1.975_905_330_9),
            (f64::INFINITY, 1.959_963_984_540_054),
        ] {
            let found = student(free);
            assert!((found / t - 1.0).abs() < 1e-9, "{free}: {found}");
        }
    }
}
