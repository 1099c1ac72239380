//! The DAC plays a ramp from flash and RAM to an input, by a timer and DMA.
#![no_std]
#![no_main]

use core::sync::atomic::{AtomicU32, Ordering};

use stm32f405_qemu_images::{AHB1ENR, APB1ENR, APB2ENR, done, modify, read, write};

const TIM7: usize = 0x4000_1400;
const DAC: usize = 0x4000_7400;
const ADC1: usize = 0x4001_2000;
const DMA1: usize = 0x4002_6000;
/// Stream 5.
const STREAM: usize = DMA1 + 0x10 + 0x18 * 5;

/// Pairs of codes: the second output's in the upper half.
static FLASH: [u32; 4] = [
    2000 << 16 | 1000,
    1990 << 16 | 1010,
    1980 << 16 | 1020,
    1970 << 16 | 1030,
];
static RAM: [AtomicU32; 4] = [const { AtomicU32::new(0) }; 4];

#[cortex_m_rt::entry]
fn main() -> ! {
    modify(AHB1ENR, |on| on | 1 << 21 | 1);
    modify(APB1ENR, |on| on | 1 << 29 | 1 << 5);
    modify(APB2ENR, |on| on | 1 << 8);
    for (place, word) in RAM.iter().enumerate() {
        word.store(FLASH[place] + (500 << 16 | 500), Ordering::Relaxed);
    }
    // 10 us of 16 MHz.
    write(TIM7 + 0x2c, 159);
    write(TIM7 + 0x04, 0b010 << 4);
    write(ADC1 + 0x08, 1);
    for (memory, name) in [
        (FLASH.as_ptr().expose_provenance(), "flash"),
        (RAM.as_ptr().expose_provenance(), "RAM"),
    ] {
        write(STREAM + 0x08, (DAC + 0x20) as u32);
        write(STREAM + 0x0c, memory as u32);
        write(STREAM + 0x04, 4);
        write(STREAM, 7 << 25 | 0b10 << 13 | 0b10 << 11 | 1 << 10 | 0b01 << 6);
        modify(STREAM, |cr| cr | 1);
        // TIM7, both channels, one request.
        let channel = 0b010 << 3 | 0b101;
        write(DAC, channel | 1 << 12 | channel << 16);
        write(TIM7, 1);
        while read(DMA1 + 0x04) & 1 << 11 == 0 {}
        // The last pair goes out with one more trigger.
        let second_half = || read(TIM7 + 0x24) >= 80;
        while !second_half() {}
        while second_half() {}
        while !second_half() {}
        write(TIM7, 0);
        let codes = [0, 2].map(|channel| {
            write(ADC1 + 0x34, channel);
            write(ADC1 + 0x08, 1 << 30 | 1);
            while read(ADC1) & 1 << 1 == 0 {}
            read(ADC1 + 0x4c)
        });
        defmt::info!("{}: {} {}", name, codes[0], codes[1]);
        write(DMA1 + 0x0c, 0x3d << 6);
        write(DAC, 0);
        write(DAC + 0x34, u32::MAX);
    }
    done()
}
