//! The front end: what a code of each sensor is worth, and the filters before the converter.

use serde::{Deserialize, Serialize};

/// Scale of a sensor behind its two amplifiers. Quantities are in N for the force and m/s² for the
/// acceleration.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SensorScale {
    /// Quantity per code at the high gain.
    pub per_code: f64,
    /// Quantity per code at the low gain.
    pub wide_per_code: f64,
    /// Pole of the anti-alias filter at the high gain, Hz; 0 for none.
    pub pole: f64,
    /// Pole at the low gain, Hz; 0 for none.
    pub wide_pole: f64,
    /// White noise at the high gain before sampling, rms.
    #[serde(default)]
    pub noise: f64,
}

/// Where the sensors themselves end, as their data sheets or the supplies of their amplifiers have it. The
/// converter may go on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct SensorEnds {
    /// Greatest force, N; absent if it is unknown.
    pub force: Option<f32>,
    /// Greatest acceleration of either sign, m/s²; absent if it is unknown.
    pub acceleration: Option<f32>,
}

/// Both sensors. The zeros of the channels are not included: the bead finds them in every window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrontEnd {
    /// Force at the host's incoming contact, N.
    pub force: SensorScale,
    /// Acceleration of the intruder, m/s².
    pub acceleration: SensorScale,
}

impl FrontEnd {
    /// The reference design of `docs/front-end.md`: 16 N and ±250 m/s² over twelve bits at the high gain, 16
    /// times as much at the low one; one-pole filters at 40 kHz.
    pub fn reference() -> Self {
        let sensor = |span: f64, noise: f64| SensorScale {
            per_code: span / 4096.0,
            wide_per_code: 16.0 * span / 4096.0,
            pole: 40e3,
            wide_pole: 40e3,
            noise,
        };
        Self {
            force: sensor(16.0, 5e-3),
            acceleration: sensor(500.0, 0.05),
        }
    }
}
