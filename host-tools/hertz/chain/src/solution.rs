//! The motion of a run at any time.
//!
//! # Design
//!
//! The state after each step is kept, and the step's stages ([`crate::solver::StepLog`]). The motion inside a
//! step is the method's dense output. A [`Sampler`] keeps the last step that it read.
//!
//! The summary looks for peaks inside each step, which takes longer than the run. It is found on request, by
//! a second run that makes the same steps.

use std::ops::RangeInclusive;
use std::sync::{Arc, OnceLock};

use crate::model::{Energies, Model};
use crate::options::Accuracy;
use crate::region::RegionEnergies;
use crate::solver::{Dense, Lanes, StepLog};
use crate::summary::{SolverSummary, Summary};

/// The motion of a chain from t = 0 to [`Solution::end`]. Bodies are counted from 0, the striker; beads and
/// contacts from 1.
///
/// Each step keeps 8 bytes × (2 bodies + 3 intruders + 1), 8 more with a wall, and a kilobyte for each eight
/// bodies or intruders that move: 3 MB for the paper's strike. A run that would keep more than 4 GB is
/// refused.
#[derive(Debug, Clone)]
pub struct Solution {
    pub(crate) model: Arc<Model>,
    pub(crate) lanes: Arc<Lanes>,
    pub(crate) accuracy: Accuracy,
    /// Ends of the steps, s.
    pub(crate) times: Vec<f64>,
    /// The state at each of them, one after another.
    pub(crate) states: Vec<f64>,
    /// The steps between them.
    pub(crate) log: StepLog,
    /// Time that the summary covers, s.
    pub(crate) covered: f64,
    pub(crate) solver: SolverSummary,
    pub(crate) summary: OnceLock<Summary>,
}

impl Solution {
    /// Masses, contacts and intruders of the chain.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Last time of the run, s.
    pub fn end(&self) -> f64 {
        self.times[self.times.len() - 1]
    }

    /// A reader that is fastest if the times are in order.
    pub fn sampler(&self) -> Sampler<'_> {
        Sampler {
            solution: self,
            dense: self.dense(),
        }
    }

    /// The state of the whole chain at time `t`, s.
    ///
    /// # Panics
    /// If `t` is not within 0 to [`Solution::end`]. [`Options::duration`](crate::Options::duration) makes a
    /// run longer.
    pub fn at(&self, t: f64) -> Snapshot<'_> {
        self.sampler().at(t)
    }

    /// Number of the step that holds time `t`, s. Panics like [`Solution::at`].
    pub(crate) fn step_at(&self, t: f64) -> usize {
        let end = self.end();
        assert!(
            (0.0..=end).contains(&t),
            "{t} s is not within the run, 0 to {end} s"
        );
        let knot = self.times.partition_point(|&time| time <= t);
        knot.clamp(1, self.times.len() - 1) - 1
    }

    pub(crate) fn state(&self, knot: usize) -> &[f64] {
        let dimension = self.model.layout().dimension();
        &self.states[knot * dimension..(knot + 1) * dimension]
    }

    /// Memory for the dense output of a step.
    pub(crate) fn dense(&self) -> Dense {
        Dense::new(&self.lanes, self.model.layout())
    }

    /// Loads the dense output between `knot` and the next.
    pub(crate) fn load(&self, dense: &mut Dense, knot: usize) {
        dense.load(&self.log, knot, self.state(knot));
    }
}

/// Reads a [`Solution`] at many times, fastest if each is close to the last.
#[derive(Debug, Clone)]
pub struct Sampler<'a> {
    solution: &'a Solution,
    dense: Dense,
}

impl<'a> Sampler<'a> {
    /// The state of the whole chain at time `t`, s. Panics like [`Solution::at`].
    pub fn at(&mut self, t: f64) -> Snapshot<'a> {
        let solution = self.solution;
        if !self.dense.holds(t) {
            solution.load(&mut self.dense, solution.step_at(t));
        }
        let mut state = Vec::with_capacity(solution.model.layout().dimension());
        self.dense.at(t, &mut state);
        Snapshot {
            model: &solution.model,
            time: t,
            state,
        }
    }
}

/// Motion of an intruder at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct IntruderMotion {
    /// Displacement relative to its host, x = u - U, m; relative to its carrier if another intruder carries
    /// it.
    pub displacement: f64,
    /// Velocity relative to its host or carrier, m/s.
    pub velocity: f64,
    /// Absolute acceleration u'', m/s².
    pub acceleration: f64,
}

impl IntruderMotion {
    /// `motion` returns displacement and velocity of an intruder, by its number.
    pub(crate) fn of(model: &Model, intruder: usize, motion: impl Fn(usize) -> (f64, f64)) -> Self {
        let (displacement, velocity) = motion(intruder);
        Self {
            displacement,
            velocity,
            acceleration: model.acceleration_at(intruder, motion),
        }
    }
}

/// A chain at one time. Bodies are counted from 0, the striker; beads and contacts from 1. Methods panic if a
/// body or contact is not in the chain.
#[derive(Debug, Clone)]
pub struct Snapshot<'a> {
    pub(crate) model: &'a Arc<Model>,
    pub(crate) time: f64,
    pub(crate) state: Vec<f64>,
}

impl<'a> Snapshot<'a> {
    /// The time, s.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Masses, contacts and intruders of the chain.
    pub fn model(&self) -> &'a Model {
        self.model
    }

    /// Displacement of `body` since t = 0, m. A chain under a static load is at rest there.
    pub fn displacement(&self, body: usize) -> f64 {
        self.body(body);
        self.state[body] - self.model.starts[body].0
    }

    /// Velocity of `body`, m/s.
    pub fn velocity(&self, body: usize) -> f64 {
        self.body(body);
        self.state[self.model.layout().velocity(body)]
    }

    /// Overlap of `contact`, m; negative if it is open.
    pub fn overlap(&self, contact: usize) -> f64 {
        self.model.contact_at(contact);
        self.model.overlap(&self.state, contact).0
    }

    /// Total force of `contact`, N, positive in compression.
    pub fn force(&self, contact: usize) -> f64 {
        self.model.contact_at(contact);
        self.model.force(&self.state, contact)
    }

    /// Motion of an intruder, by its number in [`Model::intruders`].
    ///
    /// # Panics
    /// The chain has no such intruder.
    pub fn motion_of(&self, intruder: usize) -> IntruderMotion {
        self.known(intruder);
        let layout = self.model.layout();
        IntruderMotion::of(self.model, intruder, |number| {
            (
                self.state[layout.relative(number)],
                self.state[layout.relative_velocity(number)],
            )
        })
    }

    /// Energy that an intruder has dissipated, ∫ c x'² dt, J. Panics like [`Snapshot::motion_of`].
    pub fn dissipated_by(&self, intruder: usize) -> f64 {
        self.known(intruder);
        self.state[self.model.layout().intruder_loss(intruder)]
    }

    /// Energy in the motion and in the spring of an intruder, ½ m u'² + ½ k x² + ¼ k₃ x⁴, J. Panics
    /// like [`Snapshot::motion_of`].
    pub fn stored_by(&self, intruder: usize) -> f64 {
        let one = &self.model.intruders()[intruder];
        let motion = self.motion_of(intruder);
        let velocity = self.velocity(one.bead) + self.model.velocity_in_host(&self.state, intruder);
        0.5 * one.oscillator.mass * velocity * velocity + one.elastic_energy(motion.displacement)
    }

    /// Displacement of the intruder in `bead` relative to its host, x = u - U, m; `None` for a bead without
    /// an intruder or with several, here and in the next three functions ([`Snapshot::motion_of`] covers
    /// each).
    pub fn intruder_displacement(&self, bead: usize) -> Option<f64> {
        Some(self.motion_of(self.model.intruder_of(bead)?).displacement)
    }

    /// Velocity of the intruder in `bead` relative to its host, m/s.
    pub fn intruder_velocity(&self, bead: usize) -> Option<f64> {
        Some(self.motion_of(self.model.intruder_of(bead)?).velocity)
    }

    /// Absolute acceleration of the intruder in `bead`, m/s².
    pub fn intruder_acceleration(&self, bead: usize) -> Option<f64> {
        Some(self.motion_of(self.model.intruder_of(bead)?).acceleration)
    }

    /// Energy that the intruder in `bead` has dissipated, ∫ c x'² dt, J.
    pub fn intruder_dissipated(&self, bead: usize) -> Option<f64> {
        Some(self.dissipated_by(self.model.intruder_of(bead)?))
    }

    /// Energies of beads `beads.start()` to `beads.end()`, by kind, J; body 0 is the striker.
    pub fn region(&self, beads: RangeInclusive<usize>) -> RegionEnergies {
        self.body(*beads.end());
        self.model.region_energies(&self.state, beads)
    }

    /// Energies, J.
    pub fn energies(&self) -> Energies {
        self.model.energies(&self.state)
    }

    /// Momentum of all bodies and intruders, kg·m/s. Its sum with [`Snapshot::wall_impulse`] is constant over
    /// a run without a drive, on a ground that does not drag.
    pub fn momentum(&self) -> f64 {
        self.model.momentum(&self.state)
    }

    /// Momentum that the wall has taken beyond that of the static load, ∫ (F - F₀) dt, kg·m/s. Zero if the
    /// far end is free.
    pub fn wall_impulse(&self) -> f64 {
        let index = self.model.layout().wall_impulse();
        index.map_or(0.0, |index| self.state[index])
    }

    /// Impulse of a contact beyond that of its static load since t = 0, ∫ (F - F₀) dt, N·s: the momentum that
    /// the bodies behind it, the wall and a ground that drags have gained.
    pub fn impulse(&self, contact: usize) -> f64 {
        let starts = self.model.starts.iter().enumerate().skip(contact);
        let before: f64 = starts.map(|(body, start)| self.model.mass(body) * start.1).sum();
        // ∫ M V/τ dt is M/τ times the displacement.
        let dragged = (contact..self.model.bodies())
            .map(|body| self.model.drag_on(body) * (self.state[body] - self.model.starts[body].0));
        let ground: f64 = dragged.sum();
        self.model.momentum_from(&self.state, contact) + self.wall_impulse() + ground - before
    }

    fn known(&self, intruder: usize) {
        let count = self.model.intruders().len();
        assert!(
            intruder < count,
            "intruder {intruder} is not one of the {count} of this chain"
        );
    }

    fn body(&self, body: usize) {
        assert!(body < self.model.bodies(), "body {body} is not of this chain");
    }
}
