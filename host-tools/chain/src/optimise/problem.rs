//! Designs, and the energy that they leave.

use rayon::prelude::*;

use super::remaining::{Remaining, remaining};
use super::search::{Aim, COARSE, Search};
use crate::scenario::{Intruder, Scenario};
use crate::simulate::{Accuracy, SimulateError};

/// Mass, stiffness, damping.
pub(super) type Properties = [f64; 3];

/// A design and the share that it leaves.
#[derive(Debug, Clone)]
pub(super) struct Tried {
    /// One entry a host, or one for all.
    pub(super) design: Vec<Properties>,
    pub(super) value: f64,
    pub(super) settled: bool,
}

/// Stiffnesses of a ramp go from 1/RAMP at one end of the hosts to RAMP at the other.
const RAMP: f64 = 4.0;
/// Exponent of the power mean that stands for the greatest share. Of three speeds it is at most 1.7 % below
/// it.
const POWER: f64 = 64.0;

pub(super) struct Problem<'a> {
    pub(super) bare: Scenario,
    pub(super) hosts: Vec<usize>,
    pub(super) search: &'a Search,
    pub(super) speeds: Vec<f64>,
    pub(super) progress: Option<&'a (dyn Fn(f64) + Sync)>,
}

impl Problem<'_> {
    /// The intruders of a design; they are all alike if it has one entry.
    pub(super) fn intruders(&self, design: &[Properties]) -> Vec<Intruder> {
        self.hosts
            .iter()
            .enumerate()
            .map(|(index, &bead)| {
                let [mass, stiffness, damping] = design[if design.len() == 1 { 0 } else { index }];
                Intruder {
                    beads: vec![bead],
                    mass,
                    stiffness,
                    damping,
                }
            })
            .collect()
    }

    pub(super) fn strikes(
        &self,
        scenario: &Scenario,
        accuracy: Accuracy,
    ) -> Result<Vec<Remaining>, SimulateError> {
        self.speeds
            .par_iter()
            .map(|&speed| remaining(scenario, speed, accuracy))
            .collect()
    }

    /// The shares that remain at each speed, for each set of intruders.
    pub(super) fn shares(
        &self,
        sets: Vec<Vec<Intruder>>,
        spent: &mut usize,
    ) -> Result<Vec<Vec<f64>>, SimulateError> {
        *spent += sets.len();
        let shares = sets
            .into_par_iter()
            .map(|intruders| {
                let mut scenario = self.bare.clone();
                scenario.intruders = intruders;
                let strikes = self.strikes(&scenario, self.search.accuracy)?;
                Ok(strikes.iter().map(|strike| strike.share).collect())
            })
            .collect();
        if let Some(progress) = self.progress {
            progress(*spent as f64 / self.search.evaluations as f64);
        }
        shares
    }

    /// The smooth aim that the descent follows.
    pub(super) fn follow(&self, shares: &[f64]) -> f64 {
        match self.search.aim {
            Aim::Mean => self.search.aim.of(shares),
            Aim::Worst => {
                let mean = shares.iter().map(|share| share.powf(POWER)).sum::<f64>() / shares.len() as f64;
                mean.powf(1.0 / POWER)
            }
        }
    }

    /// The best of intruders all alike, on a grid.
    pub(super) fn coarse(&self, spent: &mut usize) -> Result<Tried, SimulateError> {
        let [masses, stiffnesses, dampings] = COARSE;
        let search = self.search;
        let heaviest = search.mass[1].min(search.total_mass / self.hosts.len() as f64);
        // Between the bounds, ends left out.
        let inside = |[low, high]: [f64; 2], index: usize, count: usize| {
            low * (high / low).powf((index as f64 + 0.5) / count as f64)
        };
        let mut designs = Vec::new();
        for i in 0..masses {
            for j in 0..stiffnesses {
                for k in 0..dampings {
                    designs.push(vec![[
                        (heaviest * 0.5f64.powi(i as i32)).max(search.mass[0]),
                        inside(search.stiffness, j, stiffnesses),
                        inside(search.damping, k, dampings),
                    ]]);
                }
            }
        }
        let sets = designs.iter().map(|design| self.intruders(design)).collect();
        let values: Vec<f64> = self
            .shares(sets, spent)?
            .iter()
            .map(|shares| self.search.aim.of(shares))
            .collect();
        let best = (0..values.len())
            .min_by(|&a, &b| values[a].total_cmp(&values[b]))
            .expect("the grid has points");
        Ok(Tried {
            design: designs[best].clone(),
            value: values[best],
            settled: false,
        })
    }

    /// The designs from which each bead goes its own way.
    pub(super) fn starts(&self, alike: &Tried) -> Vec<Tried> {
        let middle = (self.hosts.len() - 1) as f64 / 2.0;
        let [low, high] = self.search.stiffness;
        [0.0, 1.0, -1.0]
            .map(|slope| {
                let design = (0..self.hosts.len())
                    .map(|index| {
                        let [mass, stiffness, damping] = alike.design[0];
                        let ramp = RAMP.powf(slope * (index as f64 - middle) / middle);
                        [mass, (stiffness * ramp).clamp(low, high), damping]
                    })
                    .collect();
                Tried {
                    design,
                    value: if slope == 0.0 { alike.value } else { f64::INFINITY },
                    settled: false,
                }
            })
            .into()
    }
}
