//! Waits for a random number from a generator that the part does not have a model of.
#![no_std]
#![no_main]

use stm32f405_qemu_images::{RCC, modify, read, write};

const AHB2ENR: usize = RCC + 0x34;
const RNG_CR: usize = 0x5006_0800;
const RNG_SR: usize = 0x5006_0804;

#[cortex_m_rt::entry]
fn main() -> ! {
    modify(AHB2ENR, |on| on | 1 << 6);
    write(RNG_CR, 1 << 2);
    defmt::info!("waiting for a random number");
    wait_for_number();
    panic!("there is one");
}

#[inline(never)]
fn wait_for_number() {
    while read(RNG_SR) & 1 == 0 {}
}
