//! The response of an oscillator to the acceleration of its base, sample by sample.
//!
//! # Design
//! The oscillator has a natural frequency ω and a quality Q; z is its displacement relative to the base, and
//! a the acceleration of the base:
//!
//! ```text
//! z̈ + (ω/Q) ż + ω² z = -a        absolute acceleration: a + z̈ = -(ω² z + (ω/Q) ż)
//! ```
//!
//! The acceleration a is linear between two samples, and the equation is solved exactly. This is the ramp
//! invariant filter of ISO 18431-4 (D. O. Smallwood, Shock and Vibration Bulletin 51, 1981) with the same
//! response to the last digit. Here it has the states ω² z and ω ż (N. C. Nigam and P. C. Jennings, Bull.
//! Seism. Soc. Am. 59, 1969), as the difference equation of the standard cancels at low frequencies. The
//! numerator for the displacement is a difference of terms near 1 that is as small as (ω dt)³: at 1 Hz and
//! 100 kHz three digits are left of sixteen. The coefficients here are power series in ω dt without a
//! difference of near terms, and the step adds the change to a state, so all digits stay.

use std::f64::consts::TAU;

/// Terms of the series: (ω dt)ⁿ/n! is below 1e-17 of the whole at half the sampling rate.
const TERMS: u32 = 48;

/// An oscillator at an interval of samples.
#[derive(Debug, Clone, PartialEq)]
pub struct Oscillator {
    /// Change of the states for each unit of a state.
    change: [[f64; 2]; 2],
    /// Change of the states for an acceleration that stays.
    level: [f64; 2],
    /// Change of the states for an acceleration that grows by 1 from 0.
    ramp: [f64; 2],
    /// 1/Q.
    loss: f64,
}

/// The state of an oscillator; at first it rests.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct OscillatorState {
    /// ω² z, m/s².
    displaced: f64,
    /// ω ż, m/s².
    moving: f64,
    /// Acceleration of the base at the last sample, m/s².
    base: f64,
}

/// The response at a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Response {
    /// Acceleration of the mass against the ground, in the unit of the base's.
    pub absolute: f64,
    /// ω² times the displacement relative to the base, in the same unit.
    pub relative: f64,
}

impl Oscillator {
    /// An oscillator with this natural frequency (Hz, up to half the sampling rate) and quality (1/(2ζ), 0.5
    /// or more), at an interval in s.
    pub fn new(natural_hz: f64, quality: f64, interval: f64) -> Self {
        let turn = TAU * natural_hz * interval;
        let loss = 1.0 / quality;
        let apply = |[z, v]: [f64; 2]| [turn * v, -turn * (z + loss * v)];
        // Sums of Mⁿ x / n!, of n ≥ 1 for the states, of Mⁿ x / (n + 1)! and Mⁿ x / (n + 2)! for the base.
        let sum = |start: [f64; 2], first: u32, shift: u32| {
            let (mut sum, mut power, mut factorial) = ([0.0; 2], start, f64::from(shift.max(1)));
            for n in 0..TERMS {
                if n >= first {
                    (0..2).for_each(|place| sum[place] += power[place] / factorial);
                }
                power = apply(power);
                factorial *= f64::from(n + 1 + shift);
            }
            sum
        };
        let (one, other) = (sum([1.0, 0.0], 1, 0), sum([0.0, 1.0], 1, 0));
        let base = [0.0, -turn];
        Self {
            change: [[one[0], other[0]], [one[1], other[1]]],
            level: sum(base, 0, 1),
            ramp: sum(base, 0, 2),
            loss,
        }
    }

    /// Takes the next sample of the base's acceleration.
    pub fn advance(&self, state: &mut OscillatorState, base: f64) -> Response {
        let (z, v, grown) = (state.displaced, state.moving, base - state.base);
        let change = |place: usize| {
            let [of_z, of_v] = self.change[place];
            of_z * z + of_v * v + self.level[place] * state.base + self.ramp[place] * grown
        };
        let (of_z, of_v) = (change(0), change(1));
        *state = OscillatorState {
            displaced: z + of_z,
            moving: v + of_v,
            base,
        };
        Response {
            absolute: -(state.displaced + self.loss * state.moving),
            relative: state.displaced,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn respond(oscillator: &Oscillator, base: impl Iterator<Item = f64>) -> Vec<Response> {
        let mut state = OscillatorState::default();
        base.map(|base| oscillator.advance(&mut state, base)).collect()
    }

    /// The difference equations of ISO 18431-4: numerators of absolute acceleration and of ω² times the
    /// relative displacement, and the denominator that both share.
    fn standard(turn: f64, quality: f64) -> [[f64; 3]; 3] {
        let root = (1.0 - 0.25 / (quality * quality)).sqrt();
        let (a, b) = (0.5 * turn / quality, turn * root);
        let (decay, sine, cosine) = ((-a).exp(), (-a).exp() * b.sin(), (-a).exp() * b.cos());
        let q = (0.5 / (quality * quality) - 1.0) / root;
        let absolute = [
            1.0 - sine / b,
            2.0 * (sine / b - cosine),
            decay * decay - sine / b,
        ];
        let relative = [
            ((1.0 - cosine) / quality - q * sine - turn) / turn,
            (2.0 * cosine * turn - (1.0 - decay * decay) / quality + 2.0 * q * sine) / turn,
            (-decay * decay * (turn + 1.0 / quality) + cosine / quality - q * sine) / turn,
        ];
        [absolute, relative, [1.0, -2.0 * cosine, decay * decay]]
    }

    #[test]
    fn the_response_is_that_of_the_difference_equations_of_the_standard() {
        // A signal without a pattern.
        let base: Vec<f64> = (0..400)
            .map(|n: u64| ((n * n * 7919) % 1009) as f64 / 504.5 - 1.0)
            .collect();
        for (turn, quality) in [(0.05, 10.0), (0.3, 50.0), (0.628, 5.0), (3.0, 1.0)] {
            let oscillator = Oscillator::new(turn / TAU, quality, 1.0);
            let found = respond(&oscillator, base.iter().copied());
            let [absolute, relative, below] = standard(turn, quality);
            let (mut y, mut z) = (vec![0.0; 2], vec![0.0; 2]);
            let x: Vec<f64> = [0.0; 2].into_iter().chain(base.iter().copied()).collect();
            for n in 2..x.len() {
                let next = |b: [f64; 3], y: &[f64]| {
                    b[0] * x[n] + b[1] * x[n - 1] + b[2] * x[n - 2]
                        - below[1] * y[n - 1]
                        - below[2] * y[n - 2]
                };
                y.push(next(absolute, &y));
                z.push(next(relative, &z));
                let response = found[n - 2];
                assert!(
                    (response.absolute - y[n]).abs() < 1e-9,
                    "{turn} {n}: {response:?} {}",
                    y[n]
                );
                assert!(
                    (response.relative - z[n]).abs() < 1e-9,
                    "{turn} {n}: {response:?} {}",
                    z[n]
                );
            }
        }
    }

    #[test]
    fn a_ramp_to_a_step_gives_the_exact_response_at_low_and_at_high_frequencies() {
        // The base's acceleration is 1 from the first sample, after a ramp of one interval.
        for turn in [1e-6, 1e-4, 0.01, 0.5] {
            let quality = 10.0_f64;
            let (decay, root) = (0.5 / quality, (1.0 - 0.25 / (quality * quality)).sqrt());
            // ω² z for an acceleration that is τ, in units of 1/ω: the integral of the step's response.
            let ramped = |time: f64| {
                let (sine, cosine) = (root * time).sin_cos();
                let shape = 2.0 * decay * cosine + (2.0 * decay * decay - 1.0) / root * sine;
                -(time - 2.0 * decay + (-decay * time).exp() * shape)
            };
            let oscillator = Oscillator::new(turn / TAU, quality, 1.0);
            let last = (6.0 / turn) as usize;
            let found = respond(&oscillator, std::iter::repeat_n(1.0, last));
            let time = turn * last as f64;
            let exact = (ramped(time) - ramped(time - turn)) / turn;
            let response = found[last - 1].relative;
            // The difference of two integrals loses digits as `turn` gets smaller.
            let near = 1e-13 + 1e-15 * time / turn;
            assert!((response - exact).abs() < near, "{turn}: {response} {exact}");
        }
    }

    #[test]
    fn a_base_that_starts_slowly_is_followed_by_a_displacement_of_all_digits() {
        // With ω t far below 1 the mass stays and the base moves: z = -a t³ / (6 T) for a ramp over T.
        let (turn, samples) = (1e-7, 100);
        let oscillator = Oscillator::new(turn / TAU, 10.0, 1.0);
        let found = respond(&oscillator, (1..=samples).map(f64::from));
        let last = f64::from(samples);
        let exact = -(turn * turn) * last.powi(3) / 6.0;
        // Left out are terms of ω t/Q.
        let part = found.last().unwrap().relative / exact - 1.0;
        assert!(part.abs() < 1e-6, "{part}");
    }
}
