//! Blinks by embassy's clock, as its examples do: with `time-driver-any`, the thread executor and the default
//! clock tree.
#![no_std]
#![no_main]

use embassy_executor::Spawner;
use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_time::{Instant, Timer};
use stm32f405_qemu_images::done;

#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    let p = embassy_stm32::init(Default::default());
    let mut light = Output::new(p.PC13, Level::High, Speed::Low);
    let began = Instant::now();
    for _ in 0..5 {
        Timer::after_millis(10).await;
        light.toggle();
    }
    let passed = began.elapsed().as_millis();
    defmt::info!("{} ms for 5 times 10 ms", passed);
    done();
}
