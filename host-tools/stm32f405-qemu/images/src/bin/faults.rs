//! Reads where nothing is.
#![no_std]
#![no_main]

use stm32f405_qemu_images::read;

/// Between the FSMC's registers and the processor's: no bus leads there.
const NOTHING: usize = 0xb000_0000;

#[cortex_m_rt::entry]
fn main() -> ! {
    defmt::info!("looking");
    look_at(NOTHING);
    panic!("the processor read it");
}

#[inline(never)]
fn look_at(address: usize) {
    defmt::info!("found {}", read(address));
}
