//! What came from a bead, from whichever file holds it.

use std::path::{Path, PathBuf};

use bead_model::settings::Settings;
use bead_wire::Counters;

use crate::cli::failure::{Blame, Failure};
use crate::recording::file::{Part, Recording};
use crate::recording::frames::{self, Frame, Identity, Message};
use crate::recording::strikes::{RecordedStrike, assemble};

/// The frames of a recording, and the recording itself.
#[derive(Debug, Clone)]
pub struct Received {
    /// Where it came from.
    pub path: PathBuf,
    /// Every frame, in the order received.
    pub frames: Vec<Frame>,
    /// What was received, refused and lost.
    pub counters: Counters,
    /// The recording.
    pub recording: Recording,
}

impl Received {
    /// Reads a recording; what is missing of it is said on standard error.
    ///
    /// # Errors
    /// The file cannot be read or is no recording.
    pub fn open(path: &Path) -> Result<Self, Failure> {
        let recording = Recording::open(path).map_err(Failure::input)?;
        if let Some(warning) = recording.warning() {
            eprintln!("bead: {}: {warning}", path.display());
        }
        let (frames, counters) = frames::decode(&recording.stream());
        Ok(Self {
            path: path.to_owned(),
            frames,
            counters,
            recording,
        })
    }

    /// The strikes, with their samples and settings.
    pub fn strikes(&self) -> Vec<RecordedStrike> {
        let given = self.recording.parts.get(&Part::Settings);
        let given = given.and_then(|block| Settings::decode(block).ok());
        assemble(&self.frames, given.as_ref())
    }

    /// The strikes, of which there is at least one.
    ///
    /// # Errors
    /// There is none: the check that was asked for has nothing to check.
    pub fn some_strikes(&self) -> Result<Vec<RecordedStrike>, Failure> {
        let strikes = self.strikes();
        if strikes.is_empty() {
            return Err(Failure::input(format!(
                "{}: no strike among its {} frames, so there is nothing to check; record one",
                self.path.display(),
                self.frames.len()
            )));
        }
        Ok(strikes)
    }

    /// Who spoke, last.
    pub fn identity(&self) -> Option<&Identity> {
        self.frames.iter().rev().find_map(|frame| match &frame.message {
            Message::Identity(identity) => Some(identity),
            _ => None,
        })
    }

    /// The last status.
    pub fn status(&self) -> Option<&bead_wire::Status> {
        self.frames.iter().rev().find_map(|frame| match &frame.message {
            Message::Status(status) => Some(status),
            _ => None,
        })
    }

    /// A part of the recording that is text.
    pub fn text(&self, part: Part) -> Option<&str> {
        self.recording
            .parts
            .get(&part)
            .and_then(|bytes| std::str::from_utf8(bytes).ok())
    }

    /// A part of the recording that is JSON.
    ///
    /// # Errors
    /// The part is there and is not what this version writes.
    pub fn json<T: serde::de::DeserializeOwned>(&self, part: Part) -> Result<Option<T>, Failure> {
        let Some(text) = self.text(part) else {
            return Ok(None);
        };
        let value = serde_json::from_str(text).or_input(|| {
            format!(
                "{}: cannot read its {}; record it again",
                self.path.display(),
                part.name()
            )
        })?;
        Ok(Some(value))
    }
}
