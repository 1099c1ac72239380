//! What is found on the way through a recording.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use crate::recording::file::about::{About, Part};
use crate::recording::file::layout::{
    ENCODING, FIRST_CHANNEL, LONGEST_RUN, METADATA, RECEIVED, RECEIVED_ENCODING, TOPIC,
};
use crate::recording::file::records::{self, op};
use crate::recording::frames::Piece;

/// Greatest number of bytes in runs that wait for the time of their piece. A piece has up to 64 KiB and may
/// end a run that began before it.
const HELD_MOST: usize = 4 * LONGEST_RUN;

/// Channels that are named of a file that is not a bead's.
const TOPICS_MOST: usize = 12;

/// What is found on the way through a file.
#[derive(Default)]
pub(super) struct Found {
    pub(super) about: About,
    pub(super) parts: BTreeMap<Part, Vec<u8>>,
    pub(super) channel: Option<u16>,
    received_channel: Option<u16>,
    /// What wrote the file, and its first channels: to name a file that is not a bead's.
    made_by: String,
    topics: BTreeSet<String>,
    /// Channels of other programs' making.
    others: BTreeSet<u16>,
    /// Whether the records that come now are of a chunk whose CRC is wrong.
    pub(super) doubtful: bool,
    /// The number of the last message with bytes.
    last: Option<u32>,
    /// How many messages with bytes are missing, by their numbers.
    pub(super) missing: u64,
    /// Runs with their numbers that wait for their time, which follows them in the file.
    held: VecDeque<(u32, Vec<u8>)>,
    held_bytes: usize,
    /// Runs with their time.
    pub(super) ready: VecDeque<Piece>,
}

impl Found {
    /// Takes a record. False if it is not what a program would have written.
    pub(super) fn record(&mut self, opcode: u8, data: &[u8]) -> bool {
        self.read(opcode, data).is_some()
    }

    fn read(&mut self, opcode: u8, data: &[u8]) -> Option<()> {
        match opcode {
            op::HEADER => self.made_by = records::library(data)?.to_owned(),
            op::CHANNEL => match self.named(records::channel(data)?) {
                (id, TOPIC, ENCODING) => self.channel = Some(id),
                (id, RECEIVED, RECEIVED_ENCODING) => self.received_channel = Some(id),
                (id, ..) if !self.doubtful => {
                    self.others.insert(id);
                }
                _ => {}
            },
            op::MESSAGE => {
                let (channel, number, data) = records::message(data)?;
                if self.is_received(channel) {
                    self.time(data)?;
                } else if self.is_frames(channel) {
                    self.run(number, data);
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
                if let Some(part) = Part::ALL.into_iter().find(|part| part.name() == name) {
                    self.parts.insert(part, data.to_owned());
                }
            }
            _ => {}
        }
        Some(())
    }

    fn named<'a>(&mut self, channel: (u16, &'a str, &'a str)) -> (u16, &'a str, &'a str) {
        if self.topics.len() < TOPICS_MOST {
            self.topics.insert(channel.1.to_owned());
        }
        channel
    }

    /// What a file is that has no frames of a bead, for people.
    pub(super) fn stranger(&self) -> String {
        let topics: Vec<_> = self.topics.iter().map(|topic| format!("`{topic}`")).collect();
        let topics = match topics[..] {
            [] => "no channels".to_owned(),
            _ => format!("the channels {}", topics.join(", ")),
        };
        match self.made_by.as_str() {
            "" => topics,
            by => format!("{topics}, written by `{by}`"),
        }
    }

    /// Whether this channel has the bytes. Where the record that says so is damaged, it is the first channel, unless
    /// that is another's.
    pub(super) fn is_frames(&self, channel: u16) -> bool {
        self.channel == Some(channel) || channel == FIRST_CHANNEL && !self.others.contains(&channel)
    }

    /// Whether this channel has the times of receipt.
    pub(super) fn is_received(&self, channel: u16) -> bool {
        let second = FIRST_CHANNEL + 1;
        self.received_channel == Some(channel) || channel == second && !self.others.contains(&channel)
    }

    fn time(&mut self, data: &[u8]) -> Option<()> {
        let (last, received_ns) = data.split_first_chunk()?;
        let last = u32::from_le_bytes(*last);
        let received_ns = u64::from_le_bytes(received_ns.try_into().ok()?);
        // A time that no clock shows is none: ns since 1970 reach the year 2262 as i64.
        let received_ns = Some(received_ns).filter(|ns| *ns < i64::MAX as u64 / 2);
        // The time of a piece is the time of every run that ended in it: the runs after the last run of the
        // piece before.
        while self
            .held
            .front()
            .is_some_and(|(number, _)| last.wrapping_sub(*number) < 1 << 31)
        {
            self.release(received_ns);
        }
        Some(())
    }

    fn run(&mut self, number: u32, data: &[u8]) {
        let ahead = self
            .last
            .map_or(number, |last| number.wrapping_sub(last).wrapping_sub(1));
        if ahead < 1 << 31 {
            self.missing = self.missing.saturating_add(ahead.into());
        }
        self.last = Some(number);
        let mut run = Vec::with_capacity(data.len() + 1);
        run.extend_from_slice(data);
        run.push(0);
        self.held_bytes += run.len();
        self.held.push_back((number, run));
        // The file does not say when these were received.
        while self.held_bytes > HELD_MOST {
            self.release(None);
        }
    }

    fn release(&mut self, received_ns: Option<u64>) {
        if let Some((_, bytes)) = self.held.pop_front() {
            self.held_bytes -= bytes.len();
            self.ready.push_back(Piece { bytes, received_ns });
        }
    }

    /// No more records come.
    pub(super) fn end(&mut self) {
        while !self.held.is_empty() {
            self.release(None);
        }
    }
}
