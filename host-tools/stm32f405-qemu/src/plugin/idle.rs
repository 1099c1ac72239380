//! QEMU's main thread rests while the processor's thread does its work.
//!
//! # Design
//! While the processor waits, virtual time goes to the next timer. QEMU does this in its main thread, and
//! wakes that thread for every timer, also for one that the processor's thread has called itself. Two threads
//! then wake one another some ten thousand times in a second of the bead's time, which takes longer than what
//! the image does. So the processor's thread passes the time
//! ([`Qemu::pass_time`](super::qemu::Qemu::pass_time)), and the main thread is kept where QEMU does not wake
//! it: in a timer of its own, which waits here. It is let go for what only it can do, a reset and the end,
//! and from time to time for a debugger and for signals.

use std::sync::{Condvar, Mutex, PoisonError};
use std::time::Duration;

/// Until the main thread looks around.
const LONGEST: Duration = Duration::from_millis(20);

/// Schedule of the main thread's rests.
#[derive(Default)]
pub(super) struct IdleSchedule {
    needed: Mutex<bool>,
    changed: Condvar,
}

impl IdleSchedule {
    pub(super) fn take(&self) {
        let needed = self.needed.lock().unwrap_or_else(PoisonError::into_inner);
        let waited = self
            .changed
            .wait_timeout_while(needed, LONGEST, |needed| !*needed);
        drop(waited);
    }

    /// The main thread is needed, or is not any more.
    pub(super) fn need(&self, needed: bool) {
        *self.needed.lock().unwrap_or_else(PoisonError::into_inner) = needed;
        self.changed.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use std::thread;
    use std::time::Instant;

    use super::*;

    #[test]
    fn a_rest_ends_when_the_thread_is_needed_and_otherwise_after_a_while() {
        let rest = IdleSchedule::default();
        let began = Instant::now();
        rest.take();
        assert!(began.elapsed() >= LONGEST);
        thread::scope(|scope| {
            let resting = scope.spawn(|| rest.take());
            rest.need(true);
            resting.join().unwrap();
        });
        let began = Instant::now();
        (0..1000).for_each(|_| rest.take());
        assert!(began.elapsed() < 1000 * LONGEST);
    }
}
