//! The signals of a strike from its codes, in SI units and f64.

use std::f64::consts::TAU;

use bead_model::converter::CONVERSION;
use bead_model::design::{Bead, SensorScale, Surroundings};
use bead_model::layout::BASELINE;
use bead_model::reduced_chain::FOOT;
use bead_model::settings::Settings;

use crate::f64_estimators;
use bead_recording::strikes::{RecordedStrike, ScanCodes};

/// The signals of a strike that has settings and all samples, enough of them for a baseline.
pub(crate) struct StrikeSignals<'a> {
    pub(crate) strike: &'a RecordedStrike,
    pub(crate) settings: &'a Settings,
    /// Scans a second, Hz.
    pub(crate) rate: f64,
    /// N.
    pub(crate) force: Vec<f64>,
    /// m/s².
    pub(crate) acceleration: Vec<f64>,
}

impl<'a> StrikeSignals<'a> {
    /// `None` where samples or settings are missing.
    pub(crate) fn of(strike: &'a RecordedStrike) -> Option<Self> {
        let is_whole = strike.missing() == 0 && strike.scans.len() > usize::from(BASELINE);
        let settings = strike.settings.as_ref().filter(|_| is_whole)?;
        let rate = f64::from(settings.sample_rate_hz);
        Some(Self {
            strike,
            settings,
            rate,
            force: sensed(&strike.scans, 0, &settings.description().force, rate),
            acceleration: sensed(&strike.scans, 1, &settings.description().acceleration, rate),
        })
    }

    /// Energies that the bead found left in the intruder at the end of the window, J, by estimates A and B. A
    /// sum over the samples lacks them.
    pub(crate) fn left(&self) -> [f64; 2] {
        let left = self.strike.shape.and_then(|shape| shape.left);
        left.map_or([0.0; 2], |left| {
            [left.measured, left.predicted].map(|energy| energy.joules())
        })
    }

    /// Energy absorbed by estimate A in f64 since the first sample, J, at each sample.
    pub(crate) fn measured(&self, bead: &Bead) -> Vec<f64> {
        f64_estimators::measured(bead, &self.acceleration, self.rate)
    }

    /// Energy absorbed by estimate B in f64 since the first sample, and work done on the host, J, at each
    /// sample.
    pub(crate) fn predicted(&self, bead: &Bead, around: &Surroundings) -> Vec<[f64; 2]> {
        let noise = self.strike.said.force_noise.newtons();
        let force = gated(&self.force, self.settings, noise, 1);
        f64_estimators::predicted(bead, around, &force, self.rate)
    }
}

/// A sensor's signal in its unit, relative to the quiet start of the window, with filter and delay removed.
/// It comes from the channel at the high gain wherever that is away from its rails.
fn sensed(scans: &[ScanCodes], sensor: usize, scale: &SensorScale, rate: f64) -> Vec<f64> {
    let sensitive: Vec<f64> = scans.iter().map(|scan| scan.sensitive[sensor].into()).collect();
    // Codes that were not sent had no part in the window.
    let wide = |scan: &ScanCodes| scan.wide.map_or(f64::NAN, |wide| wide[sensor].into());
    let wide: Vec<f64> = scans.iter().map(wide).collect();
    let values = channel(&sensitive, scale.per_code, rate / (TAU * scale.pole), 0.0);
    let wides = channel(
        &wide,
        scale.wide_per_code,
        rate / (TAU * scale.wide_pole),
        CONVERSION * rate,
    );
    let believable = |at: usize| {
        let reach = at.saturating_sub(1)..(at + 2).min(scans.len());
        sensitive[reach].iter().all(|code| (64.0..=4031.0).contains(code))
    };
    // The two channels are made to agree where both see a strong signal.
    let strong = 1024.0 * scale.per_code;
    let shared = (0..scans.len()).filter(|&at| believable(at) && values[at].abs() >= strong);
    let differences = shared.map(|at| wides[at] - values[at]);
    let differences: Vec<f64> = differences.filter(|difference| difference.is_finite()).collect();
    let offset = differences.iter().sum::<f64>() / (differences.len() + 1) as f64;
    let value = |at: usize| match wides[at] - offset {
        wide if !believable(at) && !wide.is_nan() => wide,
        _ => values[at],
    };
    (0..scans.len()).map(value).collect()
}

/// A channel's codes in its unit. Its filter has the time constant `lag` in samples, infinite for none, and
/// it is converted `delay` samples after the first channel of its sensor.
fn channel(codes: &[f64], per_code: f64, lag: f64, delay: f64) -> Vec<f64> {
    let quiet = &codes[..usize::from(BASELINE)];
    let zero = quiet.iter().sum::<f64>() / quiet.len() as f64;
    let values: Vec<f64> = codes.iter().map(|code| (code - zero) * per_code).collect();
    f64_estimators::lead(&values, if lag.is_finite() { lag } else { 0.0 }, delay)
}

/// Noise of the force before the strike, N rms.
pub(crate) fn force_noise(strike: &RecordedStrike) -> f64 {
    let quiet = strike.scans.iter().take(usize::from(BASELINE));
    let quiet = quiet.map(|scan| f64::from(scan.sensitive[0]));
    let count = quiet.clone().count().max(1) as f64;
    let mean = quiet.clone().sum::<f64>() / count;
    let codes = (quiet.map(|code| (code - mean).powi(2)).sum::<f64>() / count).sqrt();
    let per_code = strike.settings.map(|settings| settings.force.sensitive.per_code);
    codes * per_code.map_or(0.0, |per_code| per_code.to_num())
}

/// The force as the bead's estimate B uses it, N, in `finer` steps a sample; `noise` is the force's noise, N
/// rms. The bead ignores forces before the foot of the wave. After some weak forces in a row, it takes
/// further weak ones for noise.
pub(crate) fn gated(force: &[f64], settings: &Settings, noise: f64, finer: usize) -> Vec<f64> {
    let gate = f64::max(settings.chain.gate.to_num(), 3.0 * noise);
    let foot = usize::from(settings.window.noise_end()) * finer;
    let mut silent = 0;
    (0..)
        .zip(force)
        .map(|(sample, &force)| {
            let quiet = sample >= foot && force.abs() < gate;
            silent = if quiet { silent + 1 } else { 0 };
            let is_wave = sample >= foot && silent <= usize::from(FOOT) * finer;
            if is_wave { force } else { 0.0 }
        })
        .collect()
}

/// The place of the minimum of a function that has one between `low` and `high`: golden section, to a
/// millionth of the interval.
pub(crate) fn least(mut low: f64, mut high: f64, f: impl Fn(f64) -> f64) -> f64 {
    let ratio = 0.5 * (5f64.sqrt() - 1.0);
    let (mut a, mut b) = (high - ratio * (high - low), low + ratio * (high - low));
    let (mut fa, mut fb) = (f(a), f(b));
    for _ in 0..29 {
        if fa < fb {
            (high, b, fb) = (b, a, fa);
            a = high - ratio * (high - low);
            fa = f(a);
        } else {
            (low, a, fa) = (a, b, fb);
            b = low + ratio * (high - low);
            fb = f(b);
        }
    }
    0.5 * (low + high)
}
