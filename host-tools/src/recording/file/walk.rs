//! A way through the records of a file, around what is damaged.
//!
//! # Design
//! Records follow one another, and the records of a chunk that is not compressed lie in it as they are: the
//! way leads through them, so that a chunk that is cut or damaged gives what it has. Where no sound record
//! follows, the file is searched for the next one, from just behind the head of the last, whose length may be
//! what is wrong. A place counts as a record if its head and its data could have been written, and if a
//! record, or the end of the file, follows it. Frames have a CRC of their own, so that a wrong guess cannot
//! become a wrong result. Bytes of a message whose length is wrong are read again from the next record on; a
//! file can be made in which each few bytes begin a message that goes on to the end, and so this has a limit.
//!
//! A whole file must also have the CRC that is written at its end. Memory: a record, and a window of the
//! file.

use std::fs::File;
use std::path::Path;
use std::{fmt, io};

use crc32fast::Hasher;

use crate::recording::file::chunk;
use crate::recording::file::error::RecordingError;
use crate::recording::file::found::Found;
use crate::recording::file::layout::LONGEST_RUN;
use crate::recording::file::records::{self, Head, MESSAGE_HEAD, RECORD_HEAD, RECORD_MOST, op};
use crate::recording::file::source::Source;

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
    /// Something in the file is not what was written. What follows it is read again from the next record on.
    Damaged(Damage),
}

/// What is wrong in a file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Damage {
    /// Places where no record was found.
    pub places: u64,
    /// Where the first of them begins, in bytes.
    pub first: Option<u64>,
    /// Bytes in them.
    pub bytes: u64,
    /// What else is wrong: the first of it.
    pub other: Option<String>,
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            places,
            first,
            bytes,
            other,
        } = self;
        if let Some(first) = first {
            let places = if *places == 1 {
                "one place".to_owned()
            } else {
                format!("{places} places")
            };
            write!(
                f,
                "{bytes} bytes in {places}, the first at byte {first}, are no records"
            )?;
        }
        let separator = if first.is_some() { "; " } else { "" };
        other
            .as_ref()
            .map_or(Ok(()), |other| write!(f, "{separator}{other}"))
    }
}

const MAGIC: &[u8] = mcap::MAGIC;

/// Bytes before the records of a chunk, at least: times and size u64, CRC u32, no name of a compression, size
/// u64.
const CHUNK_LEAST: u64 = 8 + 8 + 8 + 4 + 4 + 8;

/// No message of the writer is longer: it has a run, or runs that are no frames.
const LONGEST_MESSAGE: u64 = (2 * LONGEST_RUN + MESSAGE_HEAD) as u64;

/// A way through the records of a file.
pub(super) struct Walk {
    source: Source,
    /// Where the next record begins.
    at: u64,
    /// Where the record before it began.
    last: u64,
    /// Where the furthest message ends that was taken: its bytes were handed on.
    handed: u64,
    /// Bytes that may still be handed on once more.
    once_more: u64,
    /// Where the records of the chunk end in which this is.
    chunk: Option<u64>,
    /// Whether its CRC is wrong.
    doubtful: bool,
    /// CRC of the bytes before a place.
    hashed: (Hasher, u64),
    /// Where the record ends that ends the data, and the index begins.
    data_end: Option<u64>,
    footer: bool,
    damage: Damage,
    /// State of what was read so far.
    pub(super) state: State,
    ended: bool,
    /// Whether the beginning may be damaged too.
    pub(super) salvages: bool,
}

/// What is at a place in the file.
enum Place {
    Record(Head),
    /// A record that goes on behind the end of the file.
    Cut(Head),
    Magic,
    End,
    Nothing,
}

impl Walk {
    /// # Errors
    /// The file cannot be read, is empty, or does not begin as a recording; with `damaged` it need not.
    pub(super) fn open(path: &Path, damaged: bool) -> Result<Self, RecordingError> {
        let failed = RecordingError::refused("read", path);
        let found = path.metadata().map_err(&failed)?;
        if !found.is_file() {
            return Err(RecordingError::NoFile(path.to_owned()));
        }
        let mut source = File::open(path).and_then(Source::new).map_err(&failed)?;
        if source.length == 0 {
            return Err(RecordingError::Empty(path.to_owned()));
        }
        let head = source.at(0, MAGIC.len()).map_err(failed)?;
        let head = &head[..head.len().min(MAGIC.len())];
        let begins = MAGIC.starts_with(head);
        if !begins && !damaged {
            return Err(RecordingError::NotMcap(path.to_owned()));
        }
        let mut walk = Self {
            once_more: source.length,
            source,
            at: MAGIC.len() as u64,
            last: 0,
            handed: 0,
            chunk: None,
            doubtful: false,
            hashed: (Hasher::new(), 0),
            data_end: None,
            footer: false,
            damage: Damage::default(),
            state: State::Whole,
            ended: false,
            salvages: damaged,
        };
        if !begins {
            walk.at = 0;
            walk.damage.other = Some("the beginning is not a recording's".to_owned());
        }
        Ok(walk)
    }

    /// Reads one record; false at the end.
    pub(super) fn step(&mut self, found: &mut Found) -> bool {
        if self.ended {
            return false;
        }
        found.doubtful = self.doubtful && self.chunk.is_some();
        if let Err(error) = self.advance(found) {
            // Why it is not read on is worth more than what was wrong before.
            self.damage.other = Some(error.to_string());
            self.ended = true;
        }
        if self.ended {
            if self.footer && self.data_end.is_none() {
                self.wrong("the end of the data is not told");
            }
            let damaged = self.damage != Damage::default();
            let runs_whole = self.data_end.is_some();
            self.state = match (damaged, self.footer) {
                (true, _) => State::Damaged(std::mem::take(&mut self.damage)),
                (false, true) => State::Whole,
                (false, false) => State::CutShort { runs_whole },
            };
        }
        !self.ended
    }

    fn place(&mut self, at: u64) -> io::Result<Place> {
        let length = self.source.length;
        if at >= length {
            return Ok(Place::End);
        }
        let bytes = self.source.at(at, RECORD_HEAD)?;
        if bytes.starts_with(MAGIC) {
            return Ok(Place::Magic);
        }
        Ok(match Head::read(bytes) {
            Some(head) if at + RECORD_HEAD as u64 + head.length <= length => Place::Record(head),
            Some(head) => Place::Cut(head),
            // The head itself may be cut.
            None if bytes.len() < RECORD_HEAD => Place::End,
            None => Place::Nothing,
        })
    }

    fn advance(&mut self, found: &mut Found) -> io::Result<()> {
        let at = self.at;
        self.hash(at)?;
        self.chunk = self.chunk.filter(|end| at < *end);
        match self.place(at)? {
            Place::Record(head) => {
                let end = at + RECORD_HEAD as u64 + head.length;
                let inside = self.chunk.is_none_or(|chunk_end| end <= chunk_end);
                // A chunk is known by more than its opcode, which would cost all that is in it.
                if head.length >= CHUNK_LEAST && self.enter_chunk(at, head, found)? {
                    if head.opcode != op::CHUNK {
                        self.wrong("the opcode of a chunk is wrong");
                    }
                    return Ok(());
                }
                if inside && head.opcode != op::CHUNK && self.take(at, head, found)? {
                    self.last = at;
                    self.at = end;
                    return Ok(());
                }
                self.search(found)
            }
            Place::Cut(head) => {
                if head.opcode == op::CHUNK && self.enter_chunk(at, head, found)? {
                    return Ok(());
                }
                self.search(found)
            }
            Place::Magic if self.footer => {
                if at + (MAGIC.len() as u64) < self.source.length {
                    let other = &mut self.damage.other;
                    other.get_or_insert_with(|| "bytes follow the end of the recording".to_owned());
                }
                self.ended = true;
                Ok(())
            }
            Place::End => {
                // The magic behind the footer is cut.
                self.footer = false;
                self.ended = true;
                Ok(())
            }
            Place::Magic | Place::Nothing => self.search(found),
        }
    }

    /// Takes a record that is no chunk. False if its data is not sound.
    fn take(&mut self, at: u64, head: Head, found: &mut Found) -> io::Result<bool> {
        if head.opcode == op::MESSAGE && !self.may_hand(at, head) {
            return Ok(false);
        }
        let length = usize::try_from(head.length).unwrap_or(usize::MAX);
        let body = at + RECORD_HEAD as u64;
        let bytes = self.source.at(body, length)?;
        let Some(data) = bytes.get(..length) else {
            return Ok(false);
        };
        match head.opcode {
            op::DATA_END => {
                let Some(crc) = records::data_end(data) else {
                    return Ok(false);
                };
                self.data_end = Some(body + head.length);
                if crc != 0 && self.hashed.0.clone().finalize() != crc {
                    self.wrong("the CRC of the data is wrong");
                }
                Ok(true)
            }
            op::FOOTER => {
                let Some((summary, crc)) = records::footer(data) else {
                    return Ok(false);
                };
                self.footer = true;
                // The CRC counts from the summary on, with the footer up to the CRC itself.
                let from = if summary == 0 { at } else { summary };
                let to = body + head.length.saturating_sub(4);
                // An index that has moved within the file is not where the footer says; nor is there its CRC.
                let moved = from > at || self.data_end.is_some_and(|begins| begins != from);
                if crc != 0 && (moved || self.source.crc(from, to)? != crc) {
                    self.wrong("the CRC of the index is wrong");
                }
                Ok(true)
            }
            opcode => {
                let taken = found.record(opcode, data);
                if taken && opcode == op::MESSAGE {
                    if at < self.handed {
                        self.once_more -= head.length;
                    }
                    self.handed = self.handed.max(body + head.length);
                }
                Ok(taken)
            }
        }
    }

    /// Whether the bytes of a message may be handed on. Those within a message that was taken are handed on
    /// once more if they could be what was written.
    fn may_hand(&self, at: u64, head: Head) -> bool {
        at >= self.handed || head.length <= LONGEST_MESSAGE.min(self.once_more)
    }

    fn wrong(&mut self, what: &str) {
        self.damage.other.get_or_insert_with(|| what.to_owned());
    }

    /// Goes on with the records in a chunk. False if it is not sound.
    fn enter_chunk(&mut self, at: u64, head: Head, found: &mut Found) -> io::Result<bool> {
        let body = at + RECORD_HEAD as u64;
        // Times, sizes and CRC, and the name of the compression.
        let bytes = self.source.at(body, 64)?;
        let Some(chunk) = records::chunk(&bytes[..bytes.len().min(64)], head.length) else {
            return Ok(false);
        };
        self.last = at;
        let begin = body + chunk.begin as u64;
        if chunk.compression.is_empty() {
            let end = begin + chunk.length;
            let whole = chunk.crc != 0 && end <= self.source.length;
            self.doubtful = whole && self.source.crc(begin, end)? != chunk.crc;
            if self.doubtful {
                self.wrong("the CRC of a chunk is wrong");
            }
            self.at = begin;
            self.chunk = Some(end);
        } else {
            self.at = body + head.length;
            self.chunk = None;
            let work = chunk::work(&chunk, bytes.get(chunk.begin..).unwrap_or_default());
            self.source.ask(work)?;
            let length = usize::try_from(chunk.length).unwrap_or(usize::MAX);
            let data = self.source.at(begin, length)?;
            let data = &data[..data.len().min(length)];
            match chunk::records(&chunk, data, RECORD_MOST as usize) {
                Ok(records) => {
                    let is_sound = chunk.crc == 0 || crc32fast::hash(&records) == chunk.crc;
                    found.doubtful = !is_sound;
                    // No chunk has attachments, which are kept: a few bytes could stand for all the memory
                    // there is.
                    let mut take = |(opcode, data)| match opcode {
                        op::CHANNEL | op::MESSAGE => found.record(opcode, data),
                        _ => true,
                    };
                    let odd = records::in_chunk(&records).filter(|record| !record.is_some_and(&mut take));
                    if odd.count() > 0 || !is_sound {
                        self.wrong("a compressed chunk is damaged");
                    }
                }
                Err(what) => self.wrong(&what),
            }
        }
        Ok(true)
    }

    /// Takes the bytes before a place into the CRC of the data, while they are in the window.
    fn hash(&mut self, to: u64) -> io::Result<()> {
        let (hasher, from) = &mut self.hashed;
        // Behind the data nothing counts any more, and where something is damaged the CRC is wrong anyway.
        while *from < to && self.data_end.is_none() && self.damage.first.is_none() {
            let bytes = self.source.at(*from, 1)?;
            let length = bytes.len().min(usize::try_from(to - *from).unwrap_or(usize::MAX));
            if length == 0 {
                break;
            }
            hasher.update(&bytes[..length]);
            *from += length as u64;
        }
        Ok(())
    }

    /// Looks for the next record. What lies before it is a damaged place, or the rest of a file that was cut.
    fn search(&mut self, found: &Found) -> io::Result<()> {
        let lost = self.at;
        let mut at = self.last + 1;
        while at < self.source.length {
            let bytes = self.source.at(at, RECORD_HEAD)?;
            let skip = bytes.iter().position(|&byte| (1..=op::DATA_END).contains(&byte));
            let Some(skip) = skip.filter(|skip| *skip == 0) else {
                let passed = at + skip.unwrap_or(bytes.len()).max(1) as u64;
                at = match skip {
                    Some(_) => passed,
                    None => self.source.behind_hole(passed),
                };
                continue;
            };
            debug_assert_eq!(skip, 0);
            if at != lost && self.is_record(at, found)? {
                self.chunk = self.chunk.filter(|end| at < *end);
                if at > lost || self.damage.first.is_none() {
                    self.damage.places += 1;
                    self.damage.first.get_or_insert(lost.min(at));
                }
                self.damage.bytes += at.saturating_sub(lost);
                (self.at, self.last) = (at, at);
                return Ok(());
            }
            at += 1;
        }
        // Nothing follows: a file that was cut, if what is left could be the beginning of a record.
        let cut = matches!(self.place(lost)?, Place::Cut(_) | Place::End);
        if !cut {
            self.damage.places += 1;
            self.damage.first.get_or_insert(lost);
            self.damage.bytes += self.source.length - lost;
        }
        self.ended = true;
        Ok(())
    }

    /// Whether a record could have been written here, with another one, or the end, behind it.
    fn is_record(&mut self, at: u64, found: &Found) -> io::Result<bool> {
        let (Place::Record(head) | Place::Cut(head)) = self.place(at)? else {
            return Ok(false);
        };
        let body = at + RECORD_HEAD as u64;
        let end = body + head.length;
        let length = self.source.length;
        let may_hand = self.may_hand(at, head);
        let bytes = self.source.at(body, 64)?;
        let sound = match head.opcode {
            op::CHUNK => records::chunk(&bytes[..bytes.len().min(64)], head.length).is_some(),
            op::MESSAGE if head.length >= MESSAGE_HEAD as u64 && may_hand => records::message(bytes)
                .is_some_and(|(channel, ..)| {
                    found.frames_of(channel).is_some() || found.times_of(channel).is_some()
                }),
            op::CHANNEL
            | op::METADATA
            | op::ATTACHMENT
            | op::MESSAGE_INDEX
            | op::CHUNK_INDEX
            | op::DATA_END
            | op::FOOTER
                if end <= length =>
            {
                let data = usize::try_from(head.length).unwrap_or(usize::MAX);
                let bytes = self.source.at(body, data)?;
                bytes.get(..data).is_some_and(|data| match head.opcode {
                    op::CHANNEL => records::channel(data).is_some(),
                    op::METADATA => records::metadata(data).is_some(),
                    op::ATTACHMENT => records::attachment(data).is_some(),
                    op::MESSAGE_INDEX => records::is_message_index(data),
                    op::CHUNK_INDEX => records::is_chunk_index(data),
                    // Of one length only: an index has zeros and small numbers, which look like a short
                    // record.
                    op::DATA_END => data.len() == records::DATA_END,
                    _ => data.len() == records::FOOTER,
                })
            }
            _ => false,
        };
        if !sound {
            return Ok(false);
        }
        if head.opcode == op::CHUNK {
            return Ok(true);
        }
        Ok(match self.place(end)? {
            Place::Record(_) | Place::Cut(_) | Place::Magic => true,
            Place::End => end >= length,
            Place::Nothing => false,
        })
    }
}
