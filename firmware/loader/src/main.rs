//! The loader of the sensing absorber bead: the first program after every reset.
//!
//! # Design
//! It swaps images if the bead asked for it, and starts the active one (`bead_update::swap`). It runs from
//! the internal oscillator, as the part does after a reset, and leaves alone the reset flags, which the bead
//! reads, and the upper half of the SRAM, where the bead keeps what survives a reset. If nothing is to be
//! swapped, this takes less than a millisecond.
//!
//! The watchdog runs from here on, with its longest time: an image that hangs in its first instruction is
//! reset too, and swapped back if it was on trial.
#![no_std]
#![no_main]

use bead_update::internal::InternalFlash;
use bead_update::layout::{FLASH, Layout, PAGE};
use bead_update::swap;
use cortex_m::peripheral::SCB;
use stm32_metapac::iwdg::vals::{Key, Pr};
use stm32_metapac::{IWDG, PWR, RCC};

/// The detector's threshold, number 6 of PWR_CR.PLS: the supply is low below 2.93 V (DocID022152, table of
/// the reset and power control block).
const THRESHOLD: u8 = 6;

/// The core-coupled memory, where an image has its stack.
const STACK: core::ops::RangeInclusive<u32> = 0x1000_0000..=0x1001_0000;

#[cortex_m_rt::entry]
fn main() -> ! {
    IWDG.kr().write(|w| w.set_key(Key::START));
    IWDG.kr().write(|w| w.set_key(Key::ENABLE));
    // The reload value after a reset is the longest: 32.8 s, 22 s at least.
    IWDG.pr().write(|w| w.set_pr(Pr::DIVIDE_BY256));

    let mut flash = InternalFlash { feed };
    if swap::is_pending(&mut flash, &Layout::BEAD) {
        wait_for_supply();
    }
    if swap::prepare::<_, PAGE>(flash, &Layout::BEAD).is_err() {
        // The flash failed, perhaps because the power is failing. The next start continues.
        SCB::sys_reset();
    }
    start(FLASH + Layout::BEAD.active.start)
}

fn feed() {
    IWDG.kr().write(|w| w.set_key(Key::RESET));
}

/// Waits until the supply is above 2.9 V: below 2.7 V flash is not written properly. If the supply stays low,
/// the watchdog resets, and the wait begins anew.
fn wait_for_supply() {
    RCC.apb1enr().modify(|w| w.set_pwren(true));
    // The clock is there two clocks later (ES0182, delay after an RCC peripheral clock enabling).
    let _ = RCC.apb1enr().read();
    PWR.cr1().modify(|w| {
        w.set_pls(THRESHOLD);
        w.set_pvde(true);
    });
    // The detector takes some time to settle, less than a millisecond.
    cortex_m::asm::delay(16_000);
    while PWR.csr1().read().pvdo() {}
}

/// Starts the image with these vectors. Without an image it waits for the watchdog: a debug probe or the ROM
/// loader brings one.
#[allow(
    unsafe_code,
    reason = "an image begins at an address and with a stack of its own"
)]
fn start(vectors: u32) -> ! {
    let table = core::ptr::with_exposed_provenance::<u32>(vectors as usize);
    // SAFETY: flash can always be read, and the address is aligned to 128 KiB.
    let [stack, reset] = unsafe { [table.read_volatile(), table.add(1).read_volatile()] };
    let active = Layout::BEAD.active;
    while !STACK.contains(&stack) || !(FLASH + active.start..FLASH + active.end).contains(&reset) {
        cortex_m::asm::nop();
    }
    // SAFETY: no interrupt is enabled, nothing of this program runs any more, and the table is that of an
    // image, which starts as after a reset.
    unsafe {
        (*SCB::PTR).vtor.write(vectors);
        cortex_m::asm::bootload(table)
    }
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    SCB::sys_reset()
}
