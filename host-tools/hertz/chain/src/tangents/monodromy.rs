//! The motion of a driven chain over a time, with its derivatives by its start.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::chain::DualChain;
use super::phase::PhaseSpace;
use super::variation::Variation;
use crate::model::Model;
use crate::options::{Accuracy, SimulateError};
use crate::run::Run;
use crate::scenario::{InputError, Scenario};

/// Derivatives that are followed side by side.
const DIRECTIONS: usize = 8;

/// A chain whose motion may start anywhere. Its coordinates are the displacements, m, and momenta, kg·m/s, of
/// the bodies that the drive does not prescribe, then the displacements, m, and velocities, m/s, of the
/// intruders.
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

    fn space(&self) -> PhaseSpace<'_> {
        PhaseSpace { model: &self.model }
    }

    /// Coordinates of a state of the model.
    pub(crate) fn coordinates(&self, state: &[f64]) -> DVector<f64> {
        DVector::from_vec(self.space().coordinates(state))
    }

    /// The state of the model at t = 0 with these coordinates.
    pub(crate) fn state(&self, coordinates: &DVector<f64>) -> Vec<f64> {
        self.space().state(coordinates.as_slice())
    }

    /// Sizes of the coordinates in a motion of displacements of `length`, m, at a frequency of `rate`
    /// radians a second.
    pub(crate) fn sizes(&self, length: f64, rate: f64) -> DVector<f64> {
        let (space, intruders) = (self.space(), self.model.intruders().len());
        let speed = length * rate;
        let bodies = space.bodies();
        let shells = &self.model.shells[self.model.bodies() - bodies..];
        let sizes = std::iter::repeat_n(length, bodies)
            .chain(shells.iter().map(|shell| shell * speed))
            .chain(std::iter::repeat_n(length, intruders))
            .chain(std::iter::repeat_n(speed, intruders));
        DVector::from_iterator(space.dimension(), sizes)
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

    /// The coordinates after `span`, s, and their derivatives by those of the start: a row for each at the
    /// end, a column for each at the start.
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
                let places = self.space().places(&self.chain, variation.at_end().layout);
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
