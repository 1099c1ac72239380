//! Keeps QEMU's main thread at rest while the processor's thread works.
//!
//! # Design
//! While the processor waits, virtual time advances to the next timer. QEMU does this in its main thread, and
//! wakes that thread for every timer, including one whose callback the processor's thread has already run.
//! The two threads then wake each other some ten thousand times per second of virtual time, which takes
//! longer than executing the image. So the processor's thread passes the time
//! ([`Qemu::pass_time`](super::qemu::Qemu::pass_time)), and the main thread blocks in a callback of its own
//! timer, where QEMU does not wake it. It is released for a reset and for the end of the run, which only it
//! can carry out, and from time to time to serve a debugger and signals.

use std::sync::{Condvar, Mutex, PoisonError};
use std::time::Duration;

/// Longest rest of the main thread.
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

    /// Sets whether the main thread is needed.
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
