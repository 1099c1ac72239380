//! The trigger line: one open-drain wire that the beads of a row share. A bead that finds a strike tells the
//! others when, so that those that feel less than their threshold keep the same instant.
//!
//! # Design
//! A strike is found a block later than it came, so the time of the edge must not depend on that: the line
//! falls [`DELAY`] scans after the scan that triggered. The timer makes the edge itself and latches the edges
//! of others ([`LineTimer`]). So the core reads two registers a block, and no edge interrupts it.
//!
//! The delay is longer than a wave takes through sixteen beads: 5.1 ms in the paper's chain at 0.1 m/s,
//! 5.8 ms if each holds an intruder of 12 g. A bead that feels the wave has found it by itself when the line
//! falls, and measures it as if there were no line. The others look back by the delay.
//!
//! # Strikes close together
//! A line that is already low cannot fall. So a strike whose edge is due while this bead still pulls for the
//! previous one is not signalled. A strike whose edge is due later waits until the bead has let go. No
//! counter of the protocol counts these strikes: each bead finds what it feels by itself.
//!
//! # Wiring faults
//! A pull lasts at least two blocks. An edge counts only if the line is still low when the core checks it, at
//! least [`TOUCH`] later, so touch and cross-talk open no window. The pull-up keeps an open line high. A line
//! that stays low is reported once; each bead then works by itself.

use crate::block::{SAMPLE_RATE_HZ, SCANS_PER_BLOCK};
use crate::device::LineTimer;

/// Clocks of the timer in a sample period.
pub const CLOCKS_PER_SAMPLE: u16 = (84_000_000 / SAMPLE_RATE_HZ) as u16;

/// Scans from the trigger to the fall of the line. All beads on a line must agree on this number.
const DELAY: u64 = 600;
/// The least time, in clocks, in which a compare can still be set.
const AHEAD: i32 = 1000;
/// Clocks for which the line has to be low: 0.1 ms.
const TOUCH: u32 = 8400;
/// Least length of a pull, in scans.
const HOLD: u64 = 2 * SCANS_PER_BLOCK as u64;
/// Scans after which a bead that pulled has let go.
const APART: u64 = HOLD + SCANS_PER_BLOCK as u64;
/// Blocks after which a low line counts as held low: 50 ms. Sixteen beads, one after another, pull for 7 ms.
const HELD: u32 = 25;

// The meter keeps enough of the past: the delay, and the block in which the edge comes.
const _: () = assert!(
    DELAY as usize + SCANS_PER_BLOCK + TOUCH as usize / CLOCKS_PER_SAMPLE as usize
        <= bead_model::meter::REACH
);

/// An instant that another bead signals, as sample indices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct LineEdge {
    /// The scan that triggered there.
    pub(crate) trigger: u64,
    /// The scan at which the line fell.
    pub(crate) at: u64,
}

/// The line of one bead.
pub(crate) struct TriggerLine<T> {
    timer: T,
    /// The scan at which this bead pulls, until it lets go.
    pulled: Option<u64>,
    /// The scan at which it has to pull after that.
    next: Option<u64>,
    /// The count at the last edge.
    latched: u32,
    /// Blocks for which the line has been low.
    low: u32,
}

impl<T: LineTimer> TriggerLine<T> {
    pub(crate) fn new(timer: T) -> Self {
        Self {
            timer,
            pulled: None,
            next: None,
            latched: 0,
            low: 0,
        }
    }

    /// Signals to the others the strike that this scan triggered. A strike is not signalled if it is found
    /// after its edge is due, as in the milliseconds after a window, or if its edge is due while the line is
    /// low.
    pub(crate) fn pull(&mut self, trigger_index: u64) {
        let index = trigger_index + DELAY;
        match self.pulled {
            None => self.fall_at(index),
            Some(before) if index >= before + APART => {
                self.next.get_or_insert(index);
            }
            Some(_) => {}
        }
    }

    /// Pulls the line at a scan, if there is still time to set the timer.
    fn fall_at(&mut self, index: u64) {
        let count = count_at(index);
        if count.wrapping_sub(self.timer.count()) as i32 >= AHEAD {
            self.timer.pull_at(count);
            self.pulled = Some(index);
        }
    }

    /// Finds an edge of another bead. Called once a block; `next_index` is that of the scan after the block.
    pub(crate) fn check(&mut self, next_index: u64) -> Option<LineEdge> {
        let is_low = self.timer.is_low();
        self.low = if is_low { self.low.saturating_add(1) } else { 0 };
        let latched = self.timer.last_edge();
        if is_low && self.timer.count().wrapping_sub(latched) < TOUCH {
            // The next check is early enough.
            return None;
        }
        let fell = core::mem::replace(&mut self.latched, latched) != latched;
        let behind = count_at(next_index).wrapping_sub(latched) as i32;
        let clocks = i32::from(CLOCKS_PER_SAMPLE);
        // To the nearest scan.
        let at = next_index.wrapping_add_signed(-i64::from((behind + clocks / 2).div_euclid(clocks)));
        let own = self.pulled.is_some_and(|pulled| pulled.abs_diff(at) <= 1);
        if self.pulled.is_some_and(|pulled| next_index >= pulled + HOLD) {
            self.timer.release();
            self.pulled = None;
            if let Some(next) = self.next.take() {
                self.fall_at(next);
            }
        }
        (fell && is_low && !own).then(|| LineEdge {
            trigger: at.saturating_sub(DELAY),
            at,
        })
    }

    /// Returns `true` at the one check at which the line counts as held low.
    pub(crate) fn is_found_held(&self) -> bool {
        self.low == HELD
    }
}

/// The timer's count at the trigger of a scan. The trigger of index 1 starts the timer.
fn count_at(index: u64) -> u32 {
    (index as u32)
        .wrapping_sub(1)
        .wrapping_mul(u32::from(CLOCKS_PER_SAMPLE))
}
