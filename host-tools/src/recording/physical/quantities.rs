//! The quantities.

use bead_model::design::{Bead, Capture, FrontEnd, Neighbours, SensorFrontEnd};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::recording::physical::keys::Key;

/// A bead in physical quantities, SI units.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Physical {
    /// The name that its owner gave it, at most 16 bytes.
    #[serde(default)]
    pub name: String,
    /// Its address, 0 to 254.
    #[serde(default)]
    pub address: u8,
    /// The host.
    pub bead: Host,
    /// The intruder.
    pub intruder: Intruder,
    /// The contacts of the chain.
    pub contact: Contact,
    /// The intruders of the beads around.
    #[serde(default)]
    pub company: Company,
    /// The force sensor; quantities in N.
    pub force: SensorScale,
    /// The acceleration sensor; quantities in m/s².
    pub acceleration: SensorScale,
    /// When a strike is taken.
    #[serde(default)]
    pub capture: Taking,
}

/// The bead around the intruder.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Host {
    /// With its intruder, kg.
    pub mass: f64,
    /// In front of the force sensor's crystal, kg.
    #[serde(default)]
    pub front_mass: f64,
}

/// The mass on springs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Intruder {
    /// kg.
    pub mass: f64,
    /// N/m.
    pub stiffness: f64,
    /// N·s/m.
    pub damping: f64,
}

/// A contact between two beads.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Contact {
    /// N/m^1.5.
    pub stiffness: f64,
    /// s.
    pub relaxation: f64,
}

/// The intruders of the beads around. All zeros for a bead that is alone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Company {
    /// Which of the four beads behind hold an intruder, by their places: 1234 for all, 0 for none.
    pub behind: u32,
    /// 1 if beads near by hold one that `behind` does not name: those in front, or further behind.
    pub elsewhere: u32,
    /// Of the intruder that each of those behind holds, kg.
    pub mass: f64,
    /// N/m.
    pub stiffness: f64,
    /// N·s/m.
    pub damping: f64,
}

impl Company {
    pub(super) fn of(neighbours: &Neighbours) -> Self {
        let places = (1..).zip(neighbours.behind).filter(|(_, holds)| *holds);
        let intruder = &neighbours.intruder;
        Self {
            behind: places.fold(0, |digits, (place, _)| 10 * digits + place),
            elsewhere: neighbours.elsewhere.into(),
            mass: intruder.mass,
            stiffness: intruder.stiffness,
            damping: intruder.damping,
        }
    }
}

/// What the codes of a sensor are worth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SensorScale {
    /// Of a code at the high gain, in the sensor's unit.
    pub per_code: f64,
    /// Of a code at the low gain.
    pub wide_per_code: f64,
    /// Pole of the filter at the high gain, Hz; 0 for none.
    pub pole: f64,
    /// At the low gain.
    pub wide_pole: f64,
    /// Noise at the high gain, rms, in the sensor's unit.
    #[serde(default)]
    pub noise: f64,
}

/// When a strike is taken, and when it is flagged.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Taking {
    /// Hz.
    pub sample_rate: u32,
    /// N.
    pub threshold: f64,
    /// s.
    pub lookback: f64,
    /// s.
    pub history: f64,
    /// s.
    pub length: f64,
    /// A part.
    pub disagreement: f64,
    /// A part.
    pub ring_frequency_tolerance: f64,
    /// A part.
    pub ring_decay_tolerance: f64,
}

impl Default for Taking {
    fn default() -> Self {
        Self::of(&Capture::default())
    }
}

impl Taking {
    pub(super) fn of(capture: &Capture) -> Self {
        let Capture {
            sample_rate_hz,
            history,
            length,
            threshold,
            lookback,
            disagreement,
            ring_frequency_tolerance,
            ring_decay_tolerance,
        } = *capture;
        Self {
            sample_rate: sample_rate_hz,
            threshold,
            lookback,
            history,
            length,
            disagreement,
            ring_frequency_tolerance,
            ring_decay_tolerance,
        }
    }
}

impl Physical {
    /// A bead and its front end with the usual capture.
    pub fn new(bead: &Bead, neighbours: &Neighbours, front_end: &FrontEnd) -> Self {
        let scale = |sensor: &SensorFrontEnd| SensorScale {
            per_code: sensor.sensitive.per_code,
            wide_per_code: sensor.wide.per_code,
            pole: sensor.sensitive.pole_hz.unwrap_or(0.0),
            wide_pole: sensor.wide.pole_hz.unwrap_or(0.0),
            noise: sensor.sensitive.noise_rms,
        };
        Self {
            name: String::new(),
            address: 0,
            bead: Host {
                mass: bead.mass,
                front_mass: bead.front_mass,
            },
            intruder: Intruder {
                mass: bead.intruder_mass,
                stiffness: bead.stiffness,
                damping: bead.damping,
            },
            contact: Contact {
                stiffness: bead.contact_stiffness,
                relaxation: bead.relaxation,
            },
            company: Company::of(neighbours),
            force: scale(&front_end.force),
            acceleration: scale(&front_end.acceleration),
            capture: Taking::of(&Capture::of(bead, front_end)),
        }
    }

    /// The value of a key.
    pub fn get(&self, key: &Key) -> Value {
        // A struct of numbers and texts is always JSON.
        let all = serde_json::to_value(self).unwrap_or_default();
        all.pointer(&pointer(key)).cloned().unwrap_or_default()
    }

    /// The same bead with another value of a key.
    ///
    /// # Errors
    /// A value of another kind.
    pub(super) fn with(&self, key: &Key, value: Value) -> Result<Self, serde_json::Error> {
        let mut all = serde_json::to_value(self)?;
        if let Some(place) = all.pointer_mut(&pointer(key)) {
            *place = value;
        }
        serde_json::from_value(all)
    }
}

fn pointer(key: &Key) -> String {
    format!("/{}", key.path.replace('.', "/"))
}
