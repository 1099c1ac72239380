//! The search for the best intruders.

use rayon::prelude::*;
use serde::Serialize;

use super::design::{BeadRadius, Design, with_radii};
use super::error::OptimiseError;
use super::objective::Objective;
use super::problem::{Problem, SearchObserver, TriedDesign};
use super::remaining::{Remaining, struck_at};
use super::search::Search;
use super::spread::{Deviation, Spread, deviating};
use super::springs::SpringChoice;
use crate::ensemble::{EnsembleOptions, single};
use crate::scenario::{InputError, Intruder, MOST_BEADS, Scenario};
use crate::simulate::{Accuracy, SimulateError};

/// The best intruders that were found.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
#[non_exhaustive]
pub struct Optimum {
    /// One intruder a host, in the order of the beads.
    pub intruders: Vec<Intruder>,
    /// The radii of the beads that the search could vary.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub radii: Vec<BeadRadius>,
    /// The quantity that was made small.
    pub objective: Objective,
    /// Its value at each speed, at [`Accuracy::REFERENCE`], in its own unit ([`Objective::unit`]).
    pub values: Vec<f64>,
    /// Its value at each speed without intruders, on the scenario's own beads, of which shares are parts; 1
    /// for [`Objective::Remaining`].
    pub without: Vec<f64>,
    /// Remaining energy at each speed, at [`Accuracy::REFERENCE`].
    pub strikes: Vec<Remaining>,
    /// The aim over the values, each as a part of that without intruders.
    pub share: f64,
    /// Share as the search found it, at its own accuracy; under a spread, the worst of its corners.
    pub share_searched: f64,
    /// The least of that for intruders that are all alike.
    pub share_alike: f64,
    /// Greatest displacement |x| of each intruder from rest in its host over all strikes, under a spread at
    /// all of its corners, m.
    #[serde(rename = "strokes_m")]
    pub strokes: Vec<f64>,
    /// Change of the share if the chain is made twice as long: the influence of the far end. If it is
    /// not near zero, a wave came back from there, and its energy was counted as absorbed the second time.
    pub far_end: f64,
    /// The springs that were chosen from the search's catalogue. `None` without one.
    pub springs: Option<SpringChoice>,
    /// The worst value under the search's spread, beside that of the plain optimum. `None` without a spread.
    pub robustness: Option<Robustness>,
    /// Runs made, one for each design tried. A gradient that is exact counts as the
    /// [`Search::GRADIENT_RUNS`] that it takes as long as.
    pub evaluations: usize,
    /// Exact gradients among them.
    pub gradients: usize,
    /// True if the search ended by itself: nothing better was near this design, and [`Optimum::in_vain`]
    /// descents in succession from elsewhere found nothing better either. If not, it spent its evaluations or
    /// was stopped.
    pub settled: bool,
    /// Descents made, each to an end of its own.
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
    /// The radii of the beads that belong to them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub plain_radii: Vec<BeadRadius>,
    /// Their share if nothing deviates.
    pub plain_share: f64,
    /// Their worst share.
    pub plain_worst: f64,
    /// Factors of stiffness and damping at which they are worst.
    pub plain_worst_at: [f64; 2],
    /// Greatest displacement |x| of each at the corners, m. They keep a limit if nothing deviates, and may
    /// break it here.
    #[serde(rename = "plain_strokes_m")]
    pub plain_strokes: Vec<f64>,
}

impl Optimum {
    /// The scenario with these intruders and radii in place of its own.
    pub fn scenario(&self, scenario: &Scenario) -> Scenario {
        Scenario {
            intruders: self.intruders.clone(),
            ..with_radii(scenario, self.radii.iter().copied())
        }
    }
}

/// Descents in vain after which a search ends.
const IN_VAIN: usize = 6;

/// Finds the intruders with the least value of the search's objective. The scenario's own are left out.
/// `watch` is called with the progress of the search and may stop it. The same input gives the same result,
/// on any number of processors.
///
/// The result is a local optimum, the best of several descents. Nothing proves that there is no better one.
/// Designs are compared with [`ensemble`](crate::ensemble()), and the result is run again at
/// [`Accuracy::REFERENCE`].
///
/// Under a [`Search::spread`], the optimum without it is found first, then the robust design. With
/// [`Search::hosts_at_most`], the hosts are chosen beforehand; with a [`Search::catalogue`], the springs are
/// chosen after each optimum with free stiffnesses.
///
/// # Errors
/// [`OptimiseError`]: a value of scenario or search is out of range, or a run cannot go on.
pub fn optimise(
    scenario: &Scenario,
    search: &Search,
    watch: Option<&SearchObserver<'_>>,
) -> Result<Optimum, OptimiseError> {
    search.check(scenario)?;
    let Some(most) = search.hosts_at_most.filter(|&most| most < search.hosts.len()) else {
        return in_all_hosts(scenario, search, None, watch);
    };
    let chosen = Problem::new(scenario, search, watch)?.choose_hosts(most)?;
    let mut found = in_all_hosts(scenario, &chosen.search, Some(chosen.design), watch)?;
    found.evaluations += chosen.sofar.evaluations;
    found.gradients += chosen.sofar.gradients;
    found.descents += chosen.sofar.descents;
    found.settled &= chosen.settled;
    Ok(found)
}

/// Finds the best intruders of all hosts; `first` is an additional start.
fn in_all_hosts(
    scenario: &Scenario,
    search: &Search,
    first: Option<Design>,
    watch: Option<&SearchObserver<'_>>,
) -> Result<Optimum, OptimiseError> {
    if search.spread.is_none() {
        return best_of(scenario, search, first, watch);
    }
    let mut exact = search.clone();
    exact.spread = Spread::default();
    let plain = best_of(scenario, &exact, first, watch)?;
    let first = Problem::new(scenario, search, None)?.design_of(&plain.intruders, &plain.radii);
    let mut robust = best_of(scenario, search, Some(first), watch)?;
    let (mut worst, mut worst_at) = worst_of(scenario, search, &robust)?;
    let (plain_worst, plain_worst_at) = worst_of(scenario, search, &plain)?;
    let plain_strokes = strokes_of(&plain.scenario(scenario), search)?;
    if plain_worst < worst && keeps_limits(search, &plain, &plain_strokes) {
        // The search was stopped, or spent its evaluations, before it was as good as its start.
        (worst, worst_at) = (plain_worst, plain_worst_at);
        robust = Optimum {
            strokes: plain_strokes.clone(),
            share_searched: plain_worst,
            share_alike: robust.share_alike,
            evaluations: robust.evaluations,
            gradients: robust.gradients,
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
        plain_radii: plain.radii,
        plain_share: plain.share,
        plain_worst,
        plain_worst_at,
        plain_strokes,
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
        let mut other = optimum.scenario(scenario);
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

/// The greatest |x| of each intruder of a scenario, m, at every speed and corner of the search's spread.
fn strokes_of(scenario: &Scenario, search: &Search) -> Result<Vec<f64>, SimulateError> {
    let speeds = search.strikes(scenario);
    let corners = search.spread.corners();
    let runs = corners
        .iter()
        .flat_map(|&corner| speeds.iter().map(move |&speed| (corner, speed)));
    let strokes = runs.collect::<Vec<_>>().into_par_iter().map(|(corner, speed)| {
        let mut struck = struck_at(scenario, speed);
        struck.intruders = deviating(&scenario.intruders, corner);
        let options = EnsembleOptions::default().with_strokes();
        Ok(single(&struck, &options, Accuracy::REFERENCE)?.strokes().to_vec())
    });
    let strokes = strokes.collect::<Result<Vec<_>, SimulateError>>()?;
    let greatest = |host: usize| strokes.iter().map(|of| of[host]).fold(0.0, f64::max);
    Ok((0..scenario.intruders.len()).map(greatest).collect())
}

/// Returns true if the intruders of an optimum keep their limits with these strokes, m.
fn keeps_limits(search: &Search, optimum: &Optimum, strokes: &[f64]) -> bool {
    let springs = optimum.springs.iter().flat_map(|choice| &choice.springs);
    let mut own = springs.map(|spring| spring.stroke);
    strokes.iter().all(|&stroke| {
        let mut limits = search.stroke.into_iter().chain(own.next().flatten());
        limits.all(|limit| stroke <= limit)
    })
}

/// The end of a search.
struct Found {
    best: TriedDesign,
    share_alike: f64,
    /// Number of the last descents that were in vain.
    in_vain: usize,
    settled: bool,
    springs: Option<SpringChoice>,
}

impl Problem<'_> {
    /// Descends from fresh starts about the best design. Returns the number of the last ones that were in
    /// vain.
    fn try_elsewhere(&self, best: &mut TriedDesign) -> Result<usize, SimulateError> {
        let (mut in_vain, mut number) = (0, 0);
        while in_vain < IN_VAIN && self.left() > 0 && !self.stopped.get() {
            number += 1;
            let start = self.restart(best, number);
            let found = self.descend(start, &[self.bounds], self.left(), best.rival())?;
            // A descent whose evaluations were spent had no chance.
            let settled = found.settled;
            let gained = found.gains_on(best);
            best.take(found);
            if !settled {
                break;
            }
            in_vain = if gained { 0 } else { in_vain + 1 };
        }
        Ok(in_vain)
    }

    /// Finds the best design; `first` is an additional start.
    fn find(&self, first: Option<Design>) -> Result<Found, OptimiseError> {
        let (search, bounds) = (self.search, [self.bounds]);
        let coarse = self.coarse()?;
        let alone = search.alike || self.hosts.len() == 1;
        let most = self.left() / if search.alike { 1 } else { 8 };
        let mut best = coarse[0].clone();
        for start in coarse {
            best.take(self.descend(start, &bounds, most, f64::INFINITY)?);
        }
        let share_alike = best.value;
        if let Some(first) = first {
            let (first, most) = (TriedDesign::untried(first), self.left() / 4);
            best.take(self.descend(first, &bounds, most, f64::INFINITY)?);
        }
        if !alone {
            // A third of what is left is for fresh starts.
            let starts = self.starts(&best);
            for (index, start) in starts.iter().enumerate() {
                let most = self.left() * 2 / 3 / (starts.len() - index);
                best.take(self.descend(start.clone(), &bounds, most, best.rival())?);
            }
        }
        let in_vain = self.try_elsewhere(&mut best)?;
        self.check_strokes(&best)?;
        let share_alike = if alone { best.value } else { share_alike };
        let mut found = Found {
            settled: best.settled && in_vain == IN_VAIN,
            best,
            share_alike,
            in_vain,
            springs: None,
        };
        let usable = search.usable_springs()?;
        if !usable.is_empty() {
            self.renew();
            let chosen = self.choose_springs(&usable, &found.best)?;
            found.settled &= chosen.settled;
            found.springs = Some(SpringChoice {
                springs: chosen.springs,
                free: self.intruders(&found.best.design),
                free_share: found.best.value,
                tried: chosen.tried,
            });
            found.best = chosen.best;
        }
        Ok(found)
    }

    /// Refuses a limit on strokes that no design has kept.
    fn check_strokes(&self, best: &TriedDesign) -> Result<(), OptimiseError> {
        let Some(limit) = self.search.stroke.filter(|_| best.excess > 0.0) else {
            return Ok(());
        };
        let mut scenario = self.sized(&best.design);
        scenario.intruders = self.intruders(&best.design);
        let strokes = strokes_of(&scenario, self.search)?;
        let least = strokes.into_iter().fold(0.0, f64::max);
        let what =
            format!("no design keeps to {limit:e} m; the least stroke that was reached is {least:.3e} m");
        let advice = "allow a longer stroke, stiffer springs or stronger dampers";
        Err(OptimiseError::Search(InputError::at("stroke", what, advice)))
    }

    /// Runs the best design again, at the reference accuracy.
    fn optimum(&self, found: Found) -> Result<Optimum, OptimiseError> {
        let (search, best) = (self.search, found.best);
        let mut intruders = self.intruders(&best.design);
        // Take back the rounding that breaks the bound on the sum.
        let total: f64 = intruders.iter().map(|intruder| intruder.mass).sum();
        for intruder in &mut intruders {
            intruder.mass *= (search.total_mass / total).min(1.0);
        }
        let mut scenario = self.sized(&best.design);
        scenario.intruders.clone_from(&intruders);
        let strikes = self.strikes(&scenario, Accuracy::REFERENCE)?;
        let mut longer = scenario.clone();
        longer.chain.beads = (2 * longer.chain.beads).min(MOST_BEADS);
        let values = self.values(&scenario)?;
        let longer = self.values(&longer)?;
        let parts = |values: &[f64]| -> Vec<f64> {
            let parts = values.iter().zip(&self.scales);
            parts.map(|(value, scale)| value / scale).collect()
        };
        let shares = parts(&values);
        let changes = shares.iter().zip(parts(&longer));
        let far_end = changes
            .map(|(share, longer)| (share - longer).abs())
            .fold(0.0, f64::max);
        Ok(Optimum {
            strokes: strokes_of(&scenario, search)?,
            intruders,
            radii: self.radii(&best.design),
            objective: search.objective,
            values,
            without: self.scales.clone(),
            share: search.aim.of(&shares),
            strikes,
            share_searched: best.value,
            share_alike: found.share_alike,
            far_end,
            springs: found.springs,
            robustness: None,
            evaluations: self.sofar.get().evaluations,
            gradients: self.sofar.get().gradients,
            settled: found.settled,
            descents: self.sofar.get().descents,
            in_vain: found.in_vain,
            stopped: self.stopped.get(),
        })
    }
}

/// Finds the best intruders; `first` is an additional start.
fn best_of(
    scenario: &Scenario,
    search: &Search,
    first: Option<Design>,
    watch: Option<&SearchObserver<'_>>,
) -> Result<Optimum, OptimiseError> {
    let problem = Problem::new(scenario, search, watch)?;
    let found = problem.find(first)?;
    problem.optimum(found)
}
