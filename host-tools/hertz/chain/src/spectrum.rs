//! Spectra of transients in physical units.
//!
//! # Design
//!
//! The spectrum of a pulse is its Fourier transform S(f) = ∫ s(t) exp(-2πi f t) dt, not a power density.
//! |S| of a force is in N·s, which is N/Hz, and |S(0)| is the impulse. The sum of the samples times their
//! interval is that integral, except for components above half the sampling rate. A fast transform of the
//! samples, padded with zeros eightfold, gives the curve. Single frequencies are summed directly, so they
//! do not depend on the padding.

use realfft::RealFftPlanner;
use realfft::num_complex::Complex64;

use crate::signal::Signal;

/// The Fourier transform of a transient; with the signal in N, its magnitude is in N·s = N/Hz.
#[derive(Debug, Clone)]
pub struct Spectrum {
    signal: Signal,
    step: f64,
    values: Vec<Complex64>,
}

/// Length of the transform over that of the signal.
const PADDING: usize = 8;

impl Spectrum {
    /// Transforms a signal.
    ///
    /// # Panics
    /// If the signal has fewer than two values, a value is not finite, or the interval is not above zero.
    pub fn of(signal: &Signal) -> Self {
        let count = signal.values.len();
        assert!(count >= 2, "a spectrum takes two values at least, not {count}");
        assert!(
            signal.interval > 0.0 && signal.values.iter().all(|value| value.is_finite()),
            "a spectrum takes numbers at an interval above zero"
        );
        let length = PADDING * count.next_power_of_two();
        let mut samples = signal.values.clone();
        samples.resize(length, 0.0);
        let transform = RealFftPlanner::<f64>::new().plan_fft_forward(length);
        let mut values = transform.make_output_vec();
        transform
            .process(&mut samples, &mut values)
            .expect("both buffers have the lengths that the plan asks for");
        let step = 1.0 / (length as f64 * signal.interval);
        for (i, value) in values.iter_mut().enumerate() {
            // Phases count from t = 0, not from the first sample.
            let turn = -std::f64::consts::TAU * step * i as f64 * signal.start;
            *value *= Complex64::from_polar(signal.interval, turn);
        }
        Self {
            signal: signal.clone(),
            step,
            values,
        }
    }

    /// Interval of the frequencies of [`Spectrum::values`], Hz; the first is 0.
    pub fn step(&self) -> f64 {
        self.step
    }

    /// The transform at multiples of [`Spectrum::step`] to half the sampling rate, in units of the signal
    /// times s.
    pub fn values(&self) -> &[Complex64] {
        &self.values
    }

    /// Frequencies (Hz) and magnitudes (units of the signal times s).
    pub fn magnitudes(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        self.values
            .iter()
            .enumerate()
            .map(|(i, value)| (self.step * i as f64, value.norm()))
    }

    /// The transform at any frequency in Hz, in units of the signal times s.
    pub fn at(&self, frequency: f64) -> Complex64 {
        let turn = -std::f64::consts::TAU * frequency;
        let signal = &self.signal;
        let wave = |(i, value): (usize, &f64)| Complex64::from_polar(*value, turn * signal.time(i));
        let sum: Complex64 = signal.values.iter().enumerate().map(wave).sum();
        sum * signal.interval
    }

    /// The -3 dB frequency, Hz: the first above the greatest magnitude at which the magnitude has fallen to
    /// 1/√2 of it; `None` if it never does.
    pub fn half_power_frequency(&self) -> Option<f64> {
        let norms = self.values.iter().map(|value| value.norm());
        let (top, greatest) = norms.enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?;
        let level = greatest * std::f64::consts::FRAC_1_SQRT_2;
        let below = (top..self.values.len()).find(|&i| self.values[i].norm() < level)?;
        let (from, to) = (self.step * (below - 1) as f64, self.step * below as f64);
        Some(crate::bisection::bisect(from, to, |f| self.at(f).norm() > level))
    }
}
