//! Panics after a while.
#![no_std]
#![no_main]

use stm32f405_qemu_images as _;

#[cortex_m_rt::entry]
fn main() -> ! {
    cortex_m::asm::delay(10_000);
    panic!("the answer is {}", 6 * 7);
}
