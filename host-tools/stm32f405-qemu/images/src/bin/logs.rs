//! Logs a thousand lines without a pause: no register is accessed, and no interrupt comes.
#![no_std]
#![no_main]

use stm32f405_qemu_images::done;

#[cortex_m_rt::entry]
fn main() -> ! {
    for line in 0..1000u32 {
        defmt::info!("line {}", line);
    }
    done();
}
