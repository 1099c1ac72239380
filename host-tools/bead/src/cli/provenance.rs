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
use bead_recording::json::hex;

/// The command line, as it was typed.
pub(crate) fn command() -> String {
    let words: Vec<_> = env::args().skip(1).collect();
    format!("bead {}", words.join(" "))
}

/// The command line, the recording, what it was compared with, program and time.
pub(crate) fn made(recording: &Path, compared: Fact) -> Result<Vec<Fact>, Failure> {
    let now = DateTime::<Utc>::from(SystemTime::now());
    Ok(vec![
        ("command", command()),
        ("recording, SHA-256", sha256_of(recording)?),
        compared,
        ("made by", concat!("bead ", env!("CARGO_PKG_VERSION")).to_owned()),
        ("made at", now.format("%Y-%m-%d %H:%M UTC").to_string()),
    ])
}

pub(crate) fn scenario(text: &str) -> Fact {
    ("scenario, SHA-256", hex(&Sha256::digest(text)))
}

/// The SHA-256 of a file, in hexadecimal, as `sha256sum` prints it.
pub(crate) fn sha256_of(path: &Path) -> Result<String, Failure> {
    let mut digest = Sha256::new();
    let read = File::open(path).and_then(|mut file| io::copy(&mut file, &mut digest));
    read.with_context(|| format!("cannot read {}", path.display()))?;
    Ok(hex(&digest.finalize()))
}
