//! The hardware as the rest of the bead sees it.

use bead_store::nor_flash::NorFlash;

use crate::block::SAMPLE_RATE_HZ;

/// Sample periods in a millisecond.
pub const MS: u64 = SAMPLE_RATE_HZ as u64 / 1000;

/// The hardware of a bead. Times are in sample periods of 10 µs.
pub trait Device: 'static {
    /// Flash that settings and key are stored in.
    type Flash: NorFlash;
    /// Timer behind the trigger line.
    type Line: LineTimer;

    /// Version of the firmware.
    const FIRMWARE: &'static str;
    /// Commit that the firmware is built from.
    const GIT: &'static str;

    /// Unique number of the part.
    fn uid(&self) -> [u8; 12];
    /// Time since the start.
    fn now(&self) -> u64;
    /// Waits at least for this time.
    fn sleep(&self, periods: u64) -> impl Future<Output = ()>;
    /// Clocks of the core; wraps.
    fn core_clocks(&self) -> u32;
    /// Clocks of the core in a microsecond.
    const CORE_MHZ: u32;
    /// Returns `true` while the supply is below 2.93 V.
    fn supply_is_low(&self) -> bool;
    /// Bytes of stack that were never used.
    fn stack_never_used(&self) -> u32;
    /// The sector that a debug probe writes settings to.
    fn probe_settings(&self) -> &'static [u8];
    /// Keeps over a reset how many frames wait.
    fn keep_frames_waiting(&self, frames: u32);
    /// Keeps over a reset how many settings were written lately ([`bead_store::Pace`]).
    fn keep_settings_written(&self, written: u32);
    /// Resets the bead.
    fn reset(&self) -> !;
}

/// The timer behind the trigger line. It counts [`CLOCKS_PER_SAMPLE`](crate::CLOCKS_PER_SAMPLE) clocks in a
/// sample period from sample index 1 on; the count wraps.
pub trait LineTimer {
    /// Clocks now.
    fn count(&self) -> u32;
    /// Clocks at the last falling edge.
    fn last_edge(&self) -> u32;
    /// Returns `true` while the line is low.
    fn is_low(&self) -> bool;
    /// Lets the line fall at this count.
    fn pull_at(&mut self, count: u32);
    /// Lets the line go.
    fn release(&mut self);
}
