//! Reads recordings, piece by piece.

use std::collections::{BTreeMap, BTreeSet};
use std::mem;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use bead_wire::{VERSION, reader};

use crate::file::about::{About, Part, RecordedBead};
use crate::file::contents::{BeadChannels, Contents};
use crate::file::error::RecordingError;
use crate::file::records::{Records, State};
use crate::frames::{Frames, Item, Piece};
use crate::strikes::{FetchedNames, StrikeName};
use bead_tables::printable::one_line;

/// The note in a recovered recording about the state of the original file: one of these, or what was lost.
pub(crate) const RECOVERED_FROM: &str = "recovered_from";
pub(crate) const WHOLE: &str = "whole";
pub(crate) const CUT_IN_INDEX: &str = "cut short in its index";

/// A recording on disk. It is read piece by piece and never kept whole.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recording {
    /// Path of the file.
    pub path: PathBuf,
    /// Description of the recording.
    pub about: Arc<About>,
    /// Its attachments: those of all beads.
    pub parts: BTreeMap<Part, Arc<[u8]>>,
    /// The beads, by their addresses, if it is a recording of several.
    pub beads: Vec<RecordedBead>,
    /// Number of runs of bytes between two delimiters. Runs that are not frames may be joined in one.
    pub runs: u64,
    /// Number of runs that are missing, by the numbers of the others.
    pub runs_missing: u64,
    /// Completeness of the file.
    pub state: State,
    pub(crate) fetched: Arc<BTreeSet<StrikeName>>,
    channels: Arc<BeadChannels>,
    /// Address of the bead whose bytes are read, if it is one of several.
    only: Option<u8>,
}

impl Recording {
    /// Reads a file, whole or cut short.
    ///
    /// # Errors
    /// The file cannot be read, is not a recording, has compressed chunks, or has only frames of a later
    /// version of the protocol. A file cut short or damaged is not an error: see [`State`].
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        Self::read(path, false)
    }

    /// Reads a file whose beginning may be damaged too.
    ///
    /// # Errors
    /// As [`open`](Self::open), or nothing in the file is of a recording.
    pub fn salvage(path: &Path) -> Result<Self, RecordingError> {
        Self::read(path, true)
    }

    fn read(path: &Path, damaged: bool) -> Result<Self, RecordingError> {
        let (mut contents, mut records, mut fetched, mut is_known);
        let mut channels = BeadChannels::default();
        loop {
            let mut pieces = Pieces::open(path, damaged, channels)?;
            (fetched, is_known) = (FetchedNames::default(), false);
            for frame in Frames::new(pieces.by_ref()).filter_map(Item::frame) {
                is_known |= frame.version <= VERSION;
                fetched.push(&frame);
            }
            (contents, records) = (pieces.contents, pieces.records);
            if !contents.knew_too_late() {
                break;
            }
            channels = contents.channels;
        }
        let (path, shown) = (path.to_owned(), path.display());
        if let Some(by) = records.compression {
            return Err(RecordingError::Unfit(format!(
                "the chunks of {shown} are compressed with {by}; write it without compression: mcap decompress {shown} -o \
                 whole.mcap"
            )));
        }
        let state = records.state;
        if !contents.has_frames() && (state == State::Whole || damaged) {
            return Err(RecordingError::NotOurs(path, contents.describe()));
        }
        if let Some(version) = contents.version.filter(|version| *version > VERSION && !is_known) {
            return Err(RecordingError::Unfit(format!(
                "{shown} has frames of version {version} of the protocol, written by {}, and this program reads version \
                 {VERSION}; use {}",
                contents.writer(),
                reader(version)
            )));
        }
        let (runs, runs_missing) = contents.counts(None);
        let mut beads: Vec<_> = mem::take(&mut contents.beads).into_values().collect();
        for bead in &mut beads {
            (bead.runs, bead.runs_missing) = contents.counts(Some(bead.origin.address));
        }
        Ok(Self {
            path,
            beads,
            about: Arc::new(contents.about),
            parts: contents.parts,
            runs,
            runs_missing,
            state,
            fetched: Arc::new(fetched.finish()),
            channels: Arc::new(contents.channels),
            only: None,
        })
    }

    /// The recording of only one of its beads. Long parts are shared, as there can be 254 of these.
    pub fn of(&self, bead: &RecordedBead) -> Self {
        let mut parts = self.parts.clone();
        parts.extend(bead.parts.clone());
        Self {
            parts,
            beads: Vec::new(),
            runs: bead.runs,
            runs_missing: bead.runs_missing,
            only: Some(bead.origin.address),
            ..self.clone()
        }
    }

    /// One recording for each of its beads, or only this one if it is of a single line.
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
        let pieces = Pieces::open(&self.path, true, BeadChannels::clone(&self.channels))?;
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

    /// A line about the part of a recording that is missing, in this file or in the one that it was recovered
    /// from. `None` if all runs are there.
    pub fn incomplete(&self) -> Option<String> {
        let runs = self.runs;
        match &self.state {
            State::CutShort { runs_whole: false } => Some(format!(
                "the recording is cut short: what came after its {runs} frames is lost"
            )),
            State::Damaged(what) => Some(format!("the recording is damaged ({what})")),
            State::Whole | State::CutShort { .. } => {
                let how = self.about.notes.get(RECOVERED_FROM)?;
                let lacks = how != WHOLE && how != CUT_IN_INDEX;
                lacks.then(|| {
                    format!(
                        "it was recovered from a recording with missing or damaged data: {}",
                        one_line(how)
                    )
                })
            }
        }
    }

    /// One line that says what is missing, `None` for a whole recording.
    pub fn warning(&self) -> Option<String> {
        let runs = self.runs;
        match &self.state {
            State::Whole => None,
            State::CutShort { runs_whole: true } => Some(format!(
                "recording is cut short in its index; all {runs} frames are there"
            )),
            State::CutShort { runs_whole: false } => Some(format!(
                "recording is cut short: {runs} frames before the cut are read, and those after it are lost"
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

/// The runs of bytes in a recording, each with its delimiter, its receive time and its bead. Memory: a chunk
/// of the file, and the runs of one piece of bytes of each bead.
pub struct Pieces {
    records: Records,
    contents: Contents,
    only: Option<u8>,
}

impl Pieces {
    /// The runs in a file; its beginning may be `damaged` too.
    pub(super) fn open(path: &Path, damaged: bool, channels: BeadChannels) -> Result<Self, RecordingError> {
        Ok(Self {
            records: Records::open(path, damaged)?,
            contents: Contents::with_channels(channels),
            only: None,
        })
    }

    fn next_of_any(&mut self) -> Option<Piece> {
        loop {
            if let Some(piece) = self.contents.ready.pop_front() {
                return Some(piece);
            }
            if !self.records.step(&mut self.contents) {
                self.contents.end();
                return self.contents.ready.pop_front();
            }
        }
    }
}

impl Iterator for Pieces {
    type Item = Piece;

    fn next(&mut self) -> Option<Piece> {
        loop {
            let piece = self.next_of_any()?;
            if self.only.is_none() || piece.bead == self.only {
                return Some(piece);
            }
        }
    }
}
