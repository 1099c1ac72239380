//! How the time grows with the chain, for a pulse that crosses it.

use std::time::Instant;

use hertz_chain::{Accuracy, Options, Scenario, simulate_with};

use crate::report::{Report, Target};

/// Seconds to simulate a strike on a chain of so many beads until the pulse has crossed it.
fn seconds(beads: usize, relaxation: f64) -> f64 {
    let mut scenario = Scenario::paper();
    scenario.intruders.clear();
    scenario.chain.beads = beads;
    scenario.chain.relaxation = relaxation;
    scenario.duration = 0.235e-3 * beads as f64;
    let accuracy = Accuracy {
        tolerance: 1e-10,
        longest_step: 0.5,
    };
    let options = Options {
        accuracy,
        ..Options::default()
    };
    let clock = Instant::now();
    std::hint::black_box(simulate_with(&scenario, &options).expect("it runs"));
    clock.elapsed().as_secs_f64()
}

/// From 256 beads to 1024, or 512: a run that keeps all it computes fills the memory soon.
pub(crate) fn measure(report: &mut Report, quick: bool) {
    let most = if quick { 512 } else { 1024 };
    for (name, relaxation, target) in [("elastic", 0.0, 1.1), ("viscoelastic", 4.2e-6, 1.3)] {
        let least = |beads: usize| {
            (0..3)
                .map(|_| seconds(beads, relaxation))
                .fold(f64::INFINITY, f64::min)
        };
        let doublings = (most as f64 / 256.0).log2();
        let exponent = (least(most) / least(256)).log2() / doublings;
        let name = format!("{name} chain: exponent of time, 256 to {most} beads, all kept");
        report.targets.push(Target::at_most(name, Some(exponent), target));
    }
}
