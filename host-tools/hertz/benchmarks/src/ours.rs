//! The simulator, as a user would run it for the same results that the other solvers give.

use hertz_chain::{Accuracy, Observable, Run, Samples, Scenario};

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

/// Displacements at the start and at each of [`SAMPLES`] times, one after another.
pub(crate) fn samples(scenario: &Scenario, accuracy: Accuracy) -> Vec<f64> {
    let channels: Vec<Observable> = (0..=scenario.chain.beads).map(Observable::Velocity).collect();
    let mut samples = Samples::new(scenario.duration / SAMPLES as f64, channels).with_end(scenario.duration);
    let mut run = Run::new(scenario, accuracy).expect("the case is sound");
    run.watch(scenario.duration, |step| samples.observe(step))
        .expect("the case can be run");
    samples.into_values()
}
