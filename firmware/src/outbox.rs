//! The queue of records that wait to be sent.
//!
//! # Design
//! A task of any priority can put a record in, and never waits: a record that finds no room is dropped and
//! counted. It takes a sequence number all the same, so the host sees the gap. The transmitter encodes the
//! records, at the lowest priority. A record is copied into the queue in a critical section, so that numbers
//! and records are in the same order. The section is about 390 instructions long, 4 to 6 µs: the copy alone
//! is of 320 bytes.

use bead_model::meter::CHUNK;
use bead_model::{Chunk, Scan};
use bead_wire::{Message, Outcome};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use embassy_time::{Duration, Timer};
use heapless::Vec;

use crate::text::Text;
use crate::{counters, trace};

/// Most records that wait: the windows of several strikes, about 23 records each.
const DEPTH: usize = 128;
/// Records for which a raw stream leaves room.
const CALM: usize = DEPTH / 2;
/// Records for which there must be room before a request is done. It is less than a raw stream leaves, so
/// that a stream does not block requests.
const ROOM: usize = DEPTH / 4;

/// What a frame is made of.
///
/// The representation is for speed: with a tag of one byte the rest would lie at an odd address and be copied
/// byte by byte.
#[repr(u32)]
pub(crate) enum Record {
    /// A message that borrows nothing, or constants only.
    Message(Message<'static>),
    /// A piece of the waveform of a strike. The transmitter packs its codes.
    Waveform(Chunk),
    /// The settings block in this slot of `settings.rs`.
    Settings(usize),
    /// The reply to a request.
    Reply {
        request: u16,
        outcome: Outcome,
        detail: Text,
    },
    /// A piece of a raw stream. The transmitter packs its codes.
    Raw {
        first_index: u64,
        scans: Vec<Scan, CHUNK>,
    },
}

/// A record with the fields of its frame's header.
pub(crate) struct Queued {
    pub(crate) sequence: u32,
    /// Index of the newest scan when the record was made.
    pub(crate) sample_index: u64,
    pub(crate) record: Record,
}

static QUEUE: Channel<CriticalSectionRawMutex, Queued, DEPTH> = Channel::new();

/// Puts a record in, or drops and counts it. Returns whether it was put in.
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

/// Puts a record in if more than half of the room is free, or does nothing. Returns whether it was put in.
pub(crate) fn push_if_calm(record: Record) -> bool {
    QUEUE.free_capacity() > CALM && push(record)
}

/// Waits until there is room for the frames of a request.
pub(crate) async fn calm() {
    while QUEUE.free_capacity() < ROOM {
        Timer::after(Duration::from_millis(1)).await;
    }
}

/// Takes the oldest record out; waits for one.
pub(crate) async fn next() -> Queued {
    QUEUE.receive().await
}
