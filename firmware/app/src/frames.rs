//! Messages become frames that wait in the outbox.
//!
//! # Design
//! A task of any priority can put a message in, and never waits: a message that finds no room is dropped and
//! counted. It takes a sequence number all the same, so the host sees the gap. A message is packed first and
//! then copied into a ring of bytes in a critical section, so that numbers and frames are in the same order.
//! The section is some 200 instructions long for the longest frame, 2 to 3 µs. CRC and COBS are the
//! transmitter's work, at the lowest priority.

use core::sync::atomic::Ordering;

use bead_model::Chunk;
use bead_wire::{KEPT, Message, Packed};

use crate::bead::BeadState;
use crate::device::{Device, MS};

/// Time that a request waits for room.
const PATIENCE: u64 = 20 * MS;

impl<D: Device> BeadState<D> {
    /// Queues a message that comes in bulk, or drops and counts it.
    pub fn push(&self, message: impl Into<Message>) {
        self.queue(&mut Packed::new(), &message.into(), KEPT);
    }

    /// Queues a message of a strike. The message stays in `packed`.
    pub(crate) fn push_packed(&self, packed: &mut Packed, message: impl Into<Message>) {
        self.queue(packed, &message.into(), KEPT);
    }

    /// Queues a piece of a window, of which there are dozens. `packed` is working space.
    pub(crate) fn push_piece(&self, packed: &mut Packed, chunk: &Chunk) {
        let whole = chunk.pack(packed, self.outbox.address(), self.boot() as u8);
        self.put(packed, whole, KEPT);
    }

    /// Queues a message that a host waits for, or that is rare. It may use the room that is kept.
    pub fn send(&self, message: impl Into<Message>) {
        self.queue(&mut Packed::new(), &message.into(), 0);
    }

    /// Queues a message as [`send`](Self::send) does, if `holds` returns `true` at that moment. Returns its
    /// result.
    pub(crate) fn send_if(&self, message: impl Into<Message>, holds: impl FnOnce() -> bool) -> bool {
        let mut packed = Packed::new();
        let whole = self.pack(&mut packed, &message.into());
        self.outbox.queue.lock(|_| {
            let holds = holds();
            if holds {
                self.put(&mut packed, whole, 0);
            }
            holds
        })
    }

    // Not inlined: building a message takes many instructions, and its callers should do something else
    // quickly.
    #[inline(never)]
    fn queue(&self, packed: &mut Packed, message: &Message, keep: usize) {
        let whole = self.pack(packed, message);
        self.put(packed, whole, keep);
    }

    /// Packs a message. Returns true if it is whole, which it always is.
    pub(crate) fn pack(&self, packed: &mut Packed, message: &Message) -> bool {
        packed
            .pack(self.outbox.address(), self.boot() as u8, message)
            .is_ok()
    }

    #[inline(never)]
    fn put(&self, packed: &mut Packed, whole: bool, keep: usize) {
        let mut wake = false;
        self.update(|c| {
            packed.stamp(c.frames, c.newest_index);
            c.frames = c.frames.wrapping_add(1);
            if !whole {
                c.frames_dropped_too_long += 1;
            } else if self
                .outbox
                .queue
                .lock(|queue| queue.borrow_mut().push(packed, keep))
            {
                // The transmitter waits only for the first.
                wake = c.frames_waiting == 0;
                c.frames_waiting += 1;
                self.device.keep_frames_waiting(c.frames_waiting);
            } else {
                c.frames_dropped_queue_full += 1;
            }
        });
        if wake {
            self.outbox.filled.signal(());
        }
    }

    /// Waits until a request may be carried out. A host that sends requests without end must not take the
    /// room that the window of a strike needs, so this waits for that room and its own. If strikes take that
    /// room for [`PATIENCE`], it waits only for the room for replies, which always becomes free.
    pub(crate) async fn wait_for_room(&self) {
        let deadline = self.device.now() + PATIENCE;
        let window = || self.outbox.window.load(Ordering::Relaxed);
        while self.outbox.room() < window() + KEPT / 2 && self.device.now() < deadline {
            self.device.sleep(MS).await;
        }
        while self.outbox.free() < KEPT / 2 {
            self.device.sleep(MS).await;
        }
    }

    /// Waits until there is room for another bulk frame beside the window of a strike. Returns false if
    /// strikes take that room until the deadline.
    pub(crate) async fn wait_for_spare(&self, deadline: u64) -> bool {
        while !self.outbox.has_spare(self.outbox.window.load(Ordering::Relaxed)) {
            if self.device.now() >= deadline {
                return false;
            }
            self.device.sleep(MS).await;
        }
        true
    }

    /// Moves the oldest frame into `packed`; waits for one.
    pub async fn next_frame(&self, packed: &mut Packed) {
        while !self.outbox.queue.lock(|queue| queue.borrow_mut().pop(packed)) {
            self.outbox.filled.wait().await;
        }
    }

    /// Counts a frame as done with, sent or not: it waits no longer.
    pub fn count_frame_done(&self) {
        self.update(|c| {
            c.frames_waiting -= 1;
            self.device.keep_frames_waiting(c.frames_waiting);
        });
    }
}
