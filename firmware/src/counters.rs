//! Counts since the reset: made where things happen, sent with the frames of status, health and link.

use core::cell::RefCell;

use bead_wire::{Guard, Health, Link};
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;

/// Counts since the reset. Each has one writer. A field without a text here has the meaning of the field of
/// the same name in [`bead_wire::Status`].
#[derive(Clone, Copy, Default)]
pub(crate) struct Counters {
    /// Index of the newest scan; while none are made, the sample periods since the start.
    pub(crate) newest_index: u64,
    /// Number of the run of samples without a gap. No window spans two of them.
    pub(crate) epoch: u32,
    pub(crate) samples: u64,
    pub(crate) strikes: u32,
    pub(crate) overruns: u32,
    pub(crate) blocks_dropped: u32,
    /// Blocks that acquisition handed to estimation.
    pub(crate) blocks_handed_on: u32,
    /// Blocks that estimation has finished.
    pub(crate) blocks_estimated: u32,
    /// Frames made, sent or not: the sequence number of the next one; wraps.
    pub(crate) frames: u32,
    pub(crate) frames_dropped_queue_full: u32,
    pub(crate) frames_dropped_too_long: u32,
    /// Frames that the transmitter has sent; wraps.
    pub(crate) frames_sent: u32,
    /// Frames that wait or are being sent; the next boot reads it after a reset.
    pub(crate) frames_waiting: u32,
    pub(crate) armed: bool,
    pub(crate) health: Health,
}

static COUNTERS: Mutex<CriticalSectionRawMutex, RefCell<Option<Counters>>> = Mutex::new(RefCell::new(None));

/// Changes some of the counts.
pub(crate) fn update(change: impl FnOnce(&mut Counters)) {
    COUNTERS.lock(|cell| change(cell.borrow_mut().get_or_insert_default()));
}

/// Sets the counts of what went wrong to 0. Sequence numbers, strike numbers and the counts that the watchdog
/// checks stay.
pub(crate) fn reset() {
    update(|c| {
        c.overruns = 0;
        c.blocks_dropped = 0;
        c.frames_dropped_queue_full = 0;
        c.frames_dropped_too_long = 0;
        c.health = Health {
            supply_mv: c.health.supply_mv,
            standing: c.health.standing,
            ..Health::default()
        };
    });
    update_link(|link| *link = Link::default());
    update_guard(|guard| {
        *guard = Guard {
            boots_failed: guard.boots_failed,
            keyed: guard.keyed,
            counter: guard.counter,
            ..Guard::default()
        };
    });
}

/// All counts at one moment.
pub(crate) fn snapshot() -> Counters {
    COUNTERS.lock(|cell| cell.borrow().unwrap_or_default())
}

/// Counts of what came in over the link. They are not part of [`Counters`], which change with every block.
static LINK: Mutex<CriticalSectionRawMutex, RefCell<Option<Link>>> = Mutex::new(RefCell::new(None));

/// The counts of the link at one moment.
pub(crate) fn link() -> Link {
    LINK.lock(|cell| cell.borrow().unwrap_or_default())
}

/// Changes some of the counts of the link.
pub(crate) fn update_link(change: impl FnOnce(&mut Link)) {
    LINK.lock(|cell| change(cell.borrow_mut().get_or_insert_default()));
}

/// Counts of what was passed over and refused.
static GUARD: Mutex<CriticalSectionRawMutex, RefCell<Option<Guard>>> = Mutex::new(RefCell::new(None));

/// Takes the counts of skipped and refused requests at one moment.
pub(crate) fn guard() -> Guard {
    GUARD.lock(|cell| cell.borrow().unwrap_or_default())
}

/// Changes some of what was passed over and refused.
pub(crate) fn update_guard(change: impl FnOnce(&mut Guard)) {
    GUARD.lock(|cell| change(cell.borrow_mut().get_or_insert_default()));
}
