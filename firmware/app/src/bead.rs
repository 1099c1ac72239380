//! State that the tasks of a bead share, and its counts.

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use bead_model::Settings;
use bead_store::Windows;
use bead_wire::{Guard, Health, Link, RequestCounters, Standing};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;

use crate::boot::ThisBoot;
use crate::counters::{BeadCounters, LoadCounter};
use crate::device::Device;
use crate::exchange::Exchange;
use crate::outbox::Outbox;
use crate::played_scans::PlayedScans;
use crate::settings::Loaded;
use crate::shared::SharedCell;

/// Bytes for windows.
pub const RING: usize = 62 * 1024;

/// State that the tasks of a bead share.
pub struct BeadState<D> {
    pub(crate) device: D,
    /// Resets since power-up.
    pub(crate) boot: AtomicU32,
    pub(crate) counters: SharedCell<BeadCounters>,
    /// Counts of what came in over the link.
    pub(crate) link: SharedCell<Link>,
    /// Counts of what was passed over and refused.
    pub(crate) guard: SharedCell<Guard>,
    pub(crate) outbox: Outbox,
    pub(crate) settings: Exchange,
    pub(crate) windows: SharedCell<Windows<'static, RING>>,
    /// Signalled when a window is closed.
    pub(crate) window_closed: Signal<CriticalSectionRawMutex, ()>,
    /// True while the detector is switched off.
    pub(crate) disarmed: AtomicBool,
    /// Scan around which a host has asked for a window.
    pub(crate) wanted_scan: Signal<CriticalSectionRawMutex, u64>,
    pub(crate) raw_blocks_left: AtomicU32,
    /// Scans that sample the last playback on the bead's own outputs.
    pub(crate) played: SharedCell<PlayedScans>,
    pub(crate) load: SharedCell<LoadCounter>,
}

impl<D: Device> BeadState<D> {
    /// Creates the state of a bead before its boot, without settings or windows.
    pub const fn new(device: D) -> Self {
        Self {
            device,
            boot: AtomicU32::new(0),
            counters: SharedCell::new(),
            link: SharedCell::new(),
            guard: SharedCell::new(),
            outbox: Outbox::new(),
            settings: Exchange::new(),
            windows: SharedCell::new(),
            window_closed: Signal::new(),
            disarmed: AtomicBool::new(false),
            wanted_scan: Signal::new(),
            raw_blocks_left: AtomicU32::new(0),
            played: SharedCell::new(),
            load: SharedCell::new(),
        }
    }

    /// Takes over settings, and the windows that the previous boot left. Called once, before the tasks start.
    pub fn begin(&self, boot: &ThisBoot, loaded: Loaded, windows: Windows<'static, RING>) {
        self.boot.store(boot.number, Ordering::Relaxed);
        self.windows.set(windows);
        self.window_closed.signal(());
        self.arm(loaded.arm());
        self.settings.in_force().set(loaded);
        self.settings_changed();
    }

    /// The hardware.
    pub fn device(&self) -> &D {
        &self.device
    }

    /// The number of this boot.
    pub(crate) fn boot(&self) -> u32 {
        self.boot.load(Ordering::Relaxed)
    }

    /// Arms or disarms the detector from the next block. A strike that is being measured is finished first.
    pub(crate) fn arm(&self, armed: bool) {
        self.disarmed.store(!armed, Ordering::Relaxed);
    }

    pub(crate) fn is_armed(&self) -> bool {
        !self.disarmed.load(Ordering::Relaxed)
    }

    /// Returns `true` if the bead makes scans: the crystal runs, and the part is the right one.
    pub(crate) fn has_scans(&self) -> bool {
        let standing = self.snapshot().health.standing;
        !standing.has(Standing::CRYSTAL_FAILED) && !standing.has(Standing::PART_WRONG)
    }

    /// Records a change of the settings in force, and returns them. Later frames carry their address.
    pub(crate) fn settings_changed(&self) -> Settings {
        let settings = self.settings.in_force().with(|loaded| loaded.settings);
        self.outbox.set_address(settings.description().address);
        self.settings.changes.fetch_add(1, Ordering::Release);
        settings
    }

    /// Changes some of the counts.
    pub fn update(&self, change: impl FnOnce(&mut BeadCounters)) {
        self.counters.update(change);
    }

    /// All counts at one moment.
    pub fn snapshot(&self) -> BeadCounters {
        self.counters.get()
    }

    /// Changes some of the counts of the link.
    pub fn update_link(&self, change: impl FnOnce(&mut Link)) {
        self.link.update(change);
    }

    /// Adds what a decoder has counted to the counts of the link.
    pub fn count_received(&self, counted: &RequestCounters) {
        let rejected = &counted.rejected;
        self.update_link(|link| {
            link.bytes += counted.bytes;
            link.requests += counted.requests as u32;
            link.rejected_too_long += rejected.too_long as u32;
            link.rejected_cobs += rejected.cobs as u32;
            link.rejected_too_short += rejected.too_short as u32;
            link.rejected_crc += rejected.crc as u32;
            link.rejected_version += rejected.version as u32;
            link.rejected_kind += rejected.kind as u32;
            link.rejected_body += rejected.body as u32;
            link.rejected_trailing += rejected.trailing as u32;
        });
    }

    /// Clears the counts of errors. Sequence numbers, strike numbers and the counts that the watchdog checks
    /// stay.
    pub(crate) fn reset_counters(&self) {
        self.update(|c| {
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
        self.link.set(Link::default());
        self.guard.update(|guard| {
            *guard = Guard {
                boots_failed: guard.boots_failed,
                keyed: guard.keyed,
                counter: guard.counter,
                ..Guard::default()
            };
        });
    }
}
