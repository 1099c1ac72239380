//! QEMU as a process: starts it with the overlay, and interprets its end.

use std::ffi::OsString;
use std::fs::File;
use std::io::{BufReader, Write};
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use super::devices::DeviceServer;
use super::error::{RunError, io};
use super::folder::RunFolder;
use super::overlay::{self, OverlayFile};
use super::qemu::{FoundQemu, cannot_run, wanted_version};
use crate::device::Devices;
use crate::ending::{CodeAddress, RunEnd};
use crate::exchange::{self, LINE_PREFIX, Reached, SELF_TEST_STATUS, TimeStep};
use crate::outcome::Outcome;

/// Inputs of a QEMU process.
pub(super) struct QemuJob {
    pub(super) qemu: FoundQemu,
    pub(super) overlay: OverlayFile,
    pub(super) folder: RunFolder,
    /// Arguments after the usual ones.
    pub(super) arguments: Vec<OsString>,
    pub(super) shift: u8,
    pub(super) devices: Devices,
}

impl QemuJob {
    /// Runs QEMU to its end. If it requires another version of the overlay than expected, it is started once
    /// more with that version.
    ///
    /// # Errors
    /// QEMU or the overlay fails, or the run takes longer than `limit`.
    pub(super) fn run(&self, limit: Option<Duration>) -> Result<Outcome, RunError> {
        let version = self.qemu.plugin_version();
        let ended = |version| {
            let (child, server) = self.start(version, Stdio::null())?;
            let ended = self.end(child, limit);
            if let Some(_server) = server {
                DeviceServer::finish(_server)
            }
            ended
        };
        let mut first = ended(version)?;
        if let Some(other) = first.other_version(version) {
            first = ended(other)?;
        }
        first.outcome(&self.folder)
    }

    /// Starts QEMU for a live run, up to its first stop.
    ///
    /// # Errors
    /// QEMU or the overlay fails, or it takes longer than `limit`.
    pub(super) fn start_live(&self, limit: Option<Duration>) -> Result<(QemuProcess, StopReport), RunError> {
        let mut version = self.qemu.plugin_version();
        let mut first = true;
        loop {
            let (child, server) = self.start(version, Stdio::piped())?;
            let mut running = QemuProcess::of(child, server);
            if let Some(report) = running.next_stop(limit) {
                return Ok((running, report));
            }
            let ended = self.end(running.take()?, limit)?;
            let other = ended
                .other_version(version)
                .filter(|_| std::mem::take(&mut first));
            version = other.ok_or_else(|| ended.failure(&self.folder, limit))?;
        }
    }

    fn start(&self, version: i32, stdout: Stdio) -> Result<(Child, Option<DeviceServer>), RunError> {
        let folder = &self.folder;
        let server = DeviceServer::start(&self.devices, folder.path(exchange::DEVICES))?;
        let plugin = folder.write("overlay.so", &overlay::with_version(&self.overlay, version)?)?;
        let stderr =
            File::create(folder.path("stderr")).map_err(io("cannot write the run's temporary files"))?;
        let program = &self.qemu.program;
        let (plugin, run) = (plugin.display(), folder.path(""));
        let run = run.display();
        let child = Command::new(program)
            .args(["-M", "netduinoplus2", "-icount"])
            .arg(format!("shift={},sleep=off", self.shift))
            .args(["-nographic", "-monitor", "none", "-serial", "none", "-plugin"])
            // Without `file=` QEMU reads a path with an equals sign as another option.
            .arg(format!("file={plugin},run={run}"))
            .args(&self.arguments)
            // Ctrl-C at a terminal goes to the whole foreground group. The host decides what happens to the
            // run.
            .process_group(0)
            // The overlay watches the other end, and ends QEMU when the host is gone.
            .stdin(Stdio::piped())
            .stdout(stdout)
            .stderr(stderr)
            .spawn()
            .map_err(|error| cannot_run(program, &error))?;
        Ok((child, server))
    }

    /// Waits until QEMU ends. At the limit it is asked for its report.
    ///
    /// # Errors
    /// It does not report.
    pub(super) fn end(&self, child: Child, limit: Option<Duration>) -> Result<Ended, RunError> {
        let status = wait(child, limit)?;
        let stderr =
            std::fs::read(self.folder.path("stderr")).map_err(io("cannot read the messages of QEMU"))?;
        let stderr = String::from_utf8_lossy(&stderr).into_owned();
        Ok(Ended { status, stderr })
    }
}

/// A QEMU that runs live. It ends when this is dropped.
pub(super) struct QemuProcess {
    child: Option<Child>,
    /// Dropped after the child.
    _server: Option<DeviceServer>,
    reports: Receiver<StopReport>,
}

/// Report at a stop.
pub(super) type StopReport = (Reached, Vec<u8>);

impl QemuProcess {
    fn of(mut child: Child, server: Option<DeviceServer>) -> Self {
        let (sender, reports) = channel();
        let stdout = child.stdout.take();
        std::thread::spawn(move || {
            let mut stdout = BufReader::new(stdout.expect("its output was piped"));
            while let Ok(message) = exchange::read_message(&mut stdout)
                && sender.send(message).is_ok()
            {}
        });
        Self {
            child: Some(child),
            _server: server,
            reports,
        }
    }

    /// Waits for the next stop. `None` if QEMU ends, or takes longer than the limit.
    pub(super) fn next_stop(&mut self, limit: Option<Duration>) -> Option<StopReport> {
        match limit {
            Some(limit) => self.reports.recv_timeout(limit).ok(),
            None => self.reports.recv().ok(),
        }
    }

    /// Sends the next step of time. [`next_stop`](Self::next_stop) notices if QEMU is gone.
    pub(super) fn say(&mut self, step: &TimeStep, rows: &[[u16; 4]]) {
        if let Some(to) = self.child.as_mut().and_then(|child| child.stdin.as_mut()) {
            let said = to
                .write_all(&[exchange::STEP])
                .and_then(|()| exchange::write_message(to, step, &exchange::bytes_of(rows)));
            drop(said);
        }
    }

    /// Takes the process, for the caller to end.
    ///
    /// # Errors
    /// The process has been taken before.
    pub(super) fn take(&mut self) -> Result<Child, RunError> {
        let child = self.child.take();
        child.ok_or_else(|| RunError::Input("the run has failed, and is over".into()))
    }
}

impl Drop for QemuProcess {
    fn drop(&mut self) {
        if let Some(mut child) = self.child.take() {
            // A process that has ended by itself cannot be killed.
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// A QEMU that ended by itself.
pub(super) struct Ended {
    status: ExitStatus,
    stderr: String,
}

impl Ended {
    /// The program counter, which QEMU prints when it gives up.
    fn program_counter(&self) -> Option<CodeAddress> {
        let (_, value) = self.stderr.split_once("R15=")?;
        Some(CodeAddress::from(u32::from_str_radix(value.get(..8)?, 16).ok()?))
    }

    /// The version of the overlay that QEMU requires, if it refused this one.
    fn other_version(&self, version: i32) -> Option<i32> {
        wanted_version(&self.stderr).filter(|other| *other != version)
    }

    /// Reason why QEMU ended before the run began.
    fn failure(&self, folder: &RunFolder, limit: Option<Duration>) -> RunError {
        match (self.outcome(folder), limit) {
            (Err(error), _) => error,
            (Ok(outcome), Some(limit)) if matches!(outcome.end, RunEnd::Stopped) => {
                RunError::Timeout(limit, outcome.into())
            }
            (Ok(_), _) => RunError::Qemu(self.status, "it ended before the first instruction".into()),
        }
    }

    /// Returns the overlay's report, or the reason why there is none.
    pub(super) fn outcome(&self, folder: &RunFolder) -> Result<Outcome, RunError> {
        let first = |part: &str| self.stderr.lines().find(|l| l.contains(part)).map(str::to_string);
        let any = || first("").unwrap_or_else(|| "it printed nothing".into());
        if let Some(panic) = panic(&self.stderr) {
            return Err(RunError::OverlayFailed(panic));
        }
        if let Ok(json) = std::fs::read(folder.path(exchange::OUTCOME)) {
            let outcome: Outcome = serde_json::from_slice(&json).map_err(|e| {
                let why =
                    format!("its report cannot be read ({e}): does the overlay come from another build?");
                RunError::Qemu(self.status, why)
            })?;
            let end = match outcome.end {
                // An image that ends itself causes no message.
                RunEnd::Exited(_) if first("terminating on signal").is_none() => {
                    RunEnd::Exited(self.status.code().unwrap_or(-1))
                }
                RunEnd::Exited(_) | RunEnd::QemuEnded(_) => {
                    RunEnd::QemuEnded(format!("{}: {}", self.status, any()))
                }
                RunEnd::LockedUp(_) if first("Lockup").is_some() => RunEnd::LockedUp(self.program_counter()),
                // QEMU aborted for another reason.
                RunEnd::LockedUp(_) => return Err(RunError::Qemu(self.status, any())),
                end => end,
            };
            return Ok(Outcome { end, ..outcome });
        }
        let ours = first(LINE_PREFIX).map(|l| l.replace(LINE_PREFIX, ""));
        Err(if self.status.code() == Some(SELF_TEST_STATUS) {
            RunError::SelfTest(ours.unwrap_or_else(any))
        } else if let Some(line) = ours.or_else(|| first("plugin")) {
            let no_exec = line.contains("failed to map segment");
            let hint = "; the temporary folder may be mounted noexec, set TMPDIR to another";
            RunError::OverlayRefused(line + if no_exec { hint } else { "" })
        } else {
            RunError::Qemu(self.status, any())
        })
    }
}

/// Place of the overlay's panic, without its folder, and the reason.
fn panic(stderr: &str) -> Option<String> {
    let (_, told) = stderr.split_once("panicked at ")?;
    let mut lines = told.lines();
    let place = lines.next()?.trim_end_matches(':');
    let place = place.rsplit('/').next().unwrap_or(place);
    Some(format!("{place}: {}", lines.next().unwrap_or("no reason given")))
}

/// Time-out of QEMU's report, once requested.
const TO_REPORT: Duration = Duration::from_secs(10);

/// Waits for the exit status. At the limit QEMU is asked for its report.
fn wait(mut child: Child, limit: Option<Duration>) -> Result<ExitStatus, RunError> {
    let mut asked = false;
    let mut deadline = limit.map(|limit| Instant::now() + limit);
    loop {
        if let Some(status) = child.try_wait().map_err(io("cannot wait for QEMU"))? {
            return Ok(status);
        }
        if let (Some(at), Some(limit)) = (deadline, limit)
            && Instant::now() >= at
        {
            let end = child.stdin.as_mut().filter(|_| !asked);
            let sent = end.and_then(|end| end.write_all(&[exchange::REPORT]).ok());
            if sent.is_none() {
                child.kill().map_err(io("cannot stop QEMU"))?;
                child.wait().map_err(io("cannot wait for QEMU"))?;
                return Err(RunError::Silent(limit));
            }
            asked = true;
            deadline = Some(Instant::now() + TO_REPORT);
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::process::ExitStatusExt;

    use super::*;

    fn ended(status: i32, stderr: &str) -> Ended {
        Ended {
            status: ExitStatus::from_raw(status),
            stderr: stderr.into(),
        }
    }

    #[test]
    fn an_overlay_that_panics_is_told_apart_from_one_that_was_not_loaded() {
        let folder = RunFolder::new().unwrap();
        let said = "thread '<unnamed>' (22) panicked at host-tools/src/plugin/rtt.rs:39:21:\n\
             attempt to add with overflow\n   4: stm32f405_qemu::plugin::callbacks::on_write\n";
        let failed = ended(134, said).outcome(&folder).unwrap_err().to_string();
        assert_eq!(
            failed,
            "the overlay failed (rtt.rs:39:21: attempt to add with overflow): this is a fault of the emulator; \
             please report it with the image"
        );
        let noexec =
            "qemu-system-arm: -plugin file=/x.so: Could not load plugin /x.so: failed to map segment";
        let refused = ended(256, noexec).outcome(&folder).unwrap_err();
        assert!(matches!(&refused, RunError::OverlayRefused(line) if line.contains("TMPDIR")));
    }

    #[test]
    fn a_qemu_that_ends_by_itself_keeps_what_it_said_and_what_the_run_had_given() {
        let folder = RunFolder::new().unwrap();
        for end in [RunEnd::QemuEnded(String::new()), RunEnd::Exited(0)] {
            let mut outcome = Outcome::default();
            (outcome.end, outcome.virtual_ns) = (end, 5);
            let json = serde_json::to_vec(&outcome).unwrap();
            folder.write(exchange::OUTCOME, &json).unwrap();
            let ended = ended(0, "qemu: terminating on signal 15");
            let outcome = ended.outcome(&folder).unwrap();
            let how = "exit status: 0: qemu: terminating on signal 15";
            assert_eq!(outcome.end, RunEnd::QemuEnded(how.into()));
            assert_eq!(outcome.virtual_ns, 5);
        }
        let by_itself = ended(7 << 8, "").outcome(&folder).unwrap();
        assert_eq!(by_itself.end, RunEnd::Exited(7));
    }
}
