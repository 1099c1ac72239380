//! The paper's set-up: beads, striker, intruder.

use hertz_chain::{Chain, Intruder, Oscillator, Scenario, Striker};

/// Relaxation time of the experiment's beads, s (Fig. 2). From Sec. III on the paper leaves viscosity out.
pub(crate) const VISCOUS: f64 = Chain::PAPER.relaxation;
/// No viscosity.
pub(crate) const ELASTIC: f64 = 0.0;
/// Intruder of the experiment: mass, kg; stiffness, N/m; damping, N·s/m.
pub(crate) const MASS: f64 = Oscillator::PAPER.mass;
pub(crate) const STIFFNESS: f64 = Oscillator::PAPER.stiffness;
pub(crate) const DAMPING: f64 = Oscillator::PAPER.damping;
/// Note on an energy of the chain by the paper's E_n, which seems to grow while an intruder takes energy up.
pub(crate) const AS_PRINTED: &str = "E_T as printed: the host counts with M, not M − m";
/// The stiffness that the paper finds to absorb most, N/m.
pub(crate) const OPTIMUM: f64 = 1e5;

/// The steel ball on a chain of `beads` beads, for `duration` seconds.
pub(crate) fn strike(beads: usize, relaxation: f64, duration: f64) -> Scenario {
    let mut chain = Chain::PAPER;
    (chain.beads, chain.relaxation) = (beads, relaxation);
    Scenario::new(duration, chain, Striker::PAPER)
}

/// An intruder in each of these beads.
pub(crate) fn intruder(
    beads: impl IntoIterator<Item = usize>,
    mass: f64,
    stiffness: f64,
    damping: f64,
) -> Intruder {
    Intruder::new(
        beads,
        Oscillator {
            mass,
            stiffness,
            damping,
        },
    )
}

/// A strike with these intruders; unchanged if they have no host.
pub(crate) fn with(mut scenario: Scenario, intruder: Intruder) -> Scenario {
    if !intruder.beads.is_empty() {
        scenario.intruders.push(intruder);
    }
    scenario
}
