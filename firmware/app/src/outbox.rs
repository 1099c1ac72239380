//! The queue of frames, and the room that is kept in it.
//!
//! # Design
//! **Room is kept for replies.** Bulk frames leave [`KEPT`] bytes free: waveforms, strikes, raw scans and
//! edges. Replies, requested data, the reports of each second and faults may use them. So a bead answers
//! whatever its settings, its sensors and its line make it send. While frames can leave, that room becomes
//! free again within 10 ms, since bulk frames may not take it.

use core::cell::RefCell;
use core::sync::atomic::{AtomicU8, AtomicUsize, Ordering};

use bead_wire::{KEPT, OUTBOX, Packed, Queue, taken};
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;

/// Bytes that a raw stream leaves besides those of a window: for its next frame, and so that no request waits
/// for it.
const SPARE: usize = taken(Packed::MAX) + KEPT / 2;

pub(crate) struct Outbox {
    pub(crate) queue: Mutex<CriticalSectionRawMutex, RefCell<Queue<OUTBOX>>>,
    /// Signalled when a frame is put in.
    pub(crate) filled: Signal<CriticalSectionRawMutex, ()>,
    /// Bytes that the window of a strike needs.
    pub(crate) window: AtomicUsize,
    /// Address of the bead, by the settings in force.
    address: AtomicU8,
}

impl Outbox {
    pub(crate) const fn new() -> Self {
        Self {
            queue: Mutex::new(RefCell::new(Queue::new())),
            filled: Signal::new(),
            window: AtomicUsize::new(0),
            address: AtomicU8::new(0),
        }
    }

    /// The address under which frames leave.
    pub(crate) fn address(&self) -> u8 {
        self.address.load(Ordering::Relaxed)
    }

    /// Changes the address of the frames that are put in from now on.
    pub(crate) fn set_address(&self, address: u8) {
        self.address.store(address, Ordering::Relaxed);
    }

    pub(crate) fn free(&self) -> usize {
        self.queue.lock(|queue| queue.borrow().free())
    }

    /// Bytes that bulk may still take.
    pub(crate) fn room(&self) -> usize {
        self.free().saturating_sub(KEPT)
    }

    /// Returns `true` if there is room for the window of a strike, which needs `window` bytes.
    pub(crate) fn has_room(&self, window: usize) -> bool {
        self.window.store(window, Ordering::Relaxed);
        self.room() >= window
    }

    /// Returns `true` if bulk may still take `window` and [`SPARE`] bytes.
    pub(crate) fn has_spare(&self, window: usize) -> bool {
        self.room() >= window + SPARE
    }
}
