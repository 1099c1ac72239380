//! Facts of a page: command, files, program and time.

use std::env;
use std::fs::File;
use std::io;
use std::path::Path;
use std::time::SystemTime;

use anyhow::Context;
use chrono::{DateTime, Utc};
use sha2::{Digest, Sha256};

use bead_compare::report::Fact;
use bead_console::failure::Failure;
use bead_model::design::Day;
use bead_recording::json::hex;

/// The command line, as it was typed.
pub(crate) fn command() -> String {
    let words: Vec<_> = env::args().skip(1).collect();
    format!("bead {}", words.join(" "))
}

/// The program.
pub(crate) fn made_by() -> Fact {
    ("made by", concat!("bead ", env!("CARGO_PKG_VERSION")).to_owned())
}

/// The time.
pub(crate) fn made_at() -> Fact {
    ("made at", now().format("%Y-%m-%d %H:%M UTC").to_string())
}

/// The time of this computer.
pub(crate) fn now() -> DateTime<Utc> {
    SystemTime::now().into()
}

/// Today, in UTC. `None` if this computer's clock shows a day before 2020.
pub(crate) fn today() -> Option<Day> {
    Day::at(now().timestamp())
}

/// The command line, the recording, what it was compared with, program and time.
pub(crate) fn made(recording: &Path, compared: Fact) -> Result<Vec<Fact>, Failure> {
    let recording = ("recording, SHA-256", sha256_of(recording)?);
    Ok(vec![
        ("command", command()),
        recording,
        compared,
        made_by(),
        made_at(),
    ])
}

pub(crate) fn scenario(text: &str) -> Fact {
    ("scenario, SHA-256", hex(&Sha256::digest(text)))
}

/// The name of a file, without its folder.
pub(crate) fn name_of(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
}

/// The SHA-256 of a file, in hexadecimal, as `sha256sum` prints it.
pub(crate) fn sha256_of(path: &Path) -> Result<String, Failure> {
    let mut digest = Sha256::new();
    let read = File::open(path).and_then(|mut file| io::copy(&mut file, &mut digest));
    read.with_context(|| format!("cannot read {}", path.display()))?;
    Ok(hex(&digest.finalize()))
}
