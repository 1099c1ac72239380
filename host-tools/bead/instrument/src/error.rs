//! The error of a file that is no waveform.

use std::io;
use std::path::{Path, PathBuf};

use bead_recording::file::RecordingError;

/// A file is no waveform. The message is one line: what, why, what next.
#[derive(Debug, thiserror::Error)]
pub enum WaveformError {
    /// The system refused.
    #[error("cannot read {path}: {source}")]
    File {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// The content of the file is no waveform.
    #[error("{path}: {what}")]
    Unfit {
        /// The file.
        path: PathBuf,
        /// The defect, and what to do.
        what: String,
    },
    /// A recording is damaged.
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

    /// Makes the error of a `path` that the system refused to read.
    pub(super) fn unread(path: &Path) -> impl Fn(io::Error) -> Self {
        move |source| Self::File {
            path: path.to_owned(),
            source,
        }
    }

    /// Turns the error of a temporary file into one of the file at `path` that it was unpacked from.
    pub(super) fn of(self, path: &Path) -> Self {
        match self {
            Self::File { source, .. } => Self::unread(path)(source),
            Self::Unfit { what, .. } => Self::unfit(path, what),
            Self::Recording(error) => Self::unfit(path, error.to_string()),
        }
    }

    /// Appends a second possible reason.
    pub(super) fn also(mut self, reason: Option<&str>) -> Self {
        if let (Self::Unfit { what, .. }, Some(reason)) = (&mut self, reason) {
            what.push_str("; ");
            what.push_str(reason);
        }
        self
    }
}
