//! Reads where nothing is, and once more in the handler of that fault: the processor locks up.
#![no_std]
#![no_main]

use cortex_m_rt::{ExceptionFrame, entry, exception};
use stm32f405_qemu_images::read;

/// Between the FSMC's registers and the processor's: no bus leads there.
const NOTHING: usize = 0xb000_0000;

#[entry]
fn main() -> ! {
    defmt::info!("looking");
    panic!("the processor read {}", read(NOTHING));
}

#[exception]
#[allow(unsafe_code, reason = "cortex-m-rt asks for it")]
unsafe fn HardFault(_frame: &ExceptionFrame) -> ! {
    defmt::info!("and again in the handler");
    panic!("the processor read {}", read(NOTHING));
}
