//! How fast an image waits, for each of the ways of `images/src/bin/waits.rs`: virtual over real time.
//!
//!     cargo xtask bench emulator

use std::time::{Duration, Instant};

use stm32f405_qemu::{Poke, Run};

const WAYS: [(&str, u64); 12] = [
    ("TIM2_CNT", 1),
    ("DWT_CYCCNT", 1),
    ("SysTick COUNTFLAG", 1),
    ("SysTick value", 1),
    ("TIM3_SR", 1),
    ("USART1_SR", 1),
    ("GPIOA_IDR and DWT", 1),
    ("DMA, ADC, flash status and DWT", 1),
    ("flag in RAM", 1),
    ("WFE", 20),
    ("WFI", 20),
    ("loop {}", 1),
];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let image = std::env::args().nth(1).ok_or("name the image")?;
    let ms: u64 = std::env::args().nth(2).map_or(Ok(200), |word| word.parse())?;
    for (way, (name, _)) in WAYS.iter().enumerate() {
        let mut run = Run::new(&image);
        run.sampling_deadline_ns = ms * 1_000_000;
        run.timeout = Duration::from_secs(600);
        let bytes = (way as u32).to_le_bytes().to_vec();
        run.pokes.push(Poke {
            at_ns: 0,
            address: 0x1000_0000,
            bytes,
        });
        run.pokes.push(Poke {
            at_ns: 0,
            address: 0x1000_0004,
            bytes: vec![0; 4],
        });
        let began = Instant::now();
        let outcome = run.execute()?;
        let took = began.elapsed().as_secs_f64();
        println!(
            "{name:32} {:8.3} s {:8.2}x {} instr",
            took,
            outcome.virtual_ns as f64 * 1e-9 / took,
            outcome.instructions.map_or(0, |i| i.total)
        );
    }
    Ok(())
}
