//! Coverage factors: quantiles of Student's t.

use std::f64::consts::FRAC_PI_2;

/// The probability of a coverage interval.
const COVERAGE: f64 = 0.95;
/// Panels of Simpson's rule.
const PANELS: usize = 400;

/// Student's t with `free` degrees of freedom, 1 or more: it lies within ± this with a probability of 95 %.
pub fn student(free: f64) -> f64 {
    if free > 100.0 {
        // Abramowitz and Stegun, 26.7.5, to third order: within 1e-8 there.
        let z = 1.959_963_984_540_054_f64;
        let first = (z.powi(3) + z) / 4.0;
        let second = (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / 96.0;
        let third = (3.0 * z.powi(7) + 19.0 * z.powi(5) + 17.0 * z.powi(3) - 15.0 * z) / 384.0;
        return z + first / free + second / free.powi(2) + third / free.powi(3);
    }
    // With t = √free tan φ, the density over φ is cos^(free - 1) φ (26.7.3 and 26.7.4).
    let below = |angle: f64| {
        let step = angle / PANELS as f64;
        let weight = |i: usize| match i {
            0 | PANELS => 1.0,
            i => [2.0, 4.0][i % 2],
        };
        let part = |i: usize| weight(i) * (i as f64 * step).cos().max(0.0).powf(free - 1.0);
        (0..=PANELS).map(part).sum::<f64>() * step
    };
    let wanted = COVERAGE * below(FRAC_PI_2);
    let (mut least, mut most) = (0.0, FRAC_PI_2);
    for _ in 0..60 {
        let middle = 0.5 * (least + most);
        if below(middle) < wanted {
            least = middle;
        } else {
            most = middle;
        }
    }
    free.sqrt() * least.tan()
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
            (1e9, 1.959_963_987),
        ] {
            assert!(
                (student(free) / t - 1.0).abs() < 1e-6,
                "{free}: {}",
                student(free)
            );
        }
    }
}
