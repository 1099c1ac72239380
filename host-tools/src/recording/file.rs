//! Recordings: what a bead sent, byte for byte, and what belongs to it, in one MCAP file.
//!
//! # Design
//! The channel `frames` has one message for each run of bytes between two delimiters, as received: sound
//! frames and corrupt ones alike, so that a recording can be decoded again by a better decoder. Beside it
//! stand a metadata record `recording` (see [`About`]) and attachments (see [`Part`]).
//!
//! **Times.** A message's publish time is the bead's own: sample index over sample rate, in nanoseconds. Its
//! log time is the same but never runs back: after a restart of the bead, whose index begins again, it goes
//! on from the last one. Bytes that are no frame have the time of the frame before them.
//!
//! A second channel, `received`, says when the host received the bytes: for each piece of bytes in which runs
//! ended, the number of the last run (u32) and the host's time (u64, ns since 1970), little-endian. From this
//! [`crate::recording::clock`] finds how the clocks of bead and host run against each other.
//!
//! **Crashes.** A recording is written as `NAME.partial` and takes its name when it is finished: a file with
//! that name is whole. The writer gives complete chunks to the system, at least once a second while bytes
//! come. A recording cut short at any byte gives back every message before the cut, and says that it was cut.
//! The chunks are not compressed, as frames are dense and a cut chunk must stay readable.

use std::collections::{BTreeMap, VecDeque};
use std::fs::{self, File};
use std::io::{self, BufWriter, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use bead_wire::{Arrival, Counters, Message};
use mcap::records::{MessageHeader, Metadata, Record};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{Attachment, McapError, WriteOptions};

use crate::recording::frames::{Frames, Item, Piece, Reader};

const TOPIC: &str = "frames";
const ENCODING: &str = "bead-wire";
const RECEIVED: &str = "received";
const RECEIVED_ENCODING: &str = "bead-received";
const METADATA: &str = "recording";
/// Bytes after which a chunk is closed: few, so that little is lost in a crash, and many more than a frame
/// has.
const CHUNK: u64 = 16 * 1024;
/// Longest time for which received bytes wait before they go to the system.
const FLUSH_EVERY: Duration = Duration::from_secs(1);
/// Bytes without a delimiter after which they are written as a run, so that a dead line cannot fill the
/// memory.
const LONGEST_RUN: usize = 64 * 1024;

/// What a recording is of.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct About {
    /// Where the bytes came from: a port, or the emulator.
    pub source: String,
    /// Build id or git description of the firmware's ELF, where it is known.
    pub firmware: Option<String>,
    /// Scans a second, in hertz, until an identity frame says otherwise; with 0 times are 0 until then.
    pub sample_rate_hz: u32,
    /// Anything else worth keeping, by name.
    pub notes: BTreeMap<String, String>,
}

impl About {
    fn to_map(&self) -> BTreeMap<String, String> {
        let mut map = self.notes.clone();
        map.insert("source".into(), self.source.clone());
        map.insert("sample_rate_hz".into(), self.sample_rate_hz.to_string());
        let firmware = self.firmware.clone();
        map.extend(firmware.map(|firmware| ("firmware".into(), firmware)));
        map
    }

    fn from_map(mut map: BTreeMap<String, String>) -> Self {
        let rate = map.remove("sample_rate_hz").and_then(|hz| hz.parse().ok());
        Self {
            source: map.remove("source").unwrap_or_default(),
            firmware: map.remove("firmware"),
            sample_rate_hz: rate.unwrap_or(0),
            notes: map,
        }
    }
}

/// What may be attached to a recording, each part once.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Part {
    /// The settings block that the bead was given.
    Settings,
    /// The scenario, as its author wrote it.
    Scenario,
    /// What the emulator measured of the run, JSON.
    EmulatorReport,
    /// What the full chain says of the strike, JSON.
    Truth,
}

impl Part {
    const ALL: [Self; 4] = [Self::Settings, Self::Scenario, Self::EmulatorReport, Self::Truth];

    /// Its name in the file.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Settings => "settings.bin",
            Self::Scenario => "scenario.toml",
            Self::EmulatorReport => "emulator.json",
            Self::Truth => "truth.json",
        }
    }

    const fn media_type(self) -> &'static str {
        match self {
            Self::Settings => "application/octet-stream",
            Self::Scenario => "application/toml",
            Self::EmulatorReport | Self::Truth => "application/json",
        }
    }
}

/// Why a recording cannot be written or read.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The system refused.
    #[error("cannot {action} {path}: {source}")]
    File {
        /// What was tried.
        action: &'static str,
        /// On what.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The file could not be written as MCAP.
    #[error("cannot write {path}: {source}")]
    Write {
        /// The file.
        path: PathBuf,
        /// What the library said.
        source: McapError,
    },
    /// Nothing is in the file.
    #[error("{0} is empty: the recording was stopped before anything was written; record again")]
    Empty(PathBuf),
    /// The file is something else.
    #[error("{0} is not an MCAP file; give a recording made by `bead record` or `bead emulate`")]
    NotMcap(PathBuf),
    /// An MCAP file, but not of a bead.
    #[error(
        "{0} is an MCAP file without a channel `frames`; give one made by `bead record` or `bead emulate`"
    )]
    NotOurs(PathBuf),
    /// A recording without a strike: a check has nothing to check.
    #[error("{path}: no strike among its {frames} frames, so there is nothing to check; record one")]
    NoStrike {
        /// The file.
        path: PathBuf,
        /// Frames in it.
        frames: u64,
    },
    /// A recording without a strike that this program can read.
    #[error("{path}: {who}")]
    FromTheFuture {
        /// The file.
        path: PathBuf,
        /// Who sent it, and what to do.
        who: String,
    },
    /// Clocks of these recordings cannot be compared.
    #[error("{0}")]
    Clock(String),
    /// An attachment that this version did not write.
    #[error("{path}: cannot read its {part}; record it again: {source}")]
    Part {
        /// The file.
        path: PathBuf,
        /// Name of the attachment.
        part: &'static str,
        /// What is wrong with it.
        source: serde_json::Error,
    },
}

impl RecordingError {
    /// The system refused to do `action` on `path`.
    fn refused(action: &'static str, path: &Path) -> impl Fn(io::Error) -> Self {
        move |source| Self::File {
            action,
            path: path.to_owned(),
            source,
        }
    }

    /// The library failed to write `path`.
    fn unwritten(path: &Path) -> impl Fn(McapError) -> Self {
        move |source| Self::Write {
            path: path.to_owned(),
            source,
        }
    }
}

/// Writes a recording while it comes.
///
/// Dropped before [`finish`](Self::finish), it leaves a readable file under its temporary name.
pub struct Writer {
    path: PathBuf,
    partial: PathBuf,
    mcap: mcap::Writer<BufWriter<File>>,
    channel: u16,
    received: u16,
    run: Vec<u8>,
    reader: Reader,
    clock: Clock,
    written: u32,
    flushed: Instant,
}

impl Writer {
    /// Begins a recording that will be called `path`.
    ///
    /// # Errors
    /// The directory cannot be written to.
    pub fn create(path: &Path, about: &About) -> Result<Self, RecordingError> {
        let (file, partial) = create_partial(path)?;
        let failed = RecordingError::unwritten(&partial);
        let mut mcap = WriteOptions::new()
            .compression(None)
            .chunk_size(Some(CHUNK))
            // A chunk is written in one go: seeking back to complete it would leave half ones after a crash.
            .disable_seeking(true)
            .library(concat!("bead ", env!("CARGO_PKG_VERSION")))
            .create(BufWriter::new(file))
            .map_err(&failed)?;
        let mut begin = || {
            mcap.write_metadata(&Metadata {
                name: METADATA.into(),
                metadata: about.to_map(),
            })?;
            let layout = BTreeMap::from([("version".into(), bead_wire::VERSION.to_string())]);
            let channel = mcap.add_channel(0, TOPIC, ENCODING, &layout)?;
            let received = mcap.add_channel(0, RECEIVED, RECEIVED_ENCODING, &BTreeMap::new())?;
            mcap.flush()?;
            Ok((channel, received))
        };
        let (channel, received) = begin().map_err(failed)?;
        Ok(Self {
            path: path.to_owned(),
            partial,
            mcap,
            channel,
            received,
            run: Vec::new(),
            reader: Reader::default(),
            clock: Clock {
                sample_rate_hz: about.sample_rate_hz,
                ..Clock::default()
            },
            written: 0,
            flushed: Instant::now(),
        })
    }

    /// Attaches a part. Parts that are known beforehand should be attached first, so that they survive a
    /// crash.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn attach(&mut self, part: Part, data: &[u8]) -> Result<(), RecordingError> {
        let attachment = Attachment {
            log_time: self.clock.log,
            create_time: 0,
            name: part.name().into(),
            media_type: part.media_type().into(),
            data: data.into(),
        };
        self.mcap
            .attach(&attachment)
            .map_err(RecordingError::unwritten(&self.partial))
    }

    /// Records bytes as received, the last of them at `received_ns`, the host's time in ns since 1970, if it
    /// is known. Hands on the frames and the rejects in them.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(
        &mut self,
        bytes: &[u8],
        received_ns: Option<u64>,
        mut sink: impl FnMut(Item),
    ) -> Result<(), RecordingError> {
        let before = self.written;
        for byte in bytes {
            let Self { reader, clock, .. } = self;
            reader.feed(std::slice::from_ref(byte), received_ns, |item| {
                if let Item::Frame(frame) = &item {
                    if let Message::Identity(identity) = &frame.message {
                        clock.sample_rate_hz = identity.sample_rate_hz;
                    }
                    clock.tick(frame.header.sample_index, frame.arrival);
                }
                sink(item);
            });
            if *byte != 0 {
                self.run.push(*byte);
            }
            if *byte == 0 || self.run.len() == LONGEST_RUN {
                self.end_run()?;
            }
        }
        if let Some(received_ns) = received_ns.filter(|_| self.written != before) {
            self.write_time(received_ns)?;
        }
        if self.flushed.elapsed() >= FLUSH_EVERY {
            self.flush()?;
        }
        Ok(())
    }

    /// Records when the piece with the end of the last run was received.
    fn write_time(&mut self, received_ns: u64) -> Result<(), RecordingError> {
        let last = self.written.wrapping_sub(1);
        let data = [&last.to_le_bytes()[..], &received_ns.to_le_bytes()].concat();
        self.message(self.received, last, &data)
    }

    fn end_run(&mut self) -> Result<(), RecordingError> {
        if self.run.is_empty() {
            return Ok(());
        }
        let run = std::mem::take(&mut self.run);
        let number = self.written;
        self.written = number.wrapping_add(1);
        self.message(self.channel, number, &run)
    }

    fn message(&mut self, channel_id: u16, sequence: u32, data: &[u8]) -> Result<(), RecordingError> {
        let header = MessageHeader {
            channel_id,
            sequence,
            log_time: self.clock.log,
            publish_time: self.clock.bead,
        };
        self.mcap
            .write_to_known_channel(&header, data)
            .map_err(RecordingError::unwritten(&self.partial))
    }

    /// Gives all whole messages to the system. After that a crash of this program cannot lose them.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn flush(&mut self) -> Result<(), RecordingError> {
        self.flushed = Instant::now();
        self.mcap
            .flush()
            .map_err(RecordingError::unwritten(&self.partial))
    }

    /// Counts of what was received so far, and of what was lost.
    pub fn counters(&self) -> &Counters {
        self.reader.counters()
    }

    /// The name until the recording is finished.
    pub fn partial_path(&self) -> &Path {
        &self.partial
    }

    /// Completes the file and gives it its name. It replaces a file of that name.
    ///
    /// # Errors
    /// The file cannot be written or renamed; what is there stays under its temporary name.
    pub fn finish(mut self) -> Result<Counters, RecordingError> {
        self.end_run()?;
        let finished = self.mcap.finish();
        finished.map_err(RecordingError::unwritten(&self.partial))?;
        let file = self.mcap.into_inner().into_inner();
        // The file must be on disk before it has its name: after a power cut no name may stand for an empty
        // file.
        file.map_err(|error| error.into_error())
            .and_then(|file| file.sync_all())
            .map_err(RecordingError::refused("write", &self.partial))?;
        fs::rename(&self.partial, &self.path)
            .map_err(RecordingError::refused("rename the recording to", &self.path))?;
        Ok(*self.reader.counters())
    }
}

/// Creates `path` with `.partial`, or `.2.partial` and so on. A file that an earlier crash left is not
/// touched.
fn create_partial(path: &Path) -> Result<(File, PathBuf), RecordingError> {
    let mut attempt = 1u32;
    loop {
        let mut partial = path.as_os_str().to_owned();
        match attempt {
            1 => partial.push(".partial"),
            _ => partial.push(format!(".{attempt}.partial")),
        }
        let partial = PathBuf::from(partial);
        match File::create_new(&partial) {
            Ok(file) => return Ok((file, partial)),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => attempt += 1,
            Err(error) => return Err(RecordingError::refused("create", &partial)(error)),
        }
    }
}

/// Times of the messages, in nanoseconds.
#[derive(Clone, Copy, Debug, Default)]
struct Clock {
    sample_rate_hz: u32,
    /// Of the bead since its reset.
    bead: u64,
    /// Of the recording.
    log: u64,
    /// Log time at the bead's reset.
    reset: u64,
}

impl Clock {
    fn tick(&mut self, sample_index: u64, arrival: Arrival) {
        if let Arrival::Restart { .. } = arrival {
            self.reset = self.log;
        }
        let ns = u128::from(sample_index) * 1_000_000_000;
        let time = ns.checked_div(u128::from(self.sample_rate_hz)).unwrap_or(0);
        self.bead = u64::try_from(time).unwrap_or(u64::MAX);
        self.log = self.log.max(self.reset.saturating_add(self.bead));
    }
}

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
            return Err(RecordingError::NotOurs(path.to_owned()));
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
    fn open(path: &Path) -> Result<Self, RecordingError> {
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

/// Longest record that is read, in bytes: a damaged length must not fill the memory. Chunks are of some 16
/// KiB, and attachments much below this.
const RECORD_MOST: usize = 64 << 20;

/// A way through the records of a file.
struct Walk {
    file: File,
    reader: LinearReader,
    /// Where the record after the last whole one begins.
    next: u64,
    runs_whole: bool,
    damage: Option<String>,
    /// State of what was read so far.
    state: State,
    ended: bool,
}

impl Walk {
    fn open(path: &Path) -> Result<Self, RecordingError> {
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
    fn step(&mut self, found: &mut Found) -> bool {
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

/// What is found on the way through a file.
#[derive(Default)]
struct Found {
    about: About,
    parts: BTreeMap<Part, Vec<u8>>,
    channel: Option<u16>,
    received_channel: Option<u16>,
    /// Runs with their numbers that wait for their time, which follows them in the file.
    held: VecDeque<(u32, Vec<u8>)>,
    held_bytes: usize,
    /// Runs with their time.
    ready: VecDeque<Piece>,
}

impl Found {
    fn record(&mut self, opcode: u8, data: &[u8]) -> Result<(), String> {
        match mcap::parse_record(opcode, data).map_err(|error| error.to_string())? {
            Record::Chunk { header, .. } if !header.compression.is_empty() => {
                let by = header.compression;
                return Err(format!(
                    "chunks are compressed with {by}: run `mcap decompress` on it"
                ));
            }
            Record::Chunk { data, .. } => return self.records(&data),
            Record::Channel(channel) if channel.topic == TOPIC => self.channel = Some(channel.id),
            Record::Channel(channel) if channel.topic == RECEIVED => self.received_channel = Some(channel.id),
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

    /// Hands on the first waiting runs whose numbers are `wanted`.
    fn release(&mut self, wanted: impl Fn(u32) -> bool, received_ns: Option<u64>) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use bead_wire::{Block, Decoder, Header, Identity, MAX_FRAME, ResetCauses, Settings, encode};
    use tempfile::TempDir;

    fn sent(boot: u8, sequence: u32, sample_index: u64, message: &Message) -> Vec<u8> {
        encode(
            &Header {
                address: 0,
                boot,
                sequence,
                sample_index,
            },
            message,
            &mut [0; MAX_FRAME],
        )
        .unwrap()
        .to_vec()
    }

    fn settings(block: &[u8]) -> Message {
        let block = Block::try_from(block).unwrap();
        Settings { block }.into()
    }

    fn identity(boot: u8) -> Vec<u8> {
        let identity = Identity {
            firmware: "0.1.0".into(),
            git: "abc".into(),
            uid: [1; 12],
            boot: boot.into(),
            reset_cause: ResetCauses::from_bits(4),
            sample_rate_hz: 50_000,
            channels: 2,
        };
        sent(boot, 0, 0, &identity.into())
    }

    /// Frames of two boots, noise between them, and the head of a frame at the end.
    fn stream(frames: u32) -> Vec<u8> {
        let mut stream = Vec::new();
        for boot in 0..2 {
            stream.extend(identity(boot));
            for n in 1..frames {
                // No two runs are alike: a test finds each in the file by its bytes.
                let block = [n.to_le_bytes().as_slice(), &[boot, 0xEE], &[n as u8; 40]].concat();
                stream.extend(sent(boot, n, 1000 * u64::from(n), &settings(&block)));
            }
            stream.extend(b"noise\0");
        }
        stream.extend(&sent(1, frames, 0, &settings(b"unfinished"))[..20]);
        stream
    }

    fn runs(stream: &[u8]) -> Vec<Vec<u8>> {
        stream
            .split(|&byte| byte == 0)
            .filter(|run| !run.is_empty())
            .map(<[u8]>::to_vec)
            .collect()
    }

    /// The runs in a recording, without their delimiters.
    fn kept(path: &Path) -> Vec<Vec<u8>> {
        let pieces = Pieces::open(path).unwrap();
        pieces
            .map(|piece| {
                let (end, run) = piece.bytes.split_last().unwrap();
                assert_eq!(*end, 0);
                run.to_vec()
            })
            .collect()
    }

    fn about() -> About {
        About {
            source: "pty".into(),
            firmware: Some("v0.1.0-3-gabc".into()),
            sample_rate_hz: 100_000,
            notes: BTreeMap::from([("bead".into(), "8".into())]),
        }
    }

    /// A finished recording of `stream`, its folder, and its bytes.
    fn recorded(stream: &[u8]) -> (TempDir, PathBuf, Vec<u8>) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("strike.mcap");
        let mut writer = Writer::create(&path, &about()).unwrap();
        writer.attach(Part::Scenario, b"title = \"x\"").unwrap();
        for piece in stream.chunks(33) {
            writer.write(piece, None, |_| {}).unwrap();
        }
        writer.attach(Part::EmulatorReport, b"{}").unwrap();
        writer.finish().unwrap();
        let file = fs::read(&path).unwrap();
        (folder, path, file)
    }

    #[test]
    fn every_run_has_the_time_of_the_piece_that_it_ended_in() {
        let stream = stream(50);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("timed.mcap");
        let mut writer = Writer::create(&path, &about()).unwrap();
        let mut expected = Vec::new();
        for (n, piece) in (1_700_000_000_000_000_000..).zip(stream.chunks(97)) {
            let before = writer.written;
            writer.write(piece, Some(n), |_| {}).unwrap();
            expected.extend((before..writer.written).map(|_| Some(n)));
        }
        // What is never ended by a delimiter has no time.
        writer.finish().unwrap();
        expected.push(None);
        let found: Vec<_> = Pieces::open(&path)
            .unwrap()
            .map(|piece| piece.received_ns)
            .collect();
        assert_eq!(found, expected);
        let (_folder, path, _) = recorded(&stream);
        assert!(
            Pieces::open(&path)
                .unwrap()
                .all(|piece| piece.received_ns.is_none())
        );
    }

    #[test]
    fn a_recording_gives_back_every_byte_between_delimiters() {
        let stream = stream(400);
        let (folder, path, _) = recorded(&stream);
        let recording = Recording::open(&path).unwrap();
        assert_eq!(recording.state, State::Whole);
        assert_eq!(recording.warning(), None);
        assert_eq!(recording.about, about());
        assert_eq!(kept(&path), runs(&stream));
        assert_eq!(recording.runs, runs(&stream).len() as u64);
        assert_eq!(recording.parts[&Part::Scenario], b"title = \"x\"");
        assert_eq!(recording.parts[&Part::EmulatorReport], b"{}");
        assert!(!recording.parts.contains_key(&Part::Truth));
        let left: Vec<_> = fs::read_dir(folder.path()).unwrap().collect();
        assert_eq!(left.len(), 1, "only the finished file is left: {left:?}");
    }

    #[test]
    fn what_is_decoded_from_a_recording_is_what_was_decoded_live() {
        let stream = stream(50);
        let (_folder, path, _) = recorded(&stream);
        let mut live = Decoder::new();
        let (mut frames, mut again) = (Vec::new(), Vec::new());
        live.feed(&stream, |result| {
            frames.extend(result.ok().map(|frame| frame.header))
        });
        let mut replayed = Recording::open(&path).unwrap().frames().unwrap();
        again.extend(
            replayed
                .by_ref()
                .filter_map(Item::frame)
                .map(|frame| frame.header),
        );
        assert_eq!(frames.len(), 100);
        assert_eq!(frames, again);
        assert_eq!(replayed.counters().lost, live.counters().lost);
    }

    #[test]
    fn times_are_sample_time_and_go_on_after_a_restart() {
        let (_folder, _, file) = recorded(&stream(3));
        let messages = mcap::MessageStream::new(&file).unwrap().map(Result::unwrap);
        let times: Vec<_> = messages
            .filter(|message| message.channel.topic == TOPIC)
            .map(|message| (message.publish_time / 1000, message.log_time / 1000))
            .collect();
        // 50 kHz as the identity says, not the 100 kHz that was expected: 20 ms for 1000 samples.
        let boot = [(0, 0), (20_000, 20_000), (40_000, 40_000), (40_000, 40_000)];
        let restarted = [
            (0, 40_000),
            (20_000, 60_000),
            (40_000, 80_000),
            (40_000, 80_000),
            (40_000, 80_000),
        ];
        assert_eq!(times, [&boot[..], &restarted[..]].concat());
    }

    #[test]
    fn a_recording_cut_anywhere_gives_back_all_before_the_cut_and_says_so() {
        let stream = stream(200);
        let (_folder, path, file) = recorded(&stream);
        let runs = runs(&stream);
        // Where each message ends in the file: the bytes are stored as they are.
        let mut from = 0;
        let ends: Vec<_> = runs
            .iter()
            .map(|run| {
                let at = file[from..]
                    .windows(run.len())
                    .position(|window| window == run)
                    .unwrap();
                from += at + run.len();
                from
            })
            .collect();
        assert!(file.len() > 2 * CHUNK as usize, "several chunks are cut");
        for cut in (1..file.len()).step_by(37).chain([file.len() - 1]) {
            fs::write(&path, &file[..cut]).unwrap();
            let recording = Recording::open(&path).unwrap();
            let whole = ends.iter().filter(|&&end| end <= cut).count();
            assert_eq!(kept(&path), runs[..whole], "cut at {cut}");
            let State::CutShort { runs_whole } = recording.state else {
                panic!("cut at {cut}: {:?}", recording.state)
            };
            assert!(!runs_whole || whole == runs.len());
            assert!(recording.warning().unwrap().contains(&whole.to_string()));
        }
    }

    #[test]
    fn a_recording_cut_in_its_index_has_lost_no_frame() {
        let (_folder, path, file) = recorded(&stream(20));
        fs::write(&path, &file[..file.len() - 1]).unwrap();
        assert_eq!(
            Recording::open(&path).unwrap().state,
            State::CutShort { runs_whole: true }
        );
    }

    #[test]
    fn a_damaged_byte_anywhere_is_noticed_and_survived() {
        let (_folder, path, file) = recorded(&stream(30));
        for at in mcap::MAGIC.len()..file.len() {
            let mut damaged = file.clone();
            damaged[at] ^= 0x55;
            fs::write(&path, &damaged).unwrap();
            match Recording::open(&path) {
                Ok(recording) => assert_ne!(recording.state, State::Whole, "byte {at}"),
                Err(error) => panic!("byte {at}: {error}"),
            }
        }
    }

    #[test]
    fn an_unfinished_recording_is_readable_and_does_not_bear_the_name() {
        let stream = stream(30);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("strike.mcap");
        let mut writer = Writer::create(&path, &about()).unwrap();
        writer.write(&stream, None, |_| {}).unwrap();
        writer.flush().unwrap();
        // Read while it is written: what a crash would leave.
        let recording = Recording::open(writer.partial_path()).unwrap();
        assert_eq!(recording.state, State::CutShort { runs_whole: false });
        // The last run has no delimiter yet.
        assert_eq!(recording.runs, runs(&stream).len() as u64 - 1);
        assert!(!path.exists());
    }

    #[test]
    fn what_a_crash_left_is_not_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("strike.mcap");
        let crashed = Writer::create(&path, &about()).unwrap();
        let next = Writer::create(&path, &about()).unwrap();
        assert_ne!(crashed.partial_path(), next.partial_path());
        next.finish().unwrap();
        assert!(crashed.partial_path().exists() && path.exists());
    }

    #[test]
    fn a_line_without_delimiters_is_recorded_in_pieces() {
        let (_folder, path, _) = recorded(&vec![1; 2 * LONGEST_RUN + 5]);
        let lengths: Vec<_> = kept(&path).iter().map(Vec::len).collect();
        assert_eq!(lengths, [LONGEST_RUN, LONGEST_RUN, 5]);
    }

    #[test]
    fn other_files_are_refused_by_what_they_are() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("other");
        let refused = |bytes: &[u8]| {
            fs::write(&path, bytes).unwrap();
            Recording::open(&path).unwrap_err()
        };
        assert!(matches!(refused(b""), RecordingError::Empty(_)));
        assert!(matches!(
            refused(b"time,force\n0,1\n"),
            RecordingError::NotMcap(_)
        ));
        let mut foreign = mcap::Writer::new(io::Cursor::new(Vec::new())).unwrap();
        foreign.finish().unwrap();
        assert!(matches!(
            refused(&foreign.into_inner().into_inner()),
            RecordingError::NotOurs(_)
        ));
        fs::remove_file(&path).unwrap();
        assert!(matches!(
            Recording::open(&path),
            Err(RecordingError::File { action: "read", .. })
        ));
    }
}
