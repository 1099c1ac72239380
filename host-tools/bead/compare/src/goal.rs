//! Goals for the estimates of a strike, as parts of its energy.

use serde::Serialize;

/// Goals for the two estimates against the full chain, for a bead whose chain is like their reduced one.
const GOAL: [f64; 2] = [2e-3, 5e-3];

/// Parts of the energy for the estimates of a strike.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct StrikeGoal {
    /// For A; none if there is no goal for it.
    pub absorbed_measured: Option<f64>,
    /// For B; none if there is no goal for it.
    pub absorbed_predicted: Option<f64>,
}

impl StrikeGoal {
    /// The goals if the chain explains errors of A and of B by these parts.
    pub(crate) fn beyond(explained: [f64; 2]) -> Self {
        let of = |place: usize| Some(GOAL[place] + explained[place]).filter(|goal| goal.is_finite());
        Self {
            absorbed_measured: of(0),
            absorbed_predicted: of(1),
        }
    }

    /// The goals of A and of B.
    pub(crate) fn each(&self) -> [Option<f64>; 2] {
        [self.absorbed_measured, self.absorbed_predicted]
    }
}

impl Default for StrikeGoal {
    fn default() -> Self {
        Self::beyond([0.0; 2])
    }
}
