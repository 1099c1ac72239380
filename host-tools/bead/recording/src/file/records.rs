//! The records of a recording, up to where it is cut, and after damaged places.
//!
//! # Design
//! The mcap crate reads the records, with a limit on their lengths and the CRCs of data and index. The
//! records of a chunk are read if its CRC is right. A chunk that the file's end cuts is read up to the cut.
//!
//! After damage, frames are searched for, each of which has its own CRC ([`search`]). They are all that is
//! read of a chunk with a wrong CRC. After a damaged record length, the search ends at the next chunk, from
//! which the crate reads on. Each byte is thus read and searched once, whatever a file says, and memory is
//! two records.

use std::fmt;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{MAGIC, McapError};

use crate::file::contents::Contents;
use crate::file::error::RecordingError;
use crate::file::layout::RECORD_MOST;
use crate::file::search::{self, CHUNK_HEAD, FRAME_MOST};

/// Completeness of a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum State {
    /// All of it is there.
    Whole,
    /// The file ends early: it was not finished, or not copied whole.
    CutShort {
        /// True if all runs are there, and only the index after them is cut.
        runs_whole: bool,
    },
    /// Something in the file is not what was written.
    Damaged(Damage),
}

/// Damage of a file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Damage {
    /// Number of damaged places.
    pub places: u64,
    /// Offset of the first of them, in bytes.
    pub first: Option<u64>,
    /// Number of bytes in them that are not read.
    pub bytes: u64,
    /// The first other fault.
    pub other: Option<String>,
}

impl Damage {
    fn note(&mut self, other: &str) {
        self.other.get_or_insert_with(|| other.to_owned());
    }
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(first) = self.first {
            let places = match self.places {
                1 => format!("one place, at byte {first}"),
                places => format!("{places} places, the first at byte {first}"),
            };
            write!(f, "{} bytes in {places}, cannot be read", self.bytes)?;
        }
        let separator = if self.first.is_some() { "; " } else { "" };
        let other = self.other.as_ref();
        other.map_or(Ok(()), |other| write!(f, "{separator}{other}"))
    }
}

#[derive(Default)]
struct ChunkRecords {
    records: Vec<u8>,
    /// Offset of the next record.
    at: usize,
}

impl ChunkRecords {
    /// The next record: opcode and data. `None` if no whole one follows.
    fn next(&mut self) -> Option<(u8, &[u8])> {
        let rest = self.records.get(self.at..)?;
        let (&opcode, rest) = rest.split_first()?;
        let (length, rest) = rest.split_first_chunk()?;
        let data = rest.get(..usize::try_from(u64::from_le_bytes(*length)).ok()?)?;
        self.at += 1 + 8 + data.len();
        Some((opcode, data))
    }
}

pub(super) struct Records {
    file: BufReader<File>,
    length: u64,
    reader: LinearReader,
    /// Offset of the next record of the file.
    at: u64,
    /// Number of bytes that the reader has.
    fed: u64,
    chunk: Option<ChunkRecords>,
    /// Offset of the records of the chunk, if the end of the file cuts it.
    cut_chunk: Option<u64>,
    /// True after a chunk that is cut: only frames may follow.
    is_cut: bool,
    has_data_end: bool,
    has_footer: bool,
    damage: Damage,
    /// End of the last damaged place.
    damage_end: Option<u64>,
    is_ended: bool,
    /// State of what was read so far.
    pub(super) state: State,
    /// The compression of the chunks, if another program compressed them.
    pub(super) compression: Option<String>,
}

enum RecordStep {
    /// A record of the file was read.
    Record(u8, Vec<u8>),
    /// The record extends beyond the end of the file.
    Cut,
    Failed(McapError),
    End,
}

impl Records {
    /// # Errors
    /// The file cannot be read, is empty, or does not begin as a recording. The beginning may be `damaged`.
    pub(super) fn open(path: &Path, damaged: bool) -> Result<Self, RecordingError> {
        let failed = RecordingError::refused("read", path);
        let metadata = path.metadata().map_err(&failed)?;
        if !metadata.is_file() {
            let shown = path.display();
            return Err(RecordingError::Unfit(format!(
                "{shown} is a directory, a device or a pipe; give the file of a recording"
            )));
        }
        let length = metadata.len();
        if length == 0 {
            return Err(RecordingError::Empty(path.to_owned()));
        }
        let mut file = BufReader::new(File::open(path).map_err(&failed)?);
        let mut head = Vec::new();
        let read = file.by_ref().take(MAGIC.len() as u64).read_to_end(&mut head);
        read.and_then(|_| file.rewind()).map_err(failed)?;
        let is_begun = MAGIC.starts_with(&head);
        if !is_begun && !damaged {
            return Err(RecordingError::NotMcap(path.to_owned()));
        }
        let mut records = Self {
            file,
            length,
            reader: LinearReader::new_with_options(options().with_validate_data_section_crc(true)),
            at: 0,
            fed: 0,
            chunk: None,
            cut_chunk: None,
            is_cut: false,
            has_data_end: false,
            has_footer: false,
            damage: Damage::default(),
            damage_end: None,
            is_ended: false,
            state: State::Whole,
            compression: None,
        };
        if !is_begun {
            records.damage.note("the file does not begin like a recording");
            records
                .resume(MAGIC.len() as u64)
                .map_err(RecordingError::refused("read", path))?;
        }
        Ok(records)
    }

    /// Reads the next record of the file. Returns false at the end.
    pub(super) fn step(&mut self, contents: &mut Contents) -> bool {
        if self.is_ended {
            return false;
        }
        if let Err(error) = self.read(contents) {
            // The reason why reading stops matters more than an earlier fault.
            self.damage.other = Some(error.to_string());
            self.is_ended = true;
        }
        if self.is_ended {
            self.state = if self.damage != Damage::default() {
                State::Damaged(std::mem::take(&mut self.damage))
            } else if self.has_footer {
                State::Whole
            } else {
                let runs_whole = self.has_data_end;
                State::CutShort { runs_whole }
            };
        }
        !self.is_ended
    }

    fn read(&mut self, contents: &mut Contents) -> io::Result<()> {
        if let Some(chunk) = &mut self.chunk {
            match chunk.next() {
                // No chunk has attachments: a few of them could take all memory.
                Some((opcode @ (op::CHANNEL | op::MESSAGE), data)) => {
                    if contents.push(opcode, data).is_none() {
                        self.damage.note("a record in a chunk is damaged");
                    }
                }
                Some(_) => {}
                None => self.end_chunk(contents)?,
            }
            return Ok(());
        }
        match self.next()? {
            RecordStep::Record(opcode, data) => {
                let start = std::mem::replace(&mut self.at, self.fed);
                self.take(start, opcode, data, contents)
            }
            RecordStep::Cut if self.has_footer => {
                // The magic after the footer is cut.
                self.has_footer = false;
                self.end()
            }
            RecordStep::Cut => self.enter_cut_chunk(contents),
            RecordStep::Failed(McapError::BadDataCrc { .. }) => {
                self.damage.note("the CRC of the data is wrong");
                self.resume(self.at)
            }
            RecordStep::Failed(McapError::BadSummaryCrc { .. }) => {
                self.damage.note("the CRC of the index is wrong");
                self.end()
            }
            RecordStep::Failed(_) if self.has_footer => {
                self.damage.note("the file does not end like a recording");
                self.end()
            }
            RecordStep::Failed(_) => self.search(self.at, true, contents),
            RecordStep::End => {
                if self.fed < self.length {
                    self.damage.note("bytes follow the end of the recording");
                }
                if !self.has_data_end {
                    self.damage.note("the mark at the end of the data is missing");
                }
                self.end()
            }
        }
    }

    fn end(&mut self) -> io::Result<()> {
        self.is_ended = true;
        Ok(())
    }

    /// Notes a damaged place, and the number of its bytes that were read nevertheless.
    fn add_damage(&mut self, begin: u64, end: u64, found: u64) {
        self.damage.places += u64::from(self.damage_end != Some(begin));
        self.damage.first.get_or_insert(begin);
        self.damage.bytes += end.saturating_sub(begin).saturating_sub(found);
        self.damage_end = Some(end);
    }

    /// Gives the reader only the bytes of its next record, so that its place in the file is known.
    fn next(&mut self) -> io::Result<RecordStep> {
        loop {
            match self.reader.next_event() {
                None => return Ok(RecordStep::End),
                Some(Err(error)) => return Ok(RecordStep::Failed(error)),
                Some(Ok(LinearReadEvent::Record { opcode, data })) => {
                    return Ok(RecordStep::Record(opcode, data.to_vec()));
                }
                Some(Ok(LinearReadEvent::ReadRequest(wanted))) => {
                    if self.length - self.fed < wanted as u64 {
                        return Ok(RecordStep::Cut);
                    }
                    self.file.read_exact(self.reader.insert(wanted))?;
                    self.reader.notify_read(wanted);
                    self.fed += wanted as u64;
                }
            }
        }
    }

    /// Resumes with the record at this offset.
    fn resume(&mut self, at: u64) -> io::Result<()> {
        self.file.seek(SeekFrom::Start(at))?;
        self.reader = LinearReader::new_with_options(options().with_skip_start_magic(true));
        (self.at, self.fed) = (at, at.min(self.length));
        Ok(())
    }

    /// Takes the record that begins at `start`.
    fn take(&mut self, start: u64, opcode: u8, data: Vec<u8>, contents: &mut Contents) -> io::Result<()> {
        match opcode {
            op::CHUNK => self.enter_chunk(start, &data, contents),
            op::DATA_END => self.has_data_end = true,
            op::FOOTER => self.has_footer = true,
            op::HEADER..op::DATA_END | 0x80.. => {
                let is_sound = contents.push(opcode, &data).is_some();
                // A damaged length may swallow all that follows.
                let may_hide_frames = !(is_sound && matches!(opcode, op::MESSAGE | op::ATTACHMENT));
                let found = if may_hide_frames {
                    salvage(&data, contents)
                } else {
                    0
                };
                if !is_sound || found > 0 {
                    self.add_damage(start, self.fed, found);
                }
            }
            _ => return self.search(start, true, contents),
        }
        Ok(())
    }

    fn enter_chunk(&mut self, start: u64, data: &[u8], contents: &mut Contents) {
        let (is_sound, records) = match mcap::parse_record(op::CHUNK, data) {
            Ok(Record::Chunk {
                header,
                data: records,
            }) => {
                let compression = header.compression.as_str();
                let is_name =
                    compression.len() <= 16 && compression.bytes().all(|byte| byte.is_ascii_graphic());
                if !compression.is_empty() && is_name {
                    self.compression = Some(header.compression);
                    self.is_ended = true;
                    return;
                }
                let crc = header.uncompressed_crc;
                let is_sound = compression.is_empty()
                    && data.len() == CHUNK_HEAD - 9 + records.len()
                    && (crc == 0 || crc32fast::hash(&records) == crc);
                (is_sound, records.into_owned())
            }
            _ => (false, Vec::new()),
        };
        if is_sound {
            self.chunk = Some(ChunkRecords { records, at: 0 });
        } else {
            let found = salvage(data, contents);
            self.add_damage(start, self.fed, found);
        }
    }

    /// Reads a chunk that the end of the file cuts, or else searches the rest.
    fn enter_cut_chunk(&mut self, contents: &mut Contents) -> io::Result<()> {
        self.file.seek(SeekFrom::Start(self.at))?;
        let mut rest = Vec::new();
        self.file
            .by_ref()
            .take(RECORD_MOST as u64)
            .read_to_end(&mut rest)?;
        if self.is_cut || search::chunk_length(&rest).is_none() {
            return self.search(self.at, false, contents);
        }
        let records = rest.split_off(CHUNK_HEAD);
        self.cut_chunk = Some(self.at + CHUNK_HEAD as u64);
        self.is_cut = true;
        self.chunk = Some(ChunkRecords { records, at: 0 });
        Ok(())
    }

    fn end_chunk(&mut self, contents: &mut Contents) -> io::Result<()> {
        let Some(chunk) = self.chunk.take() else {
            return Ok(());
        };
        if let Some(begin) = self.cut_chunk.take() {
            return self.search(begin + chunk.at as u64, false, contents);
        }
        if chunk.at != chunk.records.len() {
            self.damage.note("a chunk ends within a record");
        }
        Ok(())
    }

    /// Searches the file from `start` for frames, up to the next chunk. If neither follows, the file is cut
    /// there, unless it `is_damaged`.
    fn search(&mut self, start: u64, is_damaged: bool, contents: &mut Contents) -> io::Result<()> {
        const BLOCK: usize = 1 << 20;
        let (mut window, mut at, mut found, mut block) = (Vec::new(), start, 0, 4096);
        self.file.seek(SeekFrom::Start(start))?;
        let chunk = loop {
            let read = self.file.by_ref().take(block as u64).read_to_end(&mut window)?;
            let mut done = window.len().saturating_sub(FRAME_MOST);
            let chunk = search::chunk(&window).filter(|_| !self.is_cut);
            for frame in search::frames(&window[..chunk.unwrap_or(window.len())]) {
                contents.push_frame(&frame);
                found += (frame.end - frame.start) as u64;
                done = done.max(frame.end);
            }
            if let Some(chunk) = chunk {
                break Some(at + chunk as u64);
            }
            if read < block {
                break None;
            }
            // A frame may extend beyond the window.
            window.drain(..done);
            at += done as u64;
            block = BLOCK.min(2 * block);
        };
        if is_damaged || found > 0 || chunk.is_some() {
            let end = chunk.unwrap_or(self.length);
            self.add_damage(start, end, found);
        }
        match chunk {
            Some(chunk) => self.resume(chunk),
            None => self.end(),
        }
    }
}

/// Takes the frames in these bytes, and returns the number of bytes of their messages.
fn salvage(bytes: &[u8], contents: &mut Contents) -> u64 {
    let taken = search::frames(bytes).map(|frame| {
        contents.push_frame(&frame);
        (frame.end - frame.start) as u64
    });
    taken.sum()
}

fn options() -> LinearReaderOptions {
    LinearReaderOptions::default()
        .with_emit_chunks(true)
        .with_validate_summary_section_crc(true)
        .with_record_length_limit(RECORD_MOST)
}
