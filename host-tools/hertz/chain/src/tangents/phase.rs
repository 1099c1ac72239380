//! Coordinates of a motion in which it depends smoothly on its start.

use super::chain::DualChain;
use super::march::Layout;
use crate::model::Model;

/// Values that the motion of a chain follows from: displacements, m, and momenta w, kg·m/s ([`DualChain`]),
/// of the bodies that no drive moves, then displacements, m, and velocities, m/s, of the intruders, in the
/// order of their beads. Nothing in it is relative to a host.
#[derive(Debug, Clone, Copy)]
pub(super) struct PhaseSpace<'a> {
    pub(super) model: &'a Model,
}

impl PhaseSpace<'_> {
    /// The first body that moves freely.
    fn first(self) -> usize {
        usize::from(self.model.is_prescribed())
    }

    /// Number of bodies that move freely.
    pub(super) fn bodies(self) -> usize {
        self.model.bodies() - self.first()
    }

    pub(super) fn dimension(self) -> usize {
        2 * (self.bodies() + self.model.intruders().len())
    }

    /// Places of the coordinates in the state of a march.
    pub(super) fn places<const P: usize>(self, chain: &DualChain<P>, layout: Layout) -> Vec<usize> {
        let bodies = || self.first()..self.model.bodies();
        let number = |bead: usize| chain.intruders.iter().position(|intruder| intruder.body == bead);
        let hosts = self.model.intruders().iter();
        let numbers: Vec<usize> = hosts.filter_map(|intruder| number(intruder.bead)).collect();
        bodies()
            .chain(bodies().map(|body| layout.momentum(body)))
            .chain(numbers.iter().map(|&number| layout.place(number)))
            .chain(numbers.iter().map(|&number| layout.velocity(number)))
            .collect()
    }

    /// The viscous part of a body's momentum, kg·m/s: τ F of the contact behind it less τ F of the one
    /// before.
    fn viscous(self, body: usize, displacement: impl Fn(usize) -> f64) -> f64 {
        let model = self.model;
        let of = |contact: usize| {
            let far = if contact < model.bodies() {
                displacement(contact)
            } else {
                0.0
            };
            let joint = model.contact_at(contact);
            joint.relaxation * joint.elastic_force_beyond(displacement(contact - 1) - far)
        };
        let before = if body > 0 { of(body) } else { 0.0 };
        let behind = if body < model.contacts() {
            of(body + 1)
        } else {
            0.0
        };
        behind - before
    }

    /// The coordinates of a state of the model.
    pub(super) fn coordinates(self, state: &[f64]) -> Vec<f64> {
        let (model, layout) = (self.model, self.model.layout());
        let bodies = || self.first()..model.bodies();
        let momentum = |body: usize| {
            model.shells[body] * state[layout.velocity(body)] + self.viscous(body, |n| state[n])
        };
        let hosts = || model.intruders().iter().map(|intruder| intruder.bead).enumerate();
        let place = |(number, bead): (usize, usize)| state[bead] + state[layout.relative(number)];
        let velocity = |(number, bead): (usize, usize)| {
            state[layout.velocity(bead)] + state[layout.relative_velocity(number)]
        };
        bodies()
            .map(|body| state[body])
            .chain(bodies().map(momentum))
            .chain(hosts().map(place))
            .chain(hosts().map(velocity))
            .collect()
    }

    /// The state of the model at t = 0 with these coordinates.
    pub(super) fn state(self, coordinates: &[f64]) -> Vec<f64> {
        let (model, layout, first) = (self.model, self.model.layout(), self.first());
        let mut state = model.initial();
        let (displacements, rest) = coordinates.split_at(self.bodies());
        let (momenta, rest) = rest.split_at(self.bodies());
        let (places, velocities) = rest.split_at(model.intruders().len());
        state[first..model.bodies()].copy_from_slice(displacements);
        for (body, momentum) in (first..).zip(momenta) {
            let shell = momentum - self.viscous(body, |n| state[n]);
            state[layout.velocity(body)] = shell / model.shells[body];
        }
        for (number, intruder) in model.intruders().iter().enumerate() {
            let (host, velocity) = (state[intruder.bead], state[layout.velocity(intruder.bead)]);
            state[layout.relative(number)] = places[number] - host;
            state[layout.relative_velocity(number)] = velocities[number] - velocity;
        }
        state
    }
}
