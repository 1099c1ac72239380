//! Inputs whose uncertainty the settings state.

use bead_model::design::{Description, SensorScale};
use bead_model::violation::SettingKey;

/// Name and unit of an input.
pub(super) fn named(key: SettingKey) -> (&'static str, &'static str) {
    match key {
        SettingKey::UForceGain => ("force gain", "N/code"),
        SettingKey::UForceGainRatio => ("force gain ratio", ""),
        SettingKey::UForceFlatness => ("force flatness", ""),
        SettingKey::UAccelerationGain => ("acceleration gain", "m/s²/code"),
        SettingKey::UAccelerationGainRatio => ("acceleration gain ratio", ""),
        SettingKey::UAccelerationFlatness => ("acceleration flatness", ""),
        SettingKey::USupply => ("supply", ""),
        SettingKey::UBeadMass => ("M", "kg"),
        SettingKey::UFrontMass => ("front mass", "kg"),
        SettingKey::UIntruderMass => ("m", "kg"),
        SettingKey::UStiffness => ("k", "N/m"),
        SettingKey::UDamping => ("c", "N·s/m"),
        SettingKey::UContactStiffness => ("kappa", "N/m^1.5"),
        SettingKey::URelaxation => ("tau", "s"),
        other => (other.path(), ""),
    }
}

/// True for an input that beads of one calibration share: the reference that their sensors were calibrated
/// against, their supply, and the material of the chain.
pub(super) fn is_shared(key: SettingKey) -> bool {
    matches!(
        key,
        SettingKey::UForceGain
            | SettingKey::UForceFlatness
            | SettingKey::UAccelerationGain
            | SettingKey::UAccelerationFlatness
            | SettingKey::USupply
            | SettingKey::UContactStiffness
            | SettingKey::URelaxation
    )
}

/// The estimate of an input: the setting, or 1 for a factor that has none.
pub(super) fn estimate(description: &Description, key: SettingKey) -> f64 {
    let ratio = |sensor: &SensorScale| sensor.wide_per_code / sensor.per_code;
    match key {
        SettingKey::UForceGain => description.force.per_code,
        SettingKey::UForceGainRatio => ratio(&description.force),
        SettingKey::UAccelerationGain => description.acceleration.per_code,
        SettingKey::UAccelerationGainRatio => ratio(&description.acceleration),
        SettingKey::UBeadMass => description.bead.mass,
        SettingKey::UFrontMass => description.bead.front_mass,
        SettingKey::UIntruderMass => description.intruder.mass,
        SettingKey::UStiffness => description.intruder.stiffness,
        SettingKey::UDamping => description.intruder.damping,
        SettingKey::UContactStiffness => description.contact.stiffness,
        SettingKey::URelaxation => description.contact.relaxation,
        _ => 1.0,
    }
}

/// Multiplies an input by a factor.
pub(super) fn scale(description: &mut Description, key: SettingKey, factor: f64) {
    // Noise and threshold are codes: they grow with the gain.
    let gain = |sensor: &mut SensorScale| {
        sensor.per_code *= factor;
        sensor.wide_per_code *= factor;
        sensor.noise *= factor;
    };
    match key {
        SettingKey::UForceGain | SettingKey::UForceFlatness => {
            gain(&mut description.force);
            description.capture.threshold *= factor;
        }
        SettingKey::UForceGainRatio => description.force.wide_per_code *= factor,
        SettingKey::UAccelerationGain | SettingKey::UAccelerationFlatness => {
            gain(&mut description.acceleration);
        }
        SettingKey::UAccelerationGainRatio => description.acceleration.wide_per_code *= factor,
        SettingKey::USupply => {
            gain(&mut description.force);
            gain(&mut description.acceleration);
            description.capture.threshold *= factor;
        }
        SettingKey::UBeadMass => description.bead.mass *= factor,
        SettingKey::UFrontMass => description.bead.front_mass *= factor,
        SettingKey::UIntruderMass => description.intruder.mass *= factor,
        SettingKey::UStiffness => description.intruder.stiffness *= factor,
        SettingKey::UDamping => description.intruder.damping *= factor,
        SettingKey::UContactStiffness => description.contact.stiffness *= factor,
        SettingKey::URelaxation => description.contact.relaxation *= factor,
        _ => {}
    }
}
