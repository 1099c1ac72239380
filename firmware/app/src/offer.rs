//! Settings change while the bead measures.
//!
//! # Design
//! New settings are offered to the estimators, which take them between two strikes. At that moment a frame
//! with their block is queued: each strike was measured with the settings of the last settings frame before
//! it.

use core::sync::atomic::Ordering;

use bead_model::Settings;
use embassy_futures::select::{Either, select};

use crate::bead::BeadState;
use crate::device::{Device, MS};
use crate::settings::Loaded;

/// Longest wait until the estimators take settings: ten times the longest window.
const PATIENCE: u64 = 100 * MS;

impl<D: Device> BeadState<D> {
    /// Offers settings to the estimators; [`settings_taken`](Self::settings_taken) then waits without holding
    /// them. Arms or disarms the bead if the new settings differ from the old ones in that.
    pub(crate) fn offer_settings(&self, loaded: Loaded) {
        let arm = loaded.arm();
        if arm != self.settings.arm() {
            self.arm(arm);
        }
        #[cfg(feature = "defmt")]
        defmt::info!("settings: {=str}", loaded.origin());
        self.settings.offer(loaded);
    }

    /// Waits until the offered settings are in force. A strike that is being measured is finished first.
    /// Returns false if no block of samples came in time: the settings then apply from the first block.
    pub(crate) async fn settings_taken(&self) -> bool {
        let taken = select(self.settings.taken.wait(), self.device.sleep(PATIENCE)).await;
        matches!(taken, Either::First(()))
    }

    /// The settings that are offered, if any. The caller uses them from now on. Called between two strikes.
    pub fn take_settings(&self) -> Option<Settings> {
        if !self.settings.is_offered() {
            return None;
        }
        self.settings.take();
        let settings = self.settings_changed();
        self.send_settings();
        self.settings.taken.signal(());
        Some(settings)
    }

    /// Queues a frame with the block in force. If the settings change between reading and queueing, the block
    /// is read again: otherwise the old one would be sent after the new one, and replay would take it for the
    /// one in force. Doing both under one lock would keep interrupts waiting for 20 µs.
    pub(crate) fn send_settings(&self) {
        loop {
            let changes = || self.settings.changes.load(Ordering::Acquire);
            let before = changes();
            let message = bead_wire::Settings {
                block: self.settings.block(),
            };
            if self.send_if(message, || changes() == before) {
                return;
            }
        }
    }
}
