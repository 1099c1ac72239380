//! Finds QEMU, and the plugin interface version that it requires.

use std::collections::HashMap;
use std::ffi::{OsStr, OsString};
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::mpsc::channel;
use std::sync::{LazyLock, Mutex, PoisonError};
use std::time::Duration;

use super::error::RunError;

/// Time-out of QEMU's version query: much longer than it takes on a busy computer.
const TO_ANSWER: Duration = Duration::from_secs(10);

#[derive(Debug, Clone)]
pub(super) struct FoundQemu {
    pub(super) program: OsString,
    version: (u32, u32),
    /// The line with the version.
    said: String,
}

/// Returns the first line of QEMU's own version text, for the named QEMU or the one that
/// [`Run::qemu`](crate::Run::qemu) has for `None`.
///
/// # Errors
/// There is no such QEMU, or it is too old.
pub fn qemu_version(named: Option<&Path>) -> Result<String, RunError> {
    Ok(FoundQemu::find(named)?.said)
}

impl FoundQemu {
    /// The program named; else what `STM32F405_QEMU` names; else `qemu-system-arm` from `PATH`.
    ///
    /// # Errors
    /// [`RunError::QemuMissing`], [`RunError::QemuUnusable`] and [`RunError::QemuVersion`].
    pub(super) fn find(named: Option<&Path>) -> Result<Self, RunError> {
        /// QEMUs that have answered this process: a query takes a sixth of the time of a short run.
        static ANSWERED: LazyLock<Mutex<HashMap<OsString, FoundQemu>>> = LazyLock::new(Mutex::default);
        let named = named.map(|path| path.as_os_str().to_owned());
        let program = named.or_else(|| std::env::var_os("STM32F405_QEMU"));
        let program = program.unwrap_or_else(|| "qemu-system-arm".into());
        let mut answered = ANSWERED.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = answered.get(&program) {
            return Ok(found.clone());
        }
        let found = Self::ask(program.clone(), TO_ANSWER)?;
        Ok(answered.entry(program).or_insert(found).clone())
    }

    fn ask(program: OsString, limit: Duration) -> Result<Self, RunError> {
        let shown = program.to_string_lossy().into_owned();
        let unusable = |why: String| RunError::QemuUnusable(shown.clone(), why);
        let seconds = limit.as_secs_f64();
        let silent = || unusable(format!("it does not answer `--version` within {seconds} s"));
        let said = first_line(&program, limit)?.ok_or_else(silent)?;
        let Some(version) = version(&said) else {
            return Err(RunError::QemuVersion(shown, said));
        };
        if version < OLDEST {
            return Err(unusable(format!("it is too old ({said:?})")));
        }
        Ok(Self {
            program,
            version,
            said,
        })
    }

    /// The plugin interface version of this QEMU, as far as known.
    ///
    /// 7.2, 10.0 and 11.1 were tried. The rest follows QEMU's release notes. QEMU takes a range of versions.
    /// If it refuses this one, it names the nearest that it takes: [`wanted_version`].
    pub(super) fn plugin_version(&self) -> i32 {
        match self.version {
            (..=8, _) => 1,
            (9, 0) => 2,
            (9, 1) => 3,
            (9, _) | (10, 0) => 4,
            (10, _) => 5,
            (11, 0) => 6,
            _ => 7,
        }
    }
}

/// Oldest version that the overlay fits.
const OLDEST: (u32, u32) = (7, 2);

/// The first line of a program's version output. `None` if it takes longer than the limit.
fn first_line(program: &OsStr, limit: Duration) -> Result<Option<String>, RunError> {
    let mut child = Command::new(program)
        .arg("--version")
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .map_err(|error| cannot_run(program, &error))?;
    let stdout = child.stdout.take();
    let (sender, answer) = channel();
    // A child of the program may keep its output open for ever. Then this thread stays too.
    std::thread::spawn(move || {
        let mut said = Vec::new();
        let stdout = stdout.expect("its output was piped");
        // Much longer than a version. Unreadable output is no version.
        let _ = BufReader::new(stdout.take(4096)).read_until(b'\n', &mut said);
        sender.send(said)
    });
    let said = answer.recv_timeout(limit).ok();
    // A process that has ended cannot be killed.
    let _ = child.kill();
    let _ = child.wait();
    Ok(said.map(|said| String::from_utf8_lossy(&said).trim_end().to_owned()))
}

/// Error for a program in QEMU's place that does not start.
pub(super) fn cannot_run(program: &OsStr, error: &io::Error) -> RunError {
    let shown = program.to_string_lossy().into_owned();
    match error.kind() {
        io::ErrorKind::NotFound => RunError::QemuMissing(shown),
        _ => RunError::QemuUnusable(shown, error.to_string()),
    }
}

/// Parses `QEMU emulator version 7.2.22 (Debian …)`.
fn version(line: &str) -> Option<(u32, u32)> {
    let rest = line.strip_prefix("QEMU emulator version ")?;
    let mut parts = rest.split_whitespace().next()?.split('.');
    Some((parts.next()?.parse().ok()?, parts.next()?.parse().ok()?))
}

/// The version at the end of QEMU's refusal, `… requires API version 7, but this QEMU supports only up to
/// version 4`.
pub(super) fn wanted_version(stderr: &str) -> Option<i32> {
    let (_, tail) = stderr.split_once("this QEMU supports only")?;
    tail.lines().next()?.rsplit(' ').next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_version_is_read_from_debians_line_and_from_a_plain_one_and_gives_that_of_the_plugin() {
        for (number, version, plugin_version) in [
            ("7.2.22 (Debian 1:7.2+dfsg-7+deb12u18)", (7, 2), 1),
            ("10.0.2", (10, 0), 4),
            ("11.1.50 (v11.1.0-3-gabc)", (11, 1), 7),
        ] {
            let said = format!("QEMU emulator version {number}");
            assert_eq!(super::version(&said), Some(version));
            let program = OsString::new();
            let found = FoundQemu {
                program,
                version,
                said,
            };
            assert_eq!(found.plugin_version(), plugin_version);
        }
        let missing = version("bash: qemu-system-arm: command not found");
        assert_eq!(missing, None);
    }

    #[test]
    fn qemus_refusal_names_the_version_that_it_takes() {
        let refusal = "qemu-system-arm: a warning\n\
             qemu-system-arm: Could not load plugin /tmp/x.so: plugin requires API version 9, \
             but this QEMU supports only up to version 1\nand more\n";
        assert_eq!(wanted_version(refusal), Some(1));
        let other = "Could not load plugin /tmp/x.so: no such file";
        assert_eq!(wanted_version(other), None);
    }

    #[test]
    fn a_program_that_says_nothing_is_given_up() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("hangs.sh");
        // Another process writes it: a file that this process has open for writing cannot be executed.
        let write = r#"printf '#!/bin/sh\nexec sleep 60\n' > "$0" && chmod +x "$0""#;
        let written = Command::new("sh").args(["-c", write]).arg(&path).status();
        assert!(written.unwrap().success());
        let silent = FoundQemu::ask(path.into(), Duration::from_millis(100)).unwrap_err();
        let silent = silent.to_string();
        let expected = "does not answer `--version` within 0.1 s";
        assert!(silent.contains(expected), "{silent}");
    }
}
