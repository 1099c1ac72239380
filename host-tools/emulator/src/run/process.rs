//! QEMU as a process.

use std::fs::File;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use super::error::{RunError, io};
use super::folder::Folder;
use super::overlay;
use super::qemu::Qemu;
use crate::exchange::{self, LINE_PREFIX, Report, SELF_TEST_STATUS};

/// Runs QEMU to its end.
pub(super) fn start(
    elf: &Path,
    timeout: Duration,
    qemu: &Qemu,
    folder: &Folder,
    overlay: &Path,
    version: i32,
    blocks: &[String],
) -> Result<Ended, RunError> {
    let plugin = folder.write("overlay.so", &overlay::with_version(overlay, version)?)?;
    let stderr_path = folder.path.join("stderr");
    let stderr = File::create(&stderr_path).map_err(io("cannot write the run's temporary files"))?;
    let mut command = Command::new(&qemu.program);
    command
        .args(["-M", "netduinoplus2", "-icount", "shift=3,sleep=off"])
        .args(["-nographic", "-monitor", "none", "-serial", "none", "-kernel"])
        .arg(elf)
        .arg("-plugin")
        .arg(format!("{},run={}", plugin.display(), folder.path.display()))
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(stderr);
    for block in blocks {
        command.args(["-device", block]);
    }
    let child = command.spawn().map_err(|_| RunError::QemuMissing {
        program: qemu.program.to_string_lossy().into_owned(),
    })?;
    let Some(status) = wait(child, timeout)? else {
        let uart_bytes = folder.path.join(exchange::UART).metadata().map_or(0, |m| m.len());
        return Err(RunError::Timeout { timeout, uart_bytes });
    };
    let stderr = std::fs::read(&stderr_path).map_err(io("cannot read what QEMU said"))?;
    Ok(Ended {
        status,
        stderr: String::from_utf8_lossy(&stderr).into_owned(),
    })
}

/// A QEMU that ended by itself.
pub(super) struct Ended {
    status: ExitStatus,
    pub(super) stderr: String,
}

impl Ended {
    /// The overlay's report, or why there is none.
    pub(super) fn report(&self, folder: &Folder) -> Result<Report, RunError> {
        if let Ok(report) = std::fs::read(folder.path.join(exchange::REPORT)) {
            return serde_json::from_slice(&report).map_err(|e| RunError::Qemu {
                status: self.status.to_string(),
                line: format!("its report cannot be read ({e})"),
            });
        }
        let first = |part: &str| self.stderr.lines().find(|l| l.contains(part)).map(str::to_string);
        let ours = first(LINE_PREFIX).map(|l| l.replace(LINE_PREFIX, ""));
        let any = || {
            self.stderr
                .lines()
                .next()
                .unwrap_or("it said nothing")
                .to_string()
        };
        Err(if self.status.code() == Some(SELF_TEST_STATUS) {
            RunError::SelfTest {
                line: ours.unwrap_or_else(any),
            }
        } else if let Some(line) = first("Lockup") {
            RunError::GuestLockup { line }
        } else if let Some(line) = ours.or_else(|| first("plugin")) {
            RunError::OverlayRefused { line }
        } else {
            RunError::Qemu {
                status: self.status.to_string(),
                line: any(),
            }
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
