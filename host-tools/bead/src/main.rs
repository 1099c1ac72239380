//! `bead`, the command line. See `bead --help`.

use std::process::ExitCode;

use bead::cli::Cli;

fn main() -> ExitCode {
    stm32f405_qemu::carry_overlay!();
    bead_bench::image::carry(include_bytes!(env!("BEAD_IMAGE")));
    match Cli::typed().run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            bead_console::output::note(format_args!("{failure}"));
            ExitCode::from(&failure)
        }
    }
}
