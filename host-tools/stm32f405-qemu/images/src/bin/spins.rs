//! Does nothing, for ever.
#![no_std]
#![no_main]

use stm32f405_qemu_images as _;

#[cortex_m_rt::entry]
fn main() -> ! {
    loop {
        cortex_m::asm::nop();
    }
}
