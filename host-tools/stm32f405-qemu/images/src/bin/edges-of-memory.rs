//! Reads the last word of RAM, and then the first that is not there.
#![no_std]
#![no_main]

use stm32f405_qemu_images::read;

#[cortex_m_rt::entry]
fn main() -> ! {
    let last = read(0x2001_fffc);
    defmt::info!(
        "the last word is {}",
        if last == 0 { "there" } else { "there, too" }
    );
    let beyond = read(0x2002_0000);
    panic!("RAM goes on with {beyond}");
}
