//! Steps of a run: their lengths, and the beads that they move.

use std::ops::Range;
use std::sync::Arc;

use super::dense::{pack, unpack};
use super::glimpse::Glimpse;
use super::lanes::{BLOCK, Lanes};
use super::multirate::Multirate;
use super::rest::RestingBlocks;
use super::step_log::StepLog;
use super::work::{Losses, Work};
use crate::model::{Model, StateLayout};

/// The present state of a run: its last step, the length of the next, and counts.
#[derive(Debug, Clone)]
pub(crate) struct Stepper {
    /// End of the last step, s.
    pub(crate) time: f64,
    pub(crate) evaluations: u64,
    pub(crate) steps: u64,
    pub(crate) lanes: Arc<Lanes>,
    layout: StateLayout,
    work: Work,
    rest: RestingBlocks,
    multirate: Multirate,
    /// Losses until the start of the last step, and those of each intruder, J.
    lost: Losses,
    guests_lost: Vec<f64>,
    /// Allowed error of each step.
    pub(crate) tolerance: f64,
    step: f64,
    longest: f64,
    /// Length of the last step, s, while its stages are kept.
    made: Option<f64>,
    /// True if the stages of the dense output have been computed.
    prepared: bool,
}

/// Factor that gives a step the error 1: error^(-1/8), by roots, which are the same on every computer.
fn shorten(error: f64) -> f64 {
    1.0 / error.sqrt().sqrt().sqrt()
}

/// A step became too short to advance the clock: a value is NaN, or the system is singular.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Stuck;

impl Stepper {
    /// Starts at `time` from `state`; no step exceeds `longest`.
    pub(crate) fn new(
        lanes: Arc<Lanes>,
        layout: StateLayout,
        (time, state): (f64, &[f64]),
        tolerance: f64,
        longest: f64,
    ) -> Self {
        let mut work = Work::new(&lanes);
        if lanes.clipped || lanes.powers.is_some() {
            work.keep_inside(&lanes);
        }
        unpack(&lanes, layout, state, &mut work.start);
        let rest = RestingBlocks::new(&lanes, &mut work, time, tolerance);
        Self {
            time,
            evaluations: 0,
            steps: 0,
            layout,
            work,
            rest,
            multirate: Multirate::new(&lanes, tolerance),
            lost: Losses::of(layout, state),
            guests_lost: state[layout.intruder_loss(0)..][..lanes.guests.count].to_vec(),
            lanes,
            tolerance,
            // Short, because bodies that touch may push at the first moment.
            step: 0.02 * longest,
            longest,
            made: None,
            prepared: false,
        }
    }

    /// Allocates memory for [`Stepper::interpolate`].
    pub(crate) fn keep_inside(&mut self) {
        self.work.keep_inside(&self.lanes);
    }

    /// Computes the dense output of the last step. Returns the step's length.
    fn prepare(&mut self) -> Option<f64> {
        let length = self.made?;
        if !self.prepared {
            self.keep_inside();
            self.work.prepare(&self.lanes, length);
            self.prepared = true;
        }
        Some(length)
    }

    /// Computes the motion at time `t` of the last step, for [`Stepper::body`] and [`Stepper::guest`].
    pub(crate) fn interpolate(&mut self, t: f64) {
        self.multirate.interpolate(&self.lanes, t);
        if let Some(length) = self.prepare() {
            let x = 1.0 - (self.time - t) / length;
            self.work.interpolate(&self.lanes, length, x.clamp(0.0, 1.0));
        }
    }

    /// Adds the last step, which began at `from`, to a log.
    pub(crate) fn record(&mut self, from: f64, log: &mut StepLog) {
        if let Some(length) = self.made
            && self.work.powers.is_none()
        {
            // Made again for the powers, which all later steps have.
            self.work.keep_powers(&self.lanes);
            self.work.drive(&self.lanes, from, length);
            self.work.attempt(&self.lanes, length, self.tolerance);
            self.prepared = false;
        }
        let length = self.prepare();
        let slow = self.multirate.record(&self.lanes, log);
        let work = length.map(|_| &mut self.work);
        let length = length.unwrap_or(self.time - from);
        let mut step = log.copy(&self.lanes, work, (from, self.time), length);
        step.slow = slow;
        log.steps.push(step);
    }

    /// Overlap of a moving contact, less that at rest, in the last step; `None` if nothing moved.
    pub(crate) fn glimpse_contact(&mut self, contact: usize, from: f64) -> Option<Glimpse> {
        let length = self.prepare()?;
        let (lane, times) = (BLOCK + contact, (from, self.time));
        let slow = self.multirate.step_of(&self.lanes, lane);
        let (work, step) = slow.unwrap_or((&self.work, (from, length)));
        Some(work.glimpse_contact(&self.lanes, lane, step, times))
    }

    /// Displacement of a moving intruder relative to its host, in the last step; `None` if nothing moved.
    pub(crate) fn glimpse_guest(&mut self, guest: usize, from: f64) -> Option<Glimpse> {
        let length = self.prepare()?;
        let times = (from, self.time);
        Some(self.work.glimpse_guest(&self.lanes, guest, (from, length), times))
    }

    /// Computes the motion at the ends of the last step, for [`Stepper::body_at_ends`] and [`Stepper::lost`].
    pub(crate) fn interpolate_ends(&mut self, from: f64) {
        self.multirate.interpolate_ends(&self.lanes, [from, self.time]);
    }

    /// Displacement and velocity of a body at the start and at the end of the last step.
    pub(crate) fn body_at_ends(&self, body: usize, from: f64) -> [(f64, f64); 2] {
        let (lane, start) = (BLOCK + body, &self.work.start);
        if self.multirate.moves(lane) {
            let [start, end] = self.multirate.at_ends();
            [(start.u[lane], start.v[lane]), (end.u[lane], end.v[lane])]
        } else if self.made.is_some() && self.rest.moves(lane) {
            let end = &self.work.end;
            [(start.u[lane], start.v[lane]), (end.u[lane], end.v[lane])]
        } else {
            let place = |t: f64| (self.rest.place(&self.work, lane, t), start.v[lane]);
            [place(from), place(self.time)]
        }
    }

    /// Displacement and velocity of an intruder relative to its host, at both ends of the last step.
    pub(crate) fn guest_at_ends(&self, guest: usize) -> [(f64, f64); 2] {
        let (start, end) = (&self.work.start, &self.work.end);
        let lane = self.lanes.guests.lane(guest);
        let before = (start.u[lane], start.v[lane]);
        if self.made.is_some() && self.rest.moves(self.lanes.guests.hosts[guest]) {
            [before, (end.u[lane], end.v[lane])]
        } else {
            [before, before]
        }
    }

    /// An intruder that its softening spring no longer pulls back at the end of the last step.
    pub(crate) fn torn_off(&self) -> Option<usize> {
        let is_torn = |&&(guest, reach): &&(usize, f64)| self.guest_at_ends(guest)[1].0.abs() >= reach;
        let reaches = self.lanes.guests.reaches.iter();
        reaches.clone().find(is_torn).map(|(guest, _)| *guest)
    }

    /// Energy that all contacts, and each intruder, have dissipated by the end of the last step, J.
    pub(crate) fn lost(&self) -> (f64, impl Iterator<Item = f64> + '_) {
        let work = self.made.map(|_| &self.work);
        let contacts = work.map_or(0.0, |work| work.lost_in_contacts(&self.lanes));
        let guests =
            self.guests_lost.iter().enumerate().map(move |(guest, lost)| {
                lost + work.map_or(0.0, |work| work.lost_in_guest(&self.lanes, guest))
            });
        (self.lost.contacts + contacts + self.multirate.lost(), guests)
    }

    /// Energy that the ground has dissipated by the end of the last step, J.
    pub(crate) fn lost_on_ground(&self) -> f64 {
        self.lost.ground + self.made.map_or(0.0, |_| self.work.ground_lost)
    }

    /// Work of the drive by the end of the last step, J.
    pub(crate) fn supplied(&self) -> f64 {
        self.lost.drive + self.made.map_or(0.0, |_| self.work.drive_work())
    }

    /// Bodies whose motion the last step has computed. All others fly freely.
    pub(crate) fn moving(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        let awake = self.made.map_or(&[][..], |_| &self.rest.awake);
        let runs = awake.chunk_by(|block, next| block + 1 == *next);
        runs.map(|run| run[0] * BLOCK..((run[0] + run.len()) * BLOCK).min(self.lanes.bodies))
    }

    /// Displacement and velocity of a body at `t`, which must be the time of the last
    /// [`Stepper::interpolate`].
    #[inline]
    pub(crate) fn body(&self, body: usize, t: f64) -> (f64, f64) {
        let lane = BLOCK + body;
        if self.multirate.moves(lane) {
            let slow = self.multirate.interpolated();
            (slow.u[lane], slow.v[lane])
        } else if self.made.is_some() && self.rest.moves(lane) {
            (self.work.stage.u[lane], self.work.stage.v[lane])
        } else {
            (self.rest.place(&self.work, lane, t), self.work.start.v[lane])
        }
    }

    /// Velocity of a body at the time of the last [`Stepper::interpolate`].
    pub(crate) fn speed(&self, body: usize) -> f64 {
        let lane = BLOCK + body;
        if self.multirate.moves(lane) {
            self.multirate.interpolated().v[lane]
        } else if self.made.is_some() && self.rest.moves(lane) {
            self.work.stage.v[lane]
        } else {
            self.work.start.v[lane]
        }
    }

    /// Displacement and velocity of an intruder relative to its host, at the time of the last
    /// [`Stepper::interpolate`].
    pub(crate) fn guest(&self, guest: usize) -> (f64, f64) {
        let moves = self.made.is_some() && self.rest.moves(self.lanes.guests.hosts[guest]);
        let motion = if moves { &self.work.stage } else { &self.work.start };
        let lane = self.lanes.guests.lane(guest);
        (motion.u[lane], motion.v[lane])
    }

    /// Computes all bodies in every step.
    #[cfg(test)]
    pub(super) fn leave_nothing_out(&mut self) {
        self.rest.keep_awake(&self.lanes, &mut self.work, self.time);
        self.multirate.never();
    }

    /// Number of bodies that the last step has computed.
    #[cfg(test)]
    pub(super) fn computed(&self) -> usize {
        self.work.active.iter().map(|run| run.len() * BLOCK).sum()
    }

    /// Makes one step that meets the tolerance and does not pass `stop`, on which it may end exactly.
    pub(crate) fn advance(&mut self, stop: f64) -> Result<(), Stuck> {
        const SAFETY: f64 = 0.9;
        self.settle();
        if self.multirate.is_due(&self.rest, self.steps) {
            self.part(stop);
        }
        let stop = self.multirate.end().map_or(stop, |end| end.min(stop));
        let knot = self.lanes.drive.as_ref().map(|drive| drive.next_knot(self.time));
        let stop = knot.map_or(stop, |knot| knot.min(stop));
        let mut rejected = false;
        loop {
            let left = stop - self.time;
            let (lanes, work) = (&self.lanes, &mut self.work);
            self.rest.before_step(lanes, work, self.time, self.step.min(left));
            if work.active.is_empty() {
                // All bodies fly freely until two of them meet.
                let next = self.rest.next_touch().min(stop);
                self.time = next.max(self.time);
                self.steps += 1;
                return Ok(());
            }
            // A remainder shorter than the rounding of the clock would be an empty step.
            let last = self.step >= left * (1.0 - 1e-9);
            let mut h = if last { left } else { self.step };
            if self.time + h <= self.time || h.is_nan() {
                return Err(Stuck);
            }
            let error = self.attempt(h);
            // A NaN counts as too large an error, and the step shrinks until it is stuck.
            if error <= 1.0 {
                let (lanes, work) = (&self.lanes, &mut self.work);
                if self.rest.touched(lanes, work, self.time, h) {
                    continue;
                }
                if let Some(part) = work.sooner {
                    self.step = h * part;
                    rejected = true;
                    continue;
                }
                let kink = lanes.clipped.then(|| work.first_kink(lanes, h)).flatten();
                let turn = lanes.powers.and_then(|_| work.first_turn(lanes, h));
                let whole = kink.is_none() && turn.is_none();
                if let Some(part) = kink {
                    h *= part;
                    self.attempt(h);
                }
                if let Some((lane, part)) = turn {
                    h = self.end_at_turn(lane, h * part, h);
                }
                let growth = (SAFETY * shorten(error)).clamp(0.2, if rejected { 1.0 } else { 6.0 });
                let next = if whole { h * growth } else { self.step };
                // A step that `stop` cut short does not limit the next.
                let next = if last { next.max(self.step) } else { next };
                self.step = next.min(self.longest);
                self.steps += 1;
                self.made = Some(h);
                self.prepared = false;
                self.time = if last && whole { stop } else { self.time + h };
                return Ok(());
            }
            rejected = true;
            let shrink = SAFETY * shorten(error);
            self.step = h * if shrink > 0.2 { shrink } else { 0.2 };
        }
    }

    /// Makes the step again with a length near `h`, so that it ends where the contact at `lane` opens or
    /// closes. Returns its length, which is below `most`.
    fn end_at_turn(&mut self, lane: usize, mut h: f64, most: f64) -> f64 {
        self.attempt(h);
        for _ in 0..4 {
            let Some(way) = self.work.way_to_turn(&self.lanes, lane) else {
                break;
            };
            let next = h + way;
            if !(next > 0.0 && next < most && self.time + next > self.time) {
                break;
            }
            h = next;
            self.attempt(h);
        }
        h
    }

    /// Gives blocks that hardly change one long step, if that pays.
    fn part(&mut self, stop: f64) {
        let (lanes, step) = (&self.lanes, self.step.min(stop - self.time));
        self.rest.before_step(lanes, &mut self.work, self.time, step);
        let (parts, times) = ((&mut self.rest, &mut self.work), (self.time, stop));
        self.evaluations += 16 * self.multirate.part(lanes, parts, times, (step, self.steps));
    }

    fn attempt(&mut self, h: f64) -> f64 {
        self.evaluations += 16;
        self.work.drive(&self.lanes, self.time, h);
        self.work.attempt(&self.lanes, h, self.tolerance)
    }

    /// Makes the end of the last step the start of the next, and discards its stages.
    fn settle(&mut self) {
        let Some(length) = self.made.take() else { return };
        self.lost.contacts += self.work.lost_in_contacts(&self.lanes);
        for (guest, lost) in self.guests_lost.iter_mut().enumerate() {
            *lost += self.work.lost_in_guest(&self.lanes, guest);
        }
        self.lost.wall += self.work.wall_impulse;
        self.lost.ground += self.work.ground_lost;
        self.lost.drive += self.work.drive_work();
        self.work.accept(&self.lanes);
        self.work.lead(&self.lanes, self.time);
        let parts = (&mut self.rest, &mut self.work);
        self.lost.contacts += self.multirate.follow(&self.lanes, parts, (self.time, length));
        if self.multirate.end().is_none() {
            self.rest
                .after_step(&self.lanes, &mut self.work, self.time, length);
        }
    }

    /// Writes the present state.
    pub(crate) fn state(&mut self, out: &mut [f64]) {
        self.settle();
        let layout = self.layout;
        pack(&self.lanes, layout, &self.work.start, out);
        for (body, place) in out[..self.lanes.bodies].iter_mut().enumerate() {
            *place = self.rest.place(&self.work, BLOCK + body, self.time);
        }
        self.interpolate_ends(self.time);
        for lane in self.multirate.lanes() {
            let [_, now] = self.multirate.at_ends();
            let body = lane - BLOCK;
            (out[body], out[layout.velocity(body)]) = (now.u[lane], now.v[lane]);
        }
        out[layout.contact_loss()..].fill(0.0);
        out[layout.intruder_loss(0)..][..self.guests_lost.len()].copy_from_slice(&self.guests_lost);
        let mut lost = self.lost;
        lost.contacts += self.multirate.lost();
        lost.add_to(layout, out);
    }
}

/// A time in the last step of a run.
#[derive(Debug, Clone, Copy)]
pub(crate) enum StepMoment<'a> {
    /// The end of the step that began at this time, s.
    End(&'a Stepper, f64),
    /// The time inside the step, s, that [`Stepper::interpolate`] was called for.
    Inside(&'a Stepper, f64),
}

impl StepMoment<'_> {
    /// Displacement and velocity of a body.
    #[inline(always)]
    pub(crate) fn body(self, body: usize) -> (f64, f64) {
        match self {
            Self::End(stepper, from) => stepper.body_at_ends(body, from)[1],
            Self::Inside(stepper, t) => stepper.body(body, t),
        }
    }

    /// Displacement and velocity of an intruder relative to its host.
    #[inline(always)]
    pub(crate) fn guest(self, guest: usize) -> (f64, f64) {
        match self {
            Self::End(stepper, _) => stepper.guest_at_ends(guest)[1],
            Self::Inside(stepper, _) => stepper.guest(guest),
        }
    }

    /// Change of the overlap of a contact since rest, m, and its rate, m/s.
    #[inline]
    pub(crate) fn change(self, model: &Model, contact: usize) -> (f64, f64) {
        let near = self.body(contact - 1);
        let is_wall = contact == model.bodies();
        let far = if is_wall { (0.0, 0.0) } else { self.body(contact) };
        (near.0 - far.0, near.1 - far.1)
    }
}
