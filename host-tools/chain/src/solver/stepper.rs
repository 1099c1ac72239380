//! A run, step by step: how long a step may be, and which beads it moves.

use super::dense::{pack, unpack};
use super::lanes::Lanes;
use super::rest::Rest;
use super::work::Work;
use crate::model::Layout;

/// A trajectory as far as it is known: its state, the length of the next step, and counts.
#[derive(Debug)]
pub(crate) struct Stepper<'a> {
    pub(crate) time: f64,
    pub(crate) evaluations: u64,
    pub(crate) steps: u64,
    lanes: &'a Lanes,
    layout: Layout,
    work: Work,
    rest: Rest,
    contacts_lost: f64,
    guests_lost: Vec<f64>,
    wall_impulse: f64,
    tolerance: f64,
    step: f64,
    longest: f64,
}

/// How a step should change to have the error 1: error^(-1/8), whose root is the same on every computer.
fn shorten(error: f64) -> f64 {
    1.0 / error.sqrt().sqrt().sqrt()
}

/// A step became too short to move the clock: a value is not a number, or the system is singular.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Stuck;

impl<'a> Stepper<'a> {
    /// Starts at t = 0 from `state`; no step exceeds `longest`.
    pub(crate) fn new(lanes: &'a Lanes, layout: Layout, state: &[f64], tolerance: f64, longest: f64) -> Self {
        let mut work = Work::new(lanes, lanes.clipped);
        unpack(lanes, layout, state, &mut work.start);
        let rest = Rest::new(lanes, &mut work);
        Self {
            time: 0.0,
            evaluations: 0,
            steps: 0,
            lanes,
            layout,
            work,
            rest,
            contacts_lost: state[layout.contact_loss()],
            guests_lost: (0..lanes.guests.count)
                .map(|index| state[layout.intruder_loss(index)])
                .collect(),
            wall_impulse: layout.wall_impulse().map_or(0.0, |index| state[index]),
            tolerance,
            // Short, for the striker meets bead 1 at the first moment.
            step: 0.02 * longest,
            longest,
        }
    }

    /// Makes one step that meets the tolerance and does not pass `stop`. A step that reaches `stop` ends on
    /// it exactly.
    pub(crate) fn advance(&mut self, stop: f64) -> Result<(), Stuck> {
        const SAFETY: f64 = 0.9;
        let lanes = self.lanes;
        let mut rejected = false;
        loop {
            let left = stop - self.time;
            self.rest
                .before_step(lanes, &mut self.work, self.time, self.step.min(left));
            if self.work.active.is_empty() {
                // All fly freely: nothing happens until two of them meet.
                let next = self.rest.next_touch().min(stop);
                self.time = next.max(self.time);
                self.steps += 1;
                return Ok(());
            }
            // A remainder shorter than the rounding of the clock would be a step of nothing: this step takes
            // it along.
            let last = self.step >= left * (1.0 - 1e-9);
            let mut h = if last { left } else { self.step };
            if self.time + h <= self.time || h.is_nan() {
                return Err(Stuck);
            }
            let error = self.attempt(h);
            // What is not a number counts as too great an error, and the step shrinks until it is stuck.
            if error <= 1.0 {
                if self.rest.touched(lanes, &mut self.work, self.time, h) {
                    continue;
                }
                let kink = lanes.clipped.then(|| self.work.first_kink(lanes, h)).flatten();
                let whole = kink.is_none();
                if let Some(part) = kink {
                    h *= part;
                    self.attempt(h);
                }
                self.accept(h, (last && whole).then_some(stop));
                let growth = (SAFETY * shorten(error)).clamp(0.2, if rejected { 1.0 } else { 6.0 });
                let next = if whole { h * growth } else { self.step };
                // A step that `stop` cut short does not tell how long the next may be.
                let next = if last { next.max(self.step) } else { next };
                self.step = next.min(self.longest);
                return Ok(());
            }
            rejected = true;
            let shrink = SAFETY * shorten(error);
            self.step = h * if shrink > 0.2 { shrink } else { 0.2 };
        }
    }

    fn attempt(&mut self, h: f64) -> f64 {
        self.evaluations += 16;
        self.work.attempt(self.lanes, h, self.tolerance)
    }

    fn accept(&mut self, h: f64, stop: Option<f64>) {
        self.steps += 1;
        self.contacts_lost += self.work.lost_in_contacts();
        for (sum, lost) in self.guests_lost.iter_mut().zip(&self.work.guests_lost[..]) {
            *sum += lost;
        }
        self.wall_impulse += self.work.wall_impulse;
        self.work.accept(self.lanes);
        self.time = stop.unwrap_or(self.time + h);
        self.rest.after_step(self.lanes, &mut self.work, self.time, h);
    }

    /// Writes the state as it is now.
    pub(crate) fn state(&self, out: &mut [f64]) {
        let layout = self.layout;
        pack(self.lanes, layout, &self.work.start, out);
        self.rest.fly(
            self.lanes,
            self.time,
            &mut out[..self.lanes.bodies],
            &self.work.start.v,
        );
        out[layout.contact_loss()] = self.contacts_lost;
        for (index, lost) in self.guests_lost.iter().enumerate() {
            out[layout.intruder_loss(index)] = *lost;
        }
        if let Some(index) = layout.wall_impulse() {
            out[index] = self.wall_impulse;
        }
    }
}
