//! Steps of a run that are kept, so that the motion inside them can be read later.
//!
//! # Design
//!
//! A step keeps the accelerations of its moving blocks at the stages that the dense output uses, and the
//! powers at these stages. Beads that sleep keep nothing: they fly freely. A slow step ([`super::multirate`])
//! is kept once for all steps that it covers.

use std::ops::Range;

use super::crossing::Crossing;
use super::kernel::moving;
use super::lanes::{BLOCK, Lanes};
use super::method::LATE_STAGES;
use super::verner::STAGES;
use super::work::{Motion, Work};

/// Kept steps, in order.
#[derive(Debug, Clone, Default)]
pub(crate) struct StepLog {
    pub(super) steps: Vec<LoggedStep>,
    pub(super) slow: Vec<LoggedSlowStep>,
    /// Accelerations and powers of all steps.
    values: Vec<f64>,
    runs: Vec<Range<usize>>,
    guests: Vec<usize>,
    crossings: Vec<Crossing>,
}

/// One step: its times, and where its parts lie in the [`StepLog`].
#[derive(Debug, Clone)]
pub(super) struct LoggedStep {
    pub(super) from: f64,
    pub(super) to: f64,
    /// Length that the stages were computed for, s.
    pub(super) length: f64,
    /// Number of the slow step that was under way.
    pub(super) slow: Option<usize>,
    values: usize,
    runs: Range<usize>,
    guests: Range<usize>,
    crossings: Range<usize>,
}

/// A slow step, its start, and the blocks whose motion it gives.
#[derive(Debug, Clone)]
pub(super) struct LoggedSlowStep {
    pub(super) step: LoggedStep,
    pub(super) start: Motion,
    pub(super) own: Vec<Range<usize>>,
}

/// Values of a block at all stages, and those that the dense output uses: the first stage and the last ones.
const ALL: usize = STAGES * BLOCK;
const LATE: Range<usize> = LATE_STAGES.start * BLOCK..LATE_STAGES.end * BLOCK;

fn block(at: usize) -> Range<usize> {
    at * ALL..(at + 1) * ALL
}

/// Values that a log of a whole run begins with room for, so that few short runs are copied while they grow.
const ROOM: usize = 1 << 18;

impl StepLog {
    /// A log for a whole run.
    pub(crate) fn of_run() -> Self {
        Self {
            values: Vec::with_capacity(ROOM),
            ..Self::default()
        }
    }

    pub(crate) fn clear(&mut self) {
        self.steps.clear();
        self.slow.clear();
        self.values.clear();
        self.runs.clear();
        self.guests.clear();
        self.crossings.clear();
    }

    /// Number of steps.
    pub(crate) fn count(&self) -> usize {
        self.steps.len()
    }

    /// Memory in use, in values of 8 bytes.
    pub(crate) fn size(&self) -> usize {
        let steps = size_of_val(&self.steps[..]) + size_of_val(&self.crossings[..]);
        let start = self.slow.first().map_or(0, |slow| 2 * slow.start.u.len());
        self.values.len() + steps / size_of::<f64>() + self.slow.len() * start
    }

    /// Copies a step that was prepared for its dense output, with its powers; without `work`, nothing moved.
    pub(super) fn copy(
        &mut self,
        lanes: &Lanes,
        work: Option<&mut Work>,
        (from, to): (f64, f64),
        length: f64,
    ) -> LoggedStep {
        let starts = [self.runs.len(), self.guests.len(), self.crossings.len()];
        let values = self.values.len();
        if let Some(work) = work {
            self.runs.extend_from_slice(&work.active);
            self.guests.extend_from_slice(&work.active_guests);
            self.crossings.extend_from_slice(&work.crossings);
            each_part(lanes, work, |part| self.values.extend_from_slice(part));
        }
        LoggedStep {
            from,
            to,
            length,
            slow: None,
            values,
            runs: starts[0]..self.runs.len(),
            guests: starts[1]..self.guests.len(),
            crossings: starts[2]..self.crossings.len(),
        }
    }

    /// Restores a step in memory that keeps powers, apart from its start.
    pub(super) fn restore(&self, lanes: &Lanes, step: &LoggedStep, work: &mut Work) {
        let (runs, guests) = (&self.runs[step.runs.clone()], &self.guests[step.guests.clone()]);
        if work.active != runs || work.active_guests != guests {
            // Blocks that no longer move have no acceleration.
            let mut rates = std::mem::take(&mut work.rates);
            for at in moving(work, lanes) {
                rates[block(at)].fill(0.0);
            }
            work.rates = rates;
            work.active.clear();
            work.active.extend_from_slice(runs);
            work.active_guests.clear();
            work.active_guests.extend_from_slice(guests);
        }
        work.crossings.clear();
        work.crossings
            .extend_from_slice(&self.crossings[step.crossings.clone()]);
        work.drive(lanes, step.from, step.length);
        if runs.is_empty() {
            return;
        }
        let mut values = &self.values[step.values..];
        each_part(lanes, work, |part| {
            let (taken, left) = values.split_at(part.len());
            part.copy_from_slice(taken);
            values = left;
        });
    }
}

/// Shows the parts of a step that a log keeps: accelerations and powers, at the stages that the dense output
/// uses where there are many.
fn each_part(lanes: &Lanes, work: &mut Work, mut show: impl FnMut(&mut [f64])) {
    let mut rates = std::mem::take(&mut work.rates);
    for at in moving(work, lanes) {
        let stages = &mut rates[block(at)];
        show(&mut stages[..BLOCK]);
        show(&mut stages[LATE]);
    }
    work.rates = rates;
    let powers = work.powers.as_deref_mut().expect("a kept step has its powers");
    show(&mut powers.contacts);
    if lanes.wall.is_some() {
        show(&mut powers.wall);
    }
    if lanes.drag.is_some() {
        show(&mut powers.ground);
    }
    if let Some(driven) = &mut work.driven {
        show(&mut driven.powers);
    }
    for at in &work.active_guests {
        let stages = &mut powers.guests[block(at - lanes.guests.blocks.start)];
        show(&mut stages[..BLOCK]);
        show(&mut stages[LATE]);
    }
}
