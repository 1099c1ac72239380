//! Waits for edges on a pin (PC13) and of the voltage detector, and logs each.
#![no_std]
#![no_main]

use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

use cortex_m_rt::{entry, exception};
use stm32f405_qemu_images::{AHB1ENR, APB1ENR, APB2ENR, done, enable_interrupt, modify, read, write};

const EXTI: usize = 0x4001_3c00;
const SYSCFG: usize = 0x4001_3800;
const GPIOC: usize = 0x4002_0800;
const PWR: usize = 0x4000_7000;
const BUTTON: u32 = 1 << 13;
const DETECTOR: u32 = 1 << 16;

static EDGES: AtomicU32 = AtomicU32::new(0);

#[entry]
fn main() -> ! {
    modify(AHB1ENR, |on| on | 1 << 2);
    modify(APB1ENR, |on| on | 1 << 28);
    modify(APB2ENR, |on| on | 1 << 14);
    // The detector at 2.93 V.
    write(PWR, 1 << 14 | 6 << 5 | 1 << 4);
    // Line 13 is port C's.
    write(SYSCFG + 0x14, 2 << 4);
    write(EXTI + 0x08, BUTTON | DETECTOR);
    write(EXTI + 0x0c, BUTTON);
    write(EXTI, BUTTON | DETECTOR);
    enable_interrupt(40);
    enable_interrupt(1);
    while EDGES.load(Relaxed) < 4 {
        cortex_m::asm::wfi();
    }
    done();
}

#[exception]
#[allow(unsafe_code, reason = "the default handler is declared so")]
unsafe fn DefaultHandler(interrupt: i16) {
    let pending = read(EXTI + 0x14);
    write(EXTI + 0x14, pending);
    let pressed = read(GPIOC + 0x10) & BUTTON != 0;
    defmt::info!(
        "interrupt {}, lines {=u32:#x}, pressed {}",
        interrupt,
        pending,
        pressed
    );
    EDGES.fetch_add(1, Relaxed);
}
