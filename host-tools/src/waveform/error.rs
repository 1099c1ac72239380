//! Why a file is no waveform.

use std::io;
use std::path::{Path, PathBuf};

use crate::recording::file::RecordingError;

/// Why a file is no waveform. The message is one line: what, why, what next.
#[derive(Debug, thiserror::Error)]
pub enum WaveformError {
    /// The system refused.
    #[error("cannot read {path}: {source}")]
    File {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// What is in the file does not make a waveform.
    #[error("{path}: {what}")]
    Unfit {
        /// The file.
        path: PathBuf,
        /// What is wrong, and what to do.
        what: String,
    },
    /// It is a recording, and cannot be read as one.
    #[error(transparent)]
    Recording(#[from] RecordingError),
}

impl WaveformError {
    pub(super) fn unfit(path: &Path, what: impl Into<String>) -> Self {
        Self::Unfit {
            path: path.to_owned(),
            what: what.into(),
        }
    }

    /// With what else may be the reason.
    pub(super) fn also(mut self, reason: Option<&str>) -> Self {
        if let (Self::Unfit { what, .. }, Some(reason)) = (&mut self, reason) {
            what.push_str("; ");
            what.push_str(reason);
        }
        self
    }
}
