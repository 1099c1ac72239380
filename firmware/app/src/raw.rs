//! A stream of all scans for a limited time, as far as the link can carry them.
//!
//! # Design
//! The link cannot carry 100 000 scans a second: about half of them leave. Scans are queued in pieces behind
//! all waiting frames, and only while the outbox has room for the window of a strike as well. A piece that is
//! not queued takes no sequence number. It is counted, and the sample indices show the gap.

use core::sync::atomic::Ordering;

use bead_model::Scan;
use bead_model::quantity::pack;
use bead_wire::{MAX_SCANS, Raw};

use crate::bead::BeadState;
use crate::block::{BLOCK_US, ScanBlock};
use crate::device::Device;

/// Longest stream, in ms.
pub(crate) const MAX_MS: u32 = 10_000;

impl<D: Device> BeadState<D> {
    /// Begins a stream of `duration_ms`; 0 ends the stream.
    pub(crate) fn start_raw(&self, duration_ms: u32) {
        let blocks = duration_ms.div_ceil(BLOCK_US / 1000);
        self.raw_blocks_left.store(blocks, Ordering::Relaxed);
        if blocks == 0 {
            self.send_link();
        }
    }

    /// Queues a block if there is a stream, and leaves `room` bytes of the outbox free. At the end of the
    /// stream, sends how many scans were dropped.
    pub(crate) fn offer_raw(&self, block: &ScanBlock, room: usize) {
        // The count does not change between load and store: `start_raw` runs at a lower priority.
        let left = self.raw_blocks_left.load(Ordering::Relaxed);
        if left == 0 {
            return;
        }
        self.raw_blocks_left.store(left - 1, Ordering::Relaxed);
        let mut first_index = block.first_index;
        let mut scans_left = block.scans();
        while scans_left.len() > 0 {
            let count = scans_left.len().min(MAX_SCANS) as u64;
            let scans = scans_left.by_ref().take(MAX_SCANS);
            if self.outbox.has_spare(room) {
                self.push(Raw {
                    first_index,
                    codes: pack(scans, Scan::sensitive),
                });
                self.update_link(|link| link.raw_sent += count);
            } else {
                scans.for_each(drop);
                self.update_link(|link| link.raw_dropped += count);
            }
            first_index += count;
        }
        if left == 1 {
            self.send_link();
        }
    }
}
