//! What waits to be sent.
//!
//! # Design
//! Any task puts records in, at any priority, and never waits: a record that finds no room is dropped and
//! counted. It takes a sequence number all the same, so the host sees the gap. Encoding is left to the
//! transmitter at the lowest priority; a record is moved in within a critical section of about a
//! microsecond, so that numbers and records are in the same order.

use bead_model::Chunk;
use bead_wire::Message;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;

use crate::{counters, trace};

/// Records that wait: several windows of a strike, each some 30 records.
const DEPTH: usize = 128;

/// What a frame will be made of.
#[expect(
    clippy::large_enum_variant,
    reason = "there is no heap to box it on, and most frames are waveforms"
)]
pub(crate) enum Record {
    /// A message that borrows nothing, or what is there for ever.
    Message(Message<'static>),
    /// A piece of a strike's waveform, its codes not yet packed.
    Waveform(Chunk),
}

/// A record with what its frame's header needs.
pub(crate) struct Queued {
    pub(crate) sequence: u32,
    /// Index of the newest scan when the record was made.
    pub(crate) sample_index: u64,
    pub(crate) record: Record,
}

static QUEUE: Channel<CriticalSectionRawMutex, Queued, DEPTH> = Channel::new();

/// Puts a record in, or drops and counts it.
pub(crate) fn push(record: Record) {
    counters::update(|c| {
        let queued = Queued {
            sequence: c.frames,
            sample_index: c.newest_index,
            record,
        };
        c.frames = c.frames.wrapping_add(1);
        match QUEUE.try_send(queued) {
            Ok(()) => {
                c.frames_waiting += 1;
                trace::keep_waiting(c.frames_waiting);
            }
            Err(_) => c.frames_dropped_queue_full += 1,
        }
    });
}

/// Takes the oldest record out; waits for one.
pub(crate) async fn next() -> Queued {
    QUEUE.receive().await
}
