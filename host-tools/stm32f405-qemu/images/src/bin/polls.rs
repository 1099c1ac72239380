//! Waits for a CAN controller, which the emulator does not have a model of, to enter initialisation.
#![no_std]
#![no_main]

use stm32f405_qemu_images::{APB1ENR, modify, read, write};

const CAN1_MCR: usize = 0x4000_6400;
const CAN1_MSR: usize = 0x4000_6404;

#[cortex_m_rt::entry]
fn main() -> ! {
    modify(APB1ENR, |on| on | 1 << 25);
    write(CAN1_MCR, 1);
    defmt::info!("waiting for the controller");
    wait_for_controller();
    panic!("there is one");
}

#[inline(never)]
fn wait_for_controller() {
    while read(CAN1_MSR) & 1 == 0 {}
}
