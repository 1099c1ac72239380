//! QEMU as a process: how it is started with the overlay, and how it has ended.

use std::ffi::OsString;
use std::fs::File;
use std::io::Write;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use super::error::{RunError, io};
use super::folder::Folder;
use super::one_core;
use super::overlay::{self, Overlay};
use super::qemu::{FoundQemu, wanted_version};
use crate::ending::{End, Place};
use crate::exchange::{self, LINE_PREFIX, SELF_TEST_STATUS};
use crate::outcome::Outcome;

/// Runs QEMU to its end. The arguments come after the usual ones. If QEMU wants another version of the
/// overlay than expected, it is started once more with that version.
///
/// # Errors
/// QEMU or the overlay fails, or the run takes longer than `timeout`.
pub(super) fn run(
    qemu: &FoundQemu,
    overlay: &Overlay,
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
        // Ctrl-C at a terminal goes to the whole group of the program in front. It is for the host to say what
        // becomes of the run.
        .process_group(0)
        // The overlay watches the other end: a QEMU whose host is gone ends.
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(stderr)
        .spawn()
        .map_err(|_| RunError::QemuMissing(qemu.program.to_string_lossy().into_owned()))?;
    one_core::keep(&child);
    let status = wait(child, timeout)?;
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
    /// The program counter, which QEMU prints when it gives up.
    fn program_counter(&self) -> Option<Place> {
        let (_, value) = self.stderr.split_once("R15=")?;
        Some(Place::from(u32::from_str_radix(value.get(..8)?, 16).ok()?))
    }

    /// What the overlay reports, or why there is no report.
    fn outcome(&self, folder: &Folder) -> Result<Outcome, RunError> {
        let first = |part: &str| self.stderr.lines().find(|l| l.contains(part)).map(str::to_string);
        let any = || first("").unwrap_or_else(|| "it said nothing".into());
        if let Ok(json) = std::fs::read(folder.path(exchange::OUTCOME)) {
            let outcome: Outcome = serde_json::from_slice(&json)
                .map_err(|e| RunError::Qemu(self.status, format!("its report cannot be read ({e})")))?;
            let end = match outcome.end {
                End::Exited(_) => End::Exited(self.status.code().unwrap_or(-1)),
                End::LockedUp(_) if first("Lockup").is_some() => End::LockedUp(self.program_counter()),
                // QEMU gave up for a reason of its own.
                End::LockedUp(_) => return Err(RunError::Qemu(self.status, any())),
                end => end,
            };
            return Ok(Outcome { end, ..outcome });
        }
        let ours = first(LINE_PREFIX).map(|l| l.replace(LINE_PREFIX, ""));
        Err(if self.status.code() == Some(SELF_TEST_STATUS) {
            RunError::SelfTest(ours.unwrap_or_else(any))
        } else if let Some(line) = ours.or_else(|| first("plugin")) {
            RunError::OverlayRefused(line)
        } else {
            RunError::Qemu(self.status, any())
        })
    }
}

/// How long QEMU may take to report once it is asked to.
const TO_REPORT: Duration = Duration::from_secs(10);

/// Its exit status. At the limit it is asked for its report.
fn wait(mut child: Child, limit: Duration) -> Result<ExitStatus, RunError> {
    let mut asked = false;
    let mut deadline = Instant::now() + limit;
    loop {
        if let Some(status) = child.try_wait().map_err(io("cannot wait for QEMU"))? {
            return Ok(status);
        }
        if Instant::now() >= deadline {
            let end = child.stdin.as_mut().filter(|_| !asked);
            if end.and_then(|end| end.write_all(b"r").ok()).is_none() {
                child.kill().map_err(io("cannot stop QEMU"))?;
                child.wait().map_err(io("cannot wait for QEMU"))?;
                return Err(RunError::Silent(limit));
            }
            asked = true;
            deadline = Instant::now() + TO_REPORT;
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}
