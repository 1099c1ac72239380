//! The motion inside a step.

use std::ops::Range;
use std::sync::Arc;

use super::glimpse::Glimpse;
use super::lanes::{BLOCK, Lanes};
use super::parting::holds;
use super::step_log::{LoggedSlowStep, StepLog};
use super::work::{Motion, Work};
use crate::model::StateLayout;

/// Dense output of one step of a [`StepLog`]: of order 8 in time, and exact where contacts open or close.
#[derive(Debug, Clone)]
pub(crate) struct Dense {
    lanes: Arc<Lanes>,
    layout: StateLayout,
    from: f64,
    to: f64,
    length: f64,
    /// State at the start of the step.
    state: Vec<f64>,
    work: Work,
    slow: Option<Box<SlowPart>>,
}

/// The part of the chain that takes a longer step.
#[derive(Debug, Clone)]
struct SlowPart {
    work: Work,
    /// Blocks whose motion this step gives.
    own: Vec<Range<usize>>,
    from: f64,
    length: f64,
    /// Energy dissipated in contacts before the start of the other part's step, J.
    lost: f64,
}

/// Copies a state into arrays.
pub(super) fn unpack(lanes: &Lanes, layout: StateLayout, state: &[f64], motion: &mut Motion) {
    let (bodies, guests) = (BLOCK..BLOCK + lanes.bodies, lanes.guests.lanes());
    let (count, relative, rate) = (lanes.bodies, layout.relative(0), layout.relative_velocity(0));
    motion.u[bodies.clone()].copy_from_slice(&state[..count]);
    motion.v[bodies].copy_from_slice(&state[count..2 * count]);
    motion.u[guests.clone()].copy_from_slice(&state[relative..rate]);
    motion.v[guests].copy_from_slice(&state[rate..layout.contact_loss()]);
}

/// Copies displacements and velocities from arrays into a state.
pub(super) fn pack(lanes: &Lanes, layout: StateLayout, motion: &Motion, state: &mut [f64]) {
    let (bodies, guests) = (BLOCK..BLOCK + lanes.bodies, lanes.guests.lanes());
    let (count, relative, rate) = (lanes.bodies, layout.relative(0), layout.relative_velocity(0));
    state[..count].copy_from_slice(&motion.u[bodies.clone()]);
    state[count..2 * count].copy_from_slice(&motion.v[bodies]);
    state[relative..rate].copy_from_slice(&motion.u[guests.clone()]);
    state[rate..layout.contact_loss()].copy_from_slice(&motion.v[guests]);
}

/// Copies the bodies of some blocks from arrays into a state.
fn pack_bodies(
    lanes: &Lanes,
    layout: StateLayout,
    motion: &Motion,
    runs: &[Range<usize>],
    state: &mut [f64],
) {
    for run in runs {
        let bodies = run.start * BLOCK..(run.end * BLOCK).min(lanes.bodies);
        let from = BLOCK + bodies.start..BLOCK + bodies.end;
        let velocities = layout.velocity(bodies.start)..layout.velocity(bodies.end);
        state[bodies].copy_from_slice(&motion.u[from.clone()]);
        state[velocities].copy_from_slice(&motion.v[from]);
    }
}

/// Copies the intruders of some blocks from arrays into a state.
fn pack_guests(lanes: &Lanes, layout: StateLayout, motion: &Motion, blocks: &[usize], state: &mut [f64]) {
    for guest in blocks.iter().flat_map(|&block| lanes.guests.within(block)) {
        let lane = lanes.guests.lane(guest);
        state[layout.relative(guest)] = motion.u[lane];
        state[layout.relative_velocity(guest)] = motion.v[lane];
    }
}

impl Dense {
    /// Memory for the steps of a chain; [`Dense::load`] gives it one.
    pub(crate) fn new(lanes: &Arc<Lanes>, layout: StateLayout) -> Self {
        let mut work = Work::new(lanes);
        work.keep_powers(lanes);
        Self {
            lanes: Arc::clone(lanes),
            layout,
            from: f64::NAN,
            to: f64::NAN,
            length: f64::NAN,
            state: vec![0.0; layout.dimension()],
            work,
            slow: None,
        }
    }

    /// Takes step `number` of a log, which begins at `state`.
    pub(crate) fn load(&mut self, log: &StepLog, number: usize, state: &[f64]) {
        let (lanes, step) = (&*self.lanes, &log.steps[number]);
        (self.from, self.to, self.length) = (step.from, step.to, step.length);
        self.state.copy_from_slice(state);
        unpack(lanes, self.layout, state, &mut self.work.start);
        log.restore(lanes, step, &mut self.work);
        let slow = step.slow.map(|number| &log.slow[number]);
        let last = self.slow.take();
        self.slow = slow.map(|slow| {
            let same = last.filter(|last| last.from == slow.step.from);
            let mut part = same.unwrap_or_else(|| Box::new(SlowPart::new(lanes, log, slow)));
            let x = part.part_at(step.from);
            part.work.interpolate(lanes, part.length, x);
            part.lost = part.lost_at(lanes, x);
            part
        });
    }

    /// The state at time `t` of the step.
    pub(crate) fn at(&mut self, t: f64, out: &mut Vec<f64>) {
        let (lanes, layout) = (&*self.lanes, self.layout);
        out.clear();
        out.extend_from_slice(&self.state);
        if self.work.active.first() != Some(&(0..lanes.blocks)) {
            let (places, velocities) = out.split_at_mut(lanes.bodies);
            for (place, velocity) in places.iter_mut().zip(velocities) {
                *place += (t - self.from) * *velocity;
            }
        }
        if !self.work.active.is_empty() {
            let (work, length) = (&mut self.work, self.length);
            let x = (1.0 - (self.to - t) / length).clamp(0.0, 1.0);
            work.interpolate(lanes, length, x);
            pack_bodies(lanes, layout, &work.stage, &work.active, out);
            pack_guests(lanes, layout, &work.stage, &work.active_guests, out);
            let losses = layout.intruder_loss(0)..layout.intruder_loss(lanes.guests.count);
            let inside = work.lost_inside(lanes, length, x, &mut out[losses]);
            inside.add_to(layout, out);
        }
        if let Some(slow) = &mut self.slow {
            let x = slow.part_at(t);
            slow.work.interpolate(lanes, slow.length, x);
            pack_bodies(lanes, layout, &slow.work.stage, &slow.own, out);
            out[layout.contact_loss()] += slow.lost_at(lanes, x) - slow.lost;
        }
    }

    /// Overlap of a contact less that at rest, m, over the whole step.
    pub(crate) fn glimpse_contact(&self, contact: usize) -> Glimpse {
        let (lane, times) = (BLOCK + contact, (self.from, self.to));
        let slow = self
            .slow
            .as_deref()
            .filter(|slow| holds(&slow.own, contact / BLOCK));
        let (work, step) = match slow {
            Some(slow) => (&slow.work, (slow.from, slow.length)),
            None => (&self.work, (self.from, self.length)),
        };
        work.glimpse_contact(&self.lanes, lane, step, times)
    }

    /// Displacement of an intruder relative to its host, m, over the whole step.
    pub(crate) fn glimpse_guest(&self, guest: usize) -> Glimpse {
        let times = (self.from, self.to);
        self.work
            .glimpse_guest(&self.lanes, guest, (self.from, self.length), times)
    }

    /// Returns true if `t` lies in this step.
    pub(crate) fn holds(&self, t: f64) -> bool {
        self.from <= t && t <= self.to
    }
}

impl SlowPart {
    fn new(lanes: &Lanes, log: &StepLog, slow: &LoggedSlowStep) -> Self {
        let mut work = Work::new(lanes);
        work.keep_powers(lanes);
        work.start = slow.start.clone();
        log.restore(lanes, &slow.step, &mut work);
        Self {
            work,
            own: slow.own.clone(),
            from: slow.step.from,
            length: slow.step.length,
            lost: 0.0,
        }
    }

    /// Part of the step at time `t`.
    fn part_at(&self, t: f64) -> f64 {
        ((t - self.from) / self.length).clamp(0.0, 1.0)
    }

    /// Energy dissipated in contacts from the start to the part `x` of the last interpolation, J.
    fn lost_at(&self, lanes: &Lanes, x: f64) -> f64 {
        self.work.lost_inside(lanes, self.length, x, &mut []).contacts
    }
}
