//! Many chains at once, for sweeps and searches: what remains at the end of each, to a stated error.
//!
//! # Design
//!
//! Chains of one shape, which differ in numbers alone, are computed eight at a time, one a vector lane
//! ([`group`]). Every lane has its own steps ([`method`]) and its own contacts that open and close
//! ([`crossing`]), so a chain has the same bits whatever others there are, in whatever order, on any number
//! of threads, and on any processor that multiplies and adds in one rounding. What happens before the wave
//! reaches an intruder is computed once for chains that differ in their intruders alone ([`prefix`]). Chains
//! of other kinds run one by one, and so does one that comes to no end among others.

mod chain;
mod crossing;
mod eight;
mod group;
mod method;
mod outcome;
mod peak;
mod prefix;
mod together;

use std::collections::HashSet;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use self::chain::Shape;
pub use self::outcome::EnsembleOutcome;
pub(crate) use self::prefix::Prefixes;
use self::together::Member;
use crate::model::Model;
use crate::options::{Accuracy, SimulateError};
use crate::run::Run;
use crate::scenario::Scenario;
use crate::summariser::Summariser;

/// How to run an ensemble.
#[derive(Clone, Copy, Default)]
#[non_exhaustive]
pub struct EnsembleOptions<'a> {
    /// Contacts whose greatest force is wanted ([`EnsembleOutcome::peaks`]).
    pub peaks: &'a [usize],
    /// Called now and then with the part of the chains that are done, 0 to 1.
    pub progress: Option<&'a (dyn Fn(f64) + Sync)>,
}

impl<'a> EnsembleOptions<'a> {
    /// The same with the greatest forces of these contacts.
    #[must_use]
    pub const fn with_peaks(mut self, contacts: &'a [usize]) -> Self {
        self.peaks = contacts;
        self
    }

    /// The same with a listener.
    #[must_use]
    pub const fn with_progress(mut self, progress: &'a (dyn Fn(f64) + Sync)) -> Self {
        self.progress = Some(progress);
        self
    }
}

impl std::fmt::Debug for EnsembleOptions<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("EnsembleOptions")
            .field("peaks", &self.peaks)
            .field("progress", &self.progress.map(|_| "…"))
            .finish()
    }
}

/// Runs many scenarios, each over its duration, on all threads of the pool that this is called in. The
/// results are in the order of the scenarios, and each is the same whatever the others are.
///
/// What intruders absorb has an error of at most 1e-6 of it, and a greatest force of 1e-5, in chains like the
/// paper's. In chains of mixed spheres, and with stiff intruders, it is at most 3e-6 of the striker's energy,
/// and 4e-5 of the force (seen over thousands of random chains; the tests hold them against
/// [`simulate_with`](crate::simulate_with())). It is quick for scenarios that differ in numbers alone: as
/// many beads, intruders in the same beads, a wall in all or none. Chains under a load and those with clipped
/// forces run one by one.
///
/// # Errors
/// Each scenario has its own [`SimulateError`]; the others run all the same.
pub fn ensemble(
    scenarios: &[Scenario],
    options: &EnsembleOptions<'_>,
) -> Vec<Result<EnsembleOutcome, SimulateError>> {
    ensemble_on(scenarios, options, &Prefixes::default())
}

/// The same for one who asks again and again: what has been found out once is kept in `prefixes`.
pub(crate) fn ensemble_on(
    scenarios: &[Scenario],
    options: &EnsembleOptions<'_>,
    prefixes: &Prefixes,
) -> Vec<Result<EnsembleOutcome, SimulateError>> {
    let models: Vec<_> = scenarios.par_iter().map(Model::of).collect();
    let mut alone = Vec::new();
    let mut grouped: Vec<(Shape, Member<'_>)> = Vec::new();
    for (index, model) in models.iter().enumerate() {
        let Ok(model) = model else { continue };
        let time = scenarios[index].duration;
        if together::suits(model, time) {
            let member = Member {
                index,
                model,
                time,
                start: None,
            };
            grouped.push((Shape::of(model), member));
        } else {
            alone.push(index);
        }
    }
    prefixes.share(&mut grouped, options.peaks);
    // Chains that are struck alike take as many steps and reach the same beads: they lose least by waiting.
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
    let groups: Vec<&[(Shape, Member<'_>)]> = grouped
        .chunk_by(|one, other| one.0 == other.0)
        .flat_map(|alike| alike.chunks(eight::LANES))
        .collect();
    let of_groups = groups.into_par_iter().flat_map_iter(|group| {
        let members: Vec<&Member<'_>> = group.iter().map(|(_, member)| member).collect();
        let outcomes = together::run(&group[0].0, &members, options.peaks);
        tell(group.len());
        let indices = group.iter().map(|(_, member)| member.index);
        indices.zip(outcomes).map(|(index, outcome)| {
            let alone = || single(&scenarios[index], options.peaks);
            (index, outcome.map_or_else(alone, Ok))
        })
    });
    let mut found: Vec<(usize, Result<EnsembleOutcome, SimulateError>)> = of_groups.collect();
    let one_by_one = alone.into_par_iter().map(|index| {
        let outcome = single(&scenarios[index], options.peaks);
        tell(1);
        (index, outcome)
    });
    found.par_extend(one_by_one);
    let mut results: Vec<Option<Result<EnsembleOutcome, SimulateError>>> = models
        .iter()
        .map(|model| model.as_ref().err().map(|error| Err(error.clone().into())))
        .collect();
    for (index, outcome) in found {
        results[index] = Some(outcome);
    }
    let all = results.into_iter();
    all.map(|result| result.expect("each scenario was run or refused"))
        .collect()
}

/// A chain by itself. Nothing of the motion is kept.
fn single(scenario: &Scenario, peaks: &[usize]) -> Result<EnsembleOutcome, SimulateError> {
    let accuracy = Accuracy {
        tolerance: 1e-9,
        longest_step: 0.5,
    };
    let mut run = Run::new(scenario, accuracy)?;
    run.check(scenario.duration, accuracy.longest_step)?;
    let mut found = Vec::new();
    if peaks.is_empty() {
        run.to(scenario.duration)?;
    } else {
        let mut summary = Summariser::new(&mut run);
        run.watch(scenario.duration, |step| summary.observe(step))?;
        found = summary.summary(&mut run).peak_force;
        let wanted: HashSet<usize> = peaks.iter().copied().collect();
        found.retain(|peak| wanted.contains(&peak.contact));
        found.iter_mut().for_each(|peak| peak.fwhm = None);
    }
    let model = run.shared_model();
    let mut state = vec![0.0; model.layout().dimension()];
    run.write_state(&mut state);
    Ok(EnsembleOutcome {
        state,
        time: run.time(),
        model,
        peaks: found,
        steps: run.steps(),
    })
}
