//! The command line of probe-rs: which probe, and what one command says.

use std::process::{Command, Output, Stdio};

use crate::cli::commands::prelude::*;
use bead_tables::printable::{beginning, one_line};

/// The part as probe-rs calls it.
const CHIP: &str = "STM32F405RGTx";

/// A debug probe behind probe-rs.
pub(crate) struct ProbeRs {
    /// Arguments that each command for the part has.
    common: Vec<String>,
    /// Prints each command in place of running it.
    dry_run: bool,
}

impl ProbeRs {
    /// Finds the program and the one probe that is meant.
    ///
    /// # Errors
    /// No program, no probe, or several.
    pub(crate) fn find(serial: Option<&str>, under_reset: bool) -> Result<Self, Failure> {
        let listed = run(&["list".to_owned()])?;
        let probes: Vec<_> = listed.lines().filter_map(selector).collect();
        let all = || Vec::from_iter(probes.iter().map(|probe| one_line(probe))).join(", ");
        let fits =
            |probe: &&String| serial.is_none_or(|serial| serial_of(probe) == serial || **probe == *serial);
        let mut fitting = probes.iter().filter(fits);
        let probe = match (fitting.next(), fitting.next(), serial) {
            (Some(probe), None, _) => probe,
            (Some(_), Some(_), None) => bail!(
                Input,
                "there are several debug probes ({}); choose one with --serial, or unplug the others",
                all()
            ),
            (Some(_), Some(_), Some(serial)) => bail!(
                Input,
                "several debug probes have the serial number {serial} ({}); give --serial one of these names with vendor \
                 and product",
                all()
            ),
            (None, _, Some(serial)) if !probes.is_empty() => {
                bail!(
                    Input,
                    "no debug probe has the serial number {serial}; connected: {}",
                    all()
                )
            }
            (None, ..) => bail!(
                Device,
                "probe-rs finds no debug probe: plug one in (ST-Link, J-Link, CMSIS-DAP); on Linux it may need udev \
                 rules, see https://probe.rs/docs/getting-started/probe-setup/"
            ),
        };
        Ok(Self {
            common: common(Some(probe), under_reset),
            dry_run: false,
        })
    }

    /// Prints the commands in place of running them.
    pub(crate) fn dry(serial: Option<&str>, under_reset: bool) -> Self {
        Self {
            common: common(serial, under_reset),
            dry_run: true,
        }
    }

    /// Reads words of the part. `None` in a dry run.
    pub(crate) fn read(&self, address: u32, words: usize) -> Result<Option<Vec<u32>>, Failure> {
        let Some(said) = self.run("read", &["b32", &format!("{address:#010x}"), &words.to_string()])? else {
            return Ok(None);
        };
        // Later versions begin each line with its address.
        let lines = said
            .lines()
            .map(|line| line.split_once(": ").map_or(line, |(_, words)| words));
        let read: Result<Vec<_>, _> = lines
            .flat_map(str::split_whitespace)
            .map(|word| u32::from_str_radix(word, 16))
            .collect();
        match read {
            Ok(read) if read.len() == words => Ok(Some(read)),
            _ => bail!(
                Device,
                "probe-rs was to read {words} words at {address:#010x}, but answered: {}; `probe-rs --version` \
                 should be 0.24 or later",
                shortly(&said)
            ),
        }
    }

    /// Writes a word to RAM or to a register.
    pub(crate) fn write(&self, address: u32, word: u32) -> Result<(), Failure> {
        self.run(
            "write",
            &["b32", &format!("{address:#010x}"), &format!("{word:#010x}")],
        )?;
        Ok(())
    }

    /// Flashes an ELF file and compares.
    pub(crate) fn flash(&self, image: &Path) -> Result<(), Failure> {
        let image = image.to_string_lossy();
        let how = ["--binary-format", "elf", "--disable-progressbars", &image];
        self.run("download", &[&["--verify"], &how[..]].concat())?;
        // `verify` ends with status 0 whatever it finds.
        match self.run("verify", &how)? {
            Some(said) if !said.contains("Verification successful") => bail!(
                Device,
                "flash and image differ after flashing (probe-rs: {}); try again at a lower speed with PROBE_RS_SPEED=1000, \
                 and with shorter wires",
                shortly(&said)
            ),
            _ => Ok(()),
        }
    }

    /// Resets the part, which then runs.
    pub(crate) fn reset(&self) -> Result<(), Failure> {
        self.run("reset", &[])?;
        Ok(())
    }

    /// Runs a command for the part; returns its output, `None` in a dry run.
    fn run(&self, command: &str, arguments: &[&str]) -> Result<Option<String>, Failure> {
        let mut words = vec![command.to_owned()];
        words.extend(self.common.iter().cloned());
        words.extend(arguments.iter().map(|&word| word.to_owned()));
        if self.dry_run {
            let quoted = words.iter().map(|word| quoted(word));
            output::print_line(&format!("probe-rs {}", Vec::from_iter(quoted).join(" ")))?;
            return Ok(None);
        }
        run(&words).map(Some)
    }
}

fn common(probe: Option<&str>, under_reset: bool) -> Vec<String> {
    let mut words = vec!["--chip".to_owned(), CHIP.to_owned()];
    words.extend(
        probe
            .into_iter()
            .flat_map(|probe| ["--probe".to_owned(), probe.to_owned()]),
    );
    words.extend(under_reset.then(|| "--connect-under-reset".to_owned()));
    words
}

/// The selector in a line of `probe-rs list`: `[0]: STLink V2-1 -- 0483:374b:0670FF34 (ST-LINK)`.
fn selector(line: &str) -> Option<String> {
    let (_, rest) = line.trim_start().strip_prefix('[')?.split_once("]: ")?;
    let (_, rest) = rest.split_once(" -- ")?;
    let (selector, _) = rest.rsplit_once(" (").unwrap_or((rest, ""));
    (selector.split(':').count() >= 2).then(|| selector.trim().to_owned())
}

/// The serial number in a selector.
fn serial_of(selector: &str) -> &str {
    selector.splitn(3, ':').nth(2).unwrap_or_default()
}

/// Runs probe-rs to its end.
fn run(words: &[String]) -> Result<String, Failure> {
    let mut command = Command::new("probe-rs");
    command.args(words).stdin(Stdio::null());
    // With this variable set, every command would seem to succeed.
    command.env_remove("PROBE_RS_DRY_RUN");
    let output = command.output().map_err(|error| match error.kind() {
        std::io::ErrorKind::NotFound => failure!(
            Input,
            "probe-rs is not in PATH: `cargo install probe-rs-tools --locked` installs it, as do the installers on \
             https://probe.rs; without a probe, `bead flash --rom` flashes over the serial line"
        ),
        _ => failure!(Device, "probe-rs does not run ({error})"),
    })?;
    let Output {
        status,
        stdout,
        stderr,
    } = output;
    let said = String::from_utf8_lossy(&stdout).into_owned();
    if status.success() {
        return Ok(said);
    }
    let why = String::from_utf8_lossy(&stderr).into_owned() + &said;
    Err(failure!(Device, "probe-rs {} failed: {}", words[0], advice(&why)))
}

/// A failure of probe-rs in its own words, on one line, with the next thing to do.
fn advice(why: &str) -> String {
    let said = shortly(why);
    let lower = why.to_lowercase();
    let next = if lower.contains("unrecognized subcommand") || lower.contains("unexpected argument") {
        "this probe-rs is too old: `cargo install probe-rs-tools --locked` installs a newer one"
    } else if ["permission", "access denied"]
        .iter()
        .any(|word| lower.contains(word))
    {
        "no permission to open the probe: on Linux it needs udev rules, see \
         https://probe.rs/docs/getting-started/probe-setup/"
    } else if ["busy", "in use", "claim"]
        .iter()
        .any(|word| lower.contains(word))
    {
        "another program uses the probe: end that program"
    } else {
        "check that the part is powered, and that SWDIO, SWCLK and ground are wired to the probe; if so, wire NRST too and \
         give --under-reset; a part at read protection level 2 answers no probe, and cannot be flashed"
    };
    format!("{said}; {next}")
}

/// The first lines of an output, as one.
fn shortly(said: &str) -> String {
    let lines = said.lines().map(str::trim).filter(|line| !line.is_empty());
    let text = Vec::from_iter(lines.take(6)).join(" ");
    one_line(&beginning(&text, 200)).into_owned()
}

/// A word as a shell takes it.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./:=+,@%".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', "'\\''"))
}
