//! The motion inside a step.

use super::glimpse::Glimpse;
use super::lanes::{BLOCK, Lanes};
use super::work::{Motion, Work};
use crate::model::StateLayout;

/// Dense output of one step: of order 8 in time, and exact where contacts open or close.
#[derive(Debug, Clone)]
pub(crate) struct Dense<'a> {
    lanes: &'a Lanes,
    layout: StateLayout,
    start: f64,
    length: f64,
    state: Vec<f64>,
    work: Work,
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

impl<'a> Dense<'a> {
    /// Repeats the step from `state` at time `start` to time `end`, as the stepper made it at this tolerance.
    pub(crate) fn new(
        lanes: &'a Lanes,
        layout: StateLayout,
        (start, end): (f64, f64),
        state: &[f64],
        tolerance: f64,
    ) -> Self {
        let mut work = Work::new(lanes, true);
        work.keep_powers(lanes);
        work.activate_all(lanes);
        unpack(lanes, layout, state, &mut work.start);
        let length = end - start;
        work.drive(lanes, start, length);
        work.attempt(lanes, length, tolerance);
        work.prepare(lanes, length);
        Self {
            lanes,
            layout,
            start,
            length,
            state: state.to_vec(),
            work,
        }
    }

    /// The state at time `t` of the step.
    pub(crate) fn at(&mut self, t: f64, out: &mut [f64]) {
        let (lanes, layout) = (self.lanes, self.layout);
        let x = (t - self.start) / self.length;
        self.work.interpolate(lanes, self.length, x);
        pack(lanes, layout, &self.work.stage, out);
        let inside = self.work.lost_inside(lanes, self.length, x);
        let loss = layout.contact_loss();
        out[loss] = self.state[loss] + inside.contacts;
        for (index, lost) in inside.guests.iter().enumerate() {
            let at = layout.intruder_loss(index);
            out[at] = self.state[at] + lost;
        }
        if let Some(at) = layout.wall_impulse() {
            out[at] = self.state[at] + inside.wall;
        }
        if let Some(at) = layout.drive_work() {
            out[at] = self.state[at] + inside.drive;
        }
    }

    /// Overlap of a contact less that at rest, m, over the whole step, which has these times.
    pub(crate) fn glimpse_contact(&self, contact: usize, times: (f64, f64)) -> Glimpse {
        let step = (self.start, self.length);
        self.work
            .glimpse_contact(self.lanes, BLOCK + contact, step, times)
    }

    /// Displacement of an intruder relative to its host, m, over the whole step.
    pub(crate) fn glimpse_guest(&self, guest: usize, times: (f64, f64)) -> Glimpse {
        let step = (self.start, self.length);
        self.work.glimpse_guest(self.lanes, guest, step, times)
    }

    /// Returns true if `t` lies in this step.
    pub(crate) fn holds(&self, t: f64) -> bool {
        self.start <= t && t <= self.start + self.length
    }
}
