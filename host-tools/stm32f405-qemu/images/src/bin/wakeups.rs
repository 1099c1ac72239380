//! Raises the lines of EXTI that belong to peripherals, one after the other, by software: 17 to 22.
#![no_std]
#![no_main]

use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

use cortex_m_rt::{entry, exception};
use stm32f405_qemu_images::{done, enable_interrupt, read, write};

const EXTI: usize = 0x4001_3c00;
/// The interrupt of each line (RM0090 table 61): RTC alarm, both USB wake-ups with Ethernet's between them,
/// tamper and time stamp, RTC wake-up.
const LINES: [(u32, usize); 6] = [(17, 41), (18, 42), (19, 62), (20, 76), (21, 2), (22, 3)];

static TAKEN: AtomicU32 = AtomicU32::new(0);

#[entry]
fn main() -> ! {
    for (line, interrupt) in LINES {
        enable_interrupt(interrupt);
        // Masked, it stays quiet.
        write(EXTI + 0x10, 1 << line);
        let quiet = TAKEN.load(Relaxed);
        write(EXTI + 0x14, 1 << line);
        write(EXTI, 1 << line);
        write(EXTI + 0x10, 1 << line);
        cortex_m::asm::nop();
        defmt::info!(
            "line {=u32}: {=u32} masked, {=u32} unmasked",
            line,
            quiet,
            TAKEN.swap(0, Relaxed)
        );
        write(EXTI, 0);
    }
    done();
}

#[exception]
#[allow(unsafe_code, reason = "the default handler is declared so")]
unsafe fn DefaultHandler(interrupt: i16) {
    let pending = read(EXTI + 0x14);
    write(EXTI + 0x14, pending);
    defmt::info!("interrupt {}, lines {=u32:#x}", interrupt, pending);
    TAKEN.fetch_add(1, Relaxed);
}
