//! Strikes for pages, and frames from a recording that another program writes.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use bead_recording::file::{Follower, RecordingError};
use bead_recording::frames::FrameReader;

use crate::model::SharedMonitor;
use crate::strike::ShownStrike;

/// Interval of the search for new bytes in a recording.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// A reader's place among the strikes of a monitor.
#[derive(Clone, Debug, Default)]
pub struct Feed {
    serial: u64,
    /// Number of strikes that went by unread.
    pub missed: u64,
}

impl Feed {
    /// The newest `most` of the strikes since the last call, the oldest first.
    pub fn take(&mut self, monitor: &SharedMonitor, most: usize) -> Vec<Arc<ShownStrike>> {
        let (mut new, mut missed) = monitor.lock().strikes_after(self.serial);
        let more = new.len().saturating_sub(most);
        missed += more as u64;
        new.drain(..more);
        // Strikes before the first call do not count as missed.
        if self.serial > 0 {
            self.missed += missed;
        }
        self.serial = new.last().map_or(self.serial, |last| last.serial);
        new
    }
}

/// Feeds a monitor from a recording that may still grow, until `stop`. When the recording ends, the monitor
/// keeps its state.
///
/// # Errors
/// The file cannot be read, or is damaged.
pub fn follow(
    monitor: &SharedMonitor,
    mut follower: Follower,
    stop: &AtomicBool,
) -> Result<(), RecordingError> {
    let mut readers: BTreeMap<Option<u8>, FrameReader> = BTreeMap::new();
    let mut is_told = false;
    while !stop.load(Ordering::Relaxed) {
        let pieces = follower.pieces()?;
        if pieces.is_empty() {
            if follower.is_ended() && !is_told {
                is_told = true;
                monitor.lock().tell("the recording is complete");
            }
            thread::sleep(LOOK_EVERY);
            continue;
        }
        // Locked for one piece at a time, since pages read the monitor meanwhile.
        for piece in pieces {
            let mut monitor = monitor.lock();
            let reader = readers.entry(piece.bead).or_default();
            reader.feed(&piece.bytes, piece.received_ns, |item| monitor.push(0, &item));
            let bytes = readers.values().map(|reader| reader.counters().bytes);
            monitor.count_bytes(bytes.sum());
        }
    }
    Ok(())
}
