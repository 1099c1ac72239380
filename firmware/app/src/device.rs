//! The hardware as the rest of the bead sees it.

use bead_store::nor_flash::NorFlash;
use bead_wire::{Board, UpdateStage};

use crate::block::SAMPLE_RATE_HZ;

/// Sample periods in a millisecond.
pub const MS: u64 = SAMPLE_RATE_HZ as u64 / 1000;

/// The hardware of a bead. Times are in sample periods of 10 µs.
pub trait Device: 'static {
    /// Flash that settings and key are stored in.
    type Flash: NorFlash;
    /// Timer behind the trigger line.
    type Line: LineTimer;
    /// Flash that holds images.
    type ImageFlash: NorFlash;

    /// Version of the firmware.
    const FIRMWARE: &'static str;
    /// Commit that the firmware is built from.
    const GIT: &'static str;

    /// Board, crystal and part that the image runs on.
    fn board(&self) -> Board;
    /// Unique number of the part.
    fn uid(&self) -> [u8; 12];
    /// Time since the start.
    fn now(&self) -> u64;
    /// Public key of those who may sign an image.
    const UPDATE_KEY: [u8; 32];
    /// The stage of an update that the running image is in.
    fn update_stage(&self) -> UpdateStage;
    /// Makes the next start wait for an image.
    fn receive_after_reset(&self);
    /// Waits at least for this time.
    fn sleep(&self, periods: u64) -> impl Future<Output = ()>;
    /// Clocks of the core; wraps.
    fn core_clocks(&self) -> u32;
    /// Clocks of the longest stretch without interrupts since this was last called.
    fn take_longest_mask(&self) -> u32;
    /// Clocks of the core in a microsecond.
    const CORE_MHZ: u32;
    /// Codes that the factory measured with this part.
    fn factory_codes(&self) -> FactoryCodes;
    /// Starts a conversion of an inner channel, which takes less than a block and disturbs no scan.
    fn convert(&self, channel: InternalChannel);
    /// The code of the conversion that was started; `None` if it is not over.
    fn converted(&self) -> Option<u16>;
    /// Puts these codes on the two outputs, PA4 and PA5, or switches them off.
    fn hold(&self, codes: Option<[u16; 2]>);
    /// Starts playing pairs of codes on outputs that hold a pair, one each sample period, at most
    /// [`PLAYED`](bead_model::made_up::PLAYED) of them. `about` is the index of a scan within the last
    /// seconds. Returns the index of the first scan that samples the first pair.
    fn play(&self, codes: impl Iterator<Item = [u16; 2]>, about: u64) -> u64;
    /// Stops playing; the last pair stays on the outputs. Returns `true` if all were played.
    fn end_play(&self) -> bool;
    /// The image in flash.
    fn image(&self) -> &'static [u8];
    /// Address of its first byte.
    fn image_address(&self) -> u32 {
        self.image().as_ptr().addr() as u32
    }
    /// Hangs until the watchdog resets the bead.
    fn hang(&self) -> !;
    /// Returns `true` while the supply is below 2.93 V.
    fn supply_is_low(&self) -> bool;
    /// Bytes of stack that were never used.
    fn stack_never_used(&self) -> u32;
    /// The sector that a debug probe writes settings to.
    fn probe_settings(&self) -> &'static [u8];
    /// Stores the number of waiting frames where it survives a reset.
    fn keep_frames_waiting(&self, frames: u32);
    /// Stores the count of settings written lately ([`bead_store::Pace`]) where it survives a reset.
    fn keep_settings_written(&self, written: u32);
    /// Resets the bead.
    fn reset(&self) -> !;
}

/// A channel of the converter inside the part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InternalChannel {
    /// The reference voltage.
    Reference,
    /// The temperature sensor.
    Temperature,
}

/// Codes that the factory measured at a supply of 3.3 V.
#[derive(Clone, Copy, Debug, Default)]
pub struct FactoryCodes {
    /// Code of the reference voltage at 30 °C.
    pub reference: u16,
    /// Codes of the temperature sensor at 30 and 110 °C.
    pub temperatures: [u16; 2],
}

impl FactoryCodes {
    /// Codes of a good part's reference: 1.18 to 1.24 V (DocID022152, embedded reference voltage), and a
    /// margin.
    pub(crate) const REFERENCE: core::ops::RangeInclusive<u16> = 1400..=1600;
    /// Least difference of a good part's two temperatures: 0.4 of 80 °C · 2.5 mV/°C.
    pub(crate) const LEAST_RISE: f32 = 100.0;
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
    /// Pulls the line low at this count.
    fn pull_at(&mut self, count: u32);
    /// Releases the line.
    fn release(&mut self);
}
