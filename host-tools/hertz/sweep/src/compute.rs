//! Computes the rows of points.

use std::ops::Range;
use std::time::Instant;

use hertz_chain::{EnsembleOptions, EnsembleOutcome, Scenario, ensemble};
use rayon::prelude::*;

use crate::plan::Plan;
use bead_tables::Cell;

/// Runs in memory at a time: enough of one kind to fill the vectors of many threads.
const TOGETHER: u64 = 4096;
/// Bodies in memory at a time, some 500 B each.
const BODIES: usize = 1 << 20;

/// Runs the points of a range on all threads of the current pool, and passes their rows to `take` in order.
/// `progress` gets the number of points done. The row of a point that cannot be run holds the reason.
///
/// # Errors
/// Errors of `take`.
pub fn compute(
    plan: &Plan,
    points: Range<u64>,
    progress: &(dyn Fn(f64) + Sync),
    mut take: impl FnMut(Vec<Cell>) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let mut from = points.start;
    while from < points.end {
        let batch = batch(plan, from..points.end.min(from + TOGETHER));
        let count = batch.len() as u64;
        let done = from - points.start;
        let results = results(plan, batch, &|part| progress(done as f64 + part * count as f64));
        for (result, point) in results.iter().zip(from..) {
            take(plan.row(point, result))?;
        }
        from += count;
        progress((from - points.start) as f64);
    }
    Ok(())
}

/// Scenarios of the first points of a range, as many as memory should hold. They are made in portions of
/// doubling size, so that few are discarded.
fn batch(plan: &Plan, points: Range<u64>) -> Vec<Result<Scenario, String>> {
    let beads = |scenario: &Result<Scenario, String>| scenario.as_ref().map_or(1, |one| one.chain.beads);
    let threads = rayon::current_num_threads();
    let (mut scenarios, mut bodies) = (Vec::new(), 0);
    let (mut from, mut some) = (points.start, threads as u64);
    while from < points.end && bodies <= BODIES {
        let next: Vec<u64> = (from..points.end.min(from + some)).collect();
        from += next.len() as u64;
        some *= 2;
        let next: Vec<_> = next.into_par_iter().map(|point| plan.scenario(point)).collect();
        bodies += next.iter().map(beads).sum::<usize>();
        scenarios.extend(next);
    }
    bodies = 0;
    let fits = scenarios
        .iter()
        .take_while(|scenario| {
            bodies += beads(scenario);
            bodies <= BODIES
        })
        .count();
    scenarios.truncate(fits.max(threads));
    scenarios
}

fn results(
    plan: &Plan,
    scenarios: Vec<Result<Scenario, String>>,
    progress: &(dyn Fn(f64) + Sync),
) -> Vec<Result<EnsembleOutcome, String>> {
    let mut runnable = Vec::new();
    let runs: Vec<Result<(), String>> = scenarios
        .into_iter()
        .map(|scenario| scenario.map(|scenario| runnable.push(scenario)))
        .collect();
    let contacts = plan.definition().outputs.contacts();
    let options = EnsembleOptions::default()
        .with_peaks(&contacts)
        .with_progress(progress);
    let mut outcomes = ensemble(&runnable, &options).into_iter();
    let result = |run: Result<(), String>| {
        let outcome = run.map(|()| outcomes.next().expect("each scenario has its outcome"));
        outcome?.map_err(|error| error.to_string())
    };
    runs.into_iter().map(result).collect()
}

/// Time of a point on all threads of the pool, s, measured with a few points from all over the sweep.
pub fn seconds_for_each(plan: &Plan) -> f64 {
    let threads = rayon::current_num_threads() as u64;
    let mut tries = 8 * threads;
    loop {
        let tried = tries.min(plan.points());
        let apart = plan.points() / tried;
        let points: Vec<u64> = (0..tried).map(|n| n * apart + apart / 2).collect();
        let clock = Instant::now();
        let scenarios = points.into_par_iter().map(|point| plan.scenario(point)).collect();
        results(plan, scenarios, &|_| {});
        let seconds = clock.elapsed().as_secs_f64();
        if seconds > 0.05 || tried == plan.points() || tries >= TOGETHER {
            return seconds / tried as f64;
        }
        tries *= 8;
    }
}
