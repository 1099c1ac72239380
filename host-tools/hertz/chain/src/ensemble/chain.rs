//! Constants of the chains of a group: eight chains of one shape, each in a lane.

use super::eight::{Eight, LANES};
use crate::model::Model;

/// Properties that chains must have in common to be computed together.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct ChainShape {
    /// The striker and the beads.
    pub(super) bodies: usize,
    pub(super) walled: bool,
    /// The bead that hosts each intruder, in order.
    pub(super) hosts: Vec<usize>,
    /// Carried intruders, each with its carrier, an earlier intruder of the same bead.
    pub(super) nested: Vec<(usize, usize)>,
}

impl ChainShape {
    pub(super) fn of(model: &Model) -> Self {
        Self {
            bodies: model.bodies(),
            walled: model.contacts() == model.bodies(),
            hosts: model.intruders().iter().map(|intruder| intruder.bead).collect(),
            nested: (0..)
                .zip(model.intruders())
                .filter_map(|(guest, intruder)| Some((guest, intruder.carrier?)))
                .collect(),
        }
    }

    /// Number of bodies, counting the wall as one that nothing moves.
    pub(super) fn places(&self) -> usize {
        self.bodies + usize::from(self.walled)
    }

    /// The intruders that a body carries itself.
    pub(super) fn guests(&self, body: usize) -> impl Iterator<Item = usize> + '_ {
        let before = |body: usize| self.hosts.partition_point(|&host| host < body);
        let all = before(body)..before(body + 1);
        all.filter(|&guest| self.nested.iter().all(|(nested, _)| *nested != guest))
    }
}

#[derive(Debug)]
pub(super) struct Constants {
    /// κ, N/m^(3/2), and (3/2) τ, s, of contact j at index j; index 0 is not used.
    pub(super) stiffness: Vec<Eight>,
    pub(super) viscosity: Vec<Eight>,
    /// 1 / (M - m), 1/kg; zero for the wall.
    pub(super) inverse: Vec<Eight>,
    /// k, N/m, c, N·s/m, and 1/m, 1/kg.
    pub(super) guest_stiffness: Vec<Eight>,
    pub(super) guest_damping: Vec<Eight>,
    pub(super) guest_inverse: Vec<Eight>,
    /// Overlap, m, below which a contact carries no force: far below rounding of any result.
    pub(super) threshold: Eight,
    /// One over the allowed error of a velocity, s/m, for each body and for the intruders.
    pub(super) strictness: Vec<Eight>,
    pub(super) guest_strictness: Eight,
    /// The longest step, and the end of the run, s.
    pub(super) longest: Eight,
    pub(super) end: Eight,
    /// Most steps to try.
    pub(super) most_tries: [u64; LANES],
}

/// Overlap without force, as a part of the striker's depth.
const THRESHOLD: f64 = 1e-13;
/// Longest step as a part of the shortest contact, so that no step passes over a collision.
const LONGEST: f64 = 1.0;
/// Steps that a chain may try: for each of its fewest steps, and in addition. A chain needs more if rounding
/// is above the allowed error, as for a striker that is 1e30 times lighter than a bead.
const TRIES_FOR_EACH: f64 = 100.0;
const TRIES_BESIDES: u64 = 100_000;

impl Constants {
    /// Constants of these chains. Lanes without a chain stand still.
    pub(super) fn new(shape: &ChainShape, chains: &[(&Model, f64)], tolerance: f64) -> Self {
        let of_chains = |of: &dyn Fn(&Model, f64) -> f64| {
            let mut lanes = Eight::ZERO;
            for (lane, (model, time)) in lanes.0.iter_mut().zip(chains) {
                *lane = of(model, *time);
            }
            lanes
        };
        let lanes = |of: &dyn Fn(&Model) -> f64| of_chains(&|model, _| of(model));
        let of_contacts = |of: &dyn Fn(&Model, usize) -> f64| -> Vec<Eight> {
            let contacts = (1..shape.places()).map(|contact| lanes(&|model| of(model, contact)));
            std::iter::once(Eight::ZERO).chain(contacts).collect()
        };
        let of_bodies = |of: &dyn Fn(&Model, usize) -> f64| -> Vec<Eight> {
            let bodies = (0..shape.bodies).map(|body| lanes(&|model| of(model, body)));
            bodies.chain(shape.walled.then_some(Eight::ZERO)).collect()
        };
        let of_guests = |of: &dyn Fn(crate::Oscillator) -> f64| -> Vec<Eight> {
            let of = |guest: usize| lanes(&|model| of(model.intruders()[guest].oscillator));
            (0..shape.hosts.len()).map(of).collect()
        };
        let tries = |model: &Model, time| TRIES_FOR_EACH * fewest_steps(model, time);
        let scale = |model: &Model| tolerance * wave_speed(model);
        // Errors of the same energy weigh the same.
        let weight = |model: &Model, body| (model.mass(body) / model.mass(1)).sqrt();
        Self {
            stiffness: of_contacts(&|model, contact| model.contact_at(contact).stiffness),
            viscosity: of_contacts(&|model, contact| 1.5 * model.contact_at(contact).relaxation),
            inverse: of_bodies(&|model, body| 1.0 / model.shells[body]),
            guest_stiffness: of_guests(&|oscillator| oscillator.stiffness),
            guest_damping: of_guests(&|oscillator| oscillator.damping),
            guest_inverse: of_guests(&|oscillator| 1.0 / oscillator.mass),
            threshold: lanes(&|model| THRESHOLD * model.displacement_scale()),
            strictness: of_bodies(&|model, body| weight(model, body) / scale(model)),
            guest_strictness: lanes(&|model| 1.0 / scale(model)),
            longest: lanes(&|model| LONGEST * model.shortest_contact()),
            end: of_chains(&|_, time| time),
            most_tries: of_chains(&tries).0.map(|tries| TRIES_BESIDES + tries as u64),
        }
    }
}

/// Least number of steps of a chain. Steps of up to about 3 of the shortest time constants are stable.
pub(super) fn fewest_steps(model: &Model, duration: f64) -> f64 {
    duration * (1.0 / (LONGEST * model.shortest_contact())).max(model.fastest_rate() / 3.0)
}

/// Approximate velocity of a bead in the wave, m/s: that of bead 1 if only the striker hits it.
fn wave_speed(model: &Model) -> f64 {
    let ratio = model.mass(0) / model.mass(1);
    model.speed_scale() * (2.0 * ratio / (1.0 + ratio)).min(1.0)
}
