//! Rust's nightly, which only some checks need.

use crate::step::{CommandLine, Stop};

/// A command of the nightly's cargo. It builds into a folder of its own, and never installs a toolchain.
pub(crate) fn cargo(words: &str) -> CommandLine {
    CommandLine::new("cargo +nightly")
        .words(words)
        .env("RUSTUP_AUTO_INSTALL", "0")
}

/// Looks for a part of the nightly by a command that only works with it.
///
/// # Errors
/// Status 3 with the command that installs it.
pub(crate) fn need(command: &str, install: &str) -> Result<(), Stop> {
    let runs = cargo(command).command().output();
    if runs.is_ok_and(|output| output.status.success()) {
        Ok(())
    } else {
        Err(Stop::missing(format!(
            "`cargo +nightly {command}` does not run; `{install}` installs what it needs"
        )))
    }
}
