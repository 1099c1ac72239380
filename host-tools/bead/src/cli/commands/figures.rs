//! `bead figures`: runs the program `bead-figures`. Users who draw nothing need not compile the drawing code.

use std::ffi::OsString;
use std::os::unix::process::CommandExt;
use std::process::Command;

use crate::cli::commands::prelude::*;

/// Arguments of `bead figures`: those of `bead-figures`.
#[derive(Debug, Args)]
#[command(disable_help_flag = true)]
pub(crate) struct Arguments {
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<OsString>,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let here = std::env::current_exe()
        .context("cannot find this program's own file")
        .map_err(Failure::Device)?;
    let program = here.with_file_name("bead-figures");
    if !program.exists() {
        bail!(
            Device,
            "{} is missing; to build it: cargo build --release -p bead-figures (to install it: cargo install --path \
             host-tools/hertz/figures-command)",
            program.display()
        );
    }
    // The program takes the place of this process, so that its exit status is the command's.
    let error = Command::new(&program).args(&arguments.arguments).exec();
    bail!(Device, "cannot run {}: {error}", program.display())
}
