//! A stream of all scans for a limited time, as far as the link can carry them.
//!
//! # Design
//! The link cannot carry 100 000 scans a second: about half of them leave. Scans are queued in pieces behind
//! all that already waits, and only while the outbox has room for the window of a strike as well. A piece
//! that is not queued takes no sequence number. It is counted, and the sample indices show the gap.

use core::sync::atomic::{AtomicU32, Ordering};

use bead_model::Scan;
use bead_model::quantity::pack;
use bead_wire::{MAX_SCANS, Raw};

use crate::block::{BLOCK_US, Block};
use crate::counters;
use crate::outbox;
use crate::report;

/// Longest stream, in ms.
pub(crate) const MAX_MS: u32 = 10_000;

static BLOCKS_LEFT: AtomicU32 = AtomicU32::new(0);

/// Begins a stream of `duration_ms`; 0 ends the stream.
pub(crate) fn start(duration_ms: u32) {
    BLOCKS_LEFT.store(duration_ms.div_ceil(BLOCK_US / 1000), Ordering::Relaxed);
}

/// Queues a block if there is a stream, and leaves `room` bytes of the outbox free. At the end of the stream,
/// sends how many scans were dropped.
pub(crate) fn offer(block: &Block, room: usize) {
    // Nothing changes it between load and store: `start` runs at a lower priority.
    let left = BLOCKS_LEFT.load(Ordering::Relaxed);
    if left == 0 {
        return;
    }
    BLOCKS_LEFT.store(left - 1, Ordering::Relaxed);
    let mut first_index = block.first_index;
    let mut rest = block.scans();
    while rest.len() > 0 {
        let count = rest.len().min(MAX_SCANS) as u64;
        let scans = rest.by_ref().take(MAX_SCANS);
        if outbox::room() >= room + outbox::SPARE {
            outbox::push(Raw {
                first_index,
                codes: pack(scans, Scan::sensitive),
            });
            counters::update_link(|link| link.raw_sent += count);
        } else {
            scans.for_each(drop);
            counters::update_link(|link| link.raw_dropped += count);
        }
        first_index += count;
    }
    if left == 1 {
        report::tell_link();
    }
}
