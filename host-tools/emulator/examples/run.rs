//! Runs an image for a few milliseconds of a sine on both inputs, and tells what came of it.
//!
//!     cargo run -p stm32f405-qemu --example run -- target/thumbv7em-none-eabihf/firmware/bead-firmware

use std::process::ExitCode;

use stm32f405_qemu::{Run, RunError};

fn main() -> ExitCode {
    let Some(elf) = std::env::args_os().nth(1) else {
        eprintln!("usage: run ELF");
        return ExitCode::from(2);
    };
    match run(elf.into()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("{e}");
            ExitCode::from(3)
        }
    }
}

fn run(elf: std::path::PathBuf) -> Result<(), RunError> {
    let mut run = Run::new(elf);
    run.stimulus = (0..5000)
        .map(|i| {
            let phase = f64::from(i) * std::f64::consts::TAU / 100.0;
            [phase.sin(), phase.cos(), 0.0, 0.0].map(|x| (2048.0 + 100.0 * x) as u16)
        })
        .collect();
    let outcome = run.execute()?;

    for line in &outcome.log {
        println!("{line}");
    }
    println!(
        "{} bytes from USART1 in {:.3} ms",
        outcome.uart.len(),
        outcome.virtual_ns as f64 / 1e6
    );
    match outcome.sampling {
        Some(s) => println!("{} scans from {:.3} ms on", s.scans, s.first_ns as f64 / 1e6),
        None => println!("the image did not sample"),
    }
    println!("{} overruns, {} resets", outcome.overruns, outcome.resets.len());
    if let Some(instructions) = &outcome.instructions {
        println!("{} instructions", instructions.total);
        if let Some(block) = instructions.worst_block {
            println!("at most {:.1} instructions a scan", block.instructions_per_scan());
        }
    }
    for register in &outcome.unknown_registers {
        println!(
            "no model: {} ({} reads, {} writes)",
            register.name, register.reads, register.writes
        );
    }
    for what in &outcome.unmodelled {
        println!("not modelled: {what}");
    }
    for pin in &outcome.pins {
        println!("{} moved {} times", pin.name, pin.edges);
    }
    Ok(())
}
