//! Designs and the objective's value of each.

use std::cell::Cell;
use std::ops::ControlFlow;

use rayon::prelude::*;

use super::remaining::{Remaining, remaining, struck_at};
use super::search::{COARSE, Search};
use super::spread::deviating;
use crate::ensemble::{EnsembleOptions, Prefixes, ensemble_on};
use crate::scenario::{Intruder, Scenario};
use crate::simulate::{Accuracy, SimulateError};

/// Progress of a search.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct SearchProgress {
    /// Designs tried.
    pub evaluations: usize,
    /// The least value of the objective among them, as a part of that without intruders.
    pub best: Option<f64>,
    /// Descents begun.
    pub descents: usize,
}

/// Called often with the progress of a search, which ends with the best design so far if this returns
/// `Break`.
pub type SearchObserver<'a> = dyn Fn(SearchProgress) -> ControlFlow<()> + Sync + 'a;

/// Mass, kg, stiffness, N/m, and damping, N·s/m.
pub(super) type Properties = [f64; 3];

/// A design and its value of the objective.
#[derive(Debug, Clone)]
pub(super) struct TriedDesign {
    /// One entry for each host, or one for all.
    pub(super) design: Vec<Properties>,
    pub(super) value: f64,
    pub(super) settled: bool,
}

/// Stiffnesses of a ramp go from 1/RAMP at one end of the hosts to RAMP at the other.
const RAMP: f64 = 4.0;
/// Factors by which fresh starts differ from the best design, in turn: small, for a valley left too early.
const APART: [f64; 3] = [1.3, 2.0, 4.0];
/// Bodies of the chains computed at once, between checks for a stop: 80 MB.
const TOGETHER: usize = 1 << 19;
/// Least designs computed at once, for any length of chain: enough to share the wave's way to the first host.
const LEAST_TOGETHER: usize = 16;

pub(super) struct Problem<'a> {
    pub(super) bare: Scenario,
    pub(super) hosts: Vec<usize>,
    pub(super) search: &'a Search,
    pub(super) speeds: Vec<f64>,
    /// The objective's value at each speed without intruders.
    pub(super) scales: Vec<f64>,
    pub(super) watch: Option<&'a SearchObserver<'a>>,
    /// Motion that designs have in common.
    pub(super) prefixes: Prefixes,
    /// Progress of the search.
    pub(super) sofar: Cell<SearchProgress>,
    /// True once the search was asked to stop.
    pub(super) stopped: Cell<bool>,
}

impl Problem<'_> {
    /// Returns the intruders of a design, all alike if it has one entry.
    pub(super) fn intruders(&self, design: &[Properties]) -> Vec<Intruder> {
        let intruder = |(&bead, &[mass, stiffness, damping]): (&usize, &Properties)| Intruder {
            beads: vec![bead],
            mass,
            stiffness,
            damping: self.search.damping_of([mass, stiffness, damping]),
            cubic_stiffness: 0.0,
        };
        let hosts = self.hosts.iter().zip(design.iter().cycle());
        hosts.map(intruder).collect()
    }

    pub(super) fn strikes(
        &self,
        scenario: &Scenario,
        accuracy: Accuracy,
    ) -> Result<Vec<Remaining>, SimulateError> {
        let strikes = self.speeds.par_iter();
        strikes
            .map(|&speed| remaining(scenario, speed, accuracy))
            .collect()
    }

    /// Returns the objective's value for a scenario at each speed, at the reference accuracy, in its own
    /// unit.
    pub(super) fn values(&self, scenario: &Scenario) -> Result<Vec<f64>, SimulateError> {
        let objective = self.search.objective;
        let strikes = self.speeds.par_iter();
        strikes
            .map(|&speed| objective.at(scenario, speed, Accuracy::REFERENCE))
            .collect()
    }

    /// Returns the objective's value at each corner of the spread and each speed for each design, as a part
    /// of that without intruders; of the designs tried before the search was asked to stop.
    pub(super) fn shares(&self, designs: &[Vec<Properties>]) -> Result<Vec<Vec<f64>>, SimulateError> {
        let objective = self.search.objective;
        let peaks = objective.peaks();
        let options = EnsembleOptions::default().with_peaks(&peaks);
        let corners = self.search.spread.corners();
        let runs = corners.len() * self.speeds.len();
        let bodies = runs * (self.bare.chain.beads + 1);
        let mut found = Vec::with_capacity(designs.len());
        for designs in designs.chunks((TOGETHER / bodies).max(LEAST_TOGETHER)) {
            if self.stopped.get() {
                break;
            }
            let mut scenarios = Vec::new();
            for design in designs {
                let intruders = self.intruders(design);
                for &corner in &corners {
                    for &speed in &self.speeds {
                        let mut scenario = struck_at(&self.bare, speed);
                        scenario.intruders = deviating(&intruders, corner);
                        scenarios.push(scenario);
                    }
                }
            }
            let outcomes = ensemble_on(&scenarios, &options, &self.prefixes);
            let strikes = scenarios.iter().zip(self.scales.iter().cycle());
            let shares = outcomes
                .into_iter()
                .zip(strikes)
                .map(|(outcome, (struck, scale))| {
                    let value = objective.of(struck, &outcome?)?;
                    Ok(value / scale)
                });
            let shares = shares.collect::<Result<Vec<f64>, SimulateError>>()?;
            found.extend(shares.chunks(runs).map(<[f64]>::to_vec));
            let mut sofar = self.sofar.get();
            sofar.evaluations += designs.len();
            self.tell(sofar);
        }
        Ok(found)
    }

    /// Number of evaluations left.
    pub(super) fn left(&self) -> usize {
        let made = self.sofar.get().evaluations;
        self.search.evaluations.saturating_sub(made)
    }

    /// Reports the progress of the search, and notes a request to stop.
    pub(super) fn tell(&self, sofar: SearchProgress) {
        self.sofar.set(sofar);
        if let Some(watch) = self.watch
            && watch(sofar).is_break()
        {
            self.stopped.set(true);
        }
    }

    /// Notes the share of a design if it is the best so far.
    pub(super) fn note(&self, share: f64) {
        let mut sofar = self.sofar.get();
        if sofar.best.is_none_or(|best| share < best) {
            sofar.best = Some(share);
            self.sofar.set(sofar);
        }
    }

    /// Returns the best of a grid of designs with alike intruders, or of the part tried before a stop.
    pub(super) fn coarse(&self) -> Result<TriedDesign, SimulateError> {
        let search = self.search;
        let [masses, stiffnesses, dampings] = COARSE;
        let dampings = if search.loss_factor.is_some() { 1 } else { dampings };
        let heaviest = search.mass[1].min(search.total_mass / self.hosts.len() as f64);
        // Points between the bounds, without the ends.
        let inside = |[low, high]: [f64; 2], index: usize, count: usize| {
            low * (high / low).powf((index as f64 + 0.5) / count as f64)
        };
        let point = |index: usize| {
            let (i, rest) = (index / (stiffnesses * dampings), index % (stiffnesses * dampings));
            let mass = (heaviest * 0.5f64.powi(i as i32)).max(search.mass[0]);
            let stiffness = inside(search.stiffness, rest / dampings, stiffnesses);
            vec![[mass, stiffness, inside(search.damping, rest % dampings, dampings)]]
        };
        let designs: Vec<_> = (0..masses * stiffnesses * dampings).map(point).collect();
        let shares = self.shares(&designs)?;
        let values: Vec<f64> = shares.iter().map(|shares| self.search.value(shares)).collect();
        let best = (0..values.len())
            .min_by(|&a, &b| values[a].total_cmp(&values[b]))
            .expect("the first designs are tried before anybody can stop the search");
        self.note(values[best]);
        Ok(TriedDesign {
            design: designs[best].clone(),
            value: values[best],
            settled: false,
        })
    }

    /// Returns the design of these intruders.
    pub(super) fn start_at(&self, intruders: &[Intruder]) -> TriedDesign {
        let entries = if self.search.alike { 1 } else { intruders.len() };
        let of = |intruder: &Intruder| [intruder.mass, intruder.stiffness, intruder.damping];
        TriedDesign {
            design: intruders[..entries].iter().map(of).collect(),
            value: f64::INFINITY,
            settled: false,
        }
    }

    /// Returns the designs from which each intruder varies by itself.
    pub(super) fn starts(&self, alike: &TriedDesign) -> Vec<TriedDesign> {
        let middle = (self.hosts.len() - 1) as f64 / 2.0;
        let [low, high] = self.search.stiffness;
        let [mass, stiffness, damping] = alike.design[0];
        let start = |slope: f64| {
            let ramp = |index: usize| RAMP.powf(slope * (index as f64 - middle) / middle);
            let of_host = |index| [mass, (stiffness * ramp(index)).clamp(low, high), damping];
            TriedDesign {
                design: (0..self.hosts.len()).map(of_host).collect(),
                value: if slope == 0.0 { alike.value } else { f64::INFINITY },
                settled: false,
            }
        };
        [0.0, 1.0, -1.0].map(start).into()
    }

    /// Returns a design near the best by factors of up to one of [`APART`] that depend on `number` alone.
    pub(super) fn restart(&self, best: &TriedDesign, number: usize) -> TriedDesign {
        let apart = APART[number % APART.len()];
        let mut state = 0x9e37_79b9_7f4a_7c15_u64.wrapping_mul(number as u64 + 1);
        let mut factor = || {
            // Xorshift.
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            let part = (state >> 11) as f64 / (1_u64 << 53) as f64;
            apart.powf(2.0 * part - 1.0)
        };
        let mut design: Vec<Properties> = best.design.clone();
        design.iter_mut().flatten().for_each(|value| *value *= factor());
        let each = if design.len() == 1 { self.hosts.len() } else { 1 };
        let total = each as f64 * design.iter().map(|[mass, ..]| mass).sum::<f64>();
        let most = (self.search.total_mass / total).min(1.0);
        design.iter_mut().for_each(|[mass, ..]| *mass *= most);
        TriedDesign {
            design,
            value: f64::INFINITY,
            settled: false,
        }
    }
}
