//! The records of an MCAP file, from bytes in which anything may be wrong.
//!
//! # Design
//! Only those records are read that a recording needs, with every length checked against what is there (MCAP
//! specification, "Records"). Numbers are little-endian; texts, maps and data have their length before them.

use std::collections::BTreeMap;

/// Opcode u8 and length u64 before each record.
pub(super) const RECORD_HEAD: usize = 1 + 8;
/// Longest record that is read, in bytes: a damaged length must not fill the memory. Chunks are of 256 KiB
/// here and of some MB by other programs, and attachments much below this.
pub(super) const RECORD_MOST: u64 = 32 << 20;
/// Channel u16, sequence u32, two times u64.
pub(super) const MESSAGE_HEAD: usize = 2 + 4 + 8 + 8;

pub(super) use mcap::records::op;

/// The records in the bytes of a chunk: opcode and data of each. None for what follows the last sound one.
pub(super) fn in_chunk(mut bytes: &[u8]) -> impl Iterator<Item = Option<(u8, &[u8])>> {
    std::iter::from_fn(move || {
        if bytes.is_empty() {
            return None;
        }
        let taken = Head::read(bytes).and_then(|head| {
            let length = usize::try_from(head.length).ok()?;
            let (data, rest) = bytes.get(RECORD_HEAD..)?.split_at_checked(length)?;
            Some(((head.opcode, data), rest))
        });
        bytes = taken.map_or(&[], |(_, rest)| rest);
        Some(taken.map(|(record, _)| record))
    })
}

/// Opcode and length at the head of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Head {
    pub(super) opcode: u8,
    /// Of the data behind the head.
    pub(super) length: u64,
}

impl Head {
    /// The head at the beginning of `bytes`, if a program could have written it.
    pub(super) fn read(bytes: &[u8]) -> Option<Self> {
        let (&opcode, rest) = bytes.split_first()?;
        let length = u64::from_le_bytes(*rest.first_chunk()?);
        let is_known = (op::HEADER..=op::DATA_END).contains(&opcode) || opcode >= 0x80;
        (is_known && length <= RECORD_MOST).then_some(Self { opcode, length })
    }
}

/// What stands before the records of a chunk.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct ChunkHead {
    pub(super) uncompressed: u64,
    /// CRC-32 of the records; 0 for none.
    pub(super) crc: u32,
    /// Empty for none.
    pub(super) compression: String,
    /// Where the records begin, and how many bytes they have in the file.
    pub(super) begin: usize,
    pub(super) length: u64,
}

/// Takes values off the front of bytes.
struct Cursor<'a>(&'a [u8]);

impl<'a> Cursor<'a> {
    fn take(&mut self, length: u64) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(usize::try_from(length).ok()?)?;
        self.0 = rest;
        Some(taken)
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (taken, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*taken)
    }

    fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    fn text(&mut self) -> Option<&'a str> {
        let length = self.u32()?;
        std::str::from_utf8(self.take(length.into())?).ok()
    }

    fn map(&mut self) -> Option<BTreeMap<String, String>> {
        let length = self.u32()?;
        let mut inside = Cursor(self.take(length.into())?);
        let mut map = BTreeMap::new();
        while !inside.0.is_empty() {
            map.insert(inside.text()?.to_owned(), inside.text()?.to_owned());
        }
        Some(map)
    }
}

/// The library that wrote a file.
pub(super) fn library(data: &[u8]) -> Option<&str> {
    let mut data = Cursor(data);
    let _profile = data.text()?;
    data.text()
}

/// What the record of a channel says.
pub(super) struct ChannelHead<'a> {
    pub(super) id: u16,
    pub(super) topic: &'a str,
    pub(super) encoding: &'a str,
    metadata: Cursor<'a>,
}

impl ChannelHead<'_> {
    /// Its entries; none if they are damaged.
    pub(super) fn metadata(mut self) -> BTreeMap<String, String> {
        Some(&mut self.metadata)
            .filter(|metadata| metadata.0.len() <= METADATA_MOST)
            .and_then(Cursor::map)
            .unwrap_or_default()
    }
}

/// A channel.
pub(super) fn channel(data: &[u8]) -> Option<ChannelHead<'_>> {
    let mut data = Cursor(data);
    let (id, _schema) = (data.u16()?, data.u16()?);
    Some(ChannelHead {
        id,
        topic: data.text()?,
        encoding: data.text()?,
        metadata: data,
    })
}

/// Channel, sequence number and data of a message.
pub(super) fn message(data: &[u8]) -> Option<(u16, u32, &[u8])> {
    let mut data = Cursor(data);
    let (channel, sequence) = (data.u16()?, data.u32()?);
    let _times = (data.u64()?, data.u64()?);
    Some((channel, sequence, data.0))
}

/// Longest metadata record that is read, in bytes: its entries take many times more in memory.
const METADATA_MOST: usize = 1 << 20;

/// Name and entries of a metadata record.
pub(super) fn metadata(data: &[u8]) -> Option<(&str, BTreeMap<String, String>)> {
    let mut data = Cursor(Some(data).filter(|data| data.len() <= METADATA_MOST)?);
    Some((data.text()?, data.map()?))
}

/// Name and data of an attachment whose CRC is right.
pub(super) fn attachment(data: &[u8]) -> Option<(&str, &[u8])> {
    let (hashed, crc) = data.split_last_chunk()?;
    let crc = u32::from_le_bytes(*crc);
    let mut data = Cursor(hashed);
    let _times = (data.u64()?, data.u64()?);
    let (name, _media) = (data.text()?, data.text()?);
    let length = data.u64()?;
    let is_sound = length == data.0.len() as u64 && (crc == 0 || crc32fast::hash(hashed) == crc);
    is_sound.then_some((name, data.0))
}

/// The head of a chunk whose data has `length` bytes, from the first of them.
pub(super) fn chunk(data: &[u8], length: u64) -> Option<ChunkHead> {
    let mut rest = Cursor(data);
    let _times = (rest.u64()?, rest.u64()?);
    let (uncompressed, crc) = (rest.u64()?, rest.u32()?);
    let compression = rest.text()?.to_owned();
    let records = rest.u64()?;
    let begin = data.len() - rest.0.len();
    let fits = length.checked_sub(begin as u64) == Some(records);
    let is_sound = fits && (!compression.is_empty() || uncompressed == records);
    is_sound.then_some(ChunkHead {
        uncompressed,
        crc,
        compression,
        begin,
        length: records,
    })
}

/// Whether these could be the places of the messages of a channel in a chunk: two u64 each.
pub(super) fn is_message_index(data: &[u8]) -> bool {
    let mut data = Cursor(data);
    let length = data.u16().and_then(|_channel| data.u32());
    length.is_some_and(|length| length % 16 == 0 && length as usize == data.0.len())
}

/// Whether this could say where a chunk lies.
pub(super) fn is_chunk_index(data: &[u8]) -> bool {
    fn rest(mut data: Cursor<'_>) -> Option<usize> {
        let _times_and_place = data.take(4 * 8)?;
        // A u16 and a u64 a channel.
        let indexes = data.u32().filter(|length| length % 10 == 0)?;
        let _indexes = data.take(indexes.into())?;
        let _length = data.u64()?;
        let _compression = data.text()?;
        Some(data.0.len())
    }
    rest(Cursor(data)) == Some(2 * 8)
}

/// Bytes in the data of the record at the end of the data section: its CRC.
pub(super) const DATA_END: usize = 4;
/// Bytes in the data of a footer: two places and a CRC.
pub(super) const FOOTER: usize = 8 + 8 + 4;

/// CRC of the data section; 0 for none.
pub(super) fn data_end(data: &[u8]) -> Option<u32> {
    Cursor(data).u32()
}

/// Where the summary begins, and its CRC; each 0 for none.
pub(super) fn footer(data: &[u8]) -> Option<(u64, u32)> {
    let mut data = Cursor(data);
    let (summary, _offsets) = (data.u64()?, data.u64()?);
    Some((summary, data.u32()?))
}
