//! Fourier transforms of strikes, and power spectral densities by Welch with the windows of ISO 18431-2.

use std::f64::consts::TAU;
use std::sync::Arc;

use realfft::num_complex::Complex64;
use realfft::{RealFftPlanner, RealToComplex};

/// A window over a segment (ISO 18431-2), periodic: the first value of the next segment would be its first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Window {
    /// 1 everywhere: for what begins and ends at rest.
    Rectangular,
    /// sin²: for noise.
    Hann,
    /// Flat over its main lobe: for the amplitude of a tone.
    FlatTop,
}

/// Coefficients of the flat top over cosines (G. D'Antona and A. Ferrero, Digital Signal Processing for
/// Measurement Systems, 2006). Divided by the first, they round to those of ISO 18431-2: 1, 1.933, 1.286,
/// 0.388, 0.032.
const FLAT_TOP: [f64; 5] = [
    0.215_578_95,
    0.416_631_58,
    0.277_263_158,
    0.083_578_947,
    0.006_947_368,
];

impl Window {
    fn values(self, length: usize) -> Vec<f64> {
        let cosines: &[f64] = match self {
            Self::Rectangular => &[1.0],
            Self::Hann => &[0.5, 0.5],
            Self::FlatTop => &FLAT_TOP,
        };
        let value = |sample: usize| {
            let phase = TAU * sample as f64 / length as f64;
            let term =
                |(order, size): (i32, &f64)| size * (-1_f64).powi(order) * (f64::from(order) * phase).cos();
            (0..).zip(cosines).map(term).sum()
        };
        (0..length).map(value).collect()
    }
}

/// A plan of transforms of one length.
#[derive(Clone)]
pub struct Transform {
    plan: Arc<dyn RealToComplex<f64>>,
    window: Vec<f64>,
}

impl Transform {
    /// Transforms of this many samples, at least one, under a window.
    pub fn new(length: usize, window: Window) -> Self {
        Self {
            plan: RealFftPlanner::new().plan_fft_forward(length),
            window: window.values(length),
        }
    }

    /// Number of samples.
    pub fn length(&self) -> usize {
        self.window.len()
    }

    /// The sums of the samples under the window, times exp(-2πi k n/length), for k from 0 to half the length.
    fn sums(&self, signal: &[f64]) -> Vec<Complex64> {
        let mut samples: Vec<f64> = signal
            .iter()
            .zip(&self.window)
            .map(|(value, part)| value * part)
            .collect();
        let mut sums = self.plan.make_output_vec();
        self.plan
            .process(&mut samples, &mut sums)
            .expect("a segment has the length of the plan");
        sums
    }

    /// The Fourier transform ∫ s(t) exp(-2πi f t) dt at multiples of rate/length, in the unit of the signal
    /// times s. Phases count from sample `origin`. The signal has the length of the plan.
    pub fn transform(&self, signal: &[f64], rate: f64, origin: usize) -> Vec<Complex64> {
        let turn = TAU * origin as f64 / self.length() as f64;
        let sums = (0..).zip(self.sums(signal));
        sums.map(|(k, sum)| sum * Complex64::from_polar(1.0 / rate, turn * f64::from(k)))
            .collect()
    }

    /// The one-sided power spectral density by Welch, in the square of the signal's unit over Hz: the mean of
    /// segments that overlap by half, at multiples of rate/length. Samples after the last whole segment are
    /// ignored. `None` if the signal is shorter than a segment.
    pub fn density(&self, signal: &[f64], rate: f64) -> Option<Vec<f64>> {
        let (length, step) = (self.length(), self.length().div_ceil(2));
        let power: f64 = self.window.iter().map(|part| part * part).sum();
        let mut mean = vec![0.0; length / 2 + 1];
        let mut count = 0;
        for first in (0..=signal.len().checked_sub(length)?).step_by(step) {
            count += 1;
            for (mean, sum) in mean.iter_mut().zip(self.sums(&signal[first..first + length])) {
                *mean += sum.norm_sqr();
            }
        }
        for (k, mean) in mean.iter_mut().enumerate() {
            // The power of both halves of the spectrum, except at the ends, which belong to one.
            let halves = if k == 0 || 2 * k == length { 1.0 } else { 2.0 };
            *mean *= halves / (rate * power * f64::from(count));
        }
        Some(mean)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE: f64 = 1e5;

    #[test]
    fn the_density_of_a_tone_has_its_mean_square_and_the_flat_top_its_amplitude() {
        // 3 sin at a frequency between two of the spectrum's.
        let tone: Vec<f64> = (0..8192)
            .map(|n| 3.0 * (TAU * 10.3 / 256.0 * f64::from(n)).sin())
            .collect();
        for window in [Window::Rectangular, Window::Hann, Window::FlatTop] {
            let transform = Transform::new(256, window);
            let density = transform.density(&tone, RATE).unwrap();
            let mean_square = density.iter().sum::<f64>() * RATE / 256.0;
            assert!(
                (mean_square / 4.5 - 1.0).abs() < 0.01,
                "{window:?}: {mean_square}"
            );
            let sums = transform.sums(&tone[..256]);
            let amplitude = 2.0 * sums[10].norm() / transform.window.iter().sum::<f64>();
            let is_flat = (amplitude / 3.0 - 1.0).abs() < 0.005;
            assert_eq!(is_flat, window == Window::FlatTop, "{window:?}: {amplitude}");
        }
        assert_eq!(
            Transform::new(256, Window::Hann).density(&tone[..255], RATE),
            None
        );
    }

    #[test]
    fn the_density_of_an_impulse_has_its_mean_square_with_an_even_and_an_odd_number_of_samples() {
        for length in [16, 17] {
            let mut impulse = vec![0.0; length];
            impulse[3] = 2.0;
            let transform = Transform::new(length, Window::Rectangular);
            let density = transform.density(&impulse, RATE).unwrap();
            let power = density.iter().sum::<f64>() * RATE / length as f64;
            assert!(
                (power * length as f64 / 4.0 - 1.0).abs() < 1e-12,
                "{length}: {power}"
            );
        }
    }

    #[test]
    fn the_transform_of_a_bell_is_a_bell_with_its_area_and_no_phase_at_its_middle() {
        let width = 30e-5;
        let bell: Vec<f64> = (0..672)
            .map(|n| (-0.5 * (f64::from(n - 200) / RATE / width).powi(2)).exp())
            .collect();
        let found = Transform::new(672, Window::Rectangular).transform(&bell, RATE, 200);
        for (k, value) in (0..8).zip(&found) {
            let frequency = f64::from(k) * RATE / 672.0;
            let exact = width * TAU.sqrt() * (-0.5 * (TAU * frequency * width).powi(2)).exp();
            assert!((value - exact).norm() < 1e-9 * width, "{k}: {value} {exact}");
        }
    }
}
