//! The results of a strike.

use serde::Serialize;

/// The results of a strike by one source, SI units.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, schemars::JsonSchema)]
pub struct StrikeValues {
    /// Highest force, N.
    pub peak_force: f64,
    /// Estimate A, J; of the full chain, what the intruder dissipates.
    pub absorbed_measured: f64,
    /// Estimate B, J; of the full chain, what the intruder dissipates.
    pub absorbed_predicted: f64,
}

impl StrikeValues {
    /// The results in a strike frame.
    pub fn of(said: &bead_wire::Strike) -> Self {
        Self {
            peak_force: said.peak_force.newtons(),
            absorbed_measured: said.absorbed_measured.joules(),
            absorbed_predicted: said.absorbed_predicted.joules(),
        }
    }

    pub(crate) fn relative_to(&self, truth: &Self) -> Self {
        let off = |of: fn(&Self) -> f64| of(self) / of(truth) - 1.0;
        Self {
            peak_force: off(|values| values.peak_force),
            absorbed_measured: off(|values| values.absorbed_measured),
            absorbed_predicted: off(|values| values.absorbed_predicted),
        }
    }
}
