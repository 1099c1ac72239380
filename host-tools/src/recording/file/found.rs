//! What is found on the way through a recording.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;

use crate::recording::file::about::{About, Origin, Part};
use crate::recording::file::layout::{
    ENCODING, FIRST_CHANNEL, LONGEST_RUN, METADATA, RECEIVED, RECEIVED_ENCODING, TOPIC, bead_of,
};
use crate::recording::file::records::{self, ChannelHead, op};
use crate::recording::frames::Piece;
use crate::tables::printable::{beginning, one_line};

/// Greatest number of bytes in runs that wait for the time of their piece. A piece has up to 64 KiB and may
/// end a run that began before it.
const HELD_MOST: usize = 4 * LONGEST_RUN;

/// Channels that are named of a file that is not a bead's, and the characters of a name.
const TOPICS_MOST: usize = 12;
const NAME_MOST: usize = 64;

/// The channels with bytes and with times of receipt, each with the address of its bead if it is one of
/// several.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Lanes {
    frames: BTreeMap<u16, Option<u8>>,
    received: BTreeMap<u16, Option<u8>>,
}

/// A bead's runs.
#[derive(Default)]
struct Runs {
    /// How many there are.
    count: u64,
    /// The number of the last.
    last: Option<u32>,
    /// How many are missing, by their numbers.
    missing: u64,
    /// Runs with their numbers that wait for their time, which follows them in the file.
    held: VecDeque<(u32, Vec<u8>)>,
    held_bytes: usize,
}

/// What is found of one bead among several.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct OfBead {
    pub(super) origin: Option<Origin>,
    pub(super) parts: BTreeMap<Part, Arc<[u8]>>,
}

/// What is found on the way through a file.
#[derive(Default)]
pub(super) struct Found {
    pub(super) about: About,
    /// Attached for all.
    pub(super) parts: BTreeMap<Part, Arc<[u8]>>,
    /// By address.
    pub(super) beads: BTreeMap<u8, OfBead>,
    pub(super) lanes: Lanes,
    /// What wrote the file, and its first channels: to name a file that is not a bead's.
    made_by: String,
    topics: BTreeSet<String>,
    /// Channels of other programs' making.
    others: BTreeSet<u16>,
    /// Channels with messages before they were known.
    passed_over: BTreeSet<u16>,
    /// Whether the records that come now are of a chunk whose CRC is wrong.
    pub(super) doubtful: bool,
    /// By the bead.
    runs: BTreeMap<Option<u8>, Runs>,
    /// Runs with their time.
    pub(super) ready: VecDeque<Piece>,
}

impl Found {
    /// With channels that are known beforehand.
    pub(super) fn knowing(lanes: Lanes) -> Self {
        Self {
            lanes,
            ..Self::default()
        }
    }

    /// Whether a channel of bytes was known only when some of its messages had passed: its record is damaged,
    /// and stands again in the index at the end.
    pub(super) fn knew_too_late(&self) -> bool {
        self.lanes
            .frames
            .keys()
            .any(|channel| self.passed_over.contains(channel))
    }

    /// Takes a record. False if it is not what a program would have written.
    pub(super) fn record(&mut self, opcode: u8, data: &[u8]) -> bool {
        self.read(opcode, data).is_some()
    }

    fn read(&mut self, opcode: u8, data: &[u8]) -> Option<()> {
        match opcode {
            op::HEADER => self.made_by = beginning(records::library(data)?, NAME_MOST).into_owned(),
            op::CHANNEL => self.channel(records::channel(data)?),
            op::MESSAGE => {
                let (channel, number, data) = records::message(data)?;
                if !self.lanes.frames.contains_key(&channel) {
                    self.passed_over.insert(channel);
                }
                if let Some(bead) = self.times_of(channel) {
                    self.time(bead, data)?;
                } else if let Some(bead) = self.frames_of(channel) {
                    self.run(bead, number, data);
                }
            }
            op::METADATA => {
                let (name, map) = records::metadata(data)?;
                if name == METADATA {
                    self.about = About::from_map(map);
                }
            }
            op::ATTACHMENT => {
                let (name, data) = records::attachment(data)?;
                let (bead, name) = bead_of(name);
                if let Some(part) = Part::ALL.into_iter().find(|part| part.name() == name) {
                    let parts = match bead {
                        Some(address) => &mut self.beads.entry(address).or_default().parts,
                        None => &mut self.parts,
                    };
                    parts.insert(part, data.into());
                }
            }
            _ => {}
        }
        Some(())
    }

    fn channel(&mut self, channel: ChannelHead<'_>) {
        if self.topics.len() < TOPICS_MOST {
            let topic = beginning(channel.topic, NAME_MOST);
            self.topics.insert(topic.into_owned());
        }
        let id = channel.id;
        match (bead_of(channel.topic), channel.encoding) {
            ((bead, TOPIC), ENCODING) => {
                self.lanes.frames.insert(id, bead);
                if let Some(address) = bead {
                    let origin = Origin::from_map(address, channel.metadata());
                    self.beads.entry(address).or_default().origin = Some(origin);
                }
            }
            ((bead, RECEIVED), RECEIVED_ENCODING) => {
                self.lanes.received.insert(id, bead);
            }
            _ if !self.doubtful => {
                self.others.insert(id);
            }
            _ => {}
        }
    }

    /// What a file is that has no frames of a bead, for people.
    pub(super) fn stranger(&self) -> String {
        let topics = self.topics.iter().map(|topic| one_line(topic));
        let topics: Vec<_> = topics.map(|topic| format!("`{topic}`")).collect();
        let topics = match topics[..] {
            [] => "no channels".to_owned(),
            _ => format!("the channels {}", topics.join(", ")),
        };
        match self.made_by.as_str() {
            "" => topics,
            by => format!("{topics}, written by `{}`", one_line(by)),
        }
    }

    /// Whether a channel with bytes was found.
    pub(super) fn has_frames(&self) -> bool {
        !self.lanes.frames.is_empty()
    }

    /// Whose bytes this channel has. Where the record that says so is damaged, the first channel has them,
    /// unless that is another's.
    pub(super) fn frames_of(&self, channel: u16) -> Option<Option<u8>> {
        let guess = (channel == FIRST_CHANNEL && !self.others.contains(&channel)).then_some(None);
        self.lanes.frames.get(&channel).copied().or(guess)
    }

    /// Whose times of receipt this channel has.
    pub(super) fn times_of(&self, channel: u16) -> Option<Option<u8>> {
        let second = FIRST_CHANNEL + 1;
        let guess =
            channel == second && !self.others.contains(&channel) && !self.lanes.frames.contains_key(&channel);
        self.lanes
            .received
            .get(&channel)
            .copied()
            .or(guess.then_some(None))
    }

    fn time(&mut self, bead: Option<u8>, data: &[u8]) -> Option<()> {
        let (last, received_ns) = data.split_first_chunk()?;
        let last = u32::from_le_bytes(*last);
        let received_ns = u64::from_le_bytes(received_ns.try_into().ok()?);
        // A time that no clock shows is none: ns since 1970 reach the year 2262 as i64.
        let received_ns = Some(received_ns).filter(|ns| *ns < i64::MAX as u64 / 2);
        let runs = self.runs.entry(bead).or_default();
        // The time of a piece is the time of every run that ended in it: the runs after the last run of the
        // piece before.
        while runs
            .held
            .front()
            .is_some_and(|(number, _)| last.wrapping_sub(*number) < 1 << 31)
        {
            self.ready.extend(runs.release(bead, received_ns));
        }
        Some(())
    }

    fn run(&mut self, bead: Option<u8>, number: u32, data: &[u8]) {
        let runs = self.runs.entry(bead).or_default();
        runs.push(number, data);
        // The file does not say when these were received.
        while runs.held_bytes > HELD_MOST {
            self.ready.extend(runs.release(bead, None));
        }
    }

    /// No more records come.
    pub(super) fn end(&mut self) {
        for (bead, runs) in &mut self.runs {
            while !runs.held.is_empty() {
                self.ready.extend(runs.release(*bead, None));
            }
        }
    }

    /// How many runs there are, of one bead or of all, and how many are missing.
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
    fn push(&mut self, number: u32, data: &[u8]) {
        let ahead = self
            .last
            .map_or(number, |last| number.wrapping_sub(last).wrapping_sub(1));
        if ahead < 1 << 31 {
            self.missing = self.missing.saturating_add(ahead.into());
        }
        self.count += 1;
        self.last = Some(number);
        let mut run = Vec::with_capacity(data.len() + 1);
        run.extend_from_slice(data);
        run.push(0);
        self.held_bytes += run.len();
        self.held.push_back((number, run));
    }

    fn release(&mut self, bead: Option<u8>, received_ns: Option<u64>) -> Option<Piece> {
        let (_, bytes) = self.held.pop_front()?;
        self.held_bytes -= bytes.len();
        Some(Piece {
            bead,
            bytes,
            received_ns,
        })
    }
}
