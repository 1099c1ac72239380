//! Several recordings that a command takes at once.

use std::collections::HashSet;
use std::fs;
use std::path::PathBuf;

use anyhow::Context;
use bead_recording::file::{Recording, State, add_notes};

use bead_console::failure::Failure;

/// Opens all recordings, before the first is used.
///
/// # Errors
/// A recording cannot be read, or is given twice.
pub(crate) fn open_all(paths: &[PathBuf]) -> Result<Vec<Recording>, Failure> {
    each_once(paths)?;
    let open = |path: &PathBuf| Ok(Recording::open_named(path)?);
    paths.iter().map(open).collect()
}

/// Refuses all recordings if one of them cannot get a note, before the first is written.
///
/// # Errors
/// A recording is cut or damaged.
pub(crate) fn check_notable(recordings: &[Recording]) -> Result<(), Failure> {
    if let Some(cut) = recordings.iter().find(|one| one.state != State::Whole) {
        // `add_notes` returns the reason, and writes nothing.
        add_notes(&cut.path, &[])?;
    }
    Ok(())
}

/// Refuses a recording that is given twice.
///
/// # Errors
/// A recording is given twice, or cannot be read.
pub(crate) fn each_once(paths: &[PathBuf]) -> Result<(), Failure> {
    let mut seen = HashSet::new();
    for path in paths {
        let shown = path.display();
        let place = fs::canonicalize(path).with_context(|| format!("cannot read {shown}"))?;
        if !seen.insert(place) {
            bail!(Input, "{shown} is given twice; its strikes would count twice");
        }
    }
    Ok(())
}
