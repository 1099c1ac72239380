//! How much of its energy a striker leaves in the chain, against its mass.

use serde::Serialize;

use crate::collision::Collision;
use crate::scenario::Scenario;
use crate::simulate::{Options, SimulateError, simulate_with};
use crate::solution::Solution;

/// What a striker gave to its chain in a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Injection {
    /// Mass of the striker over that of bead 1.
    pub mass_ratio: f64,
    /// What the striker gave up by the end of the run, J.
    pub energy: f64,
    /// The same as a part of what it had.
    pub share: f64,
    /// That part in an elastic collision with bead 1 alone, 4 r / (1 + r)².
    pub binary_share: f64,
    /// Whether striker and bead 1 had parted for good as far as the run goes: no overlap, and bead 1 the faster.
    pub parted: bool,
}

impl Solution {
    /// What the striker gave to the chain by the end of the run.
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

/// Runs a scenario with strikers of each of these masses, given as parts of bead 1's. The striker keeps radius, material and
/// speed, so that nothing else changes; heavy ones take longer to part, see [`Injection::parted`].
///
/// # Errors
/// As [`simulate_with`]; a ratio that is not a positive number is the scenario's `striker.mass`.
pub fn injection_curve(
    scenario: &Scenario,
    mass_ratios: &[f64],
    options: &Options<'_>,
) -> Result<Vec<Injection>, SimulateError> {
    scenario.check()?;
    let bead = scenario.spheres()[0].mass();
    mass_ratios
        .iter()
        .map(|ratio| {
            let mut scenario = scenario.clone();
            scenario.striker.mass = Some(ratio * bead);
            Ok(simulate_with(&scenario, options)?.injection())
        })
        .collect()
}
