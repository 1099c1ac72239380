//! The paper's set-up: beads, striker, intruder.

use hertz_chain::{Chain, Intruder, Scenario, Striker};

/// Relaxation time of the experiment's beads, s (Fig. 2). From Sec. III on the paper leaves viscosity out.
pub(crate) const VISCOUS: f64 = 4.2e-6;
/// No viscosity.
pub(crate) const ELASTIC: f64 = 0.0;
/// Intruder of the experiment: mass, kg; stiffness, N/m; damping, N·s/m.
pub(crate) const MASS: f64 = 3.7e-3;
pub(crate) const STIFFNESS: f64 = 3.95e5;
pub(crate) const DAMPING: f64 = 12.0;
/// The stiffness that the paper finds to absorb most, N/m.
pub(crate) const OPTIMUM: f64 = 1e5;

/// The steel ball on a chain of so many beads, for so long.
pub(crate) fn strike(beads: usize, relaxation: f64, duration: f64) -> Scenario {
    Scenario {
        title: String::new(),
        duration,
        chain: Chain {
            beads,
            radius: 0.019,
            density: 1775.0,
            young: 4.5e9,
            poisson: 0.44,
            relaxation,
            contact_force: hertz_chain::ContactForce::Printed,
            precompression: 0.0,
        },
        striker: Striker {
            radius: 0.0045,
            density: 7980.0,
            young: 203e9,
            poisson: 0.27,
            velocity: 0.45,
            mass: None,
            relaxation: None,
        },
        intruders: Vec::new(),
        sections: Vec::new(),
        wall: None,
    }
}

/// An intruder in each of these beads.
pub(crate) fn intruder(
    beads: impl IntoIterator<Item = usize>,
    mass: f64,
    stiffness: f64,
    damping: f64,
) -> Intruder {
    Intruder {
        beads: beads.into_iter().collect(),
        mass,
        stiffness,
        damping,
    }
}

/// The same strike with these intruders; none for no host.
pub(crate) fn with(mut scenario: Scenario, intruder: Intruder) -> Scenario {
    if !intruder.beads.is_empty() {
        scenario.intruders.push(intruder);
    }
    scenario
}
