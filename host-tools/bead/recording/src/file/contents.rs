//! The contents of a recording, from its records.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::mem;
use std::sync::Arc;

use mcap::records::{Channel, Record, op};

use crate::file::about::{About, Part, RecordedBead, RecordingOrigin};
use crate::file::layout::{
    ENCODING, LONGEST_RUN, METADATA, NOTE, RECEIVED, RECEIVED_ENCODING, TOPIC, bead_of,
};
use crate::file::notes::{NOTES_MOST, Note};
use crate::file::search::{self, SoundFrame};
use crate::frames::Piece;
use bead_tables::printable::{beginning, one_line};

/// Greatest number of bytes in runs that wait until it is known whether they have receive times. A piece of
/// received bytes has up to 64 KiB and may end a run that began before it.
const HELD_MOST: usize = 4 * LONGEST_RUN;
/// Greatest number of channels in the description of a file that is not a bead's, and of characters of a
/// name.
const TOPICS_MOST: usize = 12;
const NAME_MOST: usize = 64;

/// The channels with bytes and with receive times, each with the address of its bead if it is one of several.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct BeadChannels {
    frames: BTreeMap<u16, Option<u8>>,
    received: BTreeMap<u16, Option<u8>>,
}

#[derive(Default)]
struct Runs {
    count: u64,
    /// Number of the last.
    last: Option<u32>,
    missing: u64,
    /// True if the log times are receive times, as a message on the channel `received` shows; false if none
    /// has come within [`HELD_MOST`] bytes. `None` until then.
    are_received: Option<bool>,
    /// Runs, with their log times, that wait until `are_received` is known.
    held: VecDeque<(Option<u64>, Vec<u8>)>,
    held_bytes: usize,
}

/// The contents of the records that were read so far.
#[derive(Default)]
pub(super) struct Contents {
    pub(super) about: About,
    /// Attached for all beads.
    pub(super) parts: BTreeMap<Part, Arc<[u8]>>,
    /// By address.
    pub(super) beads: BTreeMap<u8, RecordedBead>,
    pub(super) channels: BeadChannels,
    /// Version of the protocol that the writer of the file knew.
    pub(super) version: Option<u8>,
    written_by: String,
    /// The first channels: to name a file that is not a bead's.
    topics: BTreeSet<String>,
    /// Channels whose messages came before their records.
    passed_over: BTreeSet<u16>,
    /// By the bead.
    runs: BTreeMap<Option<u8>, Runs>,
    /// Runs with their receive times.
    pub(super) ready: VecDeque<Piece>,
}

impl Contents {
    /// The contents of a file whose channels are known beforehand.
    pub(super) fn with_channels(channels: BeadChannels) -> Self {
        Self {
            channels,
            ..Self::default()
        }
    }

    /// True if some messages of a channel of bytes came before its record: the first copy is damaged, and
    /// another is in the index at the end.
    pub(super) fn knew_too_late(&self) -> bool {
        let passed_over = |channel| self.passed_over.contains(channel);
        self.channels.frames.keys().any(passed_over)
    }

    /// Takes a record. `None` if it is damaged.
    pub(super) fn push(&mut self, opcode: u8, data: &[u8]) -> Option<()> {
        let record = match opcode {
            // The library slices the data of an attachment without checking its length.
            op::ATTACHMENT if attachment_length(data) != Some(data.len() as u64) => return None,
            op::HEADER | op::CHANNEL | op::METADATA | op::ATTACHMENT | op::MESSAGE => {
                mcap::parse_record(opcode, data).ok()?
            }
            _ => return Some(()),
        };
        match record {
            Record::Header(header) => self.written_by = beginning(&header.library, NAME_MOST).into_owned(),
            Record::Channel(channel) => self.push_channel(channel),
            Record::Message { header, data } => {
                let channel = header.channel_id;
                if let Some(bead) = self.channels.received.get(&channel) {
                    let runs = self.runs.entry(*bead).or_default();
                    runs.are_received = Some(true);
                    runs.release(*bead, &mut self.ready);
                } else if let Some(bead) = self.channels.frames.get(&channel).copied() {
                    self.push_run(bead, Some((header.sequence, header.log_time)), &data);
                } else {
                    self.passed_over.insert(channel);
                    // The records of all channels may be damaged.
                    if self.channels.frames.is_empty() && search::frames(&data).count() == 1 {
                        self.push_run(None, Some((header.sequence, header.log_time)), &data);
                    }
                }
            }
            Record::Metadata(metadata) if metadata.name == METADATA => {
                let remarks = mem::take(&mut self.about.remarks);
                self.about = About::from_map(metadata.metadata);
                self.about.remarks = remarks;
            }
            Record::Metadata(metadata) if metadata.name == NOTE && self.about.remarks.len() < NOTES_MOST => {
                self.about.remarks.extend(Note::from_map(metadata.metadata));
            }
            Record::Attachment { header, data, .. } => {
                let (bead, name) = bead_of(&header.name);
                if let Some(part) = Part::ALL.into_iter().find(|part| part.name() == name) {
                    let parts = match bead {
                        Some(address) => &mut self.bead(address).parts,
                        None => &mut self.parts,
                    };
                    parts.insert(part, data.into());
                }
            }
            _ => {}
        }
        Some(())
    }

    fn bead(&mut self, address: u8) -> &mut RecordedBead {
        self.beads.entry(address).or_insert_with(|| RecordedBead {
            origin: RecordingOrigin {
                address,
                ..RecordingOrigin::default()
            },
            ..RecordedBead::default()
        })
    }

    fn push_channel(&mut self, channel: Channel) {
        if self.topics.len() < TOPICS_MOST {
            self.topics
                .insert(beginning(&channel.topic, NAME_MOST).into_owned());
        }
        match (bead_of(&channel.topic), channel.message_encoding.as_str()) {
            ((bead, TOPIC), ENCODING) => {
                self.channels.frames.insert(channel.id, bead);
                let version = channel.metadata.get("version");
                self.version = version.and_then(|version| version.parse().ok()).or(self.version);
                if let Some(address) = bead {
                    self.bead(address).origin = RecordingOrigin::from_map(address, channel.metadata);
                }
            }
            ((bead, RECEIVED), RECEIVED_ENCODING) => {
                self.channels.received.insert(channel.id, bead);
            }
            _ => {}
        }
    }

    /// Takes a frame from a damaged place. Its own address names its bead if the head of its message does
    /// not.
    pub(super) fn push_frame(&mut self, frame: &SoundFrame<'_>) {
        let channel = frame.head.map(|head| head.channel);
        let of_channel = channel.and_then(|channel| self.channels.frames.get(&channel));
        let bead = of_channel.copied().unwrap_or_else(|| {
            self.passed_over.extend(channel);
            let is_of_several = !self.beads.is_empty();
            is_of_several.then_some(frame.address)
        });
        self.push_run(
            bead,
            frame.head.map(|head| (head.number, head.log_time)),
            frame.bytes,
        );
    }

    /// Takes a run, with the number and the log time of its message if they are known.
    fn push_run(&mut self, bead: Option<u8>, head: Option<(u32, u64)>, data: &[u8]) {
        let runs = self.runs.entry(bead).or_default();
        runs.push(head, data);
        if runs.held_bytes > HELD_MOST {
            runs.are_received.get_or_insert(false);
        }
        if runs.are_received.is_some() {
            runs.release(bead, &mut self.ready);
        }
    }

    /// Names a file that has no frames of a bead, for people.
    pub(super) fn describe(&self) -> String {
        let topics = self.topics.iter().map(|topic| format!("`{}`", one_line(topic)));
        let topics: Vec<_> = topics.collect();
        let topics = match topics[..] {
            [] => "no channels".to_owned(),
            _ => format!("the channels {}", topics.join(", ")),
        };
        match self.written_by.as_str() {
            "" => topics,
            by => format!("{topics}, written by `{}`", one_line(by)),
        }
    }

    /// The program that wrote the file, for people.
    pub(super) fn writer(&self) -> String {
        let by = one_line(&self.written_by);
        if by.is_empty() {
            "an unknown program".to_owned()
        } else {
            format!("`{by}`")
        }
    }

    /// True if a channel with bytes was found, or a frame in a message. Raw bytes have frames too.
    pub(super) fn has_frames(&self) -> bool {
        !self.channels.frames.is_empty() || self.runs.values().any(|runs| runs.last.is_some())
    }

    /// Hands on the waiting runs at the end of the records.
    pub(super) fn end(&mut self) {
        for (bead, runs) in &mut self.runs {
            runs.release(*bead, &mut self.ready);
        }
    }

    /// Number of runs of one bead or of all, and number of those that are missing.
    pub(super) fn counts(&self, only: Option<u8>) -> (u64, u64) {
        let runs = self
            .runs
            .iter()
            .filter(|(bead, _)| only.is_none() || **bead == only);
        runs.fold((0, 0), |(count, missing), (_, runs)| {
            (count + runs.count, missing + runs.missing)
        })
    }
}

impl Runs {
    fn push(&mut self, head: Option<(u32, u64)>, data: &[u8]) {
        if let Some((number, _)) = head {
            let ahead = self
                .last
                .map_or(number, |last| number.wrapping_sub(last).wrapping_sub(1));
            if ahead < 1 << 31 {
                self.missing = self.missing.saturating_add(ahead.into());
            }
            self.last = Some(number);
        }
        self.count += 1;
        let mut run = Vec::with_capacity(data.len() + 1);
        run.extend_from_slice(data);
        // Older recordings have no delimiter after a run.
        if run.last() != Some(&0) {
            run.push(0);
        }
        self.held_bytes += run.len();
        self.held.push_back((head.map(|(_, log_time)| log_time), run));
    }

    fn release(&mut self, bead: Option<u8>, ready: &mut VecDeque<Piece>) {
        let are_received = self.are_received == Some(true);
        self.held_bytes = 0;
        ready.extend(self.held.drain(..).map(|(log_time, bytes)| Piece {
            bead,
            bytes,
            // Half of the greatest i64 is the year 2116. No clock shows a later time.
            received_ns: log_time.filter(|ns| are_received && *ns < i64::MAX as u64 / 2),
        }));
    }
}

/// The length of an attachment by its own fields, in bytes.
fn attachment_length(data: &[u8]) -> Option<u64> {
    let text_end = |at: usize| {
        let length = data.get(at..)?.first_chunk()?;
        at.checked_add(4)?
            .checked_add(u32::from_le_bytes(*length) as usize)
    };
    // Two times, then name and type.
    let at = text_end(text_end(8 + 8)?)?;
    let length = u64::from_le_bytes(*data.get(at..)?.first_chunk()?);
    // A CRC follows the data.
    length.checked_add(at as u64 + 8 + 4)
}
