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
//! When the host received them stands in a channel of its own, `received`: for each piece of bytes in which runs ended,
//! the number of the last of them (u32) and the host's time (u64, ns since 1970), little-endian. [`crate::recording::clock`] makes
//! of it how bead and host run against each other.
//!
//! **Crashes.** A recording is written as `NAME.partial` and takes its name when it is finished, so that what
//! bears the name is whole. What is written goes to the system in chunks, each complete, at least once a
//! second while bytes come; a recording cut short at any byte gives back every message before the cut, and
//! says that it was cut. The chunks are not compressed: frames are dense, and what is cut stays readable.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use bead_wire::{Arrival, Counters, Decoder, Message};
use mcap::records::{MessageHeader, Metadata, Record};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{Attachment, McapError, WriteOptions};

const TOPIC: &str = "frames";
const ENCODING: &str = "bead-wire";
const RECEIVED: &str = "received";
const RECEIVED_ENCODING: &str = "bead-received";
const METADATA: &str = "recording";
/// Bytes after which a chunk is closed: small, so that little is at stake, and much above a frame.
const CHUNK: u64 = 16 * 1024;
/// Longest time for which received bytes are held back from the system.
const FLUSH_EVERY: Duration = Duration::from_secs(1);
/// Bytes without a delimiter after which they are put away, so that a dead line cannot fill the memory.
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
        map.extend(
            self.firmware
                .clone()
                .map(|firmware| ("firmware".into(), firmware)),
        );
        map
    }

    fn from_map(mut map: BTreeMap<String, String>) -> Self {
        Self {
            source: map.remove("source").unwrap_or_default(),
            firmware: map.remove("firmware"),
            sample_rate_hz: map
                .remove("sample_rate_hz")
                .and_then(|hz| hz.parse().ok())
                .unwrap_or(0),
            notes: map,
        }
    }
}

/// What may be attached to a recording, each once.
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
    decoder: Decoder,
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
        let failed = |source| RecordingError::Write {
            path: partial.clone(),
            source,
        };
        let mut mcap = WriteOptions::new()
            .compression(None)
            .chunk_size(Some(CHUNK))
            // A chunk is written in one go: seeking back to complete it would leave half ones after a crash.
            .disable_seeking(true)
            .library(concat!("bead ", env!("CARGO_PKG_VERSION")))
            .create(BufWriter::new(file))
            .map_err(failed)?;
        mcap.write_metadata(&Metadata {
            name: METADATA.into(),
            metadata: about.to_map(),
        })
        .map_err(failed)?;
        let layout = BTreeMap::from([("version".into(), bead_wire::VERSION.to_string())]);
        let channel = mcap.add_channel(0, TOPIC, ENCODING, &layout).map_err(failed)?;
        let plain = BTreeMap::new();
        let received = mcap
            .add_channel(0, RECEIVED, RECEIVED_ENCODING, &plain)
            .map_err(failed)?;
        mcap.flush().map_err(failed)?;
        Ok(Self {
            path: path.to_owned(),
            partial,
            mcap,
            channel,
            received,
            run: Vec::new(),
            decoder: Decoder::new(),
            clock: Clock {
                sample_rate_hz: about.sample_rate_hz,
                ..Clock::default()
            },
            written: 0,
            flushed: Instant::now(),
        })
    }

    /// Attaches a part; those known beforehand are best attached first, so that a crash leaves them.
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
        let written = self.mcap.attach(&attachment);
        written.map_err(|source| self.failed(source))
    }

    /// Records bytes as received, the last of them at `received_ns`: the host's time in ns since 1970.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write_at(&mut self, bytes: &[u8], received_ns: u64) -> Result<(), RecordingError> {
        let before = self.written;
        self.write(bytes)?;
        if self.written == before {
            return Ok(());
        }
        let last = self.written.wrapping_sub(1);
        let header = MessageHeader {
            channel_id: self.received,
            sequence: last,
            log_time: self.clock.log,
            publish_time: self.clock.bead,
        };
        let data = [&last.to_le_bytes()[..], &received_ns.to_le_bytes()].concat();
        let written = self.mcap.write_to_known_channel(&header, &data);
        written.map_err(|source| self.failed(source))
    }

    /// Records bytes as received, in pieces of any length, without saying when.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&mut self, bytes: &[u8]) -> Result<(), RecordingError> {
        for &byte in bytes {
            if let Some(Ok(frame)) = self.decoder.push(byte) {
                if let Message::Identity(identity) = frame.message {
                    self.clock.sample_rate_hz = identity.sample_rate_hz;
                }
                self.clock.tick(frame.header.sample_index, frame.arrival);
            }
            if byte != 0 {
                self.run.push(byte);
            }
            if byte == 0 || self.run.len() == LONGEST_RUN {
                self.end_run()?;
            }
        }
        if self.flushed.elapsed() >= FLUSH_EVERY {
            self.flush()?;
        }
        Ok(())
    }

    fn end_run(&mut self) -> Result<(), RecordingError> {
        if self.run.is_empty() {
            return Ok(());
        }
        let header = MessageHeader {
            channel_id: self.channel,
            sequence: self.written,
            log_time: self.clock.log,
            publish_time: self.clock.bead,
        };
        let written = self.mcap.write_to_known_channel(&header, &self.run);
        self.written = self.written.wrapping_add(1);
        self.run.clear();
        written.map_err(|source| self.failed(source))
    }

    /// Hands all whole messages to the system: from here on, a crash of this program cannot lose them.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn flush(&mut self) -> Result<(), RecordingError> {
        self.flushed = Instant::now();
        let flushed = self.mcap.flush();
        flushed.map_err(|source| self.failed(source))
    }

    /// What was received so far, and what was not.
    pub fn counters(&self) -> &Counters {
        self.decoder.counters()
    }

    /// The name until the recording is finished.
    pub fn partial_path(&self) -> &Path {
        &self.partial
    }

    /// Completes the file and gives it its name, in the place of a file that had it.
    ///
    /// # Errors
    /// The file cannot be written or renamed; what is there stays under its temporary name.
    pub fn finish(mut self) -> Result<Counters, RecordingError> {
        self.end_run()?;
        if let Err(source) = self.mcap.finish() {
            return Err(self.failed(source));
        }
        let Self {
            path,
            partial,
            mcap,
            decoder,
            ..
        } = self;
        let file = mcap.into_inner().into_inner().map_err(|error| error.into_error());
        // On disk before it has its name: a power cut must not leave the name with nothing behind it.
        file.and_then(|file| file.sync_all())
            .map_err(|source| RecordingError::File {
                action: "write",
                path: partial.clone(),
                source,
            })?;
        fs::rename(&partial, &path).map_err(|source| RecordingError::File {
            action: "rename the recording to",
            path,
            source,
        })?;
        Ok(*decoder.counters())
    }

    fn failed(&self, source: McapError) -> RecordingError {
        RecordingError::Write {
            path: self.partial.clone(),
            source,
        }
    }
}

/// Creates `path` with `.partial`, or `.2.partial` and so on: what an earlier crash left is not touched.
fn create_partial(path: &Path) -> Result<(File, PathBuf), RecordingError> {
    let mut attempt = 1u32;
    loop {
        let mut partial = path.as_os_str().to_owned();
        partial.push(if attempt == 1 {
            ".partial".to_owned()
        } else {
            format!(".{attempt}.partial")
        });
        let partial = PathBuf::from(partial);
        match File::create_new(&partial) {
            Ok(file) => return Ok((file, partial)),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => attempt += 1,
            Err(source) => {
                return Err(RecordingError::File {
                    action: "create",
                    path: partial,
                    source,
                });
            }
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
        let time = u128::from(sample_index) * 1_000_000_000 / u128::from(self.sample_rate_hz.max(1));
        self.bead = if self.sample_rate_hz == 0 {
            0
        } else {
            u64::try_from(time).unwrap_or(u64::MAX)
        };
        self.log = self.log.max(self.reset.saturating_add(self.bead));
    }
}

/// Bytes between two delimiters, as received.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Run {
    /// Time of the recording, in nanoseconds; never runs back.
    pub log_time_ns: u64,
    /// Time of the bead since its reset, in nanoseconds.
    pub bead_time_ns: u64,
    /// When its last byte was received, host time in ns since 1970, if that was recorded.
    pub received_ns: Option<u64>,
    /// The bytes, delimiters not among them.
    pub bytes: Vec<u8>,
}

/// How much of a recording is there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum State {
    /// All of it.
    Whole,
    /// The file ends early: it was not finished, or not copied whole.
    CutShort {
        /// The runs are all there nevertheless: only the index behind them is not.
        runs_whole: bool,
    },
    /// Something in the file is not what was written; what follows it may be missing.
    Damaged(String),
}

/// A recording that was read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recording {
    /// What it is of.
    pub about: About,
    /// Its attachments.
    pub parts: BTreeMap<Part, Vec<u8>>,
    /// What was received, in order.
    pub runs: Vec<Run>,
    /// Whether this is all.
    pub state: State,
}

impl Recording {
    /// Reads all that can be read, of a whole file or of one cut short.
    ///
    /// # Errors
    /// The file cannot be read, or is no recording. One cut short or damaged is no error: see [`State`].
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        let file = fs::read(path).map_err(|source| RecordingError::File {
            action: "read",
            path: path.to_owned(),
            source,
        })?;
        if file.is_empty() {
            return Err(RecordingError::Empty(path.to_owned()));
        }
        if !file.starts_with(mcap::MAGIC) && !mcap::MAGIC.starts_with(&file) {
            return Err(RecordingError::NotMcap(path.to_owned()));
        }
        let mut collector = Collector::default();
        let state = collector.read(&file);
        if collector.channel.is_none() && state == State::Whole {
            return Err(RecordingError::NotOurs(path.to_owned()));
        }
        let Collector {
            about,
            parts,
            mut runs,
            numbers,
            received,
            ..
        } = collector;
        // A piece's time is that of every run that ended in it: of those after the last of the piece before.
        for (run, number) in runs.iter_mut().zip(numbers) {
            let piece = received.range(number..).next();
            run.received_ns = piece.map(|(_, received_ns)| *received_ns);
        }
        Ok(Self {
            about,
            parts,
            runs,
            state,
        })
    }

    /// The stream as received, for a decoder.
    pub fn stream(&self) -> Vec<u8> {
        let mut stream = Vec::with_capacity(self.runs.iter().map(|run| run.bytes.len() + 1).sum());
        for run in &self.runs {
            stream.extend_from_slice(&run.bytes);
            stream.push(0);
        }
        stream
    }

    /// One line that says what is missing, if anything is.
    pub fn warning(&self) -> Option<String> {
        let runs = self.runs.len();
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

/// What is found on the way through a file.
#[derive(Default)]
struct Collector {
    about: About,
    parts: BTreeMap<Part, Vec<u8>>,
    runs: Vec<Run>,
    /// Of each run.
    numbers: Vec<u32>,
    /// By the number of the last run of a piece, when the piece was received.
    received: BTreeMap<u32, u64>,
    channel: Option<u16>,
    received_channel: Option<u16>,
}

impl Collector {
    fn read(&mut self, file: &[u8]) -> State {
        // Chunks are taken whole and walked here, as one cut short must give what it has.
        let options = LinearReaderOptions::default()
            .with_emit_chunks(true)
            .with_validate_data_section_crc(true)
            .with_validate_summary_section_crc(true)
            .with_check_finishes_after_end_magic(true);
        let mut reader = LinearReader::new_with_options(options);
        let mut rest = file;
        // Where the record after the last whole one begins.
        let mut next = mcap::MAGIC.len();
        let (mut runs_whole, mut damage) = (false, None);
        loop {
            match reader.next_event() {
                None => break,
                Some(Ok(LinearReadEvent::ReadRequest(wanted))) => {
                    // A damaged length may want more than there is memory.
                    let (given, left) = rest.split_at(wanted.min(rest.len()));
                    reader.insert(given.len()).copy_from_slice(given);
                    reader.notify_read(given.len());
                    rest = left;
                }
                Some(Ok(LinearReadEvent::Record { opcode, data })) => {
                    next += RECORD_HEAD + data.len();
                    runs_whole |= opcode == mcap::records::op::DATA_END;
                    damage = damage.or(self.record(opcode, data).err());
                }
                Some(Err(McapError::UnexpectedEof)) => {
                    self.cut_chunk(file.get(next..).unwrap_or_default());
                    return damage.map_or(State::CutShort { runs_whole }, State::Damaged);
                }
                Some(Err(error)) => return State::Damaged(damage.unwrap_or(error.to_string())),
            }
        }
        damage.map_or(State::Whole, State::Damaged)
    }

    fn record(&mut self, opcode: u8, data: &[u8]) -> Result<(), String> {
        match mcap::parse_record(opcode, data).map_err(|error| error.to_string())? {
            Record::Chunk { header, .. } if !header.compression.is_empty() => {
                return Err(format!(
                    "chunks are compressed with {}: run `mcap decompress` on it",
                    header.compression
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
                self.received
                    .insert(u32::from_le_bytes(*last), u64::from_le_bytes(received_ns));
            }
            Record::Message { header, data } if Some(header.channel_id) == self.channel => {
                self.numbers.push(header.sequence);
                self.runs.push(Run {
                    log_time_ns: header.log_time,
                    bead_time_ns: header.publish_time,
                    received_ns: None,
                    bytes: data.into_owned(),
                });
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
            // It ends within a record: that is what being cut means.
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
    use bead_wire::{Header, Identity, MAX_FRAME, Settings, encode};
    use tempfile::TempDir;

    fn sent(boot: u8, sequence: u32, sample_index: u64, message: &Message<'_>) -> Vec<u8> {
        encode(
            &Header {
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

    fn identity(boot: u8) -> Vec<u8> {
        let identity = Identity {
            firmware: "0.1.0",
            git: "abc",
            uid: [1; 12],
            boot: boot.into(),
            reset_cause: 4,
            sample_rate_hz: 50_000,
            channels: 2,
        };
        sent(boot, 0, 0, &Message::Identity(identity))
    }

    /// Frames of two boots, noise between them, and the head of a frame at the end.
    fn stream(frames: u32) -> Vec<u8> {
        let mut stream = Vec::new();
        for boot in 0..2 {
            stream.extend(identity(boot));
            for n in 1..frames {
                // No two runs are alike: a test finds each in the file by its bytes.
                let block = [n.to_le_bytes().as_slice(), &[boot, 0xEE], &[n as u8; 40]].concat();
                stream.extend(sent(
                    boot,
                    n,
                    1000 * u64::from(n),
                    &Message::Settings(Settings { block: &block }),
                ));
            }
            stream.extend(b"noise\0");
        }
        stream.extend(
            &sent(
                1,
                frames,
                0,
                &Message::Settings(Settings { block: b"unfinished" }),
            )[..20],
        );
        stream
    }

    fn runs(stream: &[u8]) -> Vec<Vec<u8>> {
        stream
            .split(|&byte| byte == 0)
            .filter(|run| !run.is_empty())
            .map(<[u8]>::to_vec)
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
            writer.write(piece).unwrap();
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
            writer.write_at(piece, n).unwrap();
            expected.extend((before..writer.written).map(|_| Some(n)));
        }
        // What is never ended by a delimiter has no time.
        writer.finish().unwrap();
        expected.push(None);
        let recording = Recording::open(&path).unwrap();
        let found: Vec<_> = recording.runs.iter().map(|run| run.received_ns).collect();
        assert_eq!(found, expected);
        let (_folder, path, _) = recorded(&stream);
        let untimed = Recording::open(&path).unwrap();
        assert!(untimed.runs.iter().all(|run| run.received_ns.is_none()));
    }

    #[test]
    fn a_recording_gives_back_every_byte_between_delimiters() {
        let stream = stream(400);
        let (folder, path, _) = recorded(&stream);
        let recording = Recording::open(&path).unwrap();
        assert_eq!(recording.state, State::Whole);
        assert_eq!(recording.warning(), None);
        assert_eq!(recording.about, about());
        let bytes: Vec<_> = recording.runs.iter().map(|run| run.bytes.clone()).collect();
        assert_eq!(bytes, runs(&stream));
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
        let mut replayed = Decoder::new();
        replayed.feed(&Recording::open(&path).unwrap().stream(), |result| {
            again.extend(result.ok().map(|frame| frame.header));
        });
        assert_eq!(frames.len(), 100);
        assert_eq!(frames, again);
        assert_eq!(replayed.counters().lost, live.counters().lost);
    }

    #[test]
    fn times_are_sample_time_and_go_on_after_a_restart() {
        let (_folder, path, _) = recorded(&stream(3));
        let times: Vec<_> = Recording::open(&path)
            .unwrap()
            .runs
            .iter()
            .map(|run| (run.bead_time_ns / 1000, run.log_time_ns / 1000))
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
            assert!(
                recording.runs.iter().map(|run| &run.bytes).eq(&runs[..whole]),
                "cut at {cut}"
            );
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
        writer.write(&stream).unwrap();
        writer.flush().unwrap();
        // Read while it is written: what a crash would leave.
        let recording = Recording::open(writer.partial_path()).unwrap();
        assert_eq!(recording.state, State::CutShort { runs_whole: false });
        // The last run has no delimiter yet.
        assert_eq!(recording.runs.len(), runs(&stream).len() - 1);
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
        let lengths: Vec<_> = Recording::open(&path)
            .unwrap()
            .runs
            .iter()
            .map(|run| run.bytes.len())
            .collect();
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
