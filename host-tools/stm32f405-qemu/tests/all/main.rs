//! Tests of the emulator, one program.

mod cases;
mod chips;
mod ci;
mod cycles;
mod images;
mod machine;
mod qemu;
mod registers;
mod sensor;
mod tables;

use std::process::{Command, Output};

/// The program `stm32-emu`.
fn emulator() -> Command {
    Command::new(env!("CARGO_BIN_EXE_stm32-emu"))
}

/// Output of a program, on both streams.
fn said(output: &Output) -> String {
    String::from_utf8_lossy(&[&*output.stdout, &*output.stderr].concat()).into_owned()
}
