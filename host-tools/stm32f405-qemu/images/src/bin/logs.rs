//! Reads a timer whose clock is off, as many images do for the time of their first line. Logs a thousand
//! lines without a pause: no register is accessed, and no interrupt comes.
#![no_std]
#![no_main]

use stm32f405_qemu_images::{done, read};

const TIM5_CNT: usize = 0x4000_0c24;

#[cortex_m_rt::entry]
fn main() -> ! {
    read(TIM5_CNT);
    for line in 0..1000u32 {
        defmt::info!("line {}", line);
    }
    done();
}
