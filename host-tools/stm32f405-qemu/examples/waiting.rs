//! Speed of an image that waits, for each of the ways of `images/src/bin/waits.rs`: virtual over real time,
//! with QEMU only, and with waiting loops executed outside of it.
//!
//!     cargo xtask bench emulator

use std::time::{Duration, Instant};

use stm32f405_qemu::{Poke, Run, RunError};

const WAYS: [(u32, &str); 14] = [
    (0, "TIM2_CNT"),
    (1, "DWT_CYCCNT"),
    (2, "SysTick_CTRL"),
    (3, "SysTick_VAL"),
    (4, "TIM3_SR"),
    (5, "USART1_SR"),
    (6, "GPIOA_IDR and DWT_CYCCNT"),
    (7, "DMA, ADC, flash, and DWT_CYCCNT"),
    (8, "a flag in RAM"),
    (9, "WFE"),
    (10, "WFI"),
    (11, "instructions of all kinds"),
    (12, "loop {}"),
    (14, "writes that move a pin"),
];

/// Virtual over real time of a way.
fn speed(image: &str, way: u32, shorten: bool) -> Result<f64, RunError> {
    let mut run = Run::new(image);
    run.shorten_waits = shorten;
    run.sampling_deadline_ns = if shorten { 20_000_000_000 } else { 500_000_000 };
    run.timeout = Duration::from_secs(600);
    for (address, word) in [(0x1000_0000, way), (0x1000_0004, 0)] {
        run.pokes.push(Poke::word(0, address, word));
    }
    let began = Instant::now();
    let outcome = run.execute()?;
    Ok(outcome.virtual_ns as f64 * 1e-9 / began.elapsed().as_secs_f64())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let image = std::env::args().nth(1).ok_or("name the image")?;
    println!(
        "virtual over real time, with the start of QEMU in it (20 s of virtual time; 0.5 s in QEMU alone)"
    );
    println!("{:34} {:>10} {:>10}", "waits for", "in QEMU", "shortened");
    for (way, name) in WAYS {
        let [without, with] = [false, true].map(|shorten| speed(&image, way, shorten));
        println!("{name:34} {:9.2}x {:9.2}x", without?, with?);
    }
    Ok(())
}
