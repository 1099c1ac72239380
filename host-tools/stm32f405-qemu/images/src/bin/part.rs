//! Logs the part on which it runs, and tries a word at an address that the test chooses: a peripheral's, or
//! the edges of memory. Then moves PE3, which packages of 100 pins have.
#![no_std]
#![no_main]

use stm32f405_qemu_images::{AHB1ENR, modify, read, write};

const GPIOE: usize = 0x4002_1000;

/// Place where a poke of the test writes the address. All parts have RAM there.
const CHOICE: usize = 0x2000_f000;

#[cortex_m_rt::entry]
fn main() -> ! {
    let device = read(0xe004_2000) & 0xfff;
    let flash_kib = read(0x1fff_7a20) >> 16;
    defmt::info!("device {=u32:#x}, {} KiB of flash", device, flash_kib);
    let place = read(CHOICE) as usize;
    let before = read(place);
    write(place, !before);
    defmt::info!(
        "{}",
        if read(place) == !before {
            "keeps a word"
        } else {
            "keeps nothing"
        }
    );
    modify(AHB1ENR, |clocks| clocks | 1 << 4);
    write(GPIOE, 0b01 << 6);
    write(GPIOE + 0x14, 1 << 3);
    stm32f405_qemu_images::done();
}
