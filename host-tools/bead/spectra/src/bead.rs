//! The spectra of a bead's strikes, gathered.

use bead_recording::strikes::LeftOut;
use schemars::JsonSchema;
use serde::Serialize;

use crate::plan::{Kind, Plan, StrikeSpectrum};
use crate::shock::ResponseKind;
use crate::statistics::{OverStrikes, tolerance};
use crate::strike::{FLAT_TO, StrikeSignal};
use crate::transfer::TransferSums;

pub use bead_tables::unit::GRAVITY;

/// A strike that had a part.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct UsedStrike {
    /// Path of the recording.
    pub recording: String,
    /// Number of the strike, as its bead counts.
    pub strike: u32,
    /// Greatest force, N.
    pub peak_force_n: f64,
    /// Greatest acceleration to either side, m/s².
    pub peak_acceleration_mps2: f64,
    /// Names of its flags.
    pub flags: Vec<&'static str>,
}

/// A spectrum at a frequency, over the strikes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct SpectrumPoint {
    /// Frequency, Hz; of a shock response spectrum the natural frequency.
    pub frequency_hz: f64,
    /// Mean of the strikes; of a shock response spectrum that of the maximax.
    pub mean: f64,
    /// Standard deviation of a strike; null of one.
    pub standard_deviation: Option<f64>,
    /// Greatest of the strikes.
    pub envelope: f64,
    /// P95/50: with an even chance above 95 of 100 strikes. Null of fewer than three.
    pub upper_95_50: Option<f64>,
    /// Standard uncertainty of the mean: that of the gain, and the scatter of the strikes. Null if unknown,
    /// and above 5 kHz, to which calibrations state how flat a sensor is.
    pub u: Option<f64>,
    /// Of a shock response spectrum: the greatest of the strikes.
    pub peaks: Option<PeakEnvelopes>,
    /// Of the transform of a single strike: its phase, rad, from the trigger.
    pub phase_rad: Option<f64>,
}

/// Envelopes of a shock response spectrum.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct PeakEnvelopes {
    /// While the window lasts.
    pub primary: f64,
    /// In the free vibration after it.
    pub residual: f64,
    /// Upward.
    pub positive: f64,
    /// Downward, without its sign.
    pub negative: f64,
}

/// A transfer at a frequency.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct TransferPoint {
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Acceleration for each newton of force; null where there is no force.
    pub magnitude: Option<f64>,
    /// Phase, rad; above zero the acceleration leads.
    pub phase_rad: Option<f64>,
    /// γ²; null of one strike.
    pub coherence: Option<f64>,
    /// Standard uncertainty of the magnitude: that of both gains, and the scatter of the strikes. Null if
    /// unknown, and above 5 kHz.
    pub u: Option<f64>,
}

/// A spectrum by frequency.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Points {
    /// Of one signal.
    Spectrum(Vec<SpectrumPoint>),
    /// Of two.
    Transfer(Vec<TransferPoint>),
}

/// The spectrum of a bead's strikes.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct BeadSpectrum {
    /// Address of the bead.
    pub address: u8,
    /// Unique id of its chip, in hexadecimal; null if it is unknown.
    pub uid: Option<String>,
    /// Samples a second.
    pub sample_rate_hz: f64,
    /// The lowest frequency of which a period fits into the window.
    pub lowest_hz: f64,
    /// The highest frequency that the sampling rate supports.
    pub highest_hz: f64,
    /// Relative standard uncertainty of the scale; null if unknown.
    pub gain_uncertainty: Option<f64>,
    /// Greatest standard uncertainty of the strikes' zero of the acceleration, m/s². An error of this size
    /// raises an absolute acceleration by up to twice as much.
    pub zero_uncertainty_mps2: f64,
    /// Unit of the values.
    pub unit: &'static str,
    /// By frequency.
    pub points: Points,
    /// The strikes in it.
    pub strikes: Vec<UsedStrike>,
    /// The strikes left out.
    pub left_out: Vec<LeftOut>,
}

/// The strikes of a bead so far.
pub struct BeadSums {
    plan: Plan,
    /// The response that a shock response spectrum is of.
    response: ResponseKind,
    /// Maximax, density or magnitude by frequency; unused for a transfer.
    by_frequency: Vec<OverStrikes>,
    /// Greatest values over the strikes of a shock response spectrum, by frequency, in the order of
    /// [`VALUES`](crate::shock::VALUES).
    greatest: Vec<[f64; 5]>,
    /// Phases of the last strike for a Fourier transform, rad.
    phases: Vec<f64>,
    transfer: TransferSums,
    /// Size of a unit of acceleration, m/s².
    acceleration: f64,
    gain_uncertainty: Option<f64>,
    zero_uncertainty: f64,
    used: Vec<UsedStrike>,
}

impl BeadSums {
    /// No strike yet. A shock response spectrum is of `response`; accelerations are in g if `gravities`.
    pub fn new(plan: Plan, response: ResponseKind, gravities: bool) -> Self {
        let places = plan.frequencies.len();
        Self {
            plan,
            response,
            by_frequency: vec![OverStrikes::default(); places],
            greatest: vec![[0.0; 5]; places],
            phases: Vec::new(),
            transfer: TransferSums::new(places),
            acceleration: if gravities { GRAVITY } else { 1.0 },
            gain_uncertainty: Some(0.0),
            zero_uncertainty: 0.0,
            used: Vec::new(),
        }
    }

    /// The computation for each strike.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// True before the first strike.
    pub fn is_empty(&self) -> bool {
        self.used.is_empty()
    }

    /// Adds a strike with its spectrum, which is of this plan.
    pub fn add(&mut self, strike: &StrikeSignal, spectrum: &StrikeSpectrum) {
        let values: Vec<f64> = match spectrum {
            StrikeSpectrum::Shock(responses) => {
                let values = responses.iter().map(|response| response.values(self.response));
                for (greatest, values) in self.greatest.iter_mut().zip(values.clone()) {
                    let both = greatest.iter_mut().zip(values);
                    both.for_each(|(most, value)| *most = most.max(value));
                }
                values.map(|[maximax, ..]| maximax).collect()
            }
            StrikeSpectrum::Density(values) => values.clone(),
            StrikeSpectrum::Fourier(values) => {
                self.phases = values.iter().map(|value| value.arg()).collect();
                values.iter().map(|value| value.norm()).collect()
            }
            StrikeSpectrum::Transfer([force, acceleration]) => {
                self.transfer.add(force, acceleration);
                Vec::new()
            }
        };
        let both = self.by_frequency.iter_mut().zip(values);
        both.for_each(|(over, value)| over.add(value));
        let both = self.gain_uncertainty.zip(strike.gain_uncertainty);
        self.gain_uncertainty = both.map(|(one, other)| one.max(other));
        self.zero_uncertainty = self.zero_uncertainty.max(strike.zero_uncertainty);
        let greatest = |values: &[f64]| values.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
        self.used.push(UsedStrike {
            recording: strike.recording.to_string(),
            strike: strike.strike,
            peak_force_n: greatest(&strike.force),
            peak_acceleration_mps2: greatest(&strike.acceleration),
            flags: strike.flags.clone(),
        });
    }

    /// The unit of the values, its size in SI units, and the power of the gain that they are proportional to.
    fn unit(&self) -> (&'static str, f64, f64) {
        use crate::strike::Sensors;
        let (is_si, size) = (self.acceleration == 1.0, self.acceleration);
        let either = |si, g| if is_si { si } else { g };
        match self.plan.kind() {
            Kind::Shock { .. } => match self.response {
                ResponseKind::AbsoluteAcceleration => (either("m/s²", "g"), size, 1.0),
                ResponseKind::PseudoVelocity => ("m/s", 1.0, 1.0),
                ResponseKind::RelativeDisplacement => ("m", 1.0, 1.0),
            },
            Kind::Density { of, .. } => match of {
                Sensors::Force => ("N²/Hz", 1.0, 2.0),
                _ => (either("(m/s²)²/Hz", "g²/Hz"), size * size, 2.0),
            },
            Kind::Fourier { of: Sensors::Force } => ("N/Hz", 1.0, 1.0),
            Kind::Fourier { .. } => (either("(m/s²)/Hz", "g/Hz"), size, 1.0),
            Kind::Transfer => (either("(m/s²)/N", "g/N"), size, 1.0),
        }
    }

    /// The spectrum of a bead. Call it with one strike at least.
    pub fn finish(self, address: u8, uid: Option<String>, left_out: Vec<LeftOut>) -> BeadSpectrum {
        let (unit, size, power) = self.unit();
        let count = self.used.len();
        let factor = if count > 2 { tolerance(count) } else { 0.0 };
        let gain = |frequency: f64| self.gain_uncertainty.filter(|_| frequency <= FLAT_TO);
        let is_shock = matches!(self.plan.kind(), Kind::Shock { .. });
        let point = |(place, frequency): (usize, f64)| {
            let over = &self.by_frequency[place];
            let [_, primary, residual, positive, negative] = self.greatest[place].map(|value| value / size);
            let (mean, deviation) = (over.mean() / size, over.deviation().map(|of| of / size));
            let of_mean = deviation.map_or(0.0, |of| of / (count as f64).sqrt());
            SpectrumPoint {
                frequency_hz: frequency,
                mean,
                standard_deviation: deviation,
                envelope: over.greatest() / size,
                upper_95_50: over.upper(factor).map(|upper| upper / size),
                u: gain(frequency).map(|part| (power * part * mean).hypot(of_mean)),
                peaks: is_shock.then_some(PeakEnvelopes {
                    primary,
                    residual,
                    positive,
                    negative,
                }),
                phase_rad: self.phases.get(place).copied().filter(|_| count == 1),
            }
        };
        let frequencies = self.plan.frequencies.iter().copied();
        let points = match self.plan.kind() {
            Kind::Shock { .. } | Kind::Density { .. } | Kind::Fourier { .. } => {
                Points::Spectrum(frequencies.enumerate().map(point).collect())
            }
            Kind::Transfer => {
                let all = frequencies.zip(self.transfer.transfers());
                let point = all.map(|(frequency, found)| {
                    let value = Some(found.value / size).filter(|value| value.is_finite());
                    let magnitude = value.map(|value| value.norm());
                    let u = gain(frequency).zip(magnitude);
                    TransferPoint {
                        frequency_hz: frequency,
                        magnitude,
                        phase_rad: value.map(|value| value.arg()),
                        coherence: found.coherence.filter(|part| part.is_finite()),
                        u: u.map(|(part, value)| value * part.hypot(found.scatter.unwrap_or(0.0)))
                            .filter(|u| u.is_finite()),
                    }
                });
                Points::Transfer(point.collect())
            }
        };
        BeadSpectrum {
            address,
            uid,
            sample_rate_hz: self.plan.rate(),
            lowest_hz: self.plan.lowest,
            highest_hz: self.plan.highest,
            gain_uncertainty: self.gain_uncertainty,
            zero_uncertainty_mps2: self.zero_uncertainty,
            unit,
            points,
            strikes: self.used,
            left_out,
        }
    }
}
