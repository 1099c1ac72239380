//! The program under test.

use std::ffi::OsStr;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

/// Runs `bead` in a folder until it ends.
pub(crate) fn bead(folder: &Path, arguments: impl IntoIterator<Item: AsRef<OsStr>>) -> Output {
    Command::new(env!("CARGO_BIN_EXE_bead"))
        .current_dir(folder)
        .args(arguments)
        .output()
        .unwrap()
}

/// `bead` in a folder, ready to start. It heeds the signals that this test may have been told to ignore, as
/// under nohup or in the background of a script.
pub(crate) fn interruptible(folder: &Path) -> Command {
    let mut command = Command::new("env");
    command
        .current_dir(folder)
        .args(["--default-signal=INT,TERM,HUP", env!("CARGO_BIN_EXE_bead")]);
    command
}

/// Text on standard error.
pub(crate) fn said(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// The one JSON document of a command that must succeed.
pub(crate) fn json(output: &Output) -> Value {
    assert!(output.status.success(), "{}", said(output));
    serde_json::from_slice(&output.stdout).unwrap()
}
