//! What a chain of an ensemble has come to.

use std::sync::Arc;

use crate::absorption::Absorption;
use crate::model::Model;
use crate::solution::Snapshot;
use crate::summary::ContactPeak;

/// The end of one chain of an ensemble.
#[derive(Debug, Clone)]
pub struct EnsembleOutcome {
    pub(super) model: Arc<Model>,
    pub(super) time: f64,
    pub(super) state: Vec<f64>,
    pub(super) peaks: Vec<ContactPeak>,
    pub(super) steps: u64,
}

impl EnsembleOutcome {
    /// The contacts' loss is what the other energies leave of the first, and no wall counts what it was
    /// given.
    pub(super) fn balanced(mut self) -> Self {
        let (model, state) = (&self.model, &mut self.state);
        let layout = model.layout();
        let viscous = (1..=model.contacts()).any(|contact| model.contact(contact).relaxation > 0.0);
        if viscous {
            state[layout.contact_loss()] = model.initial_energy() - model.energies(state).total();
        }
        if let Some(index) = layout.wall_impulse() {
            let before: f64 = (0..model.bodies()).map(|body| model.initial_momentum(body)).sum();
            state[index] = before - model.momentum(state);
        }
        self
    }

    /// Masses, contacts and intruders of the chain.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// When it ended, s.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Steps that were tried, each of nine evaluations of the equations of motion. A chain that ran by itself
    /// has steps of sixteen.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// The chain at its end: velocities, energies of any beads, and the rest that a run knows of one time.
    ///
    /// What viscous contacts have dissipated is the part of the first energy that nothing else has; the sum
    /// of all energies does not show the error here.
    pub fn end(&self) -> Snapshot<'_> {
        Snapshot::new(&self.model, self.time, self.state.clone())
    }

    /// The energy that all intruders have dissipated, J.
    pub fn absorbed(&self) -> f64 {
        let layout = self.model.layout();
        let intruders = 0..self.model.intruders().len();
        intruders
            .map(|guest| self.state[layout.intruder_loss(guest)])
            .sum()
    }

    /// The energy that the striker has given to the chain, and that beads had at t = 0, J.
    pub fn injected(&self) -> f64 {
        let speed = self.state[self.model.layout().velocity(0)];
        self.model.initial_energy() - 0.5 * self.model.mass(0) * speed * speed
    }

    /// The greatest force of each contact that [`EnsembleOptions::peaks`](crate::EnsembleOptions::peaks)
    /// names, if it ever carried one. Its width is not looked for.
    pub fn peaks(&self) -> &[ContactPeak] {
        &self.peaks
    }

    /// The energy that each intruder has taken, in the order of the beads.
    pub fn absorption(&self) -> Vec<Absorption> {
        Absorption::all(&self.end())
    }
}
