//! The queue of messages that wait to be sent.
//!
//! # Design
//! A task of any priority can put a message in, and never waits: a message that finds no room is dropped and
//! counted. It takes a sequence number all the same, so the host sees the gap. The transmitter encodes the
//! messages, at the lowest priority. A message is copied into the queue in a critical section, so that
//! numbers and messages are in the same order. The section is about 390 instructions long, 4 to 6 µs: the
//! copy alone is of some 290 bytes.

use bead_wire::Message;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use embassy_time::{Duration, Timer};

use crate::{counters, trace};

/// Most messages that wait: the windows of several strikes, about 23 records each.
const DEPTH: usize = 128;
/// Messages for which a raw stream leaves room.
const CALM: usize = DEPTH / 2;
/// Messages for which there must be room before a request is done. It is less than a raw stream leaves, so
/// that a stream does not block requests.
const ROOM: usize = DEPTH / 4;

/// A message with the fields of its frame's header.
pub(crate) struct Queued {
    pub(crate) sequence: u32,
    /// Index of the newest scan when the message was made.
    pub(crate) sample_index: u64,
    pub(crate) message: Message,
}

static QUEUE: Channel<CriticalSectionRawMutex, Queued, DEPTH> = Channel::new();

/// Puts a message in, or drops and counts it.
pub(crate) fn push(message: impl Into<Message>) {
    queue(message.into());
}

// Once in the image: a message is long to build, and it is built where the core should do something else
// quickly.
#[inline(never)]
fn queue(message: Message) {
    counters::update(|c| {
        let queued = Queued {
            sequence: c.frames,
            sample_index: c.newest_index,
            message,
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

/// Whether more than half of the room is free: a raw stream leaves the other half to strikes.
pub(crate) fn is_calm() -> bool {
    QUEUE.free_capacity() > CALM
}

/// Waits until there is room for the frames of a request.
pub(crate) async fn calm() {
    while QUEUE.free_capacity() < ROOM {
        Timer::after(Duration::from_millis(1)).await;
    }
}

/// Takes the oldest message out; waits for one.
pub(crate) async fn next() -> Queued {
    QUEUE.receive().await
}
