//! The records of a recording, and what is found in them.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

use mcap::McapError;
use mcap::records::{Channel, Record};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use crate::recording::file::about::{About, Part};
use crate::recording::file::chunk;
use crate::recording::file::error::RecordingError;
use crate::recording::file::layout::{ENCODING, LONGEST_RUN, METADATA, RECEIVED, RECEIVED_ENCODING, TOPIC};
use crate::recording::frames::Piece;

/// How much of a recording is there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum State {
    /// All of it.
    Whole,
    /// The file ends early: it was not finished, or not copied whole.
    CutShort {
        /// Whether all runs are there and only the index behind them is missing.
        runs_whole: bool,
    },
    /// Something in the file is not what was written; what follows it may be missing.
    Damaged(String),
}

/// Longest record that is read, in bytes: a damaged length must not fill the memory. Chunks are of some 16
/// KiB, and attachments much below this.
const RECORD_MOST: usize = 64 << 20;

/// A way through the records of a file.
pub(super) struct Walk {
    file: File,
    reader: LinearReader,
    /// Where the record after the last whole one begins.
    next: u64,
    runs_whole: bool,
    damage: Option<String>,
    /// State of what was read so far.
    pub(super) state: State,
    ended: bool,
}

impl Walk {
    pub(super) fn open(path: &Path) -> Result<Self, RecordingError> {
        let failed = RecordingError::refused("read", path);
        let mut file = File::open(path).map_err(&failed)?;
        let mut head = Vec::new();
        let magic = mcap::MAGIC.len() as u64;
        let read = file.by_ref().take(magic).read_to_end(&mut head);
        read.map_err(&failed)?;
        if head.is_empty() {
            return Err(RecordingError::Empty(path.to_owned()));
        }
        if !mcap::MAGIC.starts_with(&head) {
            return Err(RecordingError::NotMcap(path.to_owned()));
        }
        file.rewind().map_err(failed)?;
        // Chunks are taken whole and read here, as a cut chunk must give what it has.
        let options = LinearReaderOptions::default()
            .with_emit_chunks(true)
            .with_record_length_limit(RECORD_MOST)
            .with_validate_data_section_crc(true)
            .with_validate_summary_section_crc(true)
            .with_check_finishes_after_end_magic(true);
        Ok(Self {
            file,
            reader: LinearReader::new_with_options(options),
            next: magic,
            runs_whole: false,
            damage: None,
            state: State::Whole,
            ended: false,
        })
    }

    /// Reads one event; false at the end.
    pub(super) fn step(&mut self, found: &mut Found) -> bool {
        if self.ended {
            return false;
        }
        self.ended = true;
        match self.reader.next_event() {
            None => {}
            Some(Ok(LinearReadEvent::ReadRequest(wanted))) => {
                match self.file.read(self.reader.insert(wanted.min(RECORD_MOST))) {
                    Ok(length) => {
                        self.reader.notify_read(length);
                        self.ended = false;
                    }
                    Err(error) if error.kind() == io::ErrorKind::Interrupted => self.ended = false,
                    Err(error) => self.state = State::Damaged(error.to_string()),
                }
            }
            Some(Ok(LinearReadEvent::Record { opcode, data })) => {
                self.next += (RECORD_HEAD + data.len()) as u64;
                self.runs_whole |= opcode == mcap::records::op::DATA_END;
                if let Err(what) = found.record(opcode, data) {
                    self.damage.get_or_insert(what);
                }
                self.ended = false;
            }
            Some(Err(McapError::UnexpectedEof)) => {
                let mut tail = Vec::new();
                // What cannot be read counts as missing.
                let _ = self
                    .file
                    .seek(SeekFrom::Start(self.next))
                    .and_then(|_| self.file.by_ref().take(RECORD_MOST as u64).read_to_end(&mut tail));
                found.cut_chunk(&tail);
                let runs_whole = self.runs_whole;
                self.state = State::CutShort { runs_whole };
            }
            Some(Err(error)) => self.state = State::Damaged(error.to_string()),
        }
        if self.ended
            && let Some(what) = self.damage.take()
        {
            self.state = State::Damaged(what);
        }
        !self.ended
    }
}

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
    /// Runs with their numbers that wait for their time, which follows them in the file.
    held: VecDeque<(u32, Vec<u8>)>,
    held_bytes: usize,
    /// Runs with their time.
    pub(super) ready: VecDeque<Piece>,
}

impl Found {
    fn record(&mut self, opcode: u8, data: &[u8]) -> Result<(), String> {
        match mcap::parse_record(opcode, data).map_err(|error| error.to_string())? {
            Record::Header(header) => self.made_by = header.library,
            Record::Chunk { header, data } => {
                return self.records(&chunk::records(&header, &data, RECORD_MOST)?);
            }
            Record::Channel(channel) if self.topics.len() < TOPICS_MOST => {
                self.topics.insert(channel.topic.clone());
                self.channel(channel);
            }
            Record::Channel(channel) => self.channel(channel),
            Record::Message { header, data } if Some(header.channel_id) == self.received_channel => {
                let (last, received_ns) = data.split_first_chunk().ok_or("a receive time is too short")?;
                let received_ns = received_ns
                    .try_into()
                    .map_err(|_| "a receive time is of another length")?;
                let last = u32::from_le_bytes(*last);
                // The time of a piece is the time of every run that ended in it: the runs after the last run
                // of the piece before.
                let received_ns = Some(u64::from_le_bytes(received_ns));
                self.release(|number| last.wrapping_sub(number) < 1 << 31, received_ns);
            }
            Record::Message { header, data } if Some(header.channel_id) == self.channel => {
                let mut run = data.into_owned();
                run.push(0);
                self.held_bytes += run.len();
                self.held.push_back((header.sequence, run));
                // The file does not say when these were received.
                while self.held_bytes > HELD_MOST {
                    self.release_first(None);
                }
            }
            Record::Metadata(metadata) if metadata.name == METADATA => {
                self.about = About::from_map(metadata.metadata);
            }
            Record::Attachment { header, data, .. } => {
                if let Some(part) = Part::ALL.into_iter().find(|part| part.name() == header.name) {
                    self.parts.insert(part, data.into_owned());
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn channel(&mut self, channel: Channel) {
        match (channel.topic.as_str(), channel.message_encoding.as_str()) {
            (TOPIC, ENCODING) => self.channel = Some(channel.id),
            (RECEIVED, RECEIVED_ENCODING) => self.received_channel = Some(channel.id),
            _ => {}
        }
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

    /// Hands on the first waiting runs whose numbers are `wanted`.
    pub(super) fn release(&mut self, wanted: impl Fn(u32) -> bool, received_ns: Option<u64>) {
        while self.held.front().is_some_and(|(number, _)| wanted(*number)) {
            self.release_first(received_ns);
        }
    }

    fn release_first(&mut self, received_ns: Option<u64>) {
        if let Some((_, bytes)) = self.held.pop_front() {
            self.held_bytes -= bytes.len();
            self.ready.push_back(Piece { bytes, received_ns });
        }
    }

    /// The records in a chunk.
    fn records(&mut self, mut chunk: &[u8]) -> Result<(), String> {
        while !chunk.is_empty() {
            let (opcode, data, rest) = split_record(chunk).ok_or("a chunk ends within a record")?;
            if opcode == mcap::records::op::CHUNK {
                return Err("a chunk within a chunk".into());
            }
            self.record(opcode, data)?;
            chunk = rest;
        }
        Ok(())
    }

    /// The whole records of a chunk that the file ends in.
    fn cut_chunk(&mut self, tail: &[u8]) {
        let is_chunk = tail.first() == Some(&mcap::records::op::CHUNK);
        if let Some(records) = tail.get(RECORD_HEAD + CHUNK_HEAD..).filter(|_| is_chunk) {
            // The chunk ends within a record, as it is cut.
            let _ = self.records(records);
        }
    }
}

/// Opcode u8 and length u64 before each record.
const RECORD_HEAD: usize = 1 + 8;
/// Start and end time u64, size u64, CRC u32, an empty name u32 for no compression, size u64.
const CHUNK_HEAD: usize = 8 + 8 + 8 + 4 + 4 + 8;

/// Opcode and data of the record at the head of `bytes`, and what follows it.
fn split_record(bytes: &[u8]) -> Option<(u8, &[u8], &[u8])> {
    let (&opcode, rest) = bytes.split_first()?;
    let (length, rest) = rest.split_first_chunk()?;
    let (data, rest) = rest.split_at_checked(usize::try_from(u64::from_le_bytes(*length)).ok()?)?;
    Some((opcode, data, rest))
}
