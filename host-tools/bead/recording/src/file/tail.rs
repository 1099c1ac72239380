//! The end of a recording: the end of the data, the index and the footer (MCAP specification, "Records").
//!
//! # Design
//! Added records follow the data, so the places in the index stay right, and only what comes after is written
//! again. The CRC of the data continues the old one, which was checked when the file was read.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};

use mcap::MAGIC;
use mcap::records::{Metadata, Record, op};

use crate::file::layout::{NOTE, RECORD_MOST};
use crate::file::notes::Note;

/// Opcode and length before the data of a record.
const HEAD: u64 = 1 + 8;
/// The record at the end of the data, whose content is a CRC.
const DATA_END: u64 = HEAD + 4;
/// The last record, whose content is the places of index and offsets, and a CRC.
const FOOTER: u64 = HEAD + 8 + 8 + 4;
/// Place of the number of metadata records in the statistics.
const METADATA_COUNT: std::ops::Range<usize> = 18..22;

/// The end of a recording, from the end of its data on.
pub(super) struct Tail {
    /// Offset of the end of the data, in bytes.
    pub(super) data_end: u64,
    /// CRC of the data; 0 if it is not known.
    pub(super) data_crc: u32,
    /// The records of the index without offsets: opcode and data.
    pub(super) index: Vec<(u8, Vec<u8>)>,
    /// True if the index ends with offsets of its groups.
    pub(super) has_offsets: bool,
}

impl Tail {
    /// Reads the end of a file; the error is the reason why it has none.
    pub(super) fn read(file: &File) -> Result<Self, String> {
        let text = |error: io::Error| error.to_string();
        let length = file.metadata().map_err(text)?.len();
        let footer_at = length
            .checked_sub(FOOTER + MAGIC.len() as u64)
            .ok_or("it is too short")?;
        let mut reader = BufReader::new(file);
        let mut at = |place: u64| -> Result<(u8, Vec<u8>), String> {
            reader.seek(SeekFrom::Start(place)).map_err(text)?;
            let mut head = [0; HEAD as usize];
            reader.read_exact(&mut head).map_err(text)?;
            let [opcode, bytes @ ..] = head;
            let bytes = u64::from_le_bytes(bytes);
            if bytes > RECORD_MOST as u64 {
                return Err("a record is too long".to_owned());
            }
            let mut data = Vec::new();
            (&mut reader).take(bytes).read_to_end(&mut data).map_err(text)?;
            if data.len() as u64 != bytes {
                return Err("a record is cut".to_owned());
            }
            Ok((opcode, data))
        };
        let (opcode, data) = at(footer_at)?;
        let Ok(Record::Footer(footer)) = mcap::parse_record(opcode, &data) else {
            return Err("its footer is missing".to_owned());
        };
        let index_at = match footer.summary_start {
            0 => footer_at,
            place => place,
        };
        let data_end = index_at.checked_sub(DATA_END).ok_or("its index is misplaced")?;
        let (opcode, data) = at(data_end)?;
        let end = mcap::parse_record(opcode, &data);
        let Some(Record::DataEnd(end)) = end.ok().filter(|_| HEAD + data.len() as u64 == DATA_END) else {
            return Err("the end of its data is misplaced".to_owned());
        };
        let (mut index, mut place) = (Vec::new(), index_at);
        while place < footer_at {
            let (opcode, data) = at(place)?;
            place += HEAD + data.len() as u64;
            if opcode != op::SUMMARY_OFFSET {
                index.push((opcode, data));
            }
        }
        Ok(Self {
            data_end,
            data_crc: end.data_section_crc,
            index,
            has_offsets: footer.summary_offset_start != 0,
        })
    }

    /// The bytes after the data with these notes added.
    pub(super) fn with(mut self, notes: &[Note]) -> Vec<u8> {
        let (mut added, mut entries) = (Vec::new(), Vec::new());
        for note in notes {
            let data = metadata(note.to_record());
            let place = self.data_end + added.len() as u64;
            record(&mut added, op::METADATA, &data);
            let mut entry = place.to_le_bytes().to_vec();
            entry.extend(((HEAD as usize + data.len()) as u64).to_le_bytes());
            text(&mut entry, NOTE);
            entries.push((op::METADATA_INDEX, entry));
        }
        let mut bytes = added;
        if self.data_crc != 0 {
            let mut crc = crc32fast::Hasher::new_with_initial(self.data_crc);
            crc.update(&bytes);
            self.data_crc = crc.finalize();
        }
        record(&mut bytes, op::DATA_END, &self.data_crc.to_le_bytes());
        // A file without an index does not get one.
        let (mut summary, mut offsets) = (Vec::new(), Vec::new());
        if !self.index.is_empty() {
            self.add_entries(entries, notes.len() as u32);
            let start = self.data_end + bytes.len() as u64;
            for group in self.index.chunk_by(|(one, _), (other, _)| one == other) {
                let (opcode, begin) = (group[0].0, summary.len());
                for (opcode, data) in group {
                    record(&mut summary, *opcode, data);
                }
                let mut offset = vec![opcode];
                offset.extend((start + begin as u64).to_le_bytes());
                offset.extend(((summary.len() - begin) as u64).to_le_bytes());
                record(&mut offsets, op::SUMMARY_OFFSET, &offset);
            }
        }
        let start = self.data_end + bytes.len() as u64;
        let place = |there: bool, place: u64| if there { place } else { 0 };
        let mut footer = place(!summary.is_empty(), start).to_le_bytes().to_vec();
        let offsets_at = place(self.has_offsets, start + summary.len() as u64);
        footer.extend(offsets_at.to_le_bytes());
        if self.has_offsets {
            summary.append(&mut offsets);
        }
        // The CRC covers the index, and the footer up to the CRC.
        let mut checked = summary.clone();
        checked.push(op::FOOTER);
        checked.extend((FOOTER - HEAD).to_le_bytes());
        checked.extend(&footer);
        footer.extend(crc32fast::hash(&checked).to_le_bytes());
        bytes.append(&mut summary);
        record(&mut bytes, op::FOOTER, &footer);
        bytes.extend(MAGIC);
        bytes
    }

    /// Adds the notes to the index, beside the other metadata records, and to its statistics.
    fn add_entries(&mut self, entries: Vec<(u8, Vec<u8>)>, count: u32) {
        for (_, statistics) in self
            .index
            .iter_mut()
            .filter(|(opcode, _)| *opcode == op::STATISTICS)
        {
            if let Some(bytes) = statistics.get_mut(METADATA_COUNT)
                && let Some(bytes) = bytes.first_chunk_mut()
            {
                *bytes = u32::from_le_bytes(*bytes).saturating_add(count).to_le_bytes();
            }
        }
        let last = self
            .index
            .iter()
            .rposition(|(opcode, _)| *opcode == op::METADATA_INDEX);
        let place = last.map_or(self.index.len(), |last| last + 1);
        self.index.splice(place..place, entries);
    }
}

fn record(bytes: &mut Vec<u8>, opcode: u8, data: &[u8]) {
    bytes.push(opcode);
    bytes.extend((data.len() as u64).to_le_bytes());
    bytes.extend(data);
}

fn text(bytes: &mut Vec<u8>, text: &str) {
    bytes.extend((text.len() as u32).to_le_bytes());
    bytes.extend(text.as_bytes());
}

/// The data of a metadata record: its name, and a map with its length in bytes.
fn metadata(Metadata { name, metadata }: Metadata) -> Vec<u8> {
    let (mut data, mut map) = (Vec::new(), Vec::new());
    for (key, value) in &metadata {
        text(&mut map, key);
        text(&mut map, value);
    }
    text(&mut data, &name);
    data.extend((map.len() as u32).to_le_bytes());
    data.extend(map);
    data
}
