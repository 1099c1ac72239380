//! The solitary wave of equal elastic spheres, and measures of how near a wave comes to it.
//!
//! In units where κ = M = 1, the wave's speed c in beads per time depends only on its amplitude.

use crate::pulse::{ForceTrace, Pulse, PulseSearch};
use crate::quantity::PeakQuantity;
use crate::solution::Solution;

/// c / v^(1/5) of the discrete wave, where v is a bead's greatest speed.
pub const SPEED_FROM_VELOCITY: f64 = 0.907_47;
/// c / F^(1/6) of the discrete wave, where F is a contact's greatest force.
pub const SPEED_FROM_FORCE: f64 = 0.905_52;
/// Mean kinetic part of the wave's energy: 5/9, by the virial theorem for forces that go as δ^(3/2).
pub const KINETIC_SHARE: f64 = 5.0 / 9.0;

/// Numbers common to all solitary waves, as measured in a run.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Invariants {
    /// c / F^(1/6) in units of κ and M: [`SPEED_FROM_FORCE`] for the discrete wave.
    pub speed_from_force: f64,
    /// c / v^(1/5) in those units: [`SPEED_FROM_VELOCITY`] for the discrete wave.
    pub speed_from_velocity: f64,
    /// Kinetic part of the energy, averaged over the way between the contacts: [`KINETIC_SHARE`] for the
    /// discrete wave.
    pub kinetic_share: f64,
}

impl Solution {
    /// Measures a wave between two contacts of equal spheres without intruders; κ, M and R are those of the
    /// first. The energy is that of ten beads behind to ten ahead, far more than the wave covers.
    ///
    /// # Panics
    /// If `later` is not at a contact after `earlier`'s.
    pub fn solitary_invariants(&self, earlier: &Pulse, later: &Pulse) -> Invariants {
        assert!(
            earlier.contact < later.contact,
            "a wave is measured between a contact and a later one"
        );
        let model = self.model();
        let first = earlier.contact;
        let (stiffness, mass) = (model.contact(first).stiffness, model.mass(first));
        let (speed, diameter) = (self.speed(earlier, later), 2.0 * model.radius(earlier.contact));
        let force = 0.5 * (earlier.force + later.force);
        let search = PulseSearch {
            from: later.from,
            to: later.to,
            ..PulseSearch::default()
        };
        let velocity = PeakQuantity::Velocity(later.contact - 1);
        let peaks = ForceTrace::new(self, velocity, search.from, search.to).peaks(&search);
        let velocity = peaks.iter().map(|peak| peak.value).fold(0.0, f64::max);

        // The share repeats from bead to bead, so equal intervals converge faster than any power.
        let count = 64 * (later.contact - earlier.contact);
        let beads = earlier.contact.saturating_sub(10)..=(later.contact + 10).min(model.bodies() - 1);
        let mut sampler = self.sampler();
        let share: f64 = (0..count)
            .map(|i| earlier.time + (later.time - earlier.time) * i as f64 / count as f64)
            .map(|t| sampler.at(t).region(beads.clone()))
            .map(|region| region.kinetic / (region.kinetic + region.elastic))
            .sum();
        let of_force = diameter * stiffness.powf(1.0 / 3.0) * mass.powf(-0.5) * force.powf(1.0 / 6.0);
        let of_velocity = diameter * (stiffness / mass).powf(0.4) * velocity.powf(0.2);
        Invariants {
            speed_from_force: speed / of_force,
            speed_from_velocity: speed / of_velocity,
            kinetic_share: share / count as f64,
        }
    }
}
