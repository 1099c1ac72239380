//! Sleeps in STOP until an edge on PA0, and then in STANDBY until the next.
#![no_std]
#![no_main]

use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

use cortex_m_rt::{entry, exception};
use stm32f405_qemu_images::{AHB1ENR, APB1ENR, RCC, done, enable_interrupt, modify, read, write};

const CFGR: usize = RCC + 0x08;
const EXTI: usize = 0x4001_3c00;
const PWR_CR: usize = 0x4000_7000;
const PWR_CSR: usize = 0x4000_7004;
const SCR: usize = 0xe000_ed10;
const TIM2: usize = 0x4000_0000;

static TICKS: AtomicU32 = AtomicU32::new(0);

#[entry]
fn main() -> ! {
    modify(APB1ENR, |on| on | 1 << 28 | 1);
    if read(PWR_CSR) & 1 << 1 != 0 {
        defmt::info!("woken from STANDBY");
        done();
    }
    modify(AHB1ENR, |on| on | 1);
    // On the crystal.
    modify(RCC, |control| control | 1 << 16);
    modify(CFGR, |clocks| clocks | 1);
    defmt::info!("clock source {}", read(CFGR) >> 2 & 3);

    // A tick each ms would end an ordinary sleep.
    write(TIM2 + 0x2c, 7_999);
    write(TIM2 + 0x0c, 1);
    write(TIM2, 1);
    enable_interrupt(28);
    write(EXTI + 0x08, 1);
    write(EXTI, 1);
    enable_interrupt(6);
    modify(SCR, |control| control | 1 << 2);
    cortex_m::asm::wfi();
    defmt::info!(
        "woken from STOP, clock source {}, {} ticks",
        read(CFGR) >> 2 & 3,
        TICKS.load(Relaxed)
    );

    write(PWR_CSR, 1 << 8);
    modify(PWR_CR, |control| control | 1 << 1 | 1 << 2);
    cortex_m::asm::wfi();
    panic!("STANDBY ended without a reset");
}

#[exception]
#[allow(unsafe_code, reason = "the default handler is declared so")]
unsafe fn DefaultHandler(interrupt: i16) {
    match interrupt {
        28 => {
            write(TIM2 + 0x10, 0);
            TICKS.fetch_add(1, Relaxed);
        }
        _ => write(EXTI + 0x14, 1),
    }
}
