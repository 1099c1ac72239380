//! Relative standard uncertainties of the settings, and the calibration that they come from.

use serde::{Deserialize, Serialize};

use crate::day::Day;
use crate::name::Name;
use crate::relative::Relative;
use crate::violation::{Bound, SettingKey as Key, Violation, require};

/// Range of a relative standard uncertainty.
const RANGE: [f64; 2] = [1e-6, 0.5];

/// Relative standard uncertainties (JCGM 100, 2.3.1) of the settings. `None` is unknown. Inputs are
/// uncorrelated, apart from those that the last three fields name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct Uncertainty {
    /// Certificate or record of the calibration.
    #[cfg_attr(feature = "schema", schemars(with = "&str"))]
    pub calibration: Name,
    /// Day of the calibration.
    pub calibrated: Option<Day>,
    /// Last day on which it holds.
    pub valid_until: Option<Day>,
    /// Scale of the force, which both gains share.
    pub force_gain: Option<Relative>,
    /// Ratio of its low gain to the high one.
    pub force_gain_ratio: Option<Relative>,
    /// Response of the force sensor up to 5 kHz, relative to that at the frequency of its calibration.
    pub force_flatness: Option<Relative>,
    /// Scale of the acceleration, which both gains share.
    pub acceleration_gain: Option<Relative>,
    /// Ratio of its low gain to the high one.
    pub acceleration_gain_ratio: Option<Relative>,
    /// Response of the accelerometer up to 5 kHz, relative to that at the frequency of its calibration.
    pub acceleration_flatness: Option<Relative>,
    /// Supply of the converter, which scales the codes of both sensors.
    pub supply: Option<Relative>,
    /// M.
    pub bead_mass: Option<Relative>,
    /// Mass in front of the crystal.
    pub front_mass: Option<Relative>,
    /// m.
    pub intruder_mass: Option<Relative>,
    /// k.
    pub stiffness: Option<Relative>,
    /// c.
    pub damping: Option<Relative>,
    /// κ.
    pub contact_stiffness: Option<Relative>,
    /// τ.
    pub relaxation: Option<Relative>,
    /// Correlation of k and c, as one ring-down gives both.
    pub stiffness_with_damping: Relative,
    /// Correlation of k and m.
    pub stiffness_with_mass: Relative,
    /// Correlation of c and m.
    pub damping_with_mass: Relative,
}

impl Uncertainty {
    /// Each uncertainty with its setting.
    pub fn stated(&self) -> [(Key, Option<Relative>); 14] {
        [
            (Key::UForceGain, self.force_gain),
            (Key::UForceGainRatio, self.force_gain_ratio),
            (Key::UForceFlatness, self.force_flatness),
            (Key::UAccelerationGain, self.acceleration_gain),
            (Key::UAccelerationGainRatio, self.acceleration_gain_ratio),
            (Key::UAccelerationFlatness, self.acceleration_flatness),
            (Key::USupply, self.supply),
            (Key::UBeadMass, self.bead_mass),
            (Key::UFrontMass, self.front_mass),
            (Key::UIntruderMass, self.intruder_mass),
            (Key::UStiffness, self.stiffness),
            (Key::UDamping, self.damping),
            (Key::UContactStiffness, self.contact_stiffness),
            (Key::URelaxation, self.relaxation),
        ]
    }

    /// Correlations of k with c, k with m, and c with m.
    pub fn correlations(&self) -> [f64; 3] {
        let correlations = [
            self.stiffness_with_damping,
            self.stiffness_with_mass,
            self.damping_with_mass,
        ];
        correlations.map(Relative::part)
    }

    /// Checks ranges, dates and correlations.
    ///
    /// # Errors
    /// The first setting outside its bound.
    pub(crate) fn check(&self) -> Result<(), Violation> {
        require(self.calibration.is_text(), Key::Calibration, Bound::Text)?;
        let is_after = self
            .calibrated
            .zip(self.valid_until)
            .is_none_or(|(from, to)| from <= to);
        require(is_after, Key::ValidUntil, Bound::AfterCalibration)?;
        let [least, most] = RANGE;
        for (key, part) in self.stated() {
            let holds = part.is_none_or(|part| (least..=most).contains(&part.part()));
            require(holds, key, Bound::Range { least, most })?;
        }
        // A matrix is one of correlations if none of its principal minors is negative.
        let [a, b, c] = self.correlations();
        let minors = [
            1.0 - a * a,
            1.0 - b * b,
            1.0 - c * c,
            1.0 + 2.0 * a * b * c - a * a - b * b - c * c,
        ];
        let is_matrix = minors.iter().all(|minor| *minor >= 0.0);
        require(is_matrix, Key::StiffnessWithDamping, Bound::Correlations)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlations_are_refused_unless_they_are_a_matrix_of_correlations() {
        for (correlations, holds) in [
            ([0.0, 0.0, 0.0], true),
            ([0.5, 0.5, -0.25], true),
            ([1.0, 1.0, 1.0], true),
            ([1.0, -1.0, -1.0], true),
            ([0.9, 0.9, -0.9], false),
            ([1.0, 1.0, 0.9], false),
            // The determinant of these is not negative.
            ([1.1, 1.1, 1.1], false),
            ([1.1, 1.1, -1.0], false),
        ] {
            let [stiffness_with_damping, stiffness_with_mass, damping_with_mass] =
                correlations.map(Relative::new);
            let stated = Uncertainty {
                stiffness_with_damping,
                stiffness_with_mass,
                damping_with_mass,
                ..Uncertainty::default()
            };
            assert_eq!(stated.check().is_ok(), holds, "{correlations:?}");
        }
    }
}
