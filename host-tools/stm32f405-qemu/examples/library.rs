//! The example of docs/library.md.

use stm32f405_qemu::Run;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let image = std::env::args().nth(1).ok_or("give the path of an ELF file")?;
    let mut run = Run::new(image);
    run.stimulus = (0..1000_u16).map(|code| [code, 2048, 0, 0]).collect(); // codes at PA0 to PA3
    run.sample_period_ns = 10_000;
    let outcome = run.execute()?;
    for line in &outcome.log {
        println!("{line}"); // defmt, decoded
    }
    Ok(())
}
