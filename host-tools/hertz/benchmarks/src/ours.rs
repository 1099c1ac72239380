//! The simulator, as a user would run it for the same results that the other solvers give.

use std::hint::black_box;
use std::time::Instant;

use hertz_chain::{Accuracy, Options, Run, Scenario, simulate_with};

/// Least seconds of several runs, as on a shared computer a single one may be disturbed.
pub(crate) fn least_seconds<T>(runs: usize, run: impl Fn() -> T) -> f64 {
    let once = |_| {
        let clock = Instant::now();
        black_box(run());
        clock.elapsed().as_secs_f64()
    };
    (0..runs).map(once).fold(f64::INFINITY, f64::min)
}

/// Samples of a run.
pub(crate) const SAMPLES: usize = 1000;

/// Velocities of all bodies at the end, m/s.
pub(crate) fn end(scenario: &Scenario, accuracy: Accuracy) -> Vec<f64> {
    let mut run = Run::new(scenario, accuracy).expect("the case is sound");
    run.to(scenario.duration).expect("the case can be run");
    let snapshot = run.snapshot();
    (0..=scenario.chain.beads)
        .map(|body| snapshot.velocity(body))
        .collect()
}

/// Velocities of all bodies at the start and at each of [`SAMPLES`] times, one after another.
pub(crate) fn samples(scenario: &Scenario, accuracy: Accuracy) -> Vec<f64> {
    let (beads, interval) = (scenario.chain.beads, scenario.duration / SAMPLES as f64);
    let (mut values, mut next) = (Vec::with_capacity((SAMPLES + 1) * (beads + 1)), 0);
    let mut run = Run::new(scenario, accuracy).expect("the case is sound");
    let watched = run.watch(scenario.duration, |step| {
        // Rounding may put the last sample just past the end of the run.
        while next <= SAMPLES && next as f64 * interval <= step.to() * (1.0 + 1e-12) {
            let at = step.at((next as f64 * interval).clamp(step.from(), step.to()));
            values.extend((0..=beads).map(|body| at.velocity(body)));
            next += 1;
        }
    });
    watched.expect("the case can be run");
    values
}

/// As [`samples`], from a run that keeps its motion: the way of most programs.
pub(crate) fn kept_samples(scenario: &Scenario, accuracy: Accuracy) -> Vec<f64> {
    let (beads, interval) = (scenario.chain.beads, scenario.duration / SAMPLES as f64);
    let mut values = Vec::with_capacity((SAMPLES + 1) * (beads + 1));
    let solution = simulate_with(scenario, &Options::with(accuracy)).expect("the case can be run");
    let mut sampler = solution.sampler();
    for sample in 0..=SAMPLES {
        let at = sampler.at((sample as f64 * interval).min(solution.end()));
        values.extend((0..=beads).map(|body| at.velocity(body)));
    }
    values
}
