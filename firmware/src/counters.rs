//! What has happened since the reset, counted where it happens and told by the status frame.

use core::cell::Cell;

use bead_wire::{Health, Link};
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;

/// Counts since the reset. Each has one writer; the fields mean what those of [`bead_wire::Status`]
/// and [`Health`] do.
#[derive(Clone, Copy, Default)]
pub(crate) struct Counters {
    /// Index of the newest scan.
    pub(crate) newest_index: u64,
    /// Breaks in what the estimators see: runs of samples that a window may not span.
    pub(crate) epoch: u32,
    pub(crate) samples: u64,
    pub(crate) strikes: u32,
    pub(crate) overruns: u32,
    pub(crate) blocks_dropped: u32,
    /// Blocks that acquisition handed to estimation.
    pub(crate) blocks_handed_on: u32,
    /// Blocks that estimation is done with.
    pub(crate) blocks_estimated: u32,
    /// Frames made, sent or not: the next one's sequence number; wraps.
    pub(crate) frames: u32,
    pub(crate) frames_dropped_queue_full: u32,
    pub(crate) frames_dropped_too_long: u32,
    /// Frames that the transmitter is done with.
    pub(crate) frames_sent: u32,
    /// Frames that wait, or are being sent; kept over a reset.
    pub(crate) frames_waiting: u32,
    pub(crate) armed: bool,
    pub(crate) health: Health,
}

static COUNTERS: Mutex<CriticalSectionRawMutex, Cell<Counters>> = Mutex::new(Cell::new(Counters {
    newest_index: 0,
    epoch: 0,
    samples: 0,
    strikes: 0,
    overruns: 0,
    blocks_dropped: 0,
    blocks_handed_on: 0,
    blocks_estimated: 0,
    frames: 0,
    frames_dropped_queue_full: 0,
    frames_dropped_too_long: 0,
    frames_sent: 0,
    frames_waiting: 0,
    armed: false,
    health: Health {
        frames_lost_by_reset: 0,
        strikes_cut: 0,
        force_stuck: 0,
        force_railed: 0,
        acceleration_stuck: 0,
        acceleration_railed: 0,
        supply_low: 0,
        supply_mv: 0,
        standing: 0,
    },
}));

/// Changes some of the counts.
pub(crate) fn update(change: impl FnOnce(&mut Counters)) {
    COUNTERS.lock(|cell| {
        let mut counters = cell.get();
        change(&mut counters);
        cell.set(counters);
    });
}

/// Sets to 0 what says how often something went wrong. Sequence numbers, numbers of strikes and what the watchdog goes by
/// stay.
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
}

/// The counts as they stand, all of one moment.
pub(crate) fn snapshot() -> Counters {
    COUNTERS.lock(Cell::get)
}

/// What came in over the link. Apart from the other counts, which change with every block.
static LINK: Mutex<CriticalSectionRawMutex, Cell<Option<Link>>> = Mutex::new(Cell::new(None));

/// What came in over the link, as it stands.
pub(crate) fn link() -> Link {
    LINK.lock(Cell::get).unwrap_or_default()
}

/// Changes some of the counts of what came in.
pub(crate) fn update_link(change: impl FnOnce(&mut Link)) {
    LINK.lock(|cell| {
        let mut link = cell.get().unwrap_or_default();
        change(&mut link);
        cell.set(Some(link));
    });
}
