//! Quantities of the motion and their rates, at the ends of steps and inside them.

use crate::model::Model;
use crate::solution::Solution;
use crate::solver::Dense;

/// A quantity that has peaks.
#[derive(Debug, Clone, Copy)]
pub(crate) enum PeakQuantity {
    /// Force of a contact beyond its static load.
    ForceBeyond(usize),
    Velocity(usize),
}

impl PeakQuantity {
    pub(crate) fn value(self, model: &Model, y: &[f64]) -> f64 {
        match self {
            Self::ForceBeyond(contact) => model.force_beyond(y, contact),
            Self::Velocity(body) => y[model.layout().velocity(body)],
        }
    }

    /// Rate of change where the state is `y` and changes by `dy` a second.
    pub(crate) fn rate(self, model: &Model, y: &[f64], dy: &[f64]) -> f64 {
        match self {
            Self::ForceBeyond(contact) => model.force_rate(y, dy, contact),
            Self::Velocity(body) => dy[model.layout().velocity(body)],
        }
    }
}

/// Dense output of a step, with memory for a state and its rate.
pub(crate) struct StepSampler<'a> {
    model: &'a Model,
    dense: Dense,
    y: Vec<f64>,
    dy: Vec<f64>,
}

impl<'a> StepSampler<'a> {
    pub(crate) fn new(solution: &'a Solution, knot: usize) -> Self {
        let dimension = solution.model().layout().dimension();
        let mut dense = solution.dense();
        solution.load(&mut dense, knot);
        Self {
            model: solution.model(),
            dense,
            y: vec![0.0; dimension],
            dy: vec![0.0; dimension],
        }
    }

    pub(crate) fn at(&mut self, t: f64) -> (&Model, &[f64]) {
        self.dense.at(t, &mut self.y);
        (self.model, &self.y)
    }

    pub(crate) fn value(&mut self, quantity: PeakQuantity, t: f64) -> f64 {
        self.dense.at(t, &mut self.y);
        quantity.value(self.model, &self.y)
    }

    pub(crate) fn rate(&mut self, quantity: PeakQuantity, t: f64) -> f64 {
        self.dense.at(t, &mut self.y);
        self.model.rate(t, &self.y, &mut self.dy);
        quantity.rate(self.model, &self.y, &self.dy)
    }
}
