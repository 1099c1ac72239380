//! The energy that each intruder takes.

use serde::Serialize;

use crate::solution::{Snapshot, Solution};

/// The energy that one intruder has taken by some time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
#[non_exhaustive]
pub struct Absorption {
    /// The host bead.
    pub bead: usize,
    /// Its place among the intruders of a bead that holds several, from 1, in the order of their tables.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub place: Option<usize>,
    /// Dissipated in its damper, ∫ c x'² dt, J.
    pub dissipated: f64,
    /// Still in its motion and its spring, ½ m u'² + ½ k x² + ¼ k₃ x⁴, J.
    pub stored: f64,
    /// `dissipated` as a part of the striker's energy at t = 0.
    pub of_striker: f64,
    /// `dissipated` as a part of the energy that the striker or a drive has given by then, and that beads had
    /// at t = 0.
    pub of_injected: f64,
}

impl Absorption {
    /// The energy that each intruder has taken by the time of a snapshot.
    pub(crate) fn all(snapshot: &Snapshot<'_>) -> Vec<Self> {
        let model = snapshot.model();
        let striker = model.striker_energy();
        let energies = snapshot.energies();
        let injected = model.initial_energy() + energies.supplied - energies.striker;
        let of = |number: usize| {
            let bead = model.intruders()[number].bead;
            let dissipated = snapshot.dissipated_by(number);
            Self {
                bead,
                place: model.place_in_host(number),
                dissipated,
                stored: snapshot.stored_by(number),
                of_striker: dissipated / striker,
                of_injected: dissipated / injected,
            }
        };
        (0..model.intruders().len()).map(of).collect()
    }
}

impl Solution {
    /// The energy that each intruder has taken by time `t`, s, bead by bead. Panics like [`Solution::at`].
    pub fn absorption(&self, t: f64) -> Vec<Absorption> {
        Absorption::all(&self.at(t))
    }
}

#[cfg(test)]
mod tests {
    use crate::scenario::{Scenario, Start};
    use crate::simulate;

    #[test]
    fn the_energy_of_beads_that_move_at_the_start_is_injected_too() {
        let mut scenario = Scenario::paper();
        let end = scenario.duration;
        scenario.starts = vec![Start::moving([1], 0.45)];
        let solution = simulate(&scenario).unwrap();
        let model = solution.model();
        let kinetic = |body: usize, velocity: f64| 0.5 * model.mass(body) * velocity * velocity;
        let brought = kinetic(0, 0.45) + kinetic(1, 0.45);
        let injected = brought - kinetic(0, solution.at(end).velocity(0));
        let [absorbed] = solution.absorption(end)[..] else {
            panic!("the paper has one intruder");
        };
        let off = absorbed.of_injected * injected / absorbed.dissipated - 1.0;
        assert!(off.abs() < 1e-12, "{absorbed:?}");
    }
}
