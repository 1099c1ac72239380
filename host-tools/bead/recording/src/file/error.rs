//! Errors of recordings.

use std::io;
use std::path::{Path, PathBuf};

use bead_wire::{VERSION, reader};
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
    /// The file could not be written as MCAP.
    #[error("cannot write {path}: {source}")]
    Write {
        /// The file.
        path: PathBuf,
        /// The error of the library.
        source: McapError,
    },
    /// Another program has begun a recording of this name.
    #[error("another program is recording to {0}; give the output another name")]
    Busy(PathBuf),
    /// The file is empty.
    #[error("{0} is empty: the recording was stopped before anything was written; record again")]
    Empty(PathBuf),
    /// The path is not that of a file.
    #[error("{0} is a directory, a device or a pipe; give the file of a recording")]
    NoFile(PathBuf),
    /// The file is no MCAP file.
    #[error("{0} is not an MCAP file; give a recording made by `bead record` or `bead emulate`")]
    NotMcap(PathBuf),
    /// The file has the raw bytes of a bead.
    #[error("{0} has raw bytes as a bead sent them; make a recording of it: bead recover {0}")]
    Raw(PathBuf),
    /// The file has records of a recording, and does not begin as one.
    #[error(
        "{0} does not begin as a recording does, and its beginning may be damaged; try: bead recover {0}"
    )]
    NoBeginning(PathBuf),
    /// The MCAP file has no frames of a bead. The text names its channels and its writer.
    #[error(
        "{0} is an MCAP file with {1}, and has no channel `frames` of a bead; give one made by `bead record` or \
         `bead emulate`"
    )]
    NotOurs(PathBuf, String),
    /// Another program has compressed the chunks of the recording.
    #[error(
        "the chunks of {0} are compressed with {1}; write it without compression: mcap decompress {0} -o whole.mcap"
    )]
    Compressed(PathBuf, String),
    /// All frames in the recording are of another version of the protocol.
    #[error(
        "{path} has frames of version {version} of the protocol, written by {writer}, and this program reads version \
         {VERSION}; use {}", reader(*version)
    )]
    OtherProtocol {
        /// The file.
        path: PathBuf,
        /// Version of the frames.
        version: u8,
        /// Name and version of the program that wrote the file.
        writer: String,
    },
    /// The recording lacks something. The text is the whole message.
    #[error("{0}")]
    Lacking(String),
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
            source => Self::Write {
                path: path.to_owned(),
                source,
            },
        }
    }
}
