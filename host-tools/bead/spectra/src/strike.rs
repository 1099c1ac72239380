//! A strike's signals, and why a strike has no part in a spectrum.

use std::sync::Arc;

use bead_model::design::{Relative, Uncertainty};
use bead_model::layout::BASELINE;
use bead_recording::signal::Signal;
use bead_recording::strikes::RecordedStrike;
use bead_wire::StrikeFlags as Flags;

/// The frequency to which calibrations state how flat a sensor is, Hz.
pub const FLAT_TO: f64 = 5000.0;

/// The sensors whose signals a spectrum needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sensors {
    /// Force at the incoming contact.
    Force,
    /// Acceleration of the intruder.
    Acceleration,
    /// Both, for the transfer from force to acceleration.
    Both,
}

impl Sensors {
    /// Flags of a signal that is wrong or ends early.
    fn spoiled(self) -> Flags {
        let railed = match self {
            Self::Force => Flags::FORCE_RAILED,
            Self::Acceleration => Flags::ACCELERATION_RAILED,
            Self::Both => Flags::FORCE_RAILED.with(Flags::ACCELERATION_RAILED),
        };
        railed
            .with(Flags::WINDOW_CUT)
            .with(Flags::SENSOR_END)
            .with(Flags::SENSOR_FAULT)
            .with(Flags::SENSOR_STILL)
    }

    /// The relative standard uncertainty of the scale of a spectrum's amplitude. The supply scales both
    /// sensors, so a ratio is free of it.
    fn gain(self, stated: &Uncertainty) -> Option<f64> {
        let of_force = [stated.force_gain, stated.force_gain_ratio, stated.force_flatness];
        let of_acceleration = [
            stated.acceleration_gain,
            stated.acceleration_gain_ratio,
            stated.acceleration_flatness,
        ];
        let parts: Vec<Option<Relative>> = match self {
            Self::Force => of_force.into_iter().chain([stated.supply]).collect(),
            Self::Acceleration => of_acceleration.into_iter().chain([stated.supply]).collect(),
            Self::Both => of_force.into_iter().chain(of_acceleration).collect(),
        };
        let parts: Option<Vec<f64>> = parts.into_iter().map(|part| part.map(Relative::part)).collect();
        parts.map(|parts| parts.into_iter().fold(0.0, f64::hypot))
    }
}

/// Flags of a gain that is not the calibration's, so that its uncertainty does not hold.
const OF_GAIN: Flags = Flags::GAINS_DIFFER
    .with(Flags::SUPPLY_OFF)
    .with(Flags::SETTINGS_NOT_OWNERS);

/// The signals that are wanted of a strike.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SignalsWanted {
    /// The sensors of the signals.
    pub sensors: Sensors,
    /// True to take strikes whose flags say that a signal is wrong or ends early.
    pub doubtful: bool,
    /// Uncertainties in place of those that the strike's settings state.
    pub stated: Option<Uncertainty>,
}

/// The signals of a whole strike.
#[derive(Debug, Clone, PartialEq)]
pub struct StrikeSignal {
    /// Path of the recording.
    pub recording: Arc<str>,
    /// Number of the strike, as its bead counts.
    pub strike: u32,
    /// Samples a second.
    pub rate: f64,
    /// Sample that triggered.
    pub trigger: usize,
    /// Force, N, relative to the quiet start.
    pub force: Vec<f64>,
    /// Acceleration, m/s², relative to the quiet start.
    pub acceleration: Vec<f64>,
    /// Relative standard uncertainty of the scale, `None` if unknown.
    pub gain_uncertainty: Option<f64>,
    /// Standard uncertainty of the zero of the acceleration, m/s²: that of the mean of the quiet start.
    pub zero_uncertainty: f64,
    /// Names of its flags.
    pub flags: Vec<&'static str>,
}

impl StrikeSignal {
    /// The signals of a strike.
    ///
    /// # Errors
    /// Why the strike has no part, as the end of a sentence.
    pub fn of(recording: &Arc<str>, strike: &RecordedStrike, wanted: SignalsWanted) -> Result<Self, String> {
        let sensors = wanted.sensors;
        let (said, flags) = (&strike.said, strike.said.flags);
        if strike.missing() > 0 {
            let all = said.samples;
            return Err(format!(
                "{} of its {all} samples were not received",
                strike.missing()
            ));
        }
        let (Some(settings), Some(rate)) = (&strike.settings, strike.rate()) else {
            return Err("it came without settings, so its samples have no units".to_owned());
        };
        let Some(signal) = Signal::of(&strike.scans, settings) else {
            return Err(format!(
                "its window has {} samples, and its zero needs {BASELINE}",
                strike.scans.len()
            ));
        };
        let spoiled = flags.bits() & sensors.spoiled().bits();
        if spoiled != 0 && !wanted.doubtful {
            let names: Vec<_> = Flags::from_bits(spoiled).names().collect();
            return Err(format!("it is flagged: {}", names.join(", ")));
        }
        let stated = wanted.stated.or(settings.description().uncertainty);
        let holds = flags.bits() & OF_GAIN.bits() == 0 && spoiled == 0;
        let trigger = usize::try_from(said.trigger_index.saturating_sub(said.first_index)).unwrap_or(0);
        Ok(Self {
            recording: Arc::clone(recording),
            strike: said.strike,
            rate: rate.into(),
            trigger: trigger.min(strike.scans.len() - 1),
            gain_uncertainty: stated.filter(|_| holds).and_then(|stated| sensors.gain(&stated)),
            zero_uncertainty: of_mean(&signal.acceleration[..usize::from(BASELINE)]),
            force: signal.force,
            acceleration: signal.acceleration,
            flags: flags.names().collect(),
        })
    }

    /// Time from the trigger to the end of the window, s.
    pub fn after_trigger(&self) -> f64 {
        (self.acceleration.len() - self.trigger) as f64 / self.rate
    }

    /// Length of the window, s.
    pub fn duration(&self) -> f64 {
        self.acceleration.len() as f64 / self.rate
    }
}

/// The standard uncertainty of the mean of some values.
fn of_mean(values: &[f64]) -> f64 {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (squares / (count - 1.0) / count).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use bead_recording::strikes::ScanCodes;
    use bead_testing::paper_settings;
    use bead_wire::{Body, Strike};

    /// A whole strike with these flags: quiet until a step.
    fn strike(flags: Flags) -> RecordedStrike {
        let said = Strike {
            first_index: 1000,
            trigger_index: 1100,
            samples: 300,
            flags,
            ..Strike::draw(&mut || 0)
        };
        let mut strike = RecordedStrike::new(8, said);
        strike.settings = Some(paper_settings());
        let code = |sample: u16| 2048 + sample % 2 + if sample < 200 { 0 } else { 400 };
        strike.scans = (0..300)
            .map(|sample| ScanCodes {
                sensitive: [128, code(sample)],
                wide: None,
            })
            .collect();
        strike
    }

    fn wanted(sensors: Sensors) -> SignalsWanted {
        let part = |part| Some(Relative::new(part));
        let stated = Uncertainty {
            force_gain: part(0.01),
            force_gain_ratio: part(0.0),
            force_flatness: part(0.02),
            acceleration_gain: part(0.003),
            acceleration_gain_ratio: part(0.0),
            acceleration_flatness: part(0.004),
            supply: part(0.012),
            ..Uncertainty::default()
        };
        SignalsWanted {
            sensors,
            doubtful: false,
            stated: Some(stated),
        }
    }

    fn signal(flags: Flags, wanted: SignalsWanted) -> Result<StrikeSignal, String> {
        StrikeSignal::of(&"x.mcap".into(), &strike(flags), wanted)
    }

    #[test]
    fn the_scale_has_the_uncertainty_of_its_sensors_and_a_ratio_none_of_the_supply() {
        let of = |sensors| {
            signal(Flags::NONE, wanted(sensors))
                .unwrap()
                .gain_uncertainty
                .unwrap()
        };
        for (sensors, expected) in [
            (Sensors::Force, 0.01_f64.hypot(0.02).hypot(0.012)),
            (Sensors::Acceleration, 0.013),
            (Sensors::Both, 0.01_f64.hypot(0.02).hypot(0.005)),
        ] {
            assert!((of(sensors) - expected).abs() < 1e-9, "{sensors:?}");
        }
        let mut unknown = wanted(Sensors::Acceleration);
        unknown.stated.as_mut().unwrap().supply = None;
        assert_eq!(signal(Flags::NONE, unknown).unwrap().gain_uncertainty, None);
        let off = signal(Flags::SUPPLY_OFF, wanted(Sensors::Force)).unwrap();
        assert_eq!(off.gain_uncertainty, None);
    }

    #[test]
    fn a_flag_leaves_out_the_strike_of_the_signal_that_it_spoils_unless_doubts_are_wanted() {
        for (flags, sensors, is_spoiled) in [
            (Flags::ACCELERATION_RAILED, Sensors::Acceleration, true),
            (Flags::ACCELERATION_RAILED, Sensors::Force, false),
            (Flags::ACCELERATION_RAILED, Sensors::Both, true),
            (Flags::FORCE_RAILED, Sensors::Acceleration, false),
            (Flags::FORCE_RAILED, Sensors::Both, true),
            (Flags::WINDOW_CUT, Sensors::Force, true),
            (Flags::SENSOR_END, Sensors::Force, true),
            (Flags::MODEL_DIFFERS, Sensors::Both, false),
        ] {
            let name = flags.names().next().unwrap();
            let why = signal(flags, wanted(sensors)).err();
            assert_eq!(why, is_spoiled.then(|| format!("it is flagged: {name}")));
            let doubtful = SignalsWanted {
                doubtful: true,
                ..wanted(sensors)
            };
            let found = signal(flags, doubtful).unwrap();
            assert_eq!(found.gain_uncertainty.is_none(), is_spoiled, "{flags:?}");
        }
    }

    #[test]
    fn times_are_those_of_the_window_and_the_zero_that_of_its_quiet() {
        let found = signal(Flags::NONE, wanted(Sensors::Acceleration)).unwrap();
        assert_eq!((found.trigger, found.rate), (100, 1e5));
        assert!((found.after_trigger() - 2e-3).abs() < 1e-12 && (found.duration() - 3e-3).abs() < 1e-12);
        // Codes that alternate by one: half a code of 500/4096 m/s² over √63.
        let exact = 250.0 / 4096.0 / 63_f64.sqrt();
        assert!((found.zero_uncertainty / exact - 1.0).abs() < 0.02, "{found:?}");
        let mut lossy = strike(Flags::NONE);
        lossy.scans.truncate(290);
        let why = StrikeSignal::of(&"x.mcap".into(), &lossy, wanted(Sensors::Force)).unwrap_err();
        assert_eq!(why, "10 of its 300 samples were not received");
        let mut bare = strike(Flags::NONE);
        bare.settings = None;
        let why = StrikeSignal::of(&"x.mcap".into(), &bare, wanted(Sensors::Force)).unwrap_err();
        assert!(why.contains("came without settings"), "{why}");
    }
}
