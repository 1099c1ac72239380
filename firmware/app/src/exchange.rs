//! The settings in force, and those that are offered to the estimators.

use core::sync::atomic::{AtomicBool, AtomicU32, AtomicUsize, Ordering};

use bead_wire::{Block, Conditions, MAX_BLOCK, SettingsSource};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;

use crate::settings::Loaded;
use crate::shared::SharedCell;

/// Settings in force, and those that are offered to the estimators.
///
/// An index swaps their places: copying them under a lock would keep interrupts waiting.
pub(crate) struct Exchange {
    places: [SharedCell<Loaded>; 2],
    /// Index of the place with the settings in force.
    place: AtomicUsize,
    /// Number of changes of the settings in force; wraps.
    pub(crate) changes: AtomicU32,
    /// True while settings are offered. It is read for every block, and costs little.
    is_offered: AtomicBool,
    /// Signalled when the estimators have taken the offered settings.
    pub(crate) taken: Signal<CriticalSectionRawMutex, ()>,
}

impl Exchange {
    pub(crate) const fn new() -> Self {
        Self {
            places: [SharedCell::new(), SharedCell::new()],
            place: AtomicUsize::new(0),
            changes: AtomicU32::new(0),
            is_offered: AtomicBool::new(false),
            taken: Signal::new(),
        }
    }

    /// The settings in force.
    pub(crate) fn in_force(&self) -> &SharedCell<Loaded> {
        &self.places[self.place.load(Ordering::Acquire) & 1]
    }

    /// Offers settings. They replace an offer that was not taken.
    pub(crate) fn offer(&self, loaded: Loaded) {
        // Withdraws an earlier offer first: if it were taken now, its place would be the one in force.
        self.is_offered.store(false, Ordering::Relaxed);
        self.taken.reset();
        self.places[(self.place.load(Ordering::Acquire) ^ 1) & 1].set(loaded);
        self.is_offered.store(true, Ordering::Release);
    }

    /// Puts the offered settings in force.
    pub(crate) fn take(&self) {
        self.is_offered.store(false, Ordering::Relaxed);
        self.place.fetch_xor(1, Ordering::AcqRel);
    }

    /// Returns `true` if settings are offered.
    pub(crate) fn is_offered(&self) -> bool {
        self.is_offered.load(Ordering::Acquire)
    }

    /// Returns `true` if the bead looks for strikes unasked with the settings in force.
    pub(crate) fn arm(&self) -> bool {
        self.in_force().with(|loaded| loaded.arm())
    }

    /// Where the settings in force came from.
    pub(crate) fn source(&self) -> SettingsSource {
        self.in_force().with(|loaded| loaded.source)
    }

    /// Returns `true` if the settings in force are not the owner's: built in, with or without a refused block
    /// in flash.
    pub(crate) fn are_not_owners(&self) -> bool {
        matches!(
            self.source(),
            SettingsSource::BuiltIn | SettingsSource::FlashRefused | SettingsSource::Rescue
        )
    }

    /// Returns `true` if the supply in these conditions is not that of the settings in force.
    pub(crate) fn is_supply_off(&self, conditions: Option<&Conditions>) -> bool {
        self.in_force()
            .with(|loaded| loaded.settings.supply_is_off(conditions))
    }

    /// The block in force.
    #[inline(never)]
    pub(crate) fn block(&self) -> Block {
        let settings = self.in_force().with(|loaded| loaded.settings);
        let mut bytes = [0; MAX_BLOCK];
        // No `expect`: it would print the error, and formats take 4 KB of flash.
        let Some(Ok(block)) = settings
            .encode(&mut bytes)
            .ok()
            .map(|length| Block::try_from(&bytes[..length]))
        else {
            panic!("a block has at most MAX_BLOCK bytes");
        };
        block
    }
}
