//! The board as [`bead_app`] sees it.

use core::slice;

use bead_app::{BeadState, Device, FactoryCodes, InternalChannel};
use bead_wire::{Board, UpdateStage};
use embassy_stm32::pac::{DBGMCU, FLASH};
use embassy_time::{Duration, Instant, Timer};

use crate::clocks::TIMER_HZ;
use crate::{clocks, line, masked, outputs, stack, storage, supply, trace, update, wiring};

/// The bead of this board.
pub(crate) static BEAD: BeadState<Stm32Board> = BeadState::new(Stm32Board);

/// Bytes of the probe's sector. A block is much shorter; its header says how long it is.
const SECTOR: usize = 16 * 1024;

/// The STM32F405 and what is around it.
pub(crate) struct Stm32Board;

impl Device for Stm32Board {
    type Flash = storage::SettingsFlash;
    type Line = line::LinePins;
    type ImageFlash = update::ImageFlash;

    const FIRMWARE: &'static str = env!("CARGO_PKG_VERSION");
    const GIT: &'static str = env!("BEAD_GIT");
    /// The core runs twice as fast as the timers.
    const CORE_MHZ: u32 = 2 * TIMER_HZ / 1_000_000;

    fn board(&self) -> Board {
        let id = DBGMCU.idcode().read();
        let options = FLASH.optcr().read();
        Board {
            name: wiring::NAME.into(),
            crystal_mhz: clocks::crystal_mhz(),
            part: id.dev_id(),
            revision: id.rev_id(),
            // Counted downwards, and off at 3 (RM0090 section 3.9.7).
            brown_out_level: 3 - options.bor_lev(),
            read_protection: match options.rdp() {
                0xaa => 0,
                0xcc => 2,
                _ => 1,
            },
        }
    }

    fn uid(&self) -> [u8; 12] {
        embassy_stm32::uid::uid()
    }

    const UPDATE_KEY: [u8; 32] = update::KEY;

    fn update_stage(&self) -> UpdateStage {
        update::stage()
    }

    fn receive_after_reset(&self) {
        trace::receive_after_reset();
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

    fn take_longest_mask(&self) -> u32 {
        masked::take_longest()
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

    fn hold(&self, codes: Option<[u16; 2]>) {
        outputs::hold(codes);
    }

    fn play(&self, codes: impl Iterator<Item = [u16; 2]>, about: u64) -> u64 {
        outputs::play(codes, about)
    }

    fn end_play(&self) -> bool {
        outputs::end_play()
    }

    #[allow(unsafe_code, reason = "the image is memory that no Rust object stands for")]
    fn image(&self) -> &'static [u8] {
        unsafe extern "C" {
            // From cortex-m-rt's linker script: start of the image, where the image holds `.data`, and the
            // ends of `.data` in RAM.
            static __vector_table: u8;
            static __sidata: u8;
            static __sdata: u8;
            static __edata: u8;
        }
        let first = &raw const __vector_table;
        let data = (&raw const __edata).addr() - (&raw const __sdata).addr();
        let bytes = (&raw const __sidata).addr() + data - first.addr();
        // SAFETY: flash from the first to the last byte of the image, which is always readable and which
        // this image does not write; any byte is a valid `u8`.
        unsafe { slice::from_raw_parts(first, bytes) }
    }

    fn hang(&self) -> ! {
        cortex_m::interrupt::disable();
        loop {
            cortex_m::asm::nop();
        }
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
