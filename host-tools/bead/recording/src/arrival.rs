//! The arrival of a pulse, between samples: the time at which its force rose through half of its height.
//!
//! # Design
//! The top of a pulse is flat, so noise of some mN moves it by 0.1 to 0.6 µs, and more samples or another
//! polynomial do not help, since a pulse in a row of absorbers is not symmetric. Its front is steep. A
//! polynomial of degree `DEGREE` through the samples around the front gives its time (least squares, in
//! polynomials that are orthogonal on the samples: Forsythe, J. SIAM 5, 74, 1957), and another gives the
//! height of the top. Few samples leave noise, and over many a pulse is no such polynomial: `REACH` is
//! between. It puts all fronts a thousandth of a width too early.

use crate::signal::Signal;

const DEGREE: usize = 3;
/// Reach of a polynomial to either side, in widths of the pulse at half its height, and the least, in
/// samples.
const REACH: f64 = 0.25;
const REACH_LEAST: usize = 2;

/// The time at which the force rose through half of its greatest value, in samples of the window. `None` if
/// it never did, or too near an end of the window.
pub fn rise(signal: &Signal) -> Option<f64> {
    let force = &signal.force;
    let (peak, highest) = force
        .iter()
        .copied()
        .enumerate()
        .max_by(|a, b| a.1.total_cmp(&b.1))?;
    let half = 0.5 * highest;
    let rise = force[..peak].iter().rposition(|force| *force < half)?;
    let fall = peak + force[peak..].iter().position(|force| *force < half)?;
    let width = fall - rise;
    let top = around(force, peak, width)?;
    let half = 0.5 * top.value(top.where_is(|[_, slope, bend]| (slope, bend))?);
    let front = around(force, rise, width)?;
    let at = front.where_is(|[value, slope, _]| (value - half, slope))?;
    Some(rise as f64 + at * front.reach)
}

fn around(force: &[f64], middle: usize, width: usize) -> Option<Polynomial> {
    let reach = ((REACH * width as f64) as usize).max(REACH_LEAST);
    let values = force.get(middle.checked_sub(reach)?..=middle + reach)?;
    Some(Polynomial::through(values, reach as f64))
}

/// A polynomial over -1 ..= 1: its parts in orthogonal polynomials, and the recurrence of these,
/// `p[k+1] = x p[k] - beta[k] p[k-1]`.
struct Polynomial {
    parts: [f64; DEGREE + 1],
    beta: [f64; DEGREE + 1],
    /// Samples from 0 to 1.
    reach: f64,
}

impl Polynomial {
    /// The polynomial that fits evenly spaced values best.
    fn through(values: &[f64], reach: f64) -> Self {
        let places: Vec<f64> = (0..values.len())
            .map(|place| place as f64 / reach - 1.0)
            .collect();
        let mut fit = Self {
            parts: [0.0; DEGREE + 1],
            beta: [0.0; DEGREE + 1],
            reach,
        };
        let (mut before, mut now) = (vec![0.0; values.len()], vec![1.0; values.len()]);
        let mut norm_before = f64::INFINITY;
        for k in 0..=DEGREE {
            let norm: f64 = now.iter().map(|p| p * p).sum();
            let product: f64 = now.iter().zip(values).map(|(p, value)| p * value).sum();
            fit.parts[k] = product / norm;
            fit.beta[k] = norm / norm_before;
            norm_before = norm;
            let next = places.iter().zip(&now).zip(&before);
            let next = next
                .map(|((x, now), before)| x * now - fit.beta[k] * before)
                .collect();
            before = std::mem::replace(&mut now, next);
        }
        fit
    }

    /// Its value and first two derivatives.
    fn at(&self, x: f64) -> [f64; 3] {
        let (mut before, mut now) = ([0.0; 3], [1.0, 0.0, 0.0]);
        let mut sum = [0.0; 3];
        for (part, beta) in self.parts.iter().zip(self.beta) {
            for (sum, now) in sum.iter_mut().zip(now) {
                *sum += part * now;
            }
            let next = [
                x * now[0] - beta * before[0],
                now[0] + x * now[1] - beta * before[1],
                2.0 * now[1] + x * now[2] - beta * before[2],
            ];
            before = std::mem::replace(&mut now, next);
        }
        sum
    }

    fn value(&self, x: f64) -> f64 {
        self.at(x)[0]
    }

    /// The zero of an expression in value and derivatives, which `zero` returns with its slope: by Newton's
    /// method from the middle.
    fn where_is(&self, zero: impl Fn([f64; 3]) -> (f64, f64)) -> Option<f64> {
        let mut x = 0.0;
        for _ in 0..20 {
            let (value, slope) = zero(self.at(x));
            x -= value / slope;
        }
        // The crossing lies between the middle and the sample after it, the top beside the highest sample.
        (x.abs() <= 1.0).then_some(x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pulse like that of a chain, steeper in front, whose front passes its middle at `at`, in samples.
    fn pulse(at: f64, wide: f64) -> Signal {
        let force = |sample: usize| {
            let x = (sample as f64 - at) / wide - (2.0_f64.powf(1.0 / 3.0) - 1.0).sqrt();
            7.0 / (1.0 + x * x).powi(3)
        };
        Signal {
            force: (0..672).map(force).collect(),
            acceleration: vec![0.0; 672],
        }
    }

    #[test]
    fn the_front_is_found_between_samples_wherever_they_lie() {
        for wide in [8.0, 40.0] {
            let off = (0..40).map(|n| {
                let at = 200.0 + f64::from(n) / 40.0;
                rise(&pulse(at, wide)).unwrap() - at
            });
            let off: Vec<f64> = off.collect();
            let mean = off.iter().sum::<f64>() / 40.0;
            let worst = off
                .iter()
                .fold(0.0_f64, |worst, off| worst.max((off - mean).abs()));
            assert!(
                mean.abs() < 0.003 * wide && worst < 0.01,
                "{mean} {worst} samples: {off:?}"
            );
        }
    }

    #[test]
    fn a_front_that_the_window_cuts_has_no_place() {
        assert_eq!(rise(&pulse(671.0, 20.0)), None);
        assert_eq!(rise(&pulse(-30.0, 20.0)), None);
        let flat = Signal {
            force: vec![0.0; 100],
            acceleration: vec![0.0; 100],
        };
        assert_eq!(rise(&flat), None);
    }
}
