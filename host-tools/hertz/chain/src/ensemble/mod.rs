//! Many chains at once, for sweeps and searches: the energy that remains of each, to a stated error.
//!
//! # Design
//!
//! Chains of one shape, which differ only in numbers, are computed eight at a time, each in a vector lane
//! ([`group`]). Every lane has its own steps ([`method`]) and its own contacts that open and close
//! ([`crossing`]). A chain therefore has the same bits whatever runs beside it, in any order, on any number
//! of threads, and on any processor with fused multiplication and addition. The motion before the wave
//! reaches an intruder is computed once for chains that differ only in their intruders ([`prefix`]). Other
//! chains run one by one, as does a chain that does not reach its end in a group.

mod backwards;
mod chain;
mod crossing;
mod eight;
mod group;
mod kept;
pub(crate) mod method;
mod outcome;
mod peak;
mod prefix;
mod together;
mod turn;

use std::collections::HashSet;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

pub(crate) use self::backwards::{ChainSlopes, EndSlopes};
use self::chain::ChainShape;
pub use self::outcome::EnsembleOutcome;
pub(crate) use self::prefix::Prefixes;
use self::together::GroupMember;
use crate::model::Model;
use crate::options::{Accuracy, SimulateError};
use crate::run::Run;
use crate::scenario::Scenario;
use crate::summariser::Summariser;

/// Options of an ensemble.
#[derive(Clone, Copy, Default)]
#[non_exhaustive]
pub struct EnsembleOptions<'a> {
    /// Contacts whose greatest force is wanted ([`EnsembleOutcome::peaks`]).
    pub peaks: &'a [usize],
    /// True if the stroke of each intruder is wanted ([`EnsembleOutcome::strokes`]).
    pub strokes: bool,
    /// Called now and then with the completed part of the chains, 0 to 1.
    pub progress: Option<&'a (dyn Fn(f64) + Sync)>,
}

impl<'a> EnsembleOptions<'a> {
    /// Sets the contacts whose greatest force is wanted.
    #[must_use]
    pub const fn with_peaks(mut self, contacts: &'a [usize]) -> Self {
        self.peaks = contacts;
        self
    }

    /// Asks for the stroke of each intruder.
    #[must_use]
    pub const fn with_strokes(mut self) -> Self {
        self.strokes = true;
        self
    }

    /// Sets a function that is called with the completed part of the chains, 0 to 1.
    #[must_use]
    pub const fn with_progress(mut self, progress: &'a (dyn Fn(f64) + Sync)) -> Self {
        self.progress = Some(progress);
        self
    }
}

/// Runs many scenarios, each over its duration, on all threads of the present pool. The results are in the
/// order of the scenarios, and each is independent of the others.
///
/// The absorbed energy has a relative error of at most 1e-6, and a greatest force of 1e-5, in chains like the
/// paper's. In chains of mixed spheres, and with stiff intruders, the errors are at most 3e-6 of the
/// striker's energy and 4e-5 of the force. Thousands of random chains were tried; the tests compare them with
/// [`simulate_with`](crate::simulate_with()). Scenarios that differ only in numbers are fast: equally many
/// beads, intruders in the same beads, a wall in all or none. Chains under a load, those with clipped forces
/// and those with springs that harden or soften run one by one.
///
/// # Errors
/// Each scenario has its own [`SimulateError`]; the others run all the same.
pub fn ensemble(
    scenarios: &[Scenario],
    options: &EnsembleOptions<'_>,
) -> Vec<Result<EnsembleOutcome, SimulateError>> {
    ensemble_on(scenarios, options, &Prefixes::default())
}

/// Runs scenarios as [`ensemble`] does, and keeps shared motion in `prefixes` for further calls.
pub(crate) fn ensemble_on(
    scenarios: &[Scenario],
    options: &EnsembleOptions<'_>,
    prefixes: &Prefixes,
) -> Vec<Result<EnsembleOutcome, SimulateError>> {
    let models: Vec<_> = scenarios.par_iter().map(Model::of).collect();
    let mut alone = Vec::new();
    let mut grouped: Vec<(ChainShape, GroupMember<'_>)> = Vec::new();
    for (index, model) in models.iter().enumerate() {
        let Ok(model) = model else { continue };
        match GroupMember::of(index, model, scenarios[index].duration) {
            Some(member) => grouped.push(member),
            None => alone.push(index),
        }
    }
    prefixes.share(&mut grouped, options.peaks);
    // Chains with equal strikes take about equally many steps, so they wait least for each other.
    grouped.sort_by(|(one, a), (other, b)| {
        let speeds = a.model.striker_speed().total_cmp(&b.model.striker_speed());
        one.cmp(other).then(speeds)
    });

    let done = AtomicUsize::new(0);
    let tell = |count: usize| {
        let done = done.fetch_add(count, Ordering::Relaxed) + count;
        if let Some(progress) = options.progress {
            progress(done as f64 / scenarios.len() as f64);
        }
    };
    let alike = grouped.chunk_by(|one, other| one.0 == other.0);
    let groups: Vec<_> = alike.flat_map(|alike| alike.chunks(eight::LANES)).collect();
    let of_groups = groups.into_par_iter().flat_map_iter(|group| {
        let members: Vec<&GroupMember<'_>> = group.iter().map(|(_, member)| member).collect();
        let outcomes = together::run(&group[0].0, &members, (options.peaks, options.strokes));
        tell(group.len());
        let indices = group.iter().map(|(_, member)| member.index);
        indices.zip(outcomes).map(|(index, outcome)| {
            let alone = || single(&scenarios[index], options, ALONE);
            (index, outcome.map_or_else(alone, Ok))
        })
    });
    let mut found: Vec<(usize, Result<EnsembleOutcome, SimulateError>)> = of_groups.collect();
    let one_by_one = alone.into_par_iter().map(|index| {
        let outcome = single(&scenarios[index], options, ALONE);
        tell(1);
        (index, outcome)
    });
    found.par_extend(one_by_one);
    let refused = models.iter().enumerate();
    let refused = refused.filter_map(|(index, model)| Some((index, model.as_ref().err()?.clone())));
    found.extend(refused.map(|(index, error)| (index, Err(error.into()))));
    found.sort_by_key(|(index, _)| *index);
    found.into_iter().map(|(_, outcome)| outcome).collect()
}

/// Runs scenarios of one shape, and finds the derivatives of one number of each with respect to the constants
/// of its chain, as [`together::run_and_back`] does. `None` if a chain has none, or cannot run in a group.
pub(crate) fn slopes_on(
    scenarios: &[Scenario],
    peaks: &[usize],
    prefixes: &Prefixes,
    ends: &(dyn Fn(&EnsembleOutcome) -> Option<EndSlopes> + Sync),
) -> Option<Vec<(EnsembleOutcome, ChainSlopes)>> {
    let models = scenarios.iter().map(|scenario| Model::of(scenario).ok());
    let models = models.collect::<Option<Vec<Model>>>()?;
    let members = models.iter().zip(scenarios).enumerate();
    let members = members.map(|(index, (model, scenario))| GroupMember::of(index, model, scenario.duration));
    let mut members = members.collect::<Option<Vec<_>>>()?;
    prefixes.share(&mut members, peaks);
    let groups = members.par_chunks(eight::LANES).map(|group| {
        let members: Vec<&GroupMember<'_>> = group.iter().map(|(_, member)| member).collect();
        together::run_and_back(&group[0].0, &members, peaks, ends)
    });
    let groups = groups.collect::<Option<Vec<_>>>()?;
    Some(groups.into_iter().flatten().collect())
}

/// Accuracy of chains that run one by one.
const ALONE: Accuracy = Accuracy::new(1e-9, 0.5);

/// Runs a chain by itself, without keeping its motion.
pub(crate) fn single(
    scenario: &Scenario,
    options: &EnsembleOptions<'_>,
    accuracy: Accuracy,
) -> Result<EnsembleOutcome, SimulateError> {
    let mut run = Run::new(scenario, accuracy)?;
    run.check(scenario.duration, accuracy.longest_step)?;
    let (mut peaks, mut strokes) = (Vec::new(), Vec::new());
    if options.peaks.is_empty() && !options.strokes {
        run.to(scenario.duration)?;
    } else {
        let mut summary = Summariser::new(&mut run);
        run.watch(scenario.duration, |step| summary.observe(step))?;
        let summary = summary.summary(&mut run);
        let wanted: HashSet<usize> = options.peaks.iter().copied().collect();
        peaks = summary.peak_force;
        peaks.retain(|peak| wanted.contains(&peak.contact));
        peaks.iter_mut().for_each(|peak| peak.fwhm = None);
        if options.strokes {
            let of_each = summary.intruders.iter();
            strokes = of_each
                .map(|intruder| intruder.relative_displacement_max)
                .collect();
        }
    }
    Ok(EnsembleOutcome {
        state: run.snapshot().state,
        time: run.time(),
        peaks,
        strokes,
        steps: run.steps(),
        model: run.model,
    })
}
