//! Healthy strikes at beads of ten kinds, single and in rows of ten: no doubt may be flagged.

use bead_model::design::{Bead, Uncertainty};
use bead_wire::StrikeFlags;
use hertz_chain::Solution;

use super::measure::StrikePeaks;
use super::spheres::{SphereMaterial, SphereStrike, chain, filled};
use crate::cli::commands::prelude::*;
use bead_bench::emulation::{Placed, settings_of};
use bead_bench::model_bead::measured;
use bead_compare::sensed::{Timing, Truth, simulate_with_ring_down};

/// Kinds of beads by material and diameter, m: of docs/spheres.md, where a wave is 3.9 samples wide or more.
pub(super) const KINDS: [(SphereMaterial, f64); 10] = [
    (SphereMaterial::Steel, 0.02),
    (SphereMaterial::Steel, 0.04),
    (SphereMaterial::Glass, 0.028),
    (SphereMaterial::Aluminium, 0.04),
    (SphereMaterial::Ptfe, 0.01),
    (SphereMaterial::Ptfe, 0.028),
    (SphereMaterial::Nylon, 0.014),
    (SphereMaterial::Nylon, 0.04),
    (SphereMaterial::Abs, 0.02),
    (SphereMaterial::Bakelite, 0.038),
];
/// Velocities of the striker, m/s, at a single bead.
const VELOCITIES: [f64; 10] = [0.05, 0.075, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45];
/// Velocity of the striker of a row, m/s.
const ROW_VELOCITY: f64 = 0.3;
/// Places of the beads of a row.
const ROW: std::ops::RangeInclusive<usize> = 7..=16;
/// Beads of the chain with a row, and its duration in the paper's time, s.
const ROW_CHAIN: (usize, f64) = (30, 0.009);
/// Place of a single bead.
const ALONE: usize = 8;
/// Quiet before the first strike, and time from strike to strike, s.
const LEAD_IN: f64 = 0.01;
const INTERVAL: f64 = 0.04;

/// Healthy strikes at one kind of bead.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct HealthyKind {
    material: SphereMaterial,
    diameter_m: f64,
    /// True for beads in a row of ten.
    row: bool,
    /// Strikes of the chain.
    pub(super) struck: usize,
    /// Strikes that the beads found.
    pub(super) strikes: usize,
    /// Greatest errors of A and B, as parts of the truth.
    worst: [f64; 2],
    /// Strikes with a doubt.
    pub(super) flagged: usize,
    /// Every doubt that was flagged, with the number of its strikes.
    doubts: Vec<(&'static str, usize)>,
}

impl HealthyKind {
    /// True if every strike was found, and none is flagged.
    pub(super) fn holds(&self) -> bool {
        self.flagged == 0 && self.strikes == self.struck
    }

    pub(super) fn row(&self) -> [String; 5] {
        let doubts = self
            .doubts
            .iter()
            .map(|(flag, strikes)| format!("{flag} {strikes}"));
        let [a, b] = self.worst.map(|part| format!("{:+.2}", 100.0 * part));
        let kind = format!("{:?} {:.0} mm", self.material, self.diameter_m * 1e3).to_lowercase();
        [
            kind + &output::either(self.row, ", row of ten", ""),
            format!("{} of {}", self.strikes, self.struck),
            a,
            b,
            doubts.collect::<Vec<_>>().join(", "),
        ]
    }
}

/// Strikes one bead of a kind, or a row of ten, `strikes` times at each velocity or bead. The noise is that
/// of `seed`.
pub(super) fn strike(
    (material, diameter_m): (SphereMaterial, f64),
    row: bool,
    strikes: u32,
    stated: Uncertainty,
    seed: u64,
) -> Result<HealthyKind, Failure> {
    let mut kind = HealthyKind {
        material,
        diameter_m,
        row,
        struck: 0,
        strikes: 0,
        worst: [0.0; 2],
        flagged: 0,
        doubts: Vec::new(),
    };
    let mut paper = Scenario::paper();
    let (velocities, places) = if row {
        (paper.chain.beads, paper.duration) = ROW_CHAIN;
        paper.intruders[0].beads = ROW.collect();
        (&[ROW_VELOCITY][..], ROW)
    } else {
        (&VELOCITIES[..], ALONE..=ALONE)
    };
    for &velocity in velocities {
        let strike = SphereStrike {
            part: None,
            velocity,
            relaxation: 0.0,
        };
        let (scenario, _) = chain(&strike, &paper, &Bead::paper(), (material, diameter_m));
        let solution = simulate_with_ring_down(&scenario)?;
        for bead in places.clone() {
            kind.add(&scenario, (&solution, bead), strikes, stated, seed)?;
        }
    }
    Ok(kind)
}

impl HealthyKind {
    fn add(
        &mut self,
        scenario: &Scenario,
        (solution, bead): (&Solution, usize),
        strikes: u32,
        stated: Uncertainty,
        seed: u64,
    ) -> Result<(), Failure> {
        let front_end = filled(&StrikePeaks::of(scenario, solution, bead)?);
        let placed = Placed {
            uncertainty: Some(stated),
            ..Placed::alone(bead, None)
        };
        let settings = settings_of(solution, placed, &front_end)?;
        let timing = Timing {
            lead_in: LEAD_IN,
            strikes,
            interval: INTERVAL,
        };
        let truth = Truth::of(scenario, solution, bead)?.absorbed;
        self.struck += strikes as usize;
        // Each bead has noise of its own.
        let noise = seed.wrapping_mul(1000).wrapping_add(self.struck as u64);
        for (strike, _) in measured(&settings, &front_end, (solution, bead), timing, noise) {
            self.strikes += 1;
            let energies = [strike.absorbed_measured, strike.absorbed_predicted];
            for (worst, energy) in self.worst.iter_mut().zip(energies) {
                let off = energy.joules() / truth - 1.0;
                if off.abs() > worst.abs() {
                    *worst = off;
                }
            }
            let doubts = strike.flags.without(StrikeFlags::FROM_OUTSIDE);
            self.flagged += usize::from(doubts != StrikeFlags::NONE);
            for flag in doubts.names() {
                match self.doubts.iter_mut().find(|(name, _)| *name == flag) {
                    Some((_, strikes)) => *strikes += 1,
                    None => self.doubts.push((flag, 1)),
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bead_bench::coverage::careful_laboratory;

    #[test]
    fn healthy_strikes_at_ten_kinds_of_beads_flag_no_doubt() {
        for kind in KINDS {
            for row in [false, true] {
                let struck = strike(kind, row, 1, careful_laboratory(), 1).unwrap();
                assert!(struck.struck == 10 && struck.holds(), "{struck:?}");
            }
        }
    }
}
