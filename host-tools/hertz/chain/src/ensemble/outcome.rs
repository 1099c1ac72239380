//! The end of a chain of an ensemble.

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
    pub(super) strokes: Vec<f64>,
    pub(super) steps: u64,
}

impl EnsembleOutcome {
    /// Computes the loss in contacts and the wall's momentum from the balances of energy and momentum.
    pub(super) fn balanced(mut self) -> Self {
        let (model, state) = (&self.model, &mut self.state);
        let layout = model.layout();
        let viscous = (1..=model.contacts()).any(|contact| model.contact(contact).relaxation > 0.0);
        if viscous {
            state[layout.contact_loss()] = model.initial_energy() - model.energies(state).total();
        }
        if let Some(index) = layout.wall_impulse() {
            let bodies = model.starts.iter().enumerate();
            let before: f64 = bodies.map(|(body, start)| model.mass(body) * start.1).sum();
            state[index] = before - model.momentum(state);
        }
        self
    }

    /// The same end, on another chain.
    pub(crate) fn on(&self, model: Model) -> Self {
        let model = Arc::new(model);
        Self {
            model,
            ..self.clone()
        }
        .balanced()
    }

    /// Masses, contacts and intruders of the chain.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// End of the run, s.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Number of steps tried, each of nine evaluations, or of sixteen in a chain that ran by itself.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// The state of the chain at its end.
    ///
    /// The energy dissipated in viscous contacts is what all other energies leave of the initial one, so the
    /// sum of all energies does not show the error here.
    pub fn end(&self) -> Snapshot<'_> {
        Snapshot {
            model: &self.model,
            time: self.time,
            state: self.state.clone(),
        }
    }

    /// The energy that all intruders have dissipated, J.
    pub fn absorbed(&self) -> f64 {
        let layout = self.model.layout();
        let intruders = 0..self.model.intruders().len();
        // The sum of nothing would be -0.
        intruders.fold(0.0, |sum, guest| sum + self.state[layout.intruder_loss(guest)])
    }

    /// Injected energy, J: the striker's loss, plus the energy of beads that moved at t = 0 and the work of a
    /// drive.
    pub fn injected(&self) -> f64 {
        let layout = self.model.layout();
        let supplied = layout.drive_work().map_or(0.0, |index| self.state[index]);
        let striker = self.model.striker_energy_at(self.state[layout.velocity(0)]);
        self.model.initial_energy() + supplied - striker
    }

    /// The greatest force of each contact of [`EnsembleOptions::peaks`](crate::EnsembleOptions::peaks) that
    /// ever carried one. Its width is not computed.
    pub fn peaks(&self) -> &[ContactPeak] {
        &self.peaks
    }

    /// The greatest displacement |x| of each intruder from rest in its host, m, in the order of the beads, if
    /// [`EnsembleOptions::strokes`](crate::EnsembleOptions::strokes) asked for it.
    pub fn strokes(&self) -> &[f64] {
        &self.strokes
    }

    /// The energy that each intruder has taken, in the order of the beads.
    pub fn absorption(&self) -> Vec<Absorption> {
        Absorption::all(&self.end())
    }
}
