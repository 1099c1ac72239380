//! Standard uncertainties of a bead's results for a strike, in the unit of the value.
//!
//! # Design
//! They cover calibration and noise, but no error that a flag reports. A value whose flagged error may be
//! greater has no uncertainty.

use bead_model::design::{Relative, Uncertainty};
use bead_wire::{Shape, Strike, StrikeFlags as Flags};

/// Name of the group of uncertainties. In a table it begins their names.
pub const GROUP: &str = "u";
/// Keys of the uncertainties of A, of B and of A - B, J, in their group.
pub const ENERGIES: [&str; 3] = ["absorbed_measured_j", "absorbed_predicted_j", "difference_j"];

/// Flags that mean an error of only A, and of only B.
const OF_ONE: [Flags; 2] = [
    Flags::ACCELERATION_RAILED,
    Flags::FORCE_RAILED
        .with(Flags::CHAIN_RANGE)
        .with(Flags::WAVE_TRAIN),
];
/// Flags that mean an error of a few tenths of a percent, or none.
const OF_NEITHER: Flags = Flags::WINDOW_CUT
    .with(Flags::RINGING_LEFT)
    .with(Flags::NOT_AT_REST)
    .with(Flags::FROM_OUTSIDE);
/// Flags that mean an error of the force.
const OF_FORCE: Flags = Flags::FORCE_RAILED
    .with(Flags::GAINS_DIFFER)
    .with(Flags::SUPPLY_OFF)
    .with(Flags::SENSOR_END)
    .with(Flags::SENSOR_STILL)
    .with(Flags::SENSOR_FAULT)
    .with(Flags::SETTINGS_NOT_OWNERS);

/// True for A and for B if no flag means an error that the uncertainty does not cover.
pub fn are_held(flags: Flags) -> [bool; 2] {
    // A window cut by another wave ends before that wave.
    let cut = if flags.has(Flags::WINDOW_CUT) {
        Flags::ANOTHER_WAVE
    } else {
        Flags::NONE
    };
    let left = flags.without(OF_NEITHER).without(cut);
    [1, 0].map(|other| left.without(OF_ONE[other]) == Flags::NONE)
}

/// The uncertainties of A, B and A - B of a strike, J, from the parts in its shape; `None` for a value whose
/// flagged error may be greater. `None` altogether if the bead sent none.
pub fn of_energies(shape: &Shape, strike: &Strike) -> Option<[Option<f64>; 3]> {
    let known = shape.uncertainty?;
    let (a, b) = (strike.absorbed_measured, strike.absorbed_predicted);
    let [of_a, of_b] = are_held(strike.flags);
    let each = [
        (of_a, known.measured, a),
        (of_b, known.predicted, b),
        (of_a && of_b, known.difference, a.max(b)),
    ];
    Some(each.map(|(held, part, of)| held.then(|| part.ratio() * of.joules().abs())))
}

/// The uncertainties of the highest force, N, and of the incident energy, J, by those that the settings
/// state. The energy of a solitary wave goes with F^(5/3) and κ^(-2/3). `None` if one is unknown, or a flag
/// doubts the force.
pub fn of_force(strike: &Strike, stated: &Uncertainty) -> Option<[f64; 2]> {
    if strike.flags.has(OF_FORCE) {
        return None;
    }
    let gains = [
        stated.force_gain?,
        stated.force_gain_ratio?,
        stated.force_flatness?,
        stated.supply?,
    ];
    let force = gains.map(Relative::part).into_iter().fold(0.0, f64::hypot);
    let contact = stated.contact_stiffness?.part();
    let (peak, incident) = (strike.peak_force.newtons(), strike.incident_energy.joules());
    Some([
        force * peak.abs(),
        (5.0 / 3.0 * force).hypot(2.0 / 3.0 * contact) * incident.abs(),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_energy_that_a_flag_doubts_has_no_uncertainty() {
        for (flags, held) in [
            (Flags::NONE, [true, true]),
            (Flags::NOT_AT_REST.with(Flags::RINGING_LEFT), [true, true]),
            (Flags::WAVE_TRAIN.with(Flags::NOT_AT_REST), [true, false]),
            (Flags::FORCE_RAILED, [true, false]),
            (Flags::ACCELERATION_RAILED, [false, true]),
            (Flags::ACCELERATION_RAILED.with(Flags::WAVE_TRAIN), [false, false]),
            (Flags::MODEL_DIFFERS, [false, false]),
            (Flags::ANOTHER_WAVE, [false, false]),
            (Flags::ANOTHER_WAVE.with(Flags::WINDOW_CUT), [true, true]),
        ] {
            assert_eq!(are_held(flags), held, "{flags:?}");
        }
    }
}
