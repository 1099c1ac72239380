//! The energy that a strike leaves in the chain.

use serde::Serialize;

use crate::absorption::Absorption;
use crate::options::{Accuracy, SimulateError};
use crate::run::Run;
use crate::scenario::{InputError, Scenario};

/// Energy that a strike leaves at the end of the run. The parts are energies over [`Remaining::injected`];
/// `before`, `within`, `after`, `contacts` and `ground` add up to `share`.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
#[non_exhaustive]
pub struct Remaining {
    /// Speed of the striker, m/s.
    #[serde(rename = "velocity_mps")]
    pub speed: f64,
    /// End of the run, s.
    #[serde(rename = "time_s")]
    pub time: f64,
    /// Energy that the striker has given by then, and that beads had at t = 0, J.
    #[serde(rename = "injected_j")]
    pub injected: f64,
    /// The share that the intruders have not dissipated.
    pub share: f64,
    /// In the beads before the first host: reflected.
    pub before: f64,
    /// In the beads from the first host to the last, and in the intruders.
    pub within: f64,
    /// In the beads after the last host: transmitted. Without an intruder, the whole chain is `after`.
    pub after: f64,
    /// Dissipated in contacts.
    pub contacts: f64,
    /// Dissipated on the ground; none unless it drags.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ground: Option<f64>,
    /// Each intruder, in the order of the beads.
    pub intruders: Vec<Absorption>,
}

/// Runs a scenario with its striker at `speed`, m/s, and returns the energy that remains.
///
/// The run lasts the scenario's duration times (V/`speed`)^(1/5), V being the scenario's speed. In that time
/// the wave comes equally far at any speed: exactly so on an elastic chain without intruders, gaps and load.
/// Under a load it does not, since the wave is then as fast at any speed. The motion is not kept, so the
/// chain may have any length.
///
/// # Errors
/// As [`summarise`](crate::summarise()), and [`SimulateError::Input`] if the striker has given no energy by
/// the end.
pub fn remaining(scenario: &Scenario, speed: f64, accuracy: Accuracy) -> Result<Remaining, SimulateError> {
    needs_strike(scenario)?;
    let struck = struck_at(scenario, speed);
    let mut run = Run::new(&struck, accuracy)?;
    run.check(struck.duration, accuracy.longest_step)?;
    run.to(struck.duration)?;
    let end = run.snapshot();
    let (model, energies) = (end.model(), end.energies());
    let injected = given(&struck, model.initial_energy() - energies.striker)?;
    let beads = scenario.chain.beads;
    let intruders = model.intruders();
    let first = intruders.first().map_or(1, |intruder| intruder.bead);
    let last = intruders.last().map_or(0, |intruder| intruder.bead);
    // An empty range of beads has no energy.
    let part = |from: usize, to: usize| {
        if from > to {
            0.0
        } else {
            end.region(from..=to).mechanical() / injected
        }
    };
    Ok(Remaining {
        speed,
        time: end.time(),
        injected,
        share: 1.0 - energies.dissipated_intruders / injected,
        before: part(1, first - 1),
        within: part(first, last),
        after: part(last + 1, beads),
        contacts: energies.dissipated_contacts / injected,
        ground: model
            .is_dragged()
            .then_some(energies.dissipated_ground / injected),
        intruders: Absorption::all(&end),
    })
}

/// Refuses a scenario without a strike, of whose energy shares are parts.
pub(super) fn needs_strike(scenario: &Scenario) -> Result<(), InputError> {
    if scenario.drive.is_none() {
        return Ok(());
    }
    let what = "a driven chain has no strike whose energy remains";
    let advice = "leave the drive out and give the striker a velocity";
    Err(InputError::at("drive", what, advice))
}

/// The energy that a strike has injected by its end, J, if there is any: shares are parts of it.
pub(super) fn given(struck: &Scenario, injected: f64) -> Result<f64, InputError> {
    if injected > 0.0 {
        return Ok(injected);
    }
    let (duration, speed) = (struck.duration, struck.striker.velocity);
    let what = format!("after {duration:.3e} s at {speed} m/s the striker has given the chain no energy");
    Err(InputError::at("duration", what, "give the run more time"))
}

/// The scenario with its striker at `speed`, for the time in which the wave comes equally far.
pub(super) fn struck_at(scenario: &Scenario, speed: f64) -> Scenario {
    let mut struck = scenario.clone();
    struck.striker.velocity = speed;
    struck.duration *= (scenario.striker.velocity / speed).powf(0.2);
    struck
}
