//! Reads recordings, piece by piece.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::recording::file::about::{About, Part};
use crate::recording::file::error::RecordingError;
use crate::recording::file::records::{Found, State, Walk};
use crate::recording::frames::{Frames, Piece};

/// A recording on disk. It is read piece by piece and never kept whole.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recording {
    path: PathBuf,
    /// What it is of.
    pub about: About,
    /// Its attachments.
    pub parts: BTreeMap<Part, Vec<u8>>,
    /// Runs of bytes between two delimiters.
    pub runs: u64,
    /// Whether this is all.
    pub state: State,
}

impl Recording {
    /// Reads a file once, whole or cut short: what it is of, its attachments, and how much of it is there.
    ///
    /// # Errors
    /// The file cannot be read, or is no recording. One cut short or damaged is no error: see [`State`].
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        let mut pieces = Pieces::open(path)?;
        let runs = pieces.by_ref().count() as u64;
        let Pieces { found, walk, .. } = pieces;
        if found.channel.is_none() && walk.state == State::Whole {
            return Err(RecordingError::NotOurs(path.to_owned(), found.stranger()));
        }
        Ok(Self {
            path: path.to_owned(),
            about: found.about,
            parts: found.parts,
            runs,
            state: walk.state,
        })
    }

    /// Its runs of bytes, in the order received.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn pieces(&self) -> Result<Pieces, RecordingError> {
        Pieces::open(&self.path)
    }

    /// Its frames, in the order received, each with the time of its receipt.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn frames(&self) -> Result<Frames<Pieces>, RecordingError> {
        self.pieces().map(Frames::new)
    }

    /// One line that says what is missing; none for a whole recording.
    pub fn warning(&self) -> Option<String> {
        let runs = self.runs;
        match &self.state {
            State::Whole => None,
            State::CutShort { runs_whole: true } => Some(format!(
                "recording is cut short in its index; all {runs} frames are there"
            )),
            State::CutShort { runs_whole: false } => Some(format!(
                "recording is cut short: {runs} frames before the cut are read, those after it are gone"
            )),
            State::Damaged(what) => Some(format!(
                "recording is damaged ({what}): {runs} frames are read, others may be missing; each frame \
                 is still checked by its own CRC"
            )),
        }
    }
}

/// The runs of bytes in a recording, each with its delimiter and the time of its receipt. Memory: a chunk of
/// the file, and the runs of one piece of bytes.
pub struct Pieces {
    walk: Walk,
    found: Found,
}

impl Pieces {
    pub(super) fn open(path: &Path) -> Result<Self, RecordingError> {
        Ok(Self {
            walk: Walk::open(path)?,
            found: Found::default(),
        })
    }
}

impl Iterator for Pieces {
    type Item = Piece;

    fn next(&mut self) -> Option<Piece> {
        loop {
            if let Some(piece) = self.found.ready.pop_front() {
                return Some(piece);
            }
            if !self.walk.step(&mut self.found) {
                self.found.release(|_| true, None);
                return self.found.ready.pop_front();
            }
        }
    }
}
