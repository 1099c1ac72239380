//! The shock response spectrum of ISO 18431-4.
//!
//! # Design
//! Oscillators of one quality and of natural frequencies in even steps of an octave stand on a base that
//! moves as the signal says. The spectrum has the greatest response of each: while the record lasts
//! (primary), and in the free vibration after it (residual), upward and downward. The frequencies are those
//! of 1 kHz · 2^(i/n), whatever the record, so spectra of different strikes have the same frequencies.

use std::f64::consts::TAU;

use crate::oscillator::{Oscillator, OscillatorState};

/// Least number of samples in a period of the highest natural frequency (ISO 18431-4). The greatest sample
/// of an oscillation is then low by 5 % at most, and the straight line between samples by 3 %.
pub const SAMPLES_IN_A_PERIOD: f64 = 10.0;
/// The frequency from which steps of an octave count, Hz.
const ORIGIN: f64 = 1000.0;

/// The greatest responses to each side, both zero or above.
#[derive(Clone, Copy, Default)]
struct Sides {
    /// Upward.
    positive: f64,
    /// Downward, without its sign.
    negative: f64,
}

impl Sides {
    fn see(&mut self, value: f64) {
        self.positive = self.positive.max(value);
        self.negative = self.negative.max(-value);
    }
}

/// The five values of an oscillator's response while the record lasts, and after it.
fn values(during: Sides, after: Sides) -> [f64; 5] {
    let [primary, residual] = [during, after].map(|sides| sides.positive.max(sides.negative));
    [
        primary.max(residual),
        primary,
        residual,
        during.positive.max(after.positive),
        during.negative.max(after.negative),
    ]
}

/// Names of [`ShockResponse::values`].
pub const VALUES: [&str; 5] = ["maximax", "primary", "residual", "positive", "negative"];

/// The response that a spectrum is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ResponseKind {
    /// Acceleration of the mass against the ground, m/s².
    AbsoluteAcceleration,
    /// ω times the displacement relative to the base, m/s.
    PseudoVelocity,
    /// Displacement relative to the base, m.
    RelativeDisplacement,
}

impl ResponseKind {
    /// All kinds of responses.
    pub const ALL: [Self; 3] = [
        Self::AbsoluteAcceleration,
        Self::PseudoVelocity,
        Self::RelativeDisplacement,
    ];

    /// Its name, with underlines.
    pub fn name(self) -> &'static str {
        match self {
            Self::AbsoluteAcceleration => "absolute_acceleration",
            Self::PseudoVelocity => "pseudo_velocity",
            Self::RelativeDisplacement => "relative_displacement",
        }
    }
}

/// The greatest responses at a natural frequency.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShockResponse {
    /// Natural frequency, Hz.
    pub frequency: f64,
    /// Greatest absolute accelerations, m/s².
    absolute: [f64; 5],
    /// Greatest values of ω² times the relative displacement, m/s².
    relative: [f64; 5],
}

impl ShockResponse {
    /// The greatest values of a response in SI units, all zero or above, in the order of [`VALUES`].
    pub fn values(&self, of: ResponseKind) -> [f64; 5] {
        let omega = TAU * self.frequency;
        let relative = |by: f64| self.relative.map(|value| by * value);
        match of {
            ResponseKind::AbsoluteAcceleration => self.absolute,
            ResponseKind::PseudoVelocity => relative(1.0 / omega),
            ResponseKind::RelativeDisplacement => relative(1.0 / (omega * omega)),
        }
    }
}

/// The spectrum of an acceleration in m/s², from rest, at `rate` samples a second, for oscillators of this
/// quality (above 0.5) at these natural frequencies (Hz).
pub fn spectrum(acceleration: &[f64], rate: f64, quality: f64, frequencies: &[f64]) -> Vec<ShockResponse> {
    let of = |frequency: &f64| response(acceleration, rate, quality, *frequency);
    frequencies.iter().map(of).collect()
}

fn response(acceleration: &[f64], rate: f64, quality: f64, frequency: f64) -> ShockResponse {
    let oscillator = Oscillator::new(frequency, quality, 1.0 / rate);
    let mut state = OscillatorState::default();
    let mut run = |base: &mut dyn Iterator<Item = f64>| {
        let (mut absolute, mut relative) = (Sides::default(), Sides::default());
        for base in base {
            let response = oscillator.advance(&mut state, base);
            absolute.see(response.absolute);
            relative.see(response.relative);
        }
        (absolute, relative)
    };
    let during = run(&mut acceleration.iter().copied());
    // The free vibration decays, so its first period has its greatest values to both sides.
    let period = rate / (frequency * (1.0 - 0.25 / (quality * quality)).sqrt());
    let after = run(&mut std::iter::repeat_n(0.0, period.ceil() as usize + 1));
    ShockResponse {
        frequency,
        absolute: values(during.0, after.0),
        relative: values(during.1, after.1),
    }
}

/// Natural frequencies from one to another (Hz, both included), `per_octave` steps in an octave.
pub fn frequencies(from: f64, to: f64, per_octave: u32) -> Vec<f64> {
    let steps = f64::from(per_octave);
    let place = |frequency: f64| steps * (frequency / ORIGIN).log2();
    // A frequency that misses a step only by rounding is on it.
    let (first, last) = (
        (place(from) - 1e-9).ceil() as i64,
        (place(to) + 1e-9).floor() as i64,
    );
    (first..=last)
        .map(|i| ORIGIN * (i as f64 / steps).exp2())
        .collect()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    const RATE: f64 = 1e5;

    /// A half sine of 1000 m/s² over 2 ms, then rest.
    fn half_sine() -> Vec<f64> {
        let samples = 200;
        let value = |n: i32| 1000.0 * (PI * f64::from(n) / f64::from(samples)).sin();
        (0..=samples).map(value).collect()
    }

    /// The response of an oscillator without loss to a half sine of amplitude 1 over half a period of
    /// frequency 1/(2 D) with r = 2 f D, by the textbook (Harris, Shock and Vibration Handbook): the greatest
    /// during the pulse, and after it.
    fn exact(ratio: f64) -> (f64, f64) {
        let during =
            |phase: f64| ((PI * phase).sin() - (PI * phase * ratio).sin() / ratio) / (1.0 - ratio.powi(-2));
        let greatest = (0..=20_000)
            .map(|n| during(f64::from(n) / 20_000.0).abs())
            .fold(0.0, f64::max);
        let after = 2.0 * ratio * (0.5 * PI * ratio).cos() / (1.0 - ratio * ratio);
        (greatest, after.abs())
    }

    #[test]
    fn a_half_sine_has_the_primary_and_residual_spectrum_of_the_textbook() {
        let quality = 1e7;
        for ratio in [0.2, 0.5, 0.8, 1.2, 1.7, 2.5, 3.7, 6.0] {
            let frequency = ratio / (2.0 * 2e-3);
            let found = spectrum(&half_sine(), RATE, quality, &[frequency])[0];
            let [maximax, primary, residual, positive, _] = found.values(ResponseKind::AbsoluteAcceleration);
            let (of_primary, of_residual) = exact(ratio);
            let near = |found: f64, exact: f64| (found - 1000.0 * exact).abs() < 1.0 + 1e-3 * found;
            assert!(near(primary, of_primary), "{ratio}: {primary} {of_primary}");
            assert!(near(residual, of_residual), "{ratio}: {residual} {of_residual}");
            assert_eq!(maximax, primary.max(residual));
            assert!(positive > 0.9 * primary, "the first swing is upward");
        }
    }

    #[test]
    fn a_short_pulse_has_its_change_of_velocity_as_pseudo_velocity() {
        // ΔV = 2 A D / π, and at low frequencies ω z is that, less a part of the damping's.
        let change = 2.0 * 1000.0 * 2e-3 / PI;
        let found = spectrum(&half_sine(), RATE, 1e6, &[0.05, 0.5, 5.0]);
        for response in found {
            let [maximax, primary, residual, ..] = response.values(ResponseKind::PseudoVelocity);
            assert!((maximax / change - 1.0).abs() < 1e-3, "{response:?}");
            assert!(residual > primary);
            let displacement = response.values(ResponseKind::RelativeDisplacement)[0];
            let omega = TAU * response.frequency;
            assert!((displacement * omega / maximax - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_step_overshoots_by_what_the_damping_leaves() {
        let step = vec![1.0; 4000];
        for quality in [1.0, 10.0, 50.0] {
            let found = spectrum(&step, RATE, quality, &[100.0])[0];
            let damping = 0.5 / quality;
            let over = (-PI * damping / (1.0_f64 - damping * damping).sqrt()).exp();
            let [.., greatest] = found.values(ResponseKind::RelativeDisplacement);
            let exact = (1.0 + over) / (TAU * 100.0).powi(2);
            assert!(
                (greatest / exact - 1.0).abs() < 1e-5,
                "{quality}: {greatest} {exact}"
            );
        }
    }

    #[test]
    fn frequencies_do_not_depend_on_where_they_begin() {
        let found = frequencies(250.0, 8000.0, 3);
        assert_eq!(found.len(), 16);
        for (frequency, exact) in [(found[0], 250.0), (found[6], 1000.0), (found[15], 8000.0)] {
            assert!((frequency / exact - 1.0).abs() < 1e-12, "{frequency}");
        }
        assert_eq!(frequencies(251.0, 8001.0, 3)[..], found[1..]);
        assert_eq!(frequencies(300.0, 290.0, 3), [0.0; 0]);
    }
}
