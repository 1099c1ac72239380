//! The board as [`bead_app`] sees it.

use core::slice;

use bead_app::{BeadState, Device, FactoryCodes, InternalChannel};
use embassy_time::{Duration, Instant, Timer};

use crate::clocks::TIMER_HZ;
use crate::{line, stack, storage, supply, trace};

/// The bead of this board.
pub(crate) static BEAD: BeadState<Stm32Board> = BeadState::new(Stm32Board);

/// Bytes of the probe's sector. A block is much shorter; its header says how long it is.
const SECTOR: usize = 128 * 1024;

/// The STM32F405 and what is around it.
pub(crate) struct Stm32Board;

impl Device for Stm32Board {
    type Flash = storage::SettingsFlash;
    type Line = line::LinePins;

    const FIRMWARE: &'static str = env!("CARGO_PKG_VERSION");
    const GIT: &'static str = env!("BEAD_GIT");
    /// The core runs twice as fast as the timers.
    const CORE_MHZ: u32 = 2 * TIMER_HZ / 1_000_000;

    fn uid(&self) -> [u8; 12] {
        embassy_stm32::uid::uid()
    }

    fn now(&self) -> u64 {
        Instant::now().as_ticks()
    }

    fn sleep(&self, periods: u64) -> impl Future<Output = ()> {
        Timer::after(Duration::from_ticks(periods))
    }

    fn core_clocks(&self) -> u32 {
        cortex_m::peripheral::DWT::cycle_count()
    }

    fn factory_codes(&self) -> FactoryCodes {
        supply::factory_codes()
    }

    fn convert(&self, channel: InternalChannel) {
        supply::convert(channel);
    }

    fn converted(&self) -> Option<u16> {
        supply::converted()
    }

    fn supply_is_low(&self) -> bool {
        supply::is_low()
    }

    fn stack_never_used(&self) -> u32 {
        stack::never_used()
    }

    #[allow(unsafe_code, reason = "the sector is memory that no Rust object stands for")]
    fn probe_settings(&self) -> &'static [u8] {
        unsafe extern "C" {
            /// Start of the region SETTINGS of `memory.x`.
            static _settings: u8;
        }
        // SAFETY: `memory.x` reserves SECTOR bytes of flash from this symbol on and nothing is linked there.
        // Flash is always readable, any byte is a valid `u8`, and this image writes other sectors only.
        unsafe { slice::from_raw_parts(&raw const _settings, SECTOR) }
    }

    fn keep_frames_waiting(&self, frames: u32) {
        trace::keep_frames_waiting(frames);
    }

    fn keep_settings_written(&self, written: u32) {
        trace::change(|record| record.settings_written = written);
    }

    fn reset(&self) -> ! {
        cortex_m::peripheral::SCB::sys_reset()
    }
}
