//! Errors of recordings.

use std::io;
use std::path::{Path, PathBuf};

use mcap::McapError;

/// An error of writing or reading a recording.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The system refused.
    #[error("cannot {action} {path}: {source}")]
    File {
        /// The action that failed.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// The error of the system.
        source: io::Error,
    },
    /// Another program has begun a recording of this name.
    #[error("another program is recording to {0}; give the output another name")]
    Busy(PathBuf),
    /// The file is empty.
    #[error("{0} is empty: the recording was stopped before anything was written; record again")]
    Empty(PathBuf),
    /// The file is not an MCAP file.
    #[error("{0} is not an MCAP file; give a recording made by `bead record` or `bead emulate`")]
    NotMcap(PathBuf),
    /// The MCAP file has no frames of a bead. The text names its channels and its writer.
    #[error(
        "{0} is an MCAP file with {1}, but has no channel `frames` of a bead; give a recording made by \
         `bead record` or `bead emulate`"
    )]
    NotOurs(PathBuf, String),
    /// The file cannot be written as MCAP, or is not a recording with the requested content. The text is the
    /// whole message.
    #[error("{0}")]
    Unfit(String),
    /// The recording has no strike that this program can read.
    #[error("{path}: {who}")]
    FromTheFuture {
        /// The file.
        path: PathBuf,
        /// The bead that sent it, and what to do.
        who: String,
    },
    /// Two beads in one recording cannot be told apart.
    #[error("two beads have the address {0}; give one of them another: bead settings set address=N")]
    SameAddress(u8),
}

impl RecordingError {
    /// Makes the error of an `action` on `path` that the system refused.
    pub(crate) fn refused(action: &'static str, path: &Path) -> impl Fn(io::Error) -> Self {
        move |source| Self::File {
            action,
            path: path.to_owned(),
            source,
        }
    }

    /// Makes the error of a `path` that the library failed to write.
    pub(super) fn unwritten(path: &Path) -> impl Fn(McapError) -> Self {
        move |error| match error {
            McapError::Io(source) => Self::refused("write", path)(source),
            source => Self::Unfit(format!("cannot write {}: {source}", path.display())),
        }
    }
}
