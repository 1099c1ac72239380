//! Messages for settings that no bead has: the key, what is wrong, and what would do.

use bead_model::design::{Description, LEAST_WIDTH};
use bead_model::violation::{Bound, Coefficient, SettingKey, Violation};
use hertz_chain::InputError;

use crate::physical::values::{shown, value};

const CHECK: &str = "check the masses, springs and scales, which are in SI units";
const RELAXATION: &str = "give 0 for an elastic contact, or a time in s within that range";
const TEXT: &str = "give up to 16 bytes of text without control characters";
const UNIT: &str = "give the value of one code in the SI unit";

/// The message for a setting of `description` that is outside its bound.
pub fn refusal(description: &Description, violation: Violation) -> InputError {
    let Violation { key, bound } = violation;
    let text = shown(&value(description, key));
    let value = text.trim_end_matches(".0");
    let at = |what: String, advice: &str| InputError::at(key.path(), what, advice);
    let is = |advice: &str| at(format!("{value} {bound}"), advice);
    let out_of_range = |advice: &str| at(format!("{value} is out of range"), advice);
    match bound {
        Bound::Positive => out_of_range("give a value that is positive"),
        Bound::NotNegative if is_pole(key) => {
            out_of_range("give 0 for no filter, or a value that is positive")
        }
        Bound::NotNegative => out_of_range("give a value that is 0 or positive"),
        Bound::BelowBead => out_of_range("give a value that is below the bead's"),
        Bound::BelowHost => out_of_range("give a value that is 0 or more, and below the host's"),
        Bound::Range { least, most } => out_of_range(&format!("give a value that is from {least} to {most}")),
        Bound::OneBead => at("255 is the address of every bead".to_owned(), "give 0 to 254"),
        Bound::Text => at("this text is not allowed".to_owned(), TEXT),
        Bound::Places => {
            is("give the places of the beads with an intruder, each once: 123456, 13, or 0 for none")
        }
        Bound::Place => is("give 1 to 6, or 0 for no wall"),
        Bound::NotLight => is("give six masses in kg, of beads at least a quarter as large as this one"),
        Bound::Flag => {
            let what = format!("{value} is neither 0 nor 1");
            at(what, "give 1 if there are other intruders nearby, else 0")
        }
        Bound::Width { samples } => {
            let what = format!(
                "a wave of 1 m/s is {samples:.2} samples wide, but must be at least {LEAST_WIDTH} to be measured"
            );
            // It follows from the whole bead.
            InputError::at("bead", what, "take a larger or a softer sphere")
        }
        Bound::Format {
            coefficient,
            value,
            range: [least, most],
        } => {
            let what = format!(
                "{}: {value:.3e} in units of the sample rate is outside the usable range, {least:.1e} to {most:.1e}",
                name(coefficient)
            );
            at(
                what,
                if key == SettingKey::ContactRelaxation {
                    RELAXATION
                } else {
                    CHECK
                },
            )
        }
        Bound::Unit { range: [least, most] } => {
            let what = format!("{value} is outside the usable range, {least:.1e} to {most:.1e}");
            at(what, UNIT)
        }
        Bound::Pole => {
            let what = format!("{value} Hz {bound}");
            at(what, "give a pole of 8000 Hz or more, or 0 for no filter")
        }
        Bound::Reach => is(UNIT),
        Bound::LongHistory | Bound::ShortHistory => is("give 1.28e-3 to 2.56e-3 s"),
        Bound::LongWindow | Bound::ShortWindow => is("give more than capture.history, and up to 10.24e-3 s"),
        Bound::Lookback => is("give more than 0, and less than capture.history, in s"),
        Bound::AfterCalibration => is("give a day that is not before uncertainty.calibrated"),
        Bound::Correlations => is("give three correlations that one ring-down can have, from -1 to 1"),
        Bound::Codes | Bound::AboveNoise => is("give a force in N, and check force.per_code and force.noise"),
    }
}

fn is_pole(key: SettingKey) -> bool {
    matches!(
        key,
        SettingKey::ForcePole
            | SettingKey::WideForcePole
            | SettingKey::AccelerationPole
            | SettingKey::WideAccelerationPole
    )
}

fn name(coefficient: Coefficient) -> &'static str {
    match coefficient {
        Coefficient::OldAcceleration => "weight of the old acceleration",
        Coefficient::NewAcceleration => "weight of the new acceleration",
        Coefficient::EnergyByAcceleration => "energy by acceleration",
        Coefficient::Contact => "stiffness of the contacts",
        Coefficient::Relaxation => "relaxation time of the contacts over 2/3 of a sample",
        Coefficient::Incoming => "acceleration of the host per newton",
        Coefficient::Stiffness => "stiffness of the intruder's springs",
        Coefficient::Damping => "damping of the intruder",
        Coefficient::Intruder => "mass of the intruder over that of the host without it",
        Coefficient::Host => "mass of the bead over that of the host without intruder, less one",
        Coefficient::EnergyByVelocity => "energy by velocity",
        Coefficient::Incident => "energy of the incident wave",
        Coefficient::RingFrequency => "frequency of the ringing",
        Coefficient::RingDecay => "decay of the ringing",
        Coefficient::CompanyStiffness => "stiffness of the intruders behind",
        Coefficient::CompanyDamping => "damping of the intruders behind",
        Coefficient::CompanyRatio => "mass of the intruders behind over that of their beads",
    }
}
