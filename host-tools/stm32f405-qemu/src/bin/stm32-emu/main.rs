//! Runs an image, shows its output while it runs, and reports the result by the exit status.
//!
//!     cargo run --release -p stm32f405-qemu -- firmware.elf
//!
//! `arguments` is the command line; `session` is one run; `report` presents the result to a reader and to
//! other programs; `cases` runs the test cases of an image one by one; `uart` connects the USARTs.

mod arguments;
mod cases;
mod report;
mod session;
mod uart;

use std::process::ExitCode;

use clap::Parser;
use stm32f405_qemu::{RunError, test_cases};

use arguments::Arguments;
use report::Verdict;

fn main() -> ExitCode {
    stm32f405_qemu::carry_overlay!();
    let arguments = Arguments::parse();
    let verdict = run(&arguments).unwrap_or_else(|error| Verdict::no_run(&error));
    if let Some(why) = &verdict.why {
        eprintln!("stm32-emu: {why}");
    }
    ExitCode::from(verdict.status)
}

fn run(arguments: &Arguments) -> Result<Verdict, RunError> {
    arguments.check_outputs()?;
    match test_cases(&arguments.elf)? {
        Some(all) => cases::run(arguments, &all),
        None => {
            arguments.check_words()?;
            let mut lines = uart::Lines::new(&arguments.uart, arguments.until.as_ref());
            let session = session::run(arguments.run(), arguments, &mut lines)?;
            let verdict = report::verdict(&session, arguments);
            report::summary(&session);
            report::write(arguments, &session, &verdict)?;
            Ok(verdict)
        }
    }
}
