//! A motion that repeats, in JSON.

use hertz_chain::{Complex64, DriveParameter, DriveQuantity, PeriodExtremes, PeriodicState};

use bead_console::prelude::*;

/// A motion that repeats.
#[derive(Serialize, JsonSchema)]
pub(super) struct Motion {
    /// Amplitude of the drive, m or N.
    pub(super) amplitude: f64,
    pub(super) frequency_hz: f64,
    /// True if no small disturbance grows.
    pub(super) stable: bool,
    /// The Floquet multiplier of greatest magnitude.
    pub(super) multiplier: Multiplier,
    /// Least force of each contact, N; 0 if it opens.
    pub(super) force_min_n: Vec<f64>,
    /// Greatest force of each contact, N.
    pub(super) force_max_n: Vec<f64>,
    /// Greatest speed of each bead, m/s.
    pub(super) speed_max_mps: Vec<f64>,
    /// Greatest displacement of each intruder from its host, m, in the order of the beads.
    pub(super) stroke_max_m: Vec<f64>,
}

/// A Floquet multiplier.
#[derive(Debug, Clone, Copy, Serialize, JsonSchema)]
pub(super) struct Multiplier {
    pub(super) re: f64,
    pub(super) im: f64,
}

impl From<Complex64> for Multiplier {
    fn from(of: Complex64) -> Self {
        Self { re: of.re, im: of.im }
    }
}

impl Multiplier {
    pub(super) fn magnitude(self) -> f64 {
        self.re.hypot(self.im)
    }
}

impl Motion {
    pub(super) fn of(state: &PeriodicState) -> Result<Self, Failure> {
        let PeriodExtremes {
            forces,
            speeds,
            strokes,
            ..
        } = state.extremes()?;
        let drive = |parameter: DriveParameter| parameter.value(state.scenario()).unwrap_or(f64::NAN);
        let first = state.multipliers().first();
        Ok(Self {
            amplitude: drive(DriveParameter::Amplitude),
            frequency_hz: drive(DriveParameter::Frequency),
            stable: state.is_stable(),
            multiplier: first.copied().unwrap_or_default().into(),
            force_min_n: forces.iter().map(|force| force[0]).collect(),
            force_max_n: forces.iter().map(|force| force[1]).collect(),
            speed_max_mps: speeds,
            stroke_max_m: strokes,
        })
    }

    pub(super) fn value(&self, parameter: DriveParameter) -> f64 {
        match parameter {
            DriveParameter::Frequency => self.frequency_hz,
            _ => self.amplitude,
        }
    }

    pub(super) fn greatest_force(&self) -> f64 {
        self.force_max_n.iter().copied().fold(0.0, f64::max)
    }
}

/// Unit of the amplitude of a scenario's drive.
pub(super) fn unit_of_amplitude(scenario: &Scenario) -> &'static str {
    let quantity = scenario.drive.as_ref().map(|drive| drive.quantity);
    if quantity == Some(DriveQuantity::Force) {
        "N"
    } else {
        "m"
    }
}
