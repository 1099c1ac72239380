//! Every scan, for a while, as far as the link carries them.
//!
//! # Design
//! 100 000 scans a second are more than 2 Mbaud carry: about half of them leave. Scans are queued in pieces behind whatever
//! else waits, and only while half of the outbox is free, so that a strike finds its room. What is not queued takes no
//! sequence number; it is counted, and shows in the sample indices.

use core::sync::atomic::{AtomicU32, Ordering};

use bead_model::meter::CHUNK;

use crate::block::{BLOCK_US, Block};
use crate::counters;
use crate::outbox::{self, Record};
use crate::report;

/// Longest stream, in ms.
pub(crate) const MAX_MS: u32 = 10_000;

static BLOCKS_LEFT: AtomicU32 = AtomicU32::new(0);

/// Begins a stream of so many ms, or ends the one there is.
pub(crate) fn start(duration_ms: u32) {
    BLOCKS_LEFT.store(duration_ms.div_ceil(BLOCK_US / 1000), Ordering::Relaxed);
}

/// Queues a block if there is a stream. Tells what was dropped when the stream ends.
pub(crate) fn offer(block: &Block) {
    // Nobody else changes it meanwhile: `start` is of a lower priority.
    let left = BLOCKS_LEFT.load(Ordering::Relaxed);
    if left == 0 {
        return;
    }
    BLOCKS_LEFT.store(left - 1, Ordering::Relaxed);
    let mut first_index = block.first_index;
    let mut rest = block.scans();
    while rest.len() > 0 {
        let scans: heapless::Vec<_, CHUNK> = rest.by_ref().take(CHUNK).collect();
        let count = scans.len() as u64;
        match outbox::push_if_calm(Record::Raw { first_index, scans }) {
            true => counters::update_link(|link| link.raw_sent += count),
            false => counters::update_link(|link| link.raw_dropped += count),
        }
        first_index += count;
    }
    if left == 1 {
        report::tell_link();
    }
}
