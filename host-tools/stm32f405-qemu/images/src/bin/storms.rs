//! A handler whose interrupt stays up: it returns, and is entered again without an instruction in between.
//! Meanwhile it does one of several things that firmware does. The host writes the number of that thing to
//! the first word of CCM, and the number of ticks to the second; 0 is for ever.
//!
//! TIM7 ticks each millisecond, and interrupts the handler. The image logs its counts, and the link register
//! as the ticks found it.
#![no_std]
#![no_main]
#![allow(
    unsafe_code,
    reason = "handlers are found by their names, and one is in assembler"
)]

use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

use cortex_m::register::basepri;
use cortex_m_rt::entry;
// For its vectors.
use embassy_stm32 as _;
use stm32f405_qemu_images::{AHB1ENR, APB1ENR, APB2ENR, done, enable_interrupt, modify, read, write};

const WAY: usize = 0x1000_0000;
const TICKS: usize = 0x1000_0004;
const TIM7: usize = 0x4000_1400;
const USART1: usize = 0x4001_1000;
const USART1_CR1: usize = USART1 + 0x0c;
const DMA1: usize = 0x4002_6000;
const DMA2: usize = 0x4002_6400;
const LIFCR: usize = 0x08;
/// Streams 0 and 2.
const STREAM0: usize = 0x10;
const STREAM2: usize = 0x40;
const NVIC_IPR: usize = 0xe000_e400;
const DEMCR: usize = 0xe000_edfc;
const DWT: usize = 0xe000_1000;
const CYCCNT: usize = DWT + 4;
const LINE_OF_DMA1_STREAM0: usize = 11;
const LINE_OF_USART1: usize = 37;
const LINE_OF_TIM7: usize = 55;
const LINE_OF_DMA2_STREAM2: usize = 58;

static TICKED: AtomicU32 = AtomicU32::new(0);
static TAKEN: AtomicU32 = AtomicU32::new(0);
static SERVED: AtomicU32 = AtomicU32::new(0);
static SUM: AtomicU32 = AtomicU32::new(0);
static BUFFERS: [AtomicU32; 2] = [AtomicU32::new(0x2000_8000), AtomicU32::new(0x2000_9000)];
static OVER: AtomicU32 = AtomicU32::new(0);

core::arch::global_asm!(".thumb_func", ".global TIM7", "TIM7:", "mov r0, lr", "b tick");

#[entry]
fn main() -> ! {
    modify(DEMCR, |on| on | 1 << 24);
    write(DWT, 1);
    modify(AHB1ENR, |on| on | 0b11 << 21);
    modify(APB1ENR, |on| on | 1 << 5);
    modify(APB2ENR, |on| on | 1 << 4);
    let way = read(WAY);
    prioritize(LINE_OF_USART1, 0xe0);
    prioritize(LINE_OF_DMA2_STREAM2, 0xe0);
    prioritize(LINE_OF_DMA1_STREAM0, if way == 4 { 0xd0 } else { 0xe0 });
    prioritize(LINE_OF_TIM7, 0x40);
    for line in [LINE_OF_USART1, LINE_OF_TIM7, LINE_OF_DMA1_STREAM0] {
        enable_interrupt(line);
    }
    if way == 2 {
        enable_interrupt(LINE_OF_DMA2_STREAM2);
    }
    write(TIM7 + 0x2c, 16_000 - 1);
    write(TIM7 + 0x0c, 1);
    write(TIM7, 1);
    // The transmitter is empty.
    write(USART1_CR1, 1 << 13 | 1 << 7 | 1 << 3);
    while OVER.load(Relaxed) == 0 {
        cortex_m::asm::nop();
    }
    defmt::info!(
        "way {}: {} cycles, {} ticks, taken {}, served {}, sum {:#x}",
        way,
        read(CYCCNT),
        TICKED.load(Relaxed),
        TAKEN.load(Relaxed),
        SERVED.load(Relaxed),
        SUM.load(Relaxed)
    );
    done()
}

/// Adds with plain loads and stores: the interpreter leaves exclusive ones to QEMU. Returns the sum before.
fn add(to: &AtomicU32, n: u32) -> u32 {
    let before = to.load(Relaxed);
    to.store(before.wrapping_add(n), Relaxed);
    before
}

/// Gives a line a priority, of four bits.
fn prioritize(line: usize, priority: u32) {
    let shift = 8 * (line % 4);
    let word = NVIC_IPR + line / 4 * 4;
    modify(word, |all| all & !(0xff << shift) | priority << shift);
}

/// Stops a stream, and sets it up anew for another buffer, as drivers do. A stopped stream has its flag set
/// for a moment, which raises its line.
fn restart(dma: usize, stream: usize, flags: u32) {
    const SETTINGS: u32 = 4 << 25 | 1 << 10 | 1 << 4;
    write(dma + stream, SETTINGS);
    while read(dma + stream) & 1 != 0 {}
    write(dma + LIFCR, flags);
    let buffer = BUFFERS[0].load(Relaxed);
    BUFFERS[0].store(BUFFERS[1].load(Relaxed), Relaxed);
    BUFFERS[1].store(buffer, Relaxed);
    write(dma + stream + 0x08, USART1 as u32 + 4);
    write(dma + stream + 0x0c, buffer);
    write(dma + stream + 0x04, 100);
    write(dma + stream, SETTINGS | 1);
}

#[unsafe(export_name = "USART1")]
extern "C" fn storm() {
    if OVER.load(Relaxed) != 0 {
        write(USART1_CR1, 0);
        return;
    }
    match read(WAY) {
        1 | 2 => {
            restart(DMA2, STREAM2, 0x3d << 16);
            // SAFETY: no critical section is open.
            unsafe { basepri::write(0) };
        }
        // The line of another stream rises now and then.
        3 | 4 => {
            if add(&TAKEN, 1) % 1024 == 1023 {
                write(DMA1 + STREAM0, 1 << 10 | 1 << 4);
                write(DMA1 + STREAM0 + 0x04, 100);
            }
            write(DMA1 + STREAM0, 1 << 10 | 1 << 4 | 1);
        }
        5 => {
            add(&TAKEN, 1);
            add(&SUM, read(CYCCNT));
        }
        6 => {
            let before = basepri::read();
            // SAFETY: the priority that was there comes back.
            unsafe { basepri::write(0x80) };
            let status = read(USART1);
            // SAFETY: as above.
            unsafe { basepri::write(before) };
            add(&SUM, status);
        }
        // Floating point is in use now and then, and not when the handler is entered again.
        7 => {
            let taken = add(&TAKEN, 1);
            if taken.is_multiple_of(64) {
                add(&SUM, (taken as f32 * 1.5) as u32);
            }
            for _ in 0..20 {
                read(USART1);
            }
        }
        8 => {
            SUM.fetch_xor(read(USART1), Relaxed);
        }
        _ => {
            read(USART1);
        }
    }
}

#[unsafe(export_name = "DMA1_STREAM0")]
extern "C" fn serve_dma1() {
    write(DMA1 + LIFCR, 0x3d);
    add(&SERVED, 1);
}

#[unsafe(export_name = "DMA2_STREAM2")]
extern "C" fn serve_dma2() {
    write(DMA2 + LIFCR, 0x3d << 16);
    add(&SERVED, 1);
}

/// Handles a tick. The link register shows where the processor returns to, and whether floating point was in
/// use there.
#[unsafe(no_mangle)]
extern "C" fn tick(link: u32) {
    write(TIM7 + 0x10, 0);
    let ticked = add(&TICKED, 1) + 1;
    add(&SUM, link.rotate_left(ticked));
    if ticked == read(TICKS) {
        OVER.store(1, Relaxed);
    }
}
