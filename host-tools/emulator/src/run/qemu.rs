//! Finds QEMU, and the plugin interface version that it asks for.

use std::collections::HashMap;
use std::ffi::OsString;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::{LazyLock, Mutex, PoisonError};

use super::error::RunError;

/// A QEMU that answered.
#[derive(Debug, Clone)]
pub(super) struct FoundQemu {
    pub(super) program: OsString,
    version: (u32, u32),
}

impl FoundQemu {
    /// The program named; else what `STM32F405_QEMU` names; else `qemu-system-arm` from `PATH`.
    ///
    /// # Errors
    /// [`RunError::QemuMissing`] and [`RunError::QemuVersion`].
    pub(super) fn find(named: Option<&Path>) -> Result<Self, RunError> {
        /// Those that have answered this process: to ask takes a sixth of the time of a short run.
        static ANSWERED: LazyLock<Mutex<HashMap<OsString, FoundQemu>>> = LazyLock::new(Mutex::default);
        let named = named.map(|path| path.as_os_str().to_owned());
        let program = named
            .or_else(|| std::env::var_os("STM32F405_QEMU"))
            .unwrap_or_else(|| "qemu-system-arm".into());
        let mut answered = ANSWERED.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = answered.get(&program) {
            return Ok(found.clone());
        }
        let found = Self::ask(program.clone())?;
        Ok(answered.entry(program).or_insert(found).clone())
    }

    fn ask(program: OsString) -> Result<Self, RunError> {
        let shown = program.to_string_lossy().into_owned();
        let output = Command::new(&program)
            .arg("--version")
            .stdin(Stdio::null())
            .output()
            .map_err(|_| RunError::QemuMissing(shown.clone()))?;
        let text = String::from_utf8_lossy(&output.stdout);
        let first = text.lines().next().unwrap_or_default();
        let version = version(first).ok_or_else(|| RunError::QemuVersion(shown, first.into()))?;
        Ok(Self { program, version })
    }

    /// The plugin interface version of this QEMU, as far as it is known.
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

/// From `QEMU emulator version 7.2.22 (Debian …)`.
fn version(line: &str) -> Option<(u32, u32)> {
    let number = line
        .strip_prefix("QEMU emulator version ")?
        .split_whitespace()
        .next()?;
    let mut parts = number.split('.');
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
    fn the_version_is_read_from_debians_line_and_from_a_plain_one() {
        assert_eq!(
            version("QEMU emulator version 7.2.22 (Debian 1:7.2+dfsg-7+deb12u18)"),
            Some((7, 2))
        );
        assert_eq!(version("QEMU emulator version 10.0.2"), Some((10, 0)));
        assert_eq!(
            version("QEMU emulator version 11.1.50 (v11.1.0-3-gabc)"),
            Some((11, 1))
        );
        assert_eq!(version("bash: qemu-system-arm: command not found"), None);
    }

    #[test]
    fn the_plugin_version_follows_the_qemu_found() {
        let of = |version| {
            let program = OsString::new();
            FoundQemu { program, version }.plugin_version()
        };
        assert_eq!((of((7, 2)), of((10, 0)), of((11, 1))), (1, 4, 7));
    }

    #[test]
    fn qemus_refusal_names_the_version_that_it_takes() {
        let refusal = "qemu-system-arm: a warning\n\
             qemu-system-arm: Could not load plugin /tmp/x.so: plugin requires API version 9, \
             but this QEMU supports only up to version 1\nand more\n";
        assert_eq!(wanted_version(refusal), Some(1));
        assert_eq!(
            wanted_version("Could not load plugin /tmp/x.so: no such file"),
            None
        );
    }
}
