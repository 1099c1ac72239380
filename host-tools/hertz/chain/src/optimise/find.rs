//! The search for the best intruders.

use std::cell::Cell;

use serde::Serialize;

use super::error::OptimiseError;
use super::objective::Objective;
use super::problem::{Problem, SearchObserver, TriedDesign};
use super::remaining::Remaining;
use super::search::Search;
use crate::ensemble::Prefixes;
use crate::scenario::{Intruder, MOST_BEADS, Scenario};
use crate::simulate::Accuracy;

/// The best intruders that were found.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
#[non_exhaustive]
pub struct Optimum {
    /// One intruder a host, in the order of the beads.
    pub intruders: Vec<Intruder>,
    /// The quantity that was made small.
    pub objective: Objective,
    /// Its value at each speed, at [`Accuracy::REFERENCE`], in its own unit ([`Objective::unit`]).
    pub values: Vec<f64>,
    /// Its value at each speed without intruders, of which shares are parts; 1 for [`Objective::Remaining`].
    pub without: Vec<f64>,
    /// Remaining energy at each speed, at [`Accuracy::REFERENCE`].
    pub strikes: Vec<Remaining>,
    /// The aim over the values, each as a part of that without intruders.
    pub share: f64,
    /// Share as the search found it, at its own accuracy.
    pub share_searched: f64,
    /// The least share of intruders that are all alike, at the search's accuracy.
    pub share_alike: f64,
    /// Change of the share if the chain is made twice as long: the influence of the far end. If it is
    /// not near zero, a wave came back from there, and its energy was counted as absorbed the second time.
    pub far_end: f64,
    /// Number of designs tried.
    pub evaluations: usize,
    /// True if the search ended by itself: nothing better was near this design, and [`Optimum::in_vain`]
    /// descents in succession from elsewhere found nothing better either. If not, it spent its evaluations or
    /// was stopped.
    pub settled: bool,
    /// Descents made, each until nothing near its end was better.
    pub descents: usize,
    /// Number of the last descents, from fresh starts about the best design, that led to nothing better.
    pub in_vain: usize,
    /// True if the search was asked to stop.
    pub stopped: bool,
}

impl Optimum {
    /// The scenario with these intruders in place of its own.
    pub fn scenario(&self, scenario: &Scenario) -> Scenario {
        Scenario {
            intruders: self.intruders.clone(),
            ..scenario.clone()
        }
    }
}

/// Descents in vain after which a search ends.
const IN_VAIN: usize = 3;
/// Least gain of a useful descent, in the share.
const GAINED: f64 = 1e-6;

/// Finds the intruders with the least value of the search's objective. The scenario's own are left out.
/// `watch` hears how far the search has come and may stop it. The same input gives the same result, on any
/// number of processors.
///
/// The result is a local optimum, the best of several descents. Nothing proves that there is no better one.
/// Designs are compared with [`ensemble`](crate::ensemble()), and the result is run again at
/// [`Accuracy::REFERENCE`].
///
/// # Errors
/// [`OptimiseError`]: a value of scenario or search is out of range, or a run cannot go on.
pub fn optimise(
    scenario: &Scenario,
    search: &Search,
    watch: Option<&SearchObserver<'_>>,
) -> Result<Optimum, OptimiseError> {
    search.check(scenario)?;
    let mut hosts = search.hosts.clone();
    hosts.sort_unstable();
    let mut bare = scenario.clone();
    bare.intruders.clear();
    let speeds = search.strikes(scenario);
    let scales = speeds.iter().map(|&speed| search.objective.scale(&bare, speed));
    let scales = scales.collect::<Result<Vec<_>, _>>()?;
    let problem = Problem {
        bare,
        hosts,
        search,
        speeds,
        scales,
        watch,
        prefixes: Prefixes::default(),
        sofar: Cell::default(),
        stopped: Cell::new(false),
    };
    let coarse = problem.coarse()?;
    let alone = search.alike || problem.hosts.len() == 1;
    let most = problem.left() / if search.alike { 1 } else { 8 };
    let mut best = problem.descend(coarse, most)?;
    let share_alike = best.value;
    let take = |best: &mut TriedDesign, found: TriedDesign| {
        if found.value < best.value {
            *best = found;
        }
    };
    if !alone {
        // A third of what is left is for fresh starts.
        let starts = problem.starts(&best);
        for (index, start) in starts.iter().enumerate() {
            let most = problem.left() * 2 / 3 / (starts.len() - index);
            take(&mut best, problem.descend(start.clone(), most)?);
        }
    }
    let mut in_vain = 0;
    let mut number = 0;
    while in_vain < IN_VAIN && problem.left() > 0 && !problem.stopped.get() {
        number += 1;
        let found = problem.descend(problem.restart(&best, number), problem.left())?;
        // A descent whose evaluations were spent had no chance.
        let settled = found.settled;
        let gained = found.value < best.value - GAINED;
        take(&mut best, found);
        if !settled {
            break;
        }
        in_vain = if gained { 0 } else { in_vain + 1 };
    }
    let settled = best.settled && in_vain == IN_VAIN;

    let mut intruders = problem.intruders(&best.design);
    // Take back the rounding that breaks the bound on the sum.
    let total: f64 = intruders.iter().map(|intruder| intruder.mass).sum();
    for intruder in &mut intruders {
        intruder.mass *= (search.total_mass / total).min(1.0);
    }
    let mut scenario = problem.bare.clone();
    scenario.intruders.clone_from(&intruders);
    let strikes = problem.strikes(&scenario, Accuracy::REFERENCE)?;
    let mut longer = scenario.clone();
    longer.chain.beads = (2 * longer.chain.beads).min(MOST_BEADS);
    let values = problem.values(&scenario)?;
    let longer = problem.values(&longer)?;
    let parts = |values: &[f64]| -> Vec<f64> {
        let parts = values.iter().zip(&problem.scales);
        parts.map(|(value, scale)| value / scale).collect()
    };
    let shares = parts(&values);
    let changes = shares.iter().zip(parts(&longer));
    let far_end = changes
        .map(|(share, longer)| (share - longer).abs())
        .fold(0.0, f64::max);
    Ok(Optimum {
        intruders,
        objective: search.objective,
        values,
        without: problem.scales.clone(),
        share: search.aim.of(&shares),
        strikes,
        share_searched: best.value,
        share_alike,
        far_end,
        evaluations: problem.sofar.get().evaluations,
        settled,
        descents: problem.sofar.get().descents,
        in_vain,
        stopped: problem.stopped.get(),
    })
}
