//! The strikes of a recording, its JSON attachments, and the bead's last identity and status.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use bead_model::settings::Settings;
use bead_wire::{Counters, Identity, Message, Status};

use crate::file::{Part, Pieces, Recording, RecordingError};
use crate::frames::{Frame, Frames, Item, Piece};
use crate::note::note;
use crate::raw;
use crate::statuses::LastStatuses;
use crate::strikes::Strikes;
use bead_tables::printable::beginning;

/// Number of characters that are shown of an error in an attachment.
const WHY_MOST: usize = 200;

impl Recording {
    /// Opens a recording that a user named. A line on standard error says what is missing in it.
    ///
    /// # Errors
    /// As [`open`](Self::open); the message says how to recover what another file holds.
    pub fn open_named(path: &Path) -> Result<Self, RecordingError> {
        let shown = path.display();
        let recording = Self::open(path).map_err(|error| match error {
            RecordingError::NotMcap(_) if Self::salvage(path).is_ok() => RecordingError::Unfit(format!(
                "{shown} does not begin like a recording, but its beginning may be damaged; try: bead recover {shown}"
            )),
            RecordingError::NotMcap(_) if raw::frames_in(path) > 0 => RecordingError::Unfit(format!(
                "{shown} has raw bytes as a bead sent them; turn it into a recording: bead recover {shown}"
            )),
            error => error,
        })?;
        if let Some(warning) = recording.warning() {
            note(format_args!("{shown}: {warning}"));
        }
        Ok(recording)
    }

    /// The strikes with their samples and settings, one after another.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn strikes(&self) -> Result<Strikes<LastSaid<Pieces>>, RecordingError> {
        let given = |parts: &BTreeMap<Part, Arc<[u8]>>| Settings::decode(parts.get(&Part::Settings)?).ok();
        let beads = self.beads.iter();
        let parts = beads.map(|bead| (Some(bead.origin.address), &bead.parts));
        let parts = parts.chain([(None, &self.parts)]);
        let given = parts.filter_map(|(address, parts)| Some((address, given(parts)?)));
        let strikes = Strikes::new(LastSaid::new(self.frames()?), given.collect());
        Ok(strikes.with_fetched(self.fetched.clone()))
    }

    /// The error of a recording without a strike in its frames.
    pub fn no_strike<I: Iterator<Item = Piece>>(&self, heard: &LastSaid<I>) -> RecordingError {
        match heard.from_the_future.clone() {
            Some(who) => RecordingError::FromTheFuture {
                path: self.path.clone(),
                who,
            },
            None => RecordingError::Unfit(format!(
                "{}: no strike among its {} frames, so there is nothing to check; record one",
                self.path.display(),
                heard.counters().frames
            )),
        }
    }

    /// A part of the recording that is JSON.
    ///
    /// # Errors
    /// The part is there and is not what this version writes.
    pub fn json<T: serde::de::DeserializeOwned>(&self, part: Part) -> Result<Option<T>, RecordingError> {
        let Some(bytes) = self.parts.get(&part) else {
            return Ok(None);
        };
        let value = serde_json::from_slice(bytes).map_err(|why| {
            RecordingError::Unfit(format!(
                "{0}: cannot read its {1} ({2}); record it again",
                self.path.display(),
                part.name(),
                // The error repeats the wrong text, which may have megabytes.
                beginning(&why.to_string(), WHY_MOST)
            ))
        })?;
        Ok(Some(value))
    }
}

/// An iterator over frames that keeps the last identity and status among them.
pub struct LastSaid<I> {
    frames: Frames<I>,
    /// The last identity so far.
    pub identity: Option<Identity>,
    /// The last status so far.
    pub status: Option<Status>,
    /// Sample index of the last frame so far.
    pub sample_index: u64,
    /// The last status of every boot so far.
    pub statuses: LastStatuses,
    /// See [`Frame::from_the_future`].
    from_the_future: Option<String>,
}

impl<I: Iterator<Item = Piece>> LastSaid<I> {
    /// Keeps the last identity and status of these frames.
    pub fn new(frames: Frames<I>) -> Self {
        Self {
            frames,
            identity: None,
            status: None,
            sample_index: 0,
            statuses: LastStatuses::default(),
            from_the_future: None,
        }
    }

    /// Counts of the frames so far: received, refused and lost.
    pub fn counters(&self) -> &Counters {
        self.frames.counters()
    }
}

impl<I: Iterator<Item = Piece>> Iterator for LastSaid<I> {
    type Item = Frame;

    fn next(&mut self) -> Option<Frame> {
        let frame = self.frames.by_ref().find_map(Item::frame)?;
        self.from_the_future = frame.from_the_future().or(self.from_the_future.take());
        self.statuses.push(&frame);
        self.sample_index = frame.header.sample_index;
        match &frame.message {
            Message::Identity(identity) => self.identity = Some(identity.clone()),
            Message::Status(status) => self.status = Some(*status),
            _ => {}
        }
        Some(frame)
    }
}
