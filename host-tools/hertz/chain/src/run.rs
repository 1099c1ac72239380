//! Runs of a chain, step by step. Only the present state is kept, so a chain may have any length.
//!
//! # Design
//!
//! A [`Run`] holds the present state of a chain. It advances to a time, and each [`RunStep`] on the way can
//! be observed. A step computes only the beads that the wave moves ([`crate::solver`]), so a pulse in a long
//! elastic chain costs as much for each bead as in a short one.

use std::ops::{ControlFlow, Range};
use std::sync::Arc;

use crate::model::Model;
use crate::options::{Accuracy, SimulateError};
use crate::scenario::Scenario;
use crate::solution::{IntruderMotion, Snapshot};
use crate::solver::{Lanes, StepMoment, Stepper};

/// A chain in motion. A clone is independent of it. A step that cannot advance the clock fails with
/// [`SimulateError::Stuck`].
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
/// // A snapshot can be run on, at another accuracy.
/// let mut other = run.snapshot().resume(Accuracy::REFERENCE)?;
/// other.to(6e-3)?;
/// # assert!(first.is_finite());
/// # Ok::<(), hertz_chain::SimulateError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Run {
    pub(crate) model: Arc<Model>,
    pub(crate) stepper: Stepper,
}

/// Steps that take seconds at most.
const FEW_STEPS: f64 = 1e6;
/// Steps that take more than a day even if few beads move. A collision takes about ten.
const MOST_STEPS: f64 = 2e11;

impl Run {
    /// The chain of a scenario at t = 0. The scenario's duration is not used.
    ///
    /// # Errors
    /// [`SimulateError`]: the scenario or the accuracy is out of range.
    pub fn new(scenario: &Scenario, accuracy: Accuracy) -> Result<Self, SimulateError> {
        let model = Model::of(scenario)?;
        let start = model.initial();
        Self::start(Arc::new(model), (0.0, &start), accuracy)
    }

    /// Refuses a run to `end`, s, that would take absurdly long. `longest_step` is that of the accuracy.
    ///
    /// # Errors
    /// [`SimulateError::TooStiff`], [`SimulateError::TooManySteps`], and [`SimulateError::DriveEnds`] if a
    /// recorded drive ends before `end`.
    pub fn check(&self, end: f64, longest_step: f64) -> Result<(), SimulateError> {
        let drive = self.model.drive.as_ref().and_then(|drive| drive.end());
        if let Some(last) = drive.filter(|last| end > last * (1.0 + 1e-12)) {
            return Err(SimulateError::DriveEnds { last, end });
        }
        let step = self.model.longest_step(longest_step);
        let steps = self.fewest_steps(end, longest_step);
        // In a very slow strike, any resonator is comparatively fast.
        if steps < FEW_STEPS {
            return Ok(());
        }
        // Sixteen evaluations of 20 ns for each eight bodies.
        let seconds = steps * (0.5e-6 + 0.04e-6 * self.model.bodies() as f64);
        if let Some((bead, rate)) = self.model.absurd_intruder() {
            return Err(SimulateError::TooStiff {
                bead,
                time: 1.0 / rate,
                steps,
                seconds,
            });
        }
        if steps > MOST_STEPS {
            return Err(SimulateError::TooManySteps { end, step });
        }
        Ok(())
    }

    /// Least number of steps of a run to `end`, s. `longest_step` is that of the accuracy.
    pub fn fewest_steps(&self, end: f64, longest_step: f64) -> f64 {
        (end - self.time()) / self.model.longest_step(longest_step)
    }

    pub(crate) fn start(
        model: Arc<Model>,
        (time, state): (f64, &[f64]),
        accuracy: Accuracy,
    ) -> Result<Self, SimulateError> {
        accuracy.check()?;
        let longest = accuracy.longest_step * model.shortest_time();
        let (lanes, layout) = (Arc::new(Lanes::new(&model)), model.layout());
        let stepper = Stepper::new(lanes, layout, (time, state), accuracy.tolerance, longest);
        Ok(Self { model, stepper })
    }

    /// Masses, contacts and intruders of the chain.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Present time of the run, s.
    pub fn time(&self) -> f64 {
        self.stepper.time
    }

    /// Number of steps made.
    pub fn steps(&self) -> u64 {
        self.stepper.steps
    }

    /// Number of evaluations of the equations of motion, each of the moving beads.
    pub fn evaluations(&self) -> u64 {
        self.stepper.evaluations
    }

    /// Makes one step, which does not pass `stop`, s. A step that reaches `stop` ends on it exactly.
    pub fn step(&mut self, stop: f64) -> Result<RunStep<'_>, SimulateError> {
        let from = self.time();
        self.advance(stop)?;
        Ok(RunStep { run: self, from })
    }

    pub(crate) fn advance(&mut self, stop: f64) -> Result<(), SimulateError> {
        let time = self.time();
        if let Some(drive) = &self.model.drive
            && let Some(last) = drive.end().filter(|last| time >= *last)
        {
            return Err(SimulateError::DriveEnds { last, end: stop });
        }
        self.stepper
            .advance(stop)
            .map_err(|_| SimulateError::Stuck { time })?;
        if let Some(guest) = self.stepper.torn_off() {
            let intruder = &self.model.intruders()[guest];
            return Err(SimulateError::SpringGivesWay {
                bead: intruder.bead,
                time: self.time(),
                reach: intruder.reach().unwrap_or(0.0),
            });
        }
        Ok(())
    }

    /// Advances to `time`, s; does nothing if that has passed.
    pub fn to(&mut self, time: f64) -> Result<(), SimulateError> {
        while self.time() < time {
            self.advance(time)?;
        }
        Ok(())
    }

    /// Advances to `time`, s, and calls `observe` with each step.
    pub fn watch(
        &mut self,
        time: f64,
        mut observe: impl FnMut(&mut RunStep<'_>),
    ) -> Result<(), SimulateError> {
        let all = self.watch_while(time, |step| {
            observe(step);
            ControlFlow::<()>::Continue(())
        });
        all.map(|_| ())
    }

    /// Advances as [`Run::watch`] does, until `observe` returns `Break`.
    pub fn watch_while<B>(
        &mut self,
        time: f64,
        mut observe: impl FnMut(&mut RunStep<'_>) -> ControlFlow<B>,
    ) -> Result<ControlFlow<B>, SimulateError> {
        self.stepper.keep_inside();
        while self.time() < time {
            if let ControlFlow::Break(enough) = observe(&mut self.step(time)?) {
                return Ok(ControlFlow::Break(enough));
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    /// The present state of the whole chain.
    pub fn snapshot(&mut self) -> Snapshot<'_> {
        let mut state = vec![0.0; self.model.layout().dimension()];
        self.stepper.state(&mut state);
        Snapshot {
            model: &self.model,
            time: self.stepper.time,
            state,
        }
    }
}

/// The last step of a run.
#[derive(Debug)]
pub struct RunStep<'a> {
    pub(crate) run: &'a mut Run,
    from: f64,
}

impl RunStep<'_> {
    /// Start of the step, s.
    pub fn from(&self) -> f64 {
        self.from
    }

    /// End of the step, s.
    pub fn to(&self) -> f64 {
        self.run.time()
    }

    /// Number of steps that the run has made, including this one.
    pub fn number(&self) -> u64 {
        self.run.steps()
    }

    /// The chain's model.
    pub fn model(&self) -> &Model {
        &self.run.model
    }

    /// Bodies that a force moves in this step, in runs of neighbours. All others stand still or fly freely.
    pub fn moving(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        self.run.stepper.moving()
    }

    /// The motion at time `t`, s, inside this step.
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
        self.run.stepper.interpolate(t);
        StepView {
            model: &self.run.model,
            stepper: &self.run.stepper,
            time: t,
        }
    }
}

/// A chain at one time inside a [`RunStep`]. Values are computed on request. Methods panic if a body or
/// contact is not in the chain.
#[derive(Debug, Clone, Copy)]
pub struct StepView<'a> {
    model: &'a Model,
    stepper: &'a Stepper,
    time: f64,
}

impl StepView<'_> {
    /// Time of the view, s.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Displacement of `body` since t = 0, m; body 0 is the striker.
    pub fn displacement(&self, body: usize) -> f64 {
        self.body(body).0 - self.model.starts[body].0
    }

    /// Velocity of `body`, m/s.
    pub fn velocity(&self, body: usize) -> f64 {
        assert!(body < self.model.bodies(), "body {body} is not of this chain");
        self.stepper.speed(body)
    }

    fn body(&self, body: usize) -> (f64, f64) {
        assert!(body < self.model.bodies(), "body {body} is not of this chain");
        self.stepper.body(body, self.time)
    }

    fn change(&self, contact: usize) -> (f64, f64) {
        StepMoment::Inside(self.stepper, self.time).change(self.model, contact)
    }

    /// Overlap of `contact`, m; negative if it is open.
    pub fn overlap(&self, contact: usize) -> f64 {
        self.model.contact_at(contact).static_overlap + self.change(contact).0
    }

    /// Rate of the overlap of `contact`, m/s.
    pub fn overlap_rate(&self, contact: usize) -> f64 {
        self.change(contact).1
    }

    /// Total force of `contact`, N, positive in compression.
    pub fn force(&self, contact: usize) -> f64 {
        let load = self.model.contact_at(contact).load;
        let (change, rate) = self.change(contact);
        load + self.model.force_beyond_at(contact, change, rate)
    }

    /// Motion of an intruder, by its number in [`Model::intruders`]; panics if the chain has no such
    /// intruder.
    pub fn motion_of(&self, intruder: usize) -> IntruderMotion {
        IntruderMotion::of(self.model, intruder, |number| self.stepper.guest(number))
    }

    /// Displacement of the intruder in `bead` relative to its host, x = u - U, m; `None` for a bead without
    /// an intruder or with several, here and in the next two functions ([`StepView::motion_of`] covers each).
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
}

impl Snapshot<'_> {
    /// Starts a run at this state. It agrees with an uninterrupted run to the accuracy asked for.
    ///
    /// # Errors
    /// [`SimulateError::Input`]: the accuracy is out of range.
    pub fn resume(&self, accuracy: Accuracy) -> Result<Run, SimulateError> {
        Run::start(self.model.clone(), (self.time, &self.state), accuracy)
    }
}
