//! Set-ups that several tests share.

use hertz_chain::{Intruder, Oscillator, Scenario, Solution, Striker, simulate};

/// The paper's striker on elastic beads without an intruder. `duration` is in s.
pub(crate) fn elastic(beads: usize, duration: f64) -> Scenario {
    let mut scenario = Scenario::paper();
    scenario.intruders.clear();
    scenario.chain.relaxation = 0.0;
    scenario.chain.beads = beads;
    scenario.duration = duration;
    scenario
}

/// A chain struck by a bead like its own: one solitary wave has nearly all of the energy.
pub(crate) fn struck_by_a_bead(beads: usize, duration: f64) -> Scenario {
    let mut scenario = elastic(beads, duration);
    let (chain, striker) = (&scenario.chain, &scenario.striker);
    scenario.striker = Striker::new(chain.radius, chain.material(), striker.velocity);
    scenario
}

/// The paper's intruder on the spring that absorbs most, 1e5 N/m.
pub(crate) fn softer(beads: impl IntoIterator<Item = usize>) -> Intruder {
    let mut intruder = Intruder::new(beads, Oscillator::PAPER);
    intruder.stiffness = 1e5;
    intruder
}

pub(crate) fn run(scenario: &Scenario) -> Solution {
    simulate(scenario).expect("the scenario runs")
}

/// A pseudo-random number of mean 0 and variance 1: twelve uniform ones added.
pub(crate) fn normal(state: &mut u64) -> f64 {
    let mut uniform = || {
        *state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (*state >> 11) as f64 / (1_u64 << 53) as f64
    };
    (0..12).map(|_| uniform()).sum::<f64>() - 6.0
}
