//! Reads recordings, piece by piece.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::recording::file::about::{About, Origin, Part};
use crate::recording::file::error::RecordingError;
use crate::recording::file::found::{Found, Lanes, OfBead};
use crate::recording::file::walk::{State, Walk};
use crate::recording::frames::{Frames, Item, Piece};
use crate::recording::strikes::{FetchedNames, Name};

/// A recording on disk. It is read piece by piece and never kept whole.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recording {
    path: PathBuf,
    /// What it is of.
    pub about: Arc<About>,
    /// Its attachments: those of all beads.
    pub parts: BTreeMap<Part, Arc<[u8]>>,
    /// The beads, by their addresses, if it is a recording of several.
    pub beads: Vec<Bead>,
    /// Runs of bytes between two delimiters; what is no frame may stand together in one.
    pub runs: u64,
    /// Runs that are missing: their numbers are.
    pub runs_missing: u64,
    /// Whether this is all.
    pub state: State,
    /// The strikes that were fetched.
    pub(in crate::recording) fetched: Arc<BTreeSet<Name>>,
    lanes: Arc<Lanes>,
    /// The bead that is looked at, if it is one of several.
    only: Option<u8>,
}

/// A bead of a recording with several.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Bead {
    /// Which one, and where its bytes came from.
    pub origin: Origin,
    /// Its own attachments.
    pub parts: BTreeMap<Part, Arc<[u8]>>,
    /// Its runs of bytes.
    pub runs: u64,
    /// Those of them that are missing.
    pub runs_missing: u64,
}

impl Bead {
    /// Its place in the chain; as far as nothing else is known, that is its address.
    pub fn place(&self) -> usize {
        self.origin.bead.unwrap_or(self.origin.address.into())
    }
}

impl Recording {
    /// Reads a file once, whole or cut short: what it is of, its attachments, and how much of it is there.
    ///
    /// # Errors
    /// The file cannot be read, or is no recording. One cut short or damaged is no error: see [`State`].
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        Self::read(path, false)
    }

    /// The same of a file whose beginning may be damaged too.
    ///
    /// # Errors
    /// The file cannot be read, or nothing in it is of a recording.
    pub fn salvage(path: &Path) -> Result<Self, RecordingError> {
        Self::read(path, true)
    }

    fn read(path: &Path, damaged: bool) -> Result<Self, RecordingError> {
        let (mut pieces, mut fetched) = Self::pass(path, damaged, Lanes::default())?;
        if pieces.found.knew_too_late() {
            (pieces, fetched) = Self::pass(path, damaged, pieces.found.lanes)?;
        }
        let Pieces { found, walk, .. } = pieces;
        let (runs, runs_missing) = found.counts(None);
        if !found.has_frames() && (walk.state == State::Whole || walk.salvages && runs == 0) {
            return Err(RecordingError::NotOurs(path.to_owned(), found.stranger()));
        }
        let bead = |(address, of): (&u8, &OfBead)| {
            let (runs, runs_missing) = found.counts(Some(*address));
            let unnamed = || Origin {
                address: *address,
                ..Origin::default()
            };
            Bead {
                origin: of.origin.clone().unwrap_or_else(unnamed),
                parts: of.parts.clone(),
                runs,
                runs_missing,
            }
        };
        Ok(Self {
            path: path.to_owned(),
            beads: found.beads.iter().map(bead).collect(),
            about: Arc::new(found.about),
            parts: found.parts,
            runs,
            runs_missing,
            state: walk.state,
            fetched: Arc::new(fetched.finish()),
            lanes: Arc::new(found.lanes),
            only: None,
        })
    }

    /// Reads a file through.
    fn pass(path: &Path, damaged: bool, lanes: Lanes) -> Result<(Pieces, FetchedNames), RecordingError> {
        let mut pieces = Pieces::open(path, damaged, lanes)?;
        let mut fetched = FetchedNames::default();
        Frames::new(pieces.by_ref())
            .filter_map(Item::frame)
            .for_each(|frame| fetched.push(&frame));
        Ok((pieces, fetched))
    }

    /// The recording as it would be of one of its beads alone. What may be long is shared: there can be 254
    /// of these.
    pub fn of(&self, bead: &Bead) -> Self {
        let mut parts = self.parts.clone();
        parts.extend(bead.parts.clone());
        Self {
            path: self.path.clone(),
            about: Arc::clone(&self.about),
            parts,
            beads: Vec::new(),
            runs: bead.runs,
            runs_missing: bead.runs_missing,
            state: self.state.clone(),
            fetched: Arc::clone(&self.fetched),
            lanes: Arc::clone(&self.lanes),
            only: Some(bead.origin.address),
        }
    }

    /// One for each of its beads, or this one if it is of one line.
    pub fn each(&self) -> Vec<Self> {
        match self.beads[..] {
            [] => vec![self.clone()],
            _ => self.beads.iter().map(|bead| self.of(bead)).collect(),
        }
    }

    /// Its runs of bytes, in the order received.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn pieces(&self) -> Result<Pieces, RecordingError> {
        let pieces = Pieces::open(&self.path, true, Lanes::clone(&self.lanes))?;
        Ok(Pieces {
            only: self.only,
            ..pieces
        })
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

/// The runs of bytes in a recording, each with its delimiter, the time of its receipt and its bead. Memory: a
/// chunk of the file, and the runs of one piece of bytes of each bead.
pub struct Pieces {
    walk: Walk,
    found: Found,
    only: Option<u8>,
}

impl Pieces {
    /// Of a file; its beginning may be `damaged` too.
    pub(super) fn open(path: &Path, damaged: bool, lanes: Lanes) -> Result<Self, RecordingError> {
        Ok(Self {
            walk: Walk::open(path, damaged)?,
            found: Found::knowing(lanes),
            only: None,
        })
    }

    fn any(&mut self) -> Option<Piece> {
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

impl Iterator for Pieces {
    type Item = Piece;

    fn next(&mut self) -> Option<Piece> {
        loop {
            let piece = self.any()?;
            if self.only.is_none() || piece.bead == self.only {
                return Some(piece);
            }
        }
    }
}
