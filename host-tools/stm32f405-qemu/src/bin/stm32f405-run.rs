//! Runs an image and tells what came of it.
//!
//!     cargo run --release -p stm32f405-qemu -- firmware.elf
//!
//! `--help` says what it takes, and what its exit status means.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use stm32f405_qemu::{Outcome, Run, RunError};

const USAGE: &str = "\
usage: stm32f405-run [--seconds S] [--until TEXT] [--vcd FILE] [--semihosting] [--gdb PORT] ELF

  --seconds S     virtual time for an image that does not sample [default: 2]
  --until TEXT    fail unless a line of the log contains TEXT
  --vcd FILE      write the levels of output pins over time, for a waveform viewer such as GTKWave
  --semihosting   let the image call the host: only for an image that you trust
  --gdb PORT      wait for a debugger at this TCP port of this computer

exit status: 0 if the image used up its time, stopped at a breakpoint or ended itself with status 0; 1 if it
panicked, stands in a fault's handler, waits for what the emulator has not, or did not log TEXT; 2 for wrong
arguments; 3 if there was no run";

/// Command-line arguments.
struct Arguments {
    run: Run,
    until: Option<String>,
    vcd: Option<PathBuf>,
}

fn main() -> ExitCode {
    stm32f405_qemu::carry_overlay!();
    if std::env::args().any(|word| word == "--help") {
        println!("{USAGE}");
        return ExitCode::SUCCESS;
    }
    let Some(arguments) = parse(std::env::args().skip(1)) else {
        eprintln!("{USAGE}");
        return ExitCode::from(2);
    };
    let result = arguments.run.execute();
    if let Some(outcome) = result.as_ref().map_or_else(RunError::outcome, Some) {
        tell(outcome);
        if let Some(file) = &arguments.vcd
            && let Err(e) = std::fs::write(file, outcome.vcd())
        {
            eprintln!("stm32f405-run: cannot write {}: {e}", file.display());
            return ExitCode::from(3);
        }
    }
    let Err((status, why)) = verdict(&result, arguments.until.as_deref()) else {
        return ExitCode::SUCCESS;
    };
    eprintln!("stm32f405-run: {why}");
    ExitCode::from(status)
}

fn parse(mut words: impl Iterator<Item = String>) -> Option<Arguments> {
    let mut arguments = Arguments {
        run: Run::new(""),
        until: None,
        vcd: None,
    };
    let run = &mut arguments.run;
    // A sine on both inputs, for images that sample.
    run.stimulus = (0..5000)
        .map(|i| {
            let phase = f64::from(i) * std::f64::consts::TAU / 100.0;
            [phase.sin(), phase.cos(), 0.0, 0.0].map(|x| (2048.0 + 100.0 * x) as u16)
        })
        .collect();
    while let Some(word) = words.next() {
        match word.as_str() {
            "--seconds" => {
                let seconds = Duration::try_from_secs_f64(words.next()?.parse().ok()?).ok()?;
                run.sampling_deadline_ns = seconds.as_nanos().try_into().ok()?;
            }
            "--until" => arguments.until = Some(words.next()?),
            "--vcd" => {
                arguments.vcd = Some(words.next()?.into());
                run.record_pins = true;
            }
            "--semihosting" => run.semihosting = true,
            "--gdb" => run.gdb = Some(words.next()?.parse().ok()?),
            elf if !elf.starts_with('-') && run.elf.as_os_str().is_empty() => run.elf = elf.into(),
            _ => return None,
        }
    }
    (!arguments.run.elf.as_os_str().is_empty()).then_some(arguments)
}

/// The exit status and why, if the image has failed.
fn verdict(result: &Result<Outcome, RunError>, until: Option<&str>) -> Result<(), (u8, String)> {
    let failed = |error: &RunError| (if error.outcome().is_some() { 1 } else { 3 }, error.to_string());
    let outcome = result.as_ref().map_err(failed)?;
    outcome.verdict().map_err(|why| (1, why))?;
    let logged = |text: &str| outcome.log.iter().any(|line| line.text.contains(text));
    match until.filter(|text| !logged(text)) {
        Some(text) => Err((1, format!("no line of the log contains {text:?}"))),
        None => Ok(()),
    }
}

fn tell(outcome: &Outcome) {
    for line in &outcome.log {
        println!("{line}");
    }
    print!("{}", outcome.semihosting);
    let (bytes, ms) = (outcome.uart.len(), outcome.virtual_ns as f64 / 1e6);
    println!("{bytes} bytes from USART1 in {ms:.3} ms");
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
    for exception in &outcome.exceptions {
        println!("{exception}");
    }
    for register in &outcome.unknown_registers {
        let (reads, writes) = (register.reads, register.writes);
        println!("no model: {} ({reads} reads, {writes} writes)", register.name);
    }
    for what in &outcome.unmodelled {
        println!("not modelled: {what}");
    }
    for what in &outcome.never_came {
        println!("never came: {what}");
    }
    for interrupt in &outcome.interrupts {
        println!("{} interrupted {} times", interrupt.name, interrupt.taken);
    }
    for pin in &outcome.pins {
        println!("{} moved {} times", pin.name, pin.edges);
    }
}
