//! QEMU as a process: how it is started with the overlay, and how it has ended.

use std::ffi::OsString;
use std::fs::File;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use super::error::{RunError, io};
use super::folder::Folder;
use super::overlay;
use super::qemu::{FoundQemu, wanted_version};
use crate::exchange::{self, LINE_PREFIX, SELF_TEST_STATUS};
use crate::outcome::Outcome;

/// Runs QEMU to its end. The arguments come after the usual ones. If QEMU wants another version of the
/// overlay than expected, it is started once more with that version.
///
/// # Errors
/// QEMU or the overlay fails, or the run takes longer than `timeout`.
pub(super) fn run(
    qemu: &FoundQemu,
    overlay: &Path,
    folder: &Folder,
    arguments: &[OsString],
    shift: u8,
    timeout: Duration,
) -> Result<Outcome, RunError> {
    let version = qemu.plugin_version();
    let start = |version: i32| {
        let plugin = folder.write("overlay.so", &overlay::with_version(overlay, version)?)?;
        start(qemu, &plugin, folder, arguments, shift, timeout)
    };
    let mut ended = start(version)?;
    if let Some(other) = wanted_version(&ended.stderr).filter(|other| *other != version) {
        ended = start(other)?;
    }
    ended.outcome(folder)
}

fn start(
    qemu: &FoundQemu,
    plugin: &Path,
    folder: &Folder,
    arguments: &[OsString],
    shift: u8,
    timeout: Duration,
) -> Result<Ended, RunError> {
    let stderr = File::create(folder.path("stderr")).map_err(io("cannot write the run's temporary files"))?;
    let run = folder.path("");
    let child = Command::new(&qemu.program)
        .args(["-M", "netduinoplus2", "-icount"])
        .arg(format!("shift={shift},sleep=off"))
        .args(["-nographic", "-monitor", "none", "-serial", "none", "-plugin"])
        .arg(format!("{},run={}", plugin.display(), run.display()))
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(stderr)
        .spawn()
        .map_err(|_| RunError::QemuMissing(qemu.program.to_string_lossy().into_owned()))?;
    let Some(status) = wait(child, timeout)? else {
        // A record of ten bytes for each byte from USART1.
        let sent = folder
            .path(&exchange::sent(0))
            .metadata()
            .map_or(0, |m| m.len() / 10);
        return Err(RunError::Timeout(timeout, sent));
    };
    let stderr = std::fs::read(folder.path("stderr")).map_err(io("cannot read what QEMU said"))?;
    Ok(Ended {
        status,
        stderr: String::from_utf8_lossy(&stderr).into_owned(),
    })
}

/// A QEMU that ended by itself.
struct Ended {
    status: ExitStatus,
    stderr: String,
}

impl Ended {
    /// What the overlay reports, or why there is no report.
    fn outcome(&self, folder: &Folder) -> Result<Outcome, RunError> {
        if let Ok(json) = std::fs::read(folder.path(exchange::OUTCOME)) {
            return serde_json::from_slice(&json)
                .map_err(|e| RunError::Qemu(self.status, format!("its report cannot be read ({e})")));
        }
        let first = |part: &str| self.stderr.lines().find(|l| l.contains(part)).map(str::to_string);
        let ours = first(LINE_PREFIX).map(|l| l.replace(LINE_PREFIX, ""));
        let any = || first("").unwrap_or_else(|| "it said nothing".into());
        Err(if self.status.code() == Some(SELF_TEST_STATUS) {
            RunError::SelfTest(ours.unwrap_or_else(any))
        } else if let Some(line) = first("Lockup") {
            RunError::GuestLockup(line)
        } else if let Some(line) = ours.or_else(|| first("plugin")) {
            RunError::OverlayRefused(line)
        } else {
            RunError::Qemu(self.status, any())
        })
    }
}

/// Its exit status, or `None` if it had to be killed.
fn wait(mut child: Child, limit: Duration) -> Result<Option<ExitStatus>, RunError> {
    let deadline = Instant::now() + limit;
    loop {
        if let Some(status) = child.try_wait().map_err(io("cannot wait for QEMU"))? {
            return Ok(Some(status));
        }
        if Instant::now() >= deadline {
            child.kill().map_err(io("cannot stop QEMU"))?;
            child.wait().map_err(io("cannot wait for QEMU"))?;
            return Ok(None);
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}
