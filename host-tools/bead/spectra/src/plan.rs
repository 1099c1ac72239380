//! Spectra to compute of each strike of a bead, and their frequencies.

use realfft::num_complex::Complex64;

use crate::fourier::{Transform, Window};
use crate::shock::{SAMPLES_IN_A_PERIOD, ShockResponse, frequencies, spectrum};
use crate::strike::{Sensors, StrikeSignal};

/// A kind of spectrum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// Shock response spectrum of the acceleration.
    Shock {
        /// Quality of the oscillators, above 0.5.
        quality: f64,
        /// Natural frequencies in an octave.
        per_octave: u32,
    },
    /// Power spectral density by Welch.
    Density {
        /// The signal: force or acceleration.
        of: Sensors,
        /// Samples of a segment.
        segment: usize,
        /// Window over each segment.
        window: Window,
    },
    /// Fourier transform of the whole window.
    Fourier {
        /// The signal: force or acceleration.
        of: Sensors,
    },
    /// Transfer from force to acceleration.
    Transfer,
}

/// The choices of a user.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wanted {
    /// The kind of spectrum.
    pub kind: Kind,
    /// Lowest frequency, Hz; without it the lowest that the window supports.
    pub from: Option<f64>,
    /// Highest frequency, Hz; without it a tenth of the sampling rate.
    pub to: Option<f64>,
    /// True to take strikes whose flags say that a signal is wrong, or whose window is too short for `from`.
    pub doubtful: bool,
}

impl Wanted {
    /// The sensors that the kind needs.
    pub fn sensors(&self) -> Sensors {
        match self.kind {
            Kind::Shock { .. } => Sensors::Acceleration,
            Kind::Density { of, .. } | Kind::Fourier { of } => of,
            Kind::Transfer => Sensors::Both,
        }
    }
}

/// The spectrum of a strike at the frequencies of a plan.
#[derive(Debug, Clone, PartialEq)]
pub enum StrikeSpectrum {
    /// See [`Kind::Shock`].
    Shock(Vec<ShockResponse>),
    /// In (m/s²)²/Hz or N²/Hz.
    Density(Vec<f64>),
    /// In (m/s²)·s or N·s.
    Fourier(Vec<Complex64>),
    /// The transforms of force and acceleration.
    Transfer([Vec<Complex64>; 2]),
}

/// The computation for all strikes of a bead.
#[derive(Clone)]
pub struct Plan {
    wanted: Wanted,
    /// The frequencies of the spectra, Hz.
    pub frequencies: Vec<f64>,
    /// The lowest that the first strike's window supports, Hz.
    pub lowest: f64,
    /// The highest that the sampling rate supports, Hz.
    pub highest: f64,
    rate: f64,
    transform: Option<(Transform, usize)>,
}

/// Frequencies of which the window holds no period are doubtful. They may be lower than the lowest by up to
/// this factor.
const FAR_BELOW: f64 = 100.0;

/// Why a frequency is too low for a strike.
fn too_low(from: f64, stretch: &str, seconds: f64) -> String {
    format!(
        "{stretch} lasts {:.3} ms and holds no period below {:.1} Hz, and --from is {from} Hz",
        1e3 * seconds,
        1.0 / seconds
    )
}

impl Plan {
    /// A plan for strikes like this one.
    ///
    /// # Errors
    /// Its window is too short, or a frequency is beyond what its sampling rate supports; as the end of a
    /// sentence.
    pub fn new(wanted: &Wanted, first: &StrikeSignal) -> Result<Self, String> {
        let rate = first.rate;
        let of_rate = rate / SAMPLES_IN_A_PERIOD;
        let (stretch, seconds, highest) = match wanted.kind {
            Kind::Shock { .. } => ("its window after the trigger", first.after_trigger(), of_rate),
            Kind::Density { segment, .. } => ("a segment", segment as f64 / rate, 0.5 * rate),
            Kind::Fourier { .. } | Kind::Transfer => ("its window", first.duration(), 0.5 * rate),
        };
        let lowest = 1.0 / seconds;
        let (from, to) = (wanted.from.unwrap_or(lowest), wanted.to.unwrap_or(of_rate));
        if to > highest * (1.0 + 1e-9) {
            let why = match wanted.kind {
                Kind::Shock { .. } => {
                    "a tenth of its sampling rate, above which a peak may lie between two samples"
                }
                _ => "half of its sampling rate",
            };
            return Err(format!("--to {to} Hz is above {highest} Hz, {why}"));
        }
        // Following an oscillator far below the lowest frequency would take hours.
        let least = if wanted.doubtful {
            lowest / FAR_BELOW
        } else {
            lowest
        };
        if from < least * (1.0 - 1e-9) {
            return Err(too_low(from, stretch, seconds));
        }
        let (frequencies, transform) = match wanted.kind {
            Kind::Shock { per_octave, .. } => (frequencies(from, to, per_octave), None),
            Kind::Density { segment, window, .. } => lines(segment, window, rate, from, to),
            _ => lines(first.acceleration.len(), Window::Rectangular, rate, from, to),
        };
        if frequencies.is_empty() {
            return Err(format!(
                "its spectrum has no frequency from {from:.1} to {to:.1} Hz"
            ));
        }
        Ok(Self {
            wanted: *wanted,
            frequencies,
            lowest,
            highest,
            rate,
            transform,
        })
    }

    /// The kind of spectrum.
    pub fn kind(&self) -> Kind {
        self.wanted.kind
    }

    /// Samples a second of the strikes.
    pub fn rate(&self) -> f64 {
        self.rate
    }

    /// The spectrum of a strike.
    ///
    /// # Errors
    /// Why the strike has no part, as the end of a sentence.
    pub fn spectrum(&self, strike: &StrikeSignal) -> Result<StrikeSpectrum, String> {
        let (rate, window) = (self.rate, strike.acceleration.len());
        if strike.rate != rate {
            return Err(format!(
                "it has {} samples a second, and the bead's first strike has {rate}",
                strike.rate
            ));
        }
        let signal = |of: Sensors| match of {
            Sensors::Force => &strike.force,
            Sensors::Acceleration | Sensors::Both => &strike.acceleration,
        };
        if let Kind::Shock { quality, .. } = self.wanted.kind {
            let lowest = self.frequencies[0];
            if lowest * strike.after_trigger() < 1.0 - 1e-9 && !self.wanted.doubtful {
                return Err(too_low(
                    lowest,
                    "its window after the trigger",
                    strike.after_trigger(),
                ));
            }
            let responses = spectrum(&strike.acceleration, rate, quality, &self.frequencies);
            return Ok(StrikeSpectrum::Shock(responses));
        }
        let Some((transform, first)) = &self.transform else {
            return Err("its spectrum has no plan".to_owned());
        };
        let last = first + self.frequencies.len();
        if let Kind::Density { of, segment, .. } = self.wanted.kind {
            let density = transform.density(signal(of), rate).ok_or_else(|| {
                format!(
                    "its window has {window} samples, and a segment needs {segment}; give a shorter --segment"
                )
            })?;
            return Ok(StrikeSpectrum::Density(density[*first..last].to_vec()));
        }
        if window != transform.length() {
            return Err(format!(
                "its window has {window} samples, and that of the bead's first strike has {}",
                transform.length()
            ));
        }
        let of = |sensor| {
            let all = transform.transform(signal(sensor), rate, strike.trigger);
            all[*first..last].to_vec()
        };
        Ok(match self.wanted.kind {
            Kind::Fourier { of: sensor } => StrikeSpectrum::Fourier(of(sensor)),
            _ => StrikeSpectrum::Transfer([of(Sensors::Force), of(Sensors::Acceleration)]),
        })
    }
}

/// The frequencies of a transform from `from` to `to`, without 0, and its plan with the place of the first.
fn lines(
    length: usize,
    window: Window,
    rate: f64,
    from: f64,
    to: f64,
) -> (Vec<f64>, Option<(Transform, usize)>) {
    let at = |k: usize| k as f64 * rate / length as f64;
    let is_wanted = |k: &usize| (from * (1.0 - 1e-9)..=to * (1.0 + 1e-9)).contains(&at(*k));
    let kept: Vec<usize> = (1..=length / 2).filter(is_wanted).collect();
    let first = kept.first().copied().unwrap_or(0);
    let transform = Transform::new(length, window);
    (kept.into_iter().map(at).collect(), Some((transform, first)))
}
