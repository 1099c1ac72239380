//! Finds a task that hangs, for the watchdog.

use crate::counters::BeadCounters;

/// Consecutive checks without new samples or without a sent frame before a panic: 1.25 s.
const SILENCE: u32 = 5;

/// Progress of a bead's tasks, checked four times a second.
pub struct Progress {
    sampling: bool,
    before: BeadCounters,
    fed: BeadCounters,
    silent: u32,
}

impl Progress {
    /// Progress from now on. Without `sampling` there are no samples to wait for.
    pub fn new(sampling: bool, now: BeadCounters) -> Self {
        Self {
            sampling,
            before: now,
            fed: now,
            silent: 0,
        }
    }

    /// Returns `true` if the watchdog is to be fed: new samples have reached the estimators, and a frame has
    /// left since it was last fed.
    ///
    /// # Panics
    /// A task hangs; the message says which.
    pub fn check(&mut self, now: BeadCounters) -> bool {
        let before = core::mem::replace(&mut self.before, now);
        if self.sampling {
            // While there are no samples, acquisition counts overruns: one of the two always changes.
            if (now.samples, now.overruns) == (before.samples, before.overruns) {
                panic!("acquisition hangs");
            }
            if now.blocks_estimated == before.blocks_estimated && now.blocks_estimated != now.blocks_handed_on
            {
                panic!("estimation hangs");
            }
        }
        // `samples` counts dropped ones as well, and a bead that drops all of them measures nothing.
        let came = now.blocks_handed_on != self.fed.blocks_handed_on;
        if (came || !self.sampling) && now.frames_sent != self.fed.frames_sent {
            self.fed = now;
            self.silent = 0;
            return true;
        }
        self.silent += 1;
        if self.silent == SILENCE {
            if !came && self.sampling {
                panic!("no samples arrive");
            }
            panic!("transmission hangs");
        }
        false
    }
}
