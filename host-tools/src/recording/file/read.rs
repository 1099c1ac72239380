//! Reads recordings, piece by piece.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::recording::file::about::{About, Part};
use crate::recording::file::error::RecordingError;
use crate::recording::file::found::Found;
use crate::recording::file::walk::{State, Walk};
use crate::recording::frames::{Frames, Piece};

/// A recording on disk. It is read piece by piece and never kept whole.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recording {
    path: PathBuf,
    /// What it is of.
    pub about: About,
    /// Its attachments.
    pub parts: BTreeMap<Part, Vec<u8>>,
    /// Runs of bytes between two delimiters; what is no frame may stand together in one.
    pub runs: u64,
    /// Runs that are missing: their numbers are.
    pub runs_missing: u64,
    /// Whether this is all.
    pub state: State,
}

impl Recording {
    /// Reads a file once, whole or cut short: what it is of, its attachments, and how much of it is there.
    ///
    /// # Errors
    /// The file cannot be read, or is no recording. One cut short or damaged is no error: see [`State`].
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        Self::read(path, Pieces::open(path)?)
    }

    fn read(path: &Path, mut pieces: Pieces) -> Result<Self, RecordingError> {
        let runs = pieces.by_ref().count() as u64;
        let Pieces { found, walk, .. } = pieces;
        if found.channel.is_none() && (walk.state == State::Whole || walk.salvages && runs == 0) {
            return Err(RecordingError::NotOurs(path.to_owned(), found.stranger()));
        }
        Ok(Self {
            path: path.to_owned(),
            about: found.about,
            parts: found.parts,
            runs,
            runs_missing: found.missing,
            state: walk.state,
        })
    }

    /// The same of a file whose beginning may be damaged too.
    ///
    /// # Errors
    /// The file cannot be read, or nothing in it is of a recording.
    pub fn salvage(path: &Path) -> Result<Self, RecordingError> {
        Self::read(path, Pieces::salvage(path)?)
    }

    /// Its runs of bytes, in the order received.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn pieces(&self) -> Result<Pieces, RecordingError> {
        Pieces::salvage(&self.path)
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
                "recording is damaged ({what}): {runs} frames are read, {}; each frame is still checked by its own \
                 CRC",
                match self.runs_missing {
                    0 => "others may be missing".to_owned(),
                    missing => format!("{missing} before the last of them are missing"),
                }
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
            walk: Walk::open(path, false)?,
            found: Found::default(),
        })
    }

    /// The same of a file whose beginning may be damaged too.
    fn salvage(path: &Path) -> Result<Self, RecordingError> {
        Ok(Self {
            walk: Walk::open(path, true)?,
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
                self.found.end();
                return self.found.ready.pop_front();
            }
        }
    }
}
