//! The chain of a scenario at t = 0: places, velocities and static loads.

use super::hosted::HostedIntruder;
use crate::scenario::{DriveQuantity, Scenario};

/// Displacements, m, and velocities, m/s, of the bodies of a scenario at t = 0. Displacements count from
/// where all bodies touch, the last bead at the wall, so gaps are displacements towards the striker.
pub(super) fn starts(scenario: &Scenario) -> Vec<(f64, f64)> {
    let beads = scenario.chain.beads;
    let mut gaps = vec![0.0; beads + 2];
    let mut velocities = vec![0.0; beads + 1];
    let mut displacements = vec![0.0; beads + 1];
    velocities[0] = scenario.striker.velocity;
    gaps[beads + 1] = scenario.wall.as_ref().map_or(0.0, |wall| wall.gap);
    for start in &scenario.starts {
        for &bead in &start.beads {
            gaps[bead] = start.gap;
            velocities[bead] = start.velocity;
            displacements[bead] = start.displacement;
        }
    }
    let mut displacement = 0.0;
    let mut starts: Vec<_> = (0..=beads)
        .rev()
        .map(|body| {
            displacement -= gaps[body + 1];
            let own = displacements[body];
            (
                if own == 0.0 {
                    displacement
                } else {
                    displacement + own
                },
                velocities[body],
            )
        })
        .collect();
    starts.reverse();
    starts
}

/// Static loads of contacts 1 to N + 1, N. Below a striker that moves freely, contact 1 has none.
pub(super) fn loads(scenario: &Scenario, masses: &[f64]) -> Vec<f64> {
    let chain = &scenario.chain;
    let mut loads = vec![chain.precompression; masses.len()];
    if scenario.drive.is_none() {
        loads[0] = 0.0;
    }
    if chain.gravity > 0.0 {
        // A driven displacement carries its body.
        let carried = scenario.loads_striker() && !is_prescribed(scenario);
        let mut weight = if carried { masses[0] * chain.gravity } else { 0.0 };
        for (load, mass) in loads.iter_mut().zip(masses.iter().skip(1)) {
            *load += weight;
            weight += mass * chain.gravity;
        }
        loads[masses.len() - 1] += weight;
    }
    loads
}

/// True if body 0 follows a displacement.
fn is_prescribed(scenario: &Scenario) -> bool {
    let quantity = scenario.drive.as_ref().map(|drive| drive.quantity);
    quantity == Some(DriveQuantity::Displacement)
}

/// Displacement, m, and velocity, m/s, of each intruder at t = 0 relative to its host.
pub(super) fn intruder_starts(scenario: &Scenario, intruders: &[HostedIntruder]) -> Vec<(f64, f64)> {
    if scenario.starts.is_empty() {
        return vec![(0.0, 0.0); intruders.len()];
    }
    let mut of_bead = vec![(0.0, 0.0); scenario.chain.beads + 1];
    for start in &scenario.starts {
        for &bead in &start.beads {
            of_bead[bead] = (start.intruder_displacement, start.intruder_velocity);
        }
    }
    intruders.iter().map(|intruder| of_bead[intruder.bead]).collect()
}
