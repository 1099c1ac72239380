//! The search for the best intruders.

use std::cell::Cell;

use rayon::prelude::*;
use serde::Serialize;

use super::error::OptimiseError;
use super::objective::Objective;
use super::problem::{Problem, SearchObserver, TriedDesign};
use super::remaining::Remaining;
use super::search::Search;
use super::spread::{Deviation, Spread, deviating};
use crate::ensemble::Prefixes;
use crate::scenario::{Intruder, MOST_BEADS, Scenario};
use crate::simulate::{Accuracy, SimulateError};

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
    /// Share as the search found it, at its own accuracy; under a spread, the worst of its corners.
    pub share_searched: f64,
    /// The least of that for intruders that are all alike.
    pub share_alike: f64,
    /// Change of the share if the chain is made twice as long: the influence of the far end. If it is
    /// not near zero, a wave came back from there, and its energy was counted as absorbed the second time.
    pub far_end: f64,
    /// The worst value under the search's spread, beside that of the plain optimum. `None` without a spread.
    pub robustness: Option<Robustness>,
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

/// A robust design beside the optimum for exact springs and dampers, all at [`Accuracy::REFERENCE`].
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
#[non_exhaustive]
pub struct Robustness {
    /// The deviations, common to all intruders.
    pub spread: Spread,
    /// The worst share of the robust design at the corners of the spread, the middles of its edges, and the
    /// nominal values.
    pub worst: f64,
    /// Factors of stiffness and damping at which it is worst.
    pub worst_at: [f64; 2],
    /// The intruders that are best if nothing deviates.
    pub plain: Vec<Intruder>,
    /// Their share if nothing deviates.
    pub plain_share: f64,
    /// Their worst share.
    pub plain_worst: f64,
    /// Factors of stiffness and damping at which they are worst.
    pub plain_worst_at: [f64; 2],
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
/// Under a [`Search::spread`], the optimum without it is found first, and the robust design then.
///
/// # Errors
/// [`OptimiseError`]: a value of scenario or search is out of range, or a run cannot go on.
pub fn optimise(
    scenario: &Scenario,
    search: &Search,
    watch: Option<&SearchObserver<'_>>,
) -> Result<Optimum, OptimiseError> {
    search.check(scenario)?;
    if search.spread.is_none() {
        return best_of(scenario, search, None, watch);
    }
    let mut exact = search.clone();
    exact.spread = Spread::default();
    let plain = best_of(scenario, &exact, None, watch)?;
    let mut robust = best_of(scenario, search, Some(&plain.intruders), watch)?;
    let (mut worst, mut worst_at) = worst_of(scenario, search, &robust)?;
    let (plain_worst, plain_worst_at) = worst_of(scenario, search, &plain)?;
    if plain_worst < worst {
        // The search was stopped, or spent its evaluations, before it came as far as where it began.
        (worst, worst_at) = (plain_worst, plain_worst_at);
        robust = Optimum {
            share_searched: plain_worst,
            share_alike: robust.share_alike,
            evaluations: robust.evaluations,
            settled: robust.settled,
            descents: robust.descents,
            in_vain: robust.in_vain,
            stopped: robust.stopped,
            ..plain.clone()
        };
    }
    robust.robustness = Some(Robustness {
        spread: search.spread,
        worst,
        worst_at,
        plain: plain.intruders,
        plain_share: plain.share,
        plain_worst,
        plain_worst_at,
    });
    Ok(robust)
}

/// The worst share of an optimum at the corners and edges of the search's spread, and where.
fn worst_of(
    scenario: &Scenario,
    search: &Search,
    optimum: &Optimum,
) -> Result<(f64, Deviation), SimulateError> {
    let speeds = search.strikes(scenario);
    let at = |deviation: Deviation| {
        let mut other = scenario.clone();
        other.intruders = deviating(&optimum.intruders, deviation);
        let strikes = speeds.iter().zip(&optimum.without);
        let share = |(&speed, without): (&f64, &f64)| {
            let value = search.objective.at(&other, speed, Accuracy::REFERENCE)?;
            Ok(value / without)
        };
        let shares = strikes.map(share).collect::<Result<Vec<f64>, SimulateError>>()?;
        Ok((search.aim.of(&shares), deviation))
    };
    let deviations = search.spread.corners_and_edges();
    let all = deviations.into_par_iter().map(at);
    let all = all.collect::<Result<Vec<_>, SimulateError>>()?;
    let worst = all.into_iter().max_by(|a, b| a.0.total_cmp(&b.0));
    Ok(worst.expect("a spread has corners"))
}

/// Replaces the best design by a better one.
fn take(best: &mut TriedDesign, found: TriedDesign) {
    if found.value < best.value {
        *best = found;
    }
}

/// Descends from fresh starts about the best design. Returns the number of the last ones that were in vain.
fn try_elsewhere(problem: &Problem<'_>, best: &mut TriedDesign) -> Result<usize, SimulateError> {
    let (mut in_vain, mut number) = (0, 0);
    while in_vain < IN_VAIN && problem.left() > 0 && !problem.stopped.get() {
        number += 1;
        let found = problem.descend(problem.restart(best, number), problem.left())?;
        // A descent whose evaluations were spent had no chance.
        let settled = found.settled;
        let gained = found.value < best.value - GAINED;
        take(best, found);
        if !settled {
            break;
        }
        in_vain = if gained { 0 } else { in_vain + 1 };
    }
    Ok(in_vain)
}

/// Finds the best intruders, from `first` too.
fn best_of(
    scenario: &Scenario,
    search: &Search,
    first: Option<&[Intruder]>,
    watch: Option<&SearchObserver<'_>>,
) -> Result<Optimum, OptimiseError> {
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
    if let Some(first) = first {
        take(
            &mut best,
            problem.descend(problem.start_at(first), problem.left() / 4)?,
        );
    }
    if !alone {
        // A third of what is left is for fresh starts.
        let starts = problem.starts(&best);
        for (index, start) in starts.iter().enumerate() {
            let most = problem.left() * 2 / 3 / (starts.len() - index);
            take(&mut best, problem.descend(start.clone(), most)?);
        }
    }
    let in_vain = try_elsewhere(&problem, &mut best)?;
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
        robustness: None,
        evaluations: problem.sofar.get().evaluations,
        settled,
        descents: problem.sofar.get().descents,
        in_vain,
        stopped: problem.stopped.get(),
    })
}
