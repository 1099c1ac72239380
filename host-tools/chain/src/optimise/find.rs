//! The search for the best intruders.

use serde::Serialize;

use super::problem::Problem;
use super::remaining::Remaining;
use super::search::{OptimiseError, Search};
use crate::scenario::{Intruder, MOST_BEADS, Scenario};
use crate::simulate::Accuracy;

/// The best intruders that were found.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Optimum {
    /// One intruder a host, in the order of the beads.
    pub intruders: Vec<Intruder>,
    /// What remains at each speed, at [`Accuracy::REFERENCE`].
    pub strikes: Vec<Remaining>,
    /// The aim over these strikes.
    pub share: f64,
    /// The same as the search found it, at its own accuracy.
    pub share_searched: f64,
    /// The least share of intruders that are all alike, at the search's accuracy.
    pub share_alike: f64,
    /// How much the share changes if the chain is made twice as long: the influence of the far end. If it is
    /// not near zero, a wave came back from there, and its energy was counted as absorbed the second time.
    pub far_end: f64,
    /// Number of designs tried.
    pub evaluations: usize,
    /// Whether the descent that led here found no better design near by. If not, it spent its part of the
    /// evaluations.
    pub settled: bool,
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

/// Finds the intruders that leave the least energy. The scenario's own are left out. `progress` is called
/// with the part of the evaluations spent. The same input gives the same result, on any number of processors.
///
/// The result is a local optimum, the best of four descents (of one if [`Search::alike`]). Nothing proves
/// that there is no better one.
///
/// # Errors
/// [`OptimiseError`]: a value of scenario or search is out of range, or a run cannot go on.
pub fn optimise(
    scenario: &Scenario,
    search: &Search,
    progress: Option<&(dyn Fn(f64) + Sync)>,
) -> Result<Optimum, OptimiseError> {
    search.check(scenario)?;
    let mut hosts = search.hosts.clone();
    hosts.sort_unstable();
    let mut bare = scenario.clone();
    bare.intruders.clear();
    let speeds = if search.speeds.is_empty() {
        vec![scenario.striker.velocity]
    } else {
        search.speeds.clone()
    };
    let problem = Problem {
        bare,
        hosts,
        search,
        speeds,
        progress,
    };

    let mut spent = 0;
    let coarse = problem.coarse(&mut spent)?;
    let most = spent + (search.evaluations - spent) / if search.alike { 1 } else { 8 };
    let alike = problem.descend(coarse, most, &mut spent)?;
    let share_alike = alike.value;
    let mut best = alike;
    if !search.alike && problem.hosts.len() > 1 {
        let starts = problem.starts(&best);
        for (index, start) in starts.iter().enumerate() {
            let most = spent + (search.evaluations - spent) / (starts.len() - index);
            let found = problem.descend(start.clone(), most, &mut spent)?;
            if found.value < best.value {
                best = found;
            }
        }
    }

    let mut intruders = problem.intruders(&best.design);
    // Take back the rounding that breaks the bound on the sum.
    let total: f64 = intruders.iter().map(|intruder| intruder.mass).sum();
    for intruder in &mut intruders {
        intruder.mass *= (search.total_mass / total).min(1.0);
    }
    let mut scenario = problem.bare.clone();
    scenario.intruders.clone_from(&intruders);
    let strikes = problem.strikes(&scenario, Accuracy::REFERENCE)?;
    let mut longer = scenario;
    longer.chain.beads = (2 * longer.chain.beads).min(MOST_BEADS);
    let longer = problem.strikes(&longer, Accuracy::REFERENCE)?;
    let shares: Vec<f64> = strikes.iter().map(|strike| strike.share).collect();
    let pairs = shares.iter().zip(&longer);
    let changes = pairs.map(|(share, longer)| (share - longer.share).abs());
    let far_end = changes.fold(0.0, f64::max);
    Ok(Optimum {
        intruders,
        share: search.aim.of(&shares),
        strikes,
        share_searched: best.value,
        share_alike,
        far_end,
        evaluations: spent,
        settled: best.settled,
    })
}
