//! Waits in one of the ways in which firmware does. The host writes the way's number to the first word of
//! CCM, and the number of rounds to the second; 0 is for ever. A third word other than 0 turns the memory
//! protection on, with a fence around words that nobody uses.
//!
//! After each round the image logs the cycle counter, so that the log shows when the wait was over.
#![no_std]
#![no_main]
#![allow(unsafe_code, reason = "a loop is written in assembler")]

use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

use cortex_m_rt::{entry, exception};
use stm32f405_qemu_images::{AHB1ENR, APB1ENR, APB2ENR, done, enable_interrupt, modify, read, write};

const WAY: usize = 0x1000_0000;
const ROUNDS: usize = 0x1000_0004;
const PROTECTED: usize = 0x1000_0008;
const FENCE: usize = 0x1000_1000;
const TIM2: usize = 0x4000_0000;
const TIM3: usize = 0x4000_0400;
const GPIOA: usize = 0x4002_0000;
const USART1: usize = 0x4001_1000;
const ADC1: usize = 0x4001_2000;
const DMA2: usize = 0x4002_6400;
const FLASH_SR: usize = 0x4002_3c0c;
const SYSTICK: usize = 0xe000_e010;
const MPU: usize = 0xe000_ed90;
const DEMCR: usize = 0xe000_edfc;
const DWT: usize = 0xe000_1000;
const CYCCNT: usize = DWT + 4;
/// Cycles of a round, 1 ms of the 16 MHz after a reset.
const ROUND: u32 = 16_000;

core::arch::global_asm!(include_str!("../all_kinds.s"), options(raw));

static TICKS: AtomicU32 = AtomicU32::new(0);

#[entry]
fn main() -> ! {
    modify(DEMCR, |on| on | 1 << 24);
    write(DWT, 1);
    modify(AHB1ENR, |on| on | 1 | 1 << 22);
    modify(APB1ENR, |on| on | 0b11);
    modify(APB2ENR, |on| on | 1 << 4 | 1 << 8);
    // TIM2 counts cycles, TIM3 ends each millisecond.
    write(TIM2, 1);
    write(TIM3 + 0x2c, ROUND - 1);
    write(TIM3, 1);
    write(SYSTICK + 4, ROUND - 1);
    write(SYSTICK, 0b101);
    let (way, rounds) = (read(WAY), read(ROUNDS));
    if read(PROTECTED) != 0 {
        // Region 0 of 32 bytes, without access; the memory around it as before.
        write(MPU + 0x08, 0);
        write(MPU + 0x0c, FENCE as u32);
        write(MPU + 0x10, 4 << 1 | 1);
        write(MPU + 0x04, 0b101);
    }
    let mut round = 0;
    prepare(way);
    while rounds == 0 || round < rounds {
        wait(way);
        round += 1;
        if rounds > 0 {
            let (now, ticks) = (read(CYCCNT), TICKS.load(Relaxed));
            defmt::info!("way {}, round {}: {} cycles, {} ticks", way, round, now, ticks);
        }
    }
    done()
}

/// Sets up what a way needs beside the clocks.
fn prepare(way: u32) {
    match way {
        5 => {
            // 9600 baud on a pin, so that TC takes a millisecond.
            write(GPIOA, 0b10 << 18 | read(GPIOA));
            write(GPIOA + 0x24, 7 << 4);
            write(USART1 + 0x08, 1667);
            write(USART1 + 0x0c, 1 << 13 | 1 << 3);
        }
        14 => modify(GPIOA, |modes| modes | 0b01 << 10),
        8..=10 | 12.. => {
            write(TIM3 + 0x0c, 1);
            enable_interrupt(29);
        }
        _ => {}
    }
}

#[inline(never)]
#[expect(clippy::empty_loop, reason = "many programs end in one")]
fn wait(way: u32) {
    match way {
        0 => until_passed(TIM2 + 0x24),
        1 => until_passed(CYCCNT),
        2 => while read(SYSTICK) & 1 << 16 == 0 {},
        3 => {
            let start = read(SYSTICK + 8);
            while start.wrapping_sub(read(SYSTICK + 8)) & 0xff_ffff < ROUND / 2 {}
        }
        4 => {
            while read(TIM3 + 0x10) & 1 == 0 {}
            write(TIM3 + 0x10, 0);
        }
        5 => {
            write(USART1 + 4, 0x55);
            while read(USART1) & 1 << 6 == 0 {}
        }
        // These bits are never set: only the time ends the wait.
        6 => within_a_round(GPIOA + 0x10),
        7 => [DMA2, ADC1, FLASH_SR].into_iter().for_each(within_a_round),
        8 => {
            let before = TICKS.load(Relaxed);
            while TICKS.load(Relaxed) == before {}
        }
        9 => cortex_m::asm::wfe(),
        10 => cortex_m::asm::wfi(),
        11 => {
            let sum = all_kinds();
            defmt::info!("sum {:#x}", sum);
        }
        // A loop of some instructions, since its turns are counted up to an interrupt.
        13 => loop {
            (0..6).for_each(|_| cortex_m::asm::nop());
        },
        14 => blink(),
        _ => loop {},
    }
}

/// Writes PA5 high for some time and low for some, again and again.
fn blink() {
    const BSRR: usize = GPIOA + 0x18;
    let start = read(CYCCNT);
    while read(CYCCNT).wrapping_sub(start) < ROUND {
        (0..100).for_each(|_| write(BSRR, 1 << 5));
        (0..100).for_each(|_| write(BSRR, 1 << (5 + 16)));
    }
}

/// A loop on the cycle counter with instructions of all kinds that compilers emit. Returns a sum of all their
/// results.
fn all_kinds() -> u32 {
    // SAFETY: the function preserves the registers that it must, and reads only the counter.
    unsafe {
        unsafe extern "C" {
            fn instructions_of_all_kinds(counter: usize, turns: u32) -> u32;
        }
        instructions_of_all_kinds(CYCCNT, 2000)
    }
}

/// A delay on a counter of cycles, as most are written.
fn until_passed(counter: usize) {
    let start = read(counter);
    while read(counter).wrapping_sub(start) < ROUND {}
}

/// Waits for a bit, and gives up after a round.
fn within_a_round(register: usize) {
    let start = read(CYCCNT);
    while read(register) & 1 << 9 == 0 && read(CYCCNT).wrapping_sub(start) < ROUND {}
}

#[exception]
unsafe fn DefaultHandler(_interrupt: i16) {
    write(TIM3 + 0x10, 0);
    let ticks = TICKS.fetch_add(1, Relaxed);
    if read(WAY) == 13 {
        // The interpreter is tried after some number of turns, and then there is a read.
        for _ in 0..40 + ticks {
            cortex_m::asm::nop();
        }
        read(SYSTICK);
    }
}
