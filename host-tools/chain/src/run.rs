//! A chain that runs step by step. What is not asked for is not kept, so a chain may have any length.
//!
//! # Design
//!
//! A [`Run`] is where the chain is now. It moves on to a time, and a [`Step`] lets look into each step on the
//! way. A step computes only the beads that the wave moves ([`crate::solver`]), so with nothing kept a pulse
//! in a long elastic chain costs as much in each bead as in a short one.

use std::ops::{ControlFlow, Range};
use std::sync::Arc;

use crate::model::Model;
use crate::options::{Accuracy, SimulateError};
use crate::scenario::Scenario;

use crate::solution::Snapshot;
use crate::solver::{Lanes, Stepper};

/// A chain that moves on from where it is. A copy goes its own way from there.
///
/// ```
/// use hertz_chain::{Accuracy, Run, Scenario};
///
/// let mut scenario = Scenario::paper();
/// scenario.chain.beads = 4000;
/// let mut run = Run::new(&scenario, Accuracy::DRAFT)?;
/// run.to(5e-3)?;
/// let first = run.snapshot().velocity(20);
///
/// // What if it had gone on from there? A snapshot can be run on.
/// let mut other = run.snapshot().resume(Accuracy::REFERENCE)?;
/// other.to(6e-3)?;
/// # assert!(first.is_finite());
/// # Ok::<(), hertz_chain::SimulateError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Run {
    model: Arc<Model>,
    stepper: Stepper,
}

/// Steps that take seconds at most.
const FEW_STEPS: f64 = 1e6;
/// Steps that take more than a day, even if few beads move. A collision takes some ten.
const MOST_STEPS: f64 = 2e11;

impl Run {
    /// The chain of a scenario at t = 0. Its duration is not looked at.
    ///
    /// # Errors
    /// [`SimulateError`]: the scenario or the accuracy is out of range.
    pub fn new(scenario: &Scenario, accuracy: Accuracy) -> Result<Self, SimulateError> {
        scenario.check()?;
        let model = Model::new(scenario);
        let start = model.initial();
        Self::start(Arc::new(model), (0.0, &start), accuracy)
    }

    /// Refuses a run to `end`, s, if it would take absurdly long. `longest_step` is that of the accuracy.
    ///
    /// # Errors
    /// [`SimulateError::TooStiff`], [`SimulateError::TooManySteps`].
    pub fn check(&self, end: f64, longest_step: f64) -> Result<(), SimulateError> {
        let step = self.model.longest_step(longest_step);
        let steps = self.fewest_steps(end, longest_step);
        // A strike may be so slow that no resonator is as slow.
        if steps < FEW_STEPS {
            return Ok(());
        }
        // Sixteen evaluations, 20 ns for eight bodies each.
        let seconds = steps * (0.5e-6 + 0.04e-6 * self.model.bodies() as f64);
        if let Some((bead, rate)) = self.model.absurd_intruder() {
            let time = 1.0 / rate;
            return Err(SimulateError::TooStiff {
                bead,
                time,
                steps,
                seconds,
            });
        }
        if steps > MOST_STEPS {
            return Err(SimulateError::TooManySteps { end, step });
        }
        Ok(())
    }

    /// How many steps a run to `end`, s, takes at the least. `longest_step` is that of the accuracy.
    pub fn fewest_steps(&self, end: f64, longest_step: f64) -> f64 {
        (end - self.time()) / self.model.longest_step(longest_step)
    }

    pub(crate) fn start(
        model: Arc<Model>,
        (time, state): (f64, &[f64]),
        accuracy: Accuracy,
    ) -> Result<Self, SimulateError> {
        accuracy.check()?;
        let longest = accuracy.longest_step * model.shortest_contact();
        let (lanes, layout) = (Arc::new(Lanes::new(&model)), model.layout());
        let stepper = Stepper::new(lanes, layout, (time, state), accuracy.tolerance, longest);
        Ok(Self { model, stepper })
    }

    /// Masses, contacts and intruders of the chain.
    pub fn model(&self) -> &Model {
        &self.model
    }

    pub(crate) fn shared_model(&self) -> Arc<Model> {
        self.model.clone()
    }

    pub(crate) fn lanes(&self) -> Arc<Lanes> {
        self.stepper.lanes()
    }

    /// Where the run is, s.
    pub fn time(&self) -> f64 {
        self.stepper.time
    }

    /// Steps made so far.
    pub fn steps(&self) -> u64 {
        self.stepper.steps
    }

    /// Evaluations of the equations of motion so far, of the beads that move.
    pub fn evaluations(&self) -> u64 {
        self.stepper.evaluations
    }

    /// Makes one step, which does not pass `stop`, s. A step that reaches `stop` ends on it exactly.
    ///
    /// # Errors
    /// [`SimulateError::Stuck`].
    pub fn step(&mut self, stop: f64) -> Result<Step<'_>, SimulateError> {
        let from = self.time();
        self.advance(stop)?;
        Ok(Step { run: self, from })
    }

    pub(crate) fn advance(&mut self, stop: f64) -> Result<(), SimulateError> {
        let time = self.time();
        self.stepper
            .advance(stop)
            .map_err(|_| SimulateError::Stuck { time })
    }

    /// Goes on to `time`, s; nothing happens if that has passed.
    ///
    /// # Errors
    /// [`SimulateError::Stuck`].
    pub fn to(&mut self, time: f64) -> Result<(), SimulateError> {
        while self.time() < time {
            self.advance(time)?;
        }
        Ok(())
    }

    /// Goes on to `time`, s, and lets `look` into each step.
    ///
    /// # Errors
    /// [`SimulateError::Stuck`].
    pub fn watch(&mut self, time: f64, mut look: impl FnMut(&mut Step<'_>)) -> Result<(), SimulateError> {
        let all = self.watch_while(time, |step| {
            look(step);
            ControlFlow::<()>::Continue(())
        });
        all.map(|_| ())
    }

    /// [`Run::watch`] until `look` has seen enough.
    ///
    /// # Errors
    /// [`SimulateError::Stuck`].
    pub fn watch_while<B>(
        &mut self,
        time: f64,
        mut look: impl FnMut(&mut Step<'_>) -> ControlFlow<B>,
    ) -> Result<ControlFlow<B>, SimulateError> {
        self.stepper.keep_inside();
        while self.time() < time {
            if let ControlFlow::Break(enough) = look(&mut self.step(time)?) {
                return Ok(ControlFlow::Break(enough));
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    /// Everything, at the time where the run is.
    pub fn snapshot(&mut self) -> Snapshot<'_> {
        let mut state = vec![0.0; self.model.layout().dimension()];
        self.stepper.state(&mut state);
        Snapshot::new(&self.model, self.time(), state)
    }

    pub(crate) fn stepper(&self) -> &Stepper {
        &self.stepper
    }

    pub(crate) fn write_state(&mut self, out: &mut [f64]) {
        self.stepper.state(out);
    }
}

/// A step that a run has just made.
#[derive(Debug)]
pub struct Step<'a> {
    run: &'a mut Run,
    from: f64,
}

impl Step<'_> {
    /// When it starts, s.
    pub fn from(&self) -> f64 {
        self.from
    }

    /// When it ends, s.
    pub fn to(&self) -> f64 {
        self.run.time()
    }

    /// How many steps the run has made, this one included.
    pub fn number(&self) -> u64 {
        self.run.steps()
    }

    /// The chain's model.
    pub fn model(&self) -> &Model {
        &self.run.model
    }

    pub(crate) fn parts(&mut self) -> (&Model, &mut Stepper) {
        (&self.run.model, &mut self.run.stepper)
    }

    pub(crate) fn shared_model(&self) -> &Arc<Model> {
        &self.run.model
    }

    /// What it takes to repeat the step: the chain on lanes, and the tolerance.
    pub(crate) fn method(&self) -> (Arc<Lanes>, f64) {
        (self.run.lanes(), self.run.stepper.tolerance())
    }

    pub(crate) fn write_state(&mut self, out: &mut [f64]) {
        self.run.write_state(out);
    }

    /// Bodies that something moves in this step, in runs of neighbours. All others stand still or fly freely.
    pub fn moving(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        self.run.stepper.moving()
    }

    /// The motion at time `t`, s, of this step.
    ///
    /// # Panics
    /// If `t` is not in the step.
    pub fn at(&mut self, t: f64) -> StepView<'_> {
        let (from, to) = (self.from, self.to());
        assert!(
            (from..=to).contains(&t),
            "{t} s is not in the step, {from} to {to} s"
        );
        self.run.stepper.keep_inside();
        self.run.stepper.look(t);
        StepView {
            model: &self.run.model,
            stepper: &self.run.stepper,
            time: t,
        }
    }
}

/// A chain at one time of a [`Step`]. Only what is asked for is computed.
#[derive(Debug, Clone, Copy)]
pub struct StepView<'a> {
    model: &'a Model,
    stepper: &'a Stepper,
    time: f64,
}

impl StepView<'_> {
    /// The time, s.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Displacement of `body` since t = 0, m; body 0 is the striker.
    ///
    /// # Panics
    /// If there is no such body.
    pub fn displacement(&self, body: usize) -> f64 {
        self.body(body).0 - self.model.start(body)
    }

    /// Velocity of `body`, m/s.
    ///
    /// # Panics
    /// If there is no such body.
    pub fn velocity(&self, body: usize) -> f64 {
        assert!(body < self.model.bodies(), "body {body} is not of this chain");
        self.stepper.speed(body)
    }

    fn body(&self, body: usize) -> (f64, f64) {
        assert!(body < self.model.bodies(), "body {body} is not of this chain");
        self.stepper.body(body, self.time)
    }

    /// Change of the overlap of a contact since rest, and its rate.
    fn change(&self, contact: usize) -> (f64, f64) {
        let near = self.body(contact - 1);
        let far = if contact < self.model.bodies() {
            self.body(contact)
        } else {
            (0.0, 0.0)
        };
        (near.0 - far.0, near.1 - far.1)
    }

    /// How far `contact` is compressed, m; negative if it is open.
    ///
    /// # Panics
    /// If there is no such contact.
    pub fn overlap(&self, contact: usize) -> f64 {
        self.model.contact(contact).static_overlap + self.change(contact).0
    }

    /// Total force of `contact`, N, positive in compression.
    ///
    /// # Panics
    /// If there is no such contact.
    pub fn force(&self, contact: usize) -> f64 {
        let load = self.model.contact(contact).load;
        let (change, rate) = self.change(contact);
        load + self.model.force_beyond_at(contact, change, rate)
    }

    /// Displacement of the intruder in `bead` relative to its host, x = u - U, m; none without an intruder.
    pub fn intruder_displacement(&self, bead: usize) -> Option<f64> {
        Some(self.stepper.guest(self.model.intruder_of(bead)?).0)
    }

    /// Its rate, m/s.
    pub fn intruder_velocity(&self, bead: usize) -> Option<f64> {
        Some(self.stepper.guest(self.model.intruder_of(bead)?).1)
    }

    /// Absolute acceleration of the intruder in `bead`, m/s²; none without an intruder.
    pub fn intruder_acceleration(&self, bead: usize) -> Option<f64> {
        let intruder = self.model.intruder_of(bead)?;
        let (x, x_rate) = self.stepper.guest(intruder);
        let oscillator = &self.model.intruders()[intruder].oscillator;
        Some(-oscillator.pull(x, x_rate) / oscillator.mass)
    }
}

impl Snapshot<'_> {
    /// A run that goes on from here. It comes to the same values as one that was never interrupted, to the
    /// accuracy asked for.
    ///
    /// # Errors
    /// [`SimulateError::Input`]: the accuracy is out of range.
    pub fn resume(&self, accuracy: Accuracy) -> Result<Run, SimulateError> {
        let (model, state) = self.parts();
        Run::start(model.clone(), (self.time(), state), accuracy)
    }
}
