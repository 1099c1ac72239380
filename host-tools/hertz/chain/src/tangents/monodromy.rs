//! The motion of a driven chain over a time, with its derivatives with respect to the start.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::chain::DualChain;
use super::march::Layout;
use super::variation::Variation;
use crate::model::Model;
use crate::options::{Accuracy, SimulateError};
use crate::run::Run;
use crate::scenario::{InputError, Scenario};

/// Derivatives that are followed side by side.
const DIRECTIONS: usize = 8;

/// A chain whose motion may start anywhere. Its coordinates are those in which the motion depends smoothly on
/// its start: displacements, m, and momenta w, kg·m/s ([`DualChain`]), of the bodies that the drive does not
/// prescribe, then displacements, m, and velocities, m/s, of the intruders, in the order of their beads. No
/// coordinate is relative to a host.
#[derive(Debug, Clone)]
pub(crate) struct DrivenChain {
    pub(crate) model: Arc<Model>,
    chain: DualChain<DIRECTIONS>,
}

impl DrivenChain {
    /// # Errors
    /// The scenario is out of range, or its contacts are clipped or not Hertz'.
    pub(crate) fn of(scenario: &Scenario) -> Result<Self, InputError> {
        let model = Model::of(scenario)?;
        let chain = DualChain::of(&model, scenario, &[])?;
        let model = Arc::new(model);
        Ok(Self { model, chain })
    }

    /// The bodies that move freely.
    fn bodies(&self) -> Range<usize> {
        usize::from(self.model.is_prescribed())..self.model.bodies()
    }

    /// Places of the coordinates in the state of a march.
    fn places(&self, layout: Layout) -> Vec<usize> {
        let hosted = &self.chain.intruders;
        let number = |bead: usize| hosted.iter().position(|intruder| intruder.body == bead);
        let hosts = self.model.intruders().iter();
        let numbers: Vec<usize> = hosts.filter_map(|intruder| number(intruder.bead)).collect();
        self.bodies()
            .chain(self.bodies().map(|body| layout.momentum(body)))
            .chain(numbers.iter().map(|&number| layout.place(number)))
            .chain(numbers.iter().map(|&number| layout.velocity(number)))
            .collect()
    }

    /// The viscous part of a body's momentum, kg·m/s: τ F of the contact behind it less τ F of the one
    /// before.
    fn viscous(&self, body: usize, state: &[f64]) -> f64 {
        let of = |contact: usize| {
            if !(1..=self.model.contacts()).contains(&contact) {
                return 0.0;
            }
            let joint = self.model.contact_at(contact);
            joint.relaxation * joint.elastic_force_beyond(self.model.change(state, contact).0)
        };
        of(body + 1) - of(body)
    }

    /// Coordinates of a state of the model.
    pub(crate) fn coordinates(&self, state: &[f64]) -> DVector<f64> {
        let (model, layout) = (&self.model, self.model.layout());
        let momentum =
            |body: usize| model.shells[body] * state[layout.velocity(body)] + self.viscous(body, state);
        let hosts = || model.intruders().iter().map(|intruder| intruder.bead).enumerate();
        let place = |(number, bead): (usize, usize)| state[bead] + state[layout.relative(number)];
        let velocity = |(number, bead): (usize, usize)| {
            state[layout.velocity(bead)] + state[layout.relative_velocity(number)]
        };
        let coordinates = self.bodies().map(|body| state[body]);
        let coordinates = coordinates.chain(self.bodies().map(momentum));
        let coordinates = coordinates.chain(hosts().map(place)).chain(hosts().map(velocity));
        DVector::from_vec(coordinates.collect())
    }

    /// The state of the model at t = 0 with these coordinates.
    fn state(&self, coordinates: &DVector<f64>) -> Vec<f64> {
        let (model, layout) = (&self.model, self.model.layout());
        let mut state = model.initial();
        let (displacements, rest) = coordinates.as_slice().split_at(self.bodies().len());
        let (momenta, rest) = rest.split_at(self.bodies().len());
        let (places, velocities) = rest.split_at(model.intruders().len());
        state[self.bodies()].copy_from_slice(displacements);
        for (body, momentum) in self.bodies().zip(momenta) {
            let shell = momentum - self.viscous(body, &state);
            state[layout.velocity(body)] = shell / model.shells[body];
        }
        for (number, intruder) in model.intruders().iter().enumerate() {
            let (host, velocity) = (state[intruder.bead], state[layout.velocity(intruder.bead)]);
            state[layout.relative(number)] = places[number] - host;
            state[layout.relative_velocity(number)] = velocities[number] - velocity;
        }
        state
    }

    /// Sizes of the coordinates in a motion of displacements of `length`, m, at a frequency of `rate`
    /// radians a second.
    pub(crate) fn sizes(&self, length: f64, rate: f64) -> DVector<f64> {
        let (bodies, intruders) = (self.bodies(), self.model.intruders().len());
        let speed = length * rate;
        let sizes = std::iter::repeat_n(length, bodies.len())
            .chain(self.model.shells[bodies].iter().map(|shell| shell * speed))
            .chain(std::iter::repeat_n(length, intruders))
            .chain(std::iter::repeat_n(speed, intruders));
        DVector::from_vec(sizes.collect())
    }

    /// The run from a start at t = 0.
    pub(crate) fn run(&self, start: &DVector<f64>, accuracy: Accuracy) -> Result<Run, SimulateError> {
        Run::start(Arc::clone(&self.model), (0.0, &self.state(start)), accuracy)
    }

    /// The coordinates after `span`, s.
    pub(crate) fn end(
        &self,
        start: &DVector<f64>,
        span: f64,
        accuracy: Accuracy,
    ) -> Result<DVector<f64>, SimulateError> {
        let mut run = self.run(start, accuracy)?;
        run.to(span)?;
        Ok(self.coordinates(&run.snapshot().state))
    }

    /// The coordinates after `span`, s, and their derivatives with respect to those at the start: a row for
    /// each at the end, a column for each at the start.
    pub(crate) fn end_and_derivatives(
        &self,
        start: &DVector<f64>,
        span: f64,
        accuracy: Accuracy,
    ) -> Result<(DVector<f64>, DMatrix<f64>), SimulateError> {
        let count = start.len();
        let parts: Vec<(DVector<f64>, DMatrix<f64>)> = (0..count.div_ceil(DIRECTIONS))
            .into_par_iter()
            .map(|part| {
                let mut run = self.run(start, accuracy)?;
                let mut variation = Variation::new(&self.chain, [0.0; DIRECTIONS]);
                let places = self.places(variation.at_end().layout);
                let columns = part * DIRECTIONS..count.min((part + 1) * DIRECTIONS);
                variation.start_at(&places[columns.clone()]);
                run.watch(span, |step| variation.follow(step))?;
                let slope = |row: usize, column: usize| variation.slopes(places[row])[column];
                let derivatives = DMatrix::from_fn(count, columns.len(), slope);
                Ok((self.coordinates(&run.snapshot().state), derivatives))
            })
            .collect::<Result<_, SimulateError>>()?;
        let columns: Vec<_> = parts.iter().flat_map(|(_, part)| part.column_iter()).collect();
        let derivatives = DMatrix::from_columns(&columns);
        let end = parts.into_iter().next().map(|(end, _)| end);
        Ok((end.unwrap_or_else(|| start.clone()), derivatives))
    }
}
