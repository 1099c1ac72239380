//! Chains of one shape, from their models to their outcomes.

use std::sync::Arc;

use super::chain::{Constants, Shape};
use super::group::{Group, Motion};
use super::outcome::Outcome;
use crate::model::Model;
use crate::observe::ContactPeak;
use crate::options::SimulateError;

/// Steps of one chain, above which it would keep seven others waiting. The single run refuses those that need far
/// more.
const MOST_STEPS: f64 = 1e6;

/// Whether a chain can go with others.
pub(super) fn suits(model: &Model, duration: f64) -> bool {
    let loaded = (1..=model.contacts()).any(|contact| model.contact(contact).load > 0.0);
    // The method is stable for steps of up to some 3 of the shortest time constants.
    let steps = duration * (1.0 / model.shortest_contact()).max(model.fastest_rate() / 3.0);
    !loaded && !model.clipped && steps < MOST_STEPS
}

/// The error allowed to each step in a velocity, as a part of that of a bead in the wave. Of 10,000 random chains
/// like the paper's, none then errs by more than 8e-7 in what its intruder absorbs.
const TOLERANCE: f64 = 2.5e-7;

/// Runs up to eight chains, each to its time, s. The greatest forces of these contacts are kept.
pub(super) fn run(
    shape: &Shape,
    chains: &[(&Model, f64)],
    peaks: &[usize],
) -> Vec<Result<Outcome, SimulateError>> {
    let constants = Constants::new(shape, chains, TOLERANCE);
    let models: Vec<&Model> = chains.iter().map(|(model, _)| *model).collect();
    let mut start = Motion::zeros(shape);
    for (lane, model) in models.iter().enumerate() {
        let (state, layout) = (model.initial(), model.layout());
        for body in 0..shape.bodies {
            start.u[body].0[lane] = state[body];
            start.v[body].0[lane] = state[layout.velocity(body)];
        }
    }
    let there = |contact: &usize| (1..shape.places()).contains(contact);
    let mut wanted: Vec<usize> = peaks.iter().copied().filter(there).collect();
    wanted.sort_unstable();
    wanted.dedup();
    let mut group = Group::new(shape, &constants, &models, start, &wanted);
    let stuck = group.run();
    let outcome = |(lane, (model, time)): (usize, &(&Model, f64))| match stuck[lane] {
        Some(time) => Err(SimulateError::Stuck { time }),
        None => {
            let outcome = Outcome {
                model: Arc::new((*model).clone()),
                time: *time,
                state: state(shape, model, &group, lane),
                peaks: greatest(&group, lane),
                steps: group.tries[lane],
            };
            Ok(outcome.balanced())
        }
    };
    chains.iter().enumerate().map(outcome).collect()
}

/// The state of one lane, but for what contacts and the wall took.
fn state(shape: &Shape, model: &Model, group: &Group<'_>, lane: usize) -> Vec<f64> {
    let layout = model.layout();
    let mut state = vec![0.0; layout.dimension()];
    for body in 0..shape.bodies {
        state[body] = group.now.u[body].0[lane];
        state[layout.velocity(body)] = group.now.v[body].0[lane];
    }
    for guest in 0..shape.hosts.len() {
        state[layout.relative(guest)] = group.now.x[guest].0[lane];
        state[layout.relative_velocity(guest)] = group.now.w[guest].0[lane];
        state[layout.intruder_loss(guest)] = group.dissipated[guest].0[lane];
    }
    state
}

fn greatest(group: &Group<'_>, lane: usize) -> Vec<ContactPeak> {
    let of = |peaks: &super::peak::Peaks| {
        let (force, time) = peaks.greatest[lane];
        (force > 0.0).then_some(ContactPeak {
            contact: peaks.contact,
            force,
            time,
            fwhm: None,
        })
    };
    group.peaks.iter().filter_map(of).collect()
}
