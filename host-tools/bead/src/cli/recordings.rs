//! Several recordings that a command takes at once.

use std::collections::HashSet;
use std::fs;
use std::path::PathBuf;

use anyhow::Context;
use bead_recording::file::Recording;

use crate::cli::failure::Failure;

/// Opens all of them, before anything is made of the first.
///
/// # Errors
/// One cannot be read, or is given twice.
pub(crate) fn open_all(paths: &[PathBuf]) -> Result<Vec<Recording>, Failure> {
    let (mut seen, mut recordings) = (HashSet::new(), Vec::new());
    for path in paths {
        let shown = path.display();
        let place = fs::canonicalize(path).with_context(|| format!("cannot read {shown}"))?;
        if !seen.insert(place) {
            bail!(Input, "{shown} is given twice; its strikes would count twice");
        }
        recordings.push(Recording::open_named(path)?);
    }
    Ok(recordings)
}
