//! What waits to be sent.
//!
//! # Design
//! Any task puts records in, at any priority, and never waits: a record that finds no room is dropped and
//! counted. It takes a sequence number all the same, so the host sees the gap. Encoding is left to the
//! transmitter at the lowest priority; a record is moved in within a critical section of about a
//! microsecond, so that numbers and records are in the same order.

use bead_model::meter::CHUNK;
use bead_model::{Chunk, Scan};
use bead_wire::{Message, Outcome};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use embassy_time::{Duration, Timer};
use heapless::Vec;

use crate::text::Text;
use crate::{counters, trace};

/// Records that wait: several windows of a strike, each some 30 records.
const DEPTH: usize = 128;
/// Room that a raw stream leaves to strikes and all else.
const CALM: usize = DEPTH / 2;
/// Room that there is before a request is done: less, so that a raw stream does not keep requests from being done.
const ROOM: usize = DEPTH / 4;

/// What a frame will be made of.
///
/// The representation is for speed: with a tag of a byte the rest is moved from one odd address to another, byte by byte.
#[repr(u32)]
pub(crate) enum Record {
    /// A message that borrows nothing, or what is there for ever.
    Message(Message<'static>),
    /// A piece of a strike's waveform, its codes not yet packed.
    Waveform(Chunk),
    /// The settings block in this slot of [`settings`](crate::settings).
    Settings(usize),
    /// The answer to a request.
    Reply {
        request: u16,
        outcome: Outcome,
        detail: Text,
    },
    /// A piece of a raw stream, its codes not yet packed.
    Raw {
        first_index: u64,
        scans: Vec<Scan, CHUNK>,
    },
}

/// A record with what its frame's header needs.
pub(crate) struct Queued {
    pub(crate) sequence: u32,
    /// Index of the newest scan when the record was made.
    pub(crate) sample_index: u64,
    pub(crate) record: Record,
}

static QUEUE: Channel<CriticalSectionRawMutex, Queued, DEPTH> = Channel::new();

/// Puts a record in, or drops and counts it. Gives whether it was put in.
pub(crate) fn push(record: Record) -> bool {
    let mut taken = false;
    counters::update(|c| {
        let queued = Queued {
            sequence: c.frames,
            sample_index: c.newest_index,
            record,
        };
        c.frames = c.frames.wrapping_add(1);
        match QUEUE.try_send(queued) {
            Ok(()) => {
                taken = true;
                c.frames_waiting += 1;
                trace::keep_waiting(c.frames_waiting);
            }
            Err(_) => c.frames_dropped_queue_full += 1,
        }
    });
    taken
}

/// Puts a record in if half of the room is free, or does nothing. Gives whether it was put in.
pub(crate) fn push_if_calm(record: Record) -> bool {
    QUEUE.free_capacity() > CALM && push(record)
}

/// Waits until there is room for what a request may ask for, beside a strike.
pub(crate) async fn calm() {
    while QUEUE.free_capacity() < ROOM {
        Timer::after(Duration::from_millis(1)).await;
    }
}

/// Takes the oldest record out; waits for one.
pub(crate) async fn next() -> Queued {
    QUEUE.receive().await
}
