//! The energy that a striker leaves in the chain, by its mass.

use serde::Serialize;

use crate::collision::Collision;
use crate::solution::Solution;

/// The energy that a striker gives to its chain in a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
#[non_exhaustive]
pub struct Injection {
    /// Mass of the striker over that of bead 1.
    pub mass_ratio: f64,
    /// The energy that the striker has given by the end of the run, J.
    pub energy: f64,
    /// Energy given, as a part of the energy that the striker had.
    pub share: f64,
    /// That part in an elastic collision with bead 1 alone, 4 r / (1 + r)².
    pub binary_share: f64,
    /// True if striker and bead 1 have parted for good by the end: no overlap, and bead 1 is the faster.
    pub parted: bool,
}

impl Solution {
    /// The energy that the striker has given to the chain by the end of the run.
    pub fn injection(&self) -> Injection {
        let (model, end) = (self.model(), self.at(self.end()));
        let had = model.striker_energy();
        let energy = had - end.energies().striker;
        Injection {
            mass_ratio: model.mass(0) / model.mass(1),
            energy,
            share: energy / had,
            binary_share: Collision::of_striker(model).transferred(),
            parted: end.overlap(1) <= 0.0 && end.velocity(1) > end.velocity(0),
        }
    }
}
