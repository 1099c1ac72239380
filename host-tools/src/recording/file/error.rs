//! Why a recording cannot be written or read.

use std::io;
use std::path::{Path, PathBuf};

use mcap::McapError;

/// Why a recording cannot be written or read.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The system refused.
    #[error("cannot {action} {path}: {source}")]
    File {
        /// What was tried.
        action: &'static str,
        /// On what.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The file could not be written as MCAP.
    #[error("cannot write {path}: {source}")]
    Write {
        /// The file.
        path: PathBuf,
        /// What the library said.
        source: McapError,
    },
    /// Another program has begun a recording of this name.
    #[error("another program is recording to {0}; give the output another name")]
    Busy(PathBuf),
    /// Nothing is in the file.
    #[error("{0} is empty: the recording was stopped before anything was written; record again")]
    Empty(PathBuf),
    /// There is no file, but something else of that name.
    #[error("{0} is a directory, a device or a pipe; give the file of a recording")]
    NoFile(PathBuf),
    /// The file is something else.
    #[error("{0} is not an MCAP file; give a recording made by `bead record` or `bead emulate`")]
    NotMcap(PathBuf),
    /// The file has frames, but is no recording.
    #[error("{0} has raw bytes as a bead sent them; make a recording of it: bead recover {0}")]
    Raw(PathBuf),
    /// The beginning is not a recording's, and there are records of one in it.
    #[error(
        "{0} does not begin as a recording does, and its beginning may be damaged; try: bead recover {0}"
    )]
    NoBeginning(PathBuf),
    /// An MCAP file, but not of a bead: what it is instead.
    #[error(
        "{0} is an MCAP file with {1}, and has no channel `frames` of a bead; give one made by `bead record` or \
         `bead emulate`"
    )]
    NotOurs(PathBuf, String),
    /// A recording without a strike: a check has nothing to check.
    #[error("{path}: no strike among its {frames} frames, so there is nothing to check; record one")]
    NoStrike {
        /// The file.
        path: PathBuf,
        /// Frames in it.
        frames: u64,
    },
    /// A recording without a strike that this program can read.
    #[error("{path}: {who}")]
    FromTheFuture {
        /// The file.
        path: PathBuf,
        /// Who sent it, and what to do.
        who: String,
    },
    /// Two beads in one recording cannot be told apart.
    #[error("two beads have the address {0}; give one of them another: bead settings set address=N")]
    SameAddress(u8),
    /// Clocks of these recordings cannot be compared.
    #[error("{0}")]
    Clock(String),
    /// An attachment that this version did not write.
    #[error("{path}: cannot read its {part}; record it again: {why}")]
    Part {
        /// The file.
        path: PathBuf,
        /// Name of the attachment.
        part: &'static str,
        /// What is wrong with it.
        why: String,
    },
}

impl RecordingError {
    /// The system refused to do `action` on `path`.
    pub(super) fn refused(action: &'static str, path: &Path) -> impl Fn(io::Error) -> Self {
        move |source| Self::File {
            action,
            path: path.to_owned(),
            source,
        }
    }

    /// The system refused to read `path`.
    pub(in crate::recording) fn unread(path: &Path) -> impl Fn(io::Error) -> Self {
        Self::refused("read", path)
    }

    /// The library failed to write `path`.
    pub(super) fn unwritten(path: &Path) -> impl Fn(McapError) -> Self {
        move |error| {
            let path = path.to_owned();
            match error {
                McapError::Io(source) => Self::File {
                    action: "write",
                    path,
                    source,
                },
                source => Self::Write { path, source },
            }
        }
    }
}
