//! Frames and chunks in bytes of a recording in which nothing else can be trusted.
//!
//! # Design
//! A frame is between two delimiters and has its own CRC. In a recording, the delimiter before it is the last
//! byte of its message's publish time, and the message ends with the one after it. The head of the message is
//! believed if its length fits.

use bead_wire::{Decoder, MAX_FRAME};

/// Opcode and length before a record, and channel, number and two times before the data of a message.
const MESSAGE_HEAD: usize = 1 + 8 + MESSAGE_FIELDS;
const MESSAGE_FIELDS: usize = 2 + 4 + 8 + 8;
/// Bytes from the opcode of a chunk that is not compressed to its records: opcode, length, two times, size,
/// CRC, an empty name, size.
pub(super) const CHUNK_HEAD: usize = 1 + 8 + 8 + 8 + 8 + 4 + 4 + 8;
/// Greatest number of bytes of a frame with the head of its message.
pub(super) const FRAME_MOST: usize = MESSAGE_HEAD + MAX_FRAME;

/// A frame with a good CRC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct SoundFrame<'a> {
    /// Offset of its message; of the frame itself, if the head of the message is damaged.
    pub(super) start: usize,
    /// Offset of the byte after its delimiter.
    pub(super) end: usize,
    pub(super) address: u8,
    pub(super) head: Option<MessageHead>,
    /// The frame with its delimiter.
    pub(super) bytes: &'a [u8],
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct MessageHead {
    pub(super) channel: u16,
    pub(super) number: u32,
    /// In ns.
    pub(super) log_time: u64,
}

pub(super) fn frames(bytes: &[u8]) -> impl Iterator<Item = SoundFrame<'_>> {
    let mut decoder = Box::new(Decoder::new());
    let mut start = 0;
    std::iter::from_fn(move || {
        loop {
            let length = bytes.get(start..)?.iter().position(|byte| *byte == 0)?;
            let (begin, end) = (start, start + length + 1);
            start = end;
            if length == 0 || length > MAX_FRAME {
                continue;
            }
            let mut address = None;
            let frame = &bytes[begin..end];
            decoder.feed(frame, |result| {
                address = result.ok().map(|frame| frame.header.address)
            });
            let Some(address) = address else { continue };
            let head = begin.checked_sub(MESSAGE_HEAD);
            let head = head.and_then(|at| message_head(&bytes[at..begin], frame.len()));
            return Some(SoundFrame {
                start: head.map_or(begin, |_| begin - MESSAGE_HEAD),
                end,
                address,
                head,
                bytes: frame,
            });
        }
    })
}

/// The head of a message with this number of bytes of data.
fn message_head(head: &[u8], length: usize) -> Option<MessageHead> {
    let (&opcode, head) = head.split_first()?;
    let (record, head) = head.split_first_chunk()?;
    let (channel, head) = head.split_first_chunk()?;
    let (number, head) = head.split_first_chunk()?;
    let (log_time, _publish_time) = head.split_first_chunk()?;
    let fits = u64::from_le_bytes(*record) == (MESSAGE_FIELDS + length) as u64;
    (opcode == mcap::records::op::MESSAGE && fits).then_some(MessageHead {
        channel: u16::from_le_bytes(*channel),
        number: u32::from_le_bytes(*number),
        log_time: u64::from_le_bytes(*log_time),
    })
}

/// Offset of the first chunk. A chunk is recognised by its length, which it states three times.
pub(super) fn chunk(bytes: &[u8]) -> Option<usize> {
    let opcodes = (0..bytes.len()).filter(|at| bytes[*at] == mcap::records::op::CHUNK);
    opcodes
        .into_iter()
        .find(|at| chunk_length(&bytes[*at..]).is_some())
}

/// The number of bytes of the records in the chunk that begins here.
pub(super) fn chunk_length(bytes: &[u8]) -> Option<u64> {
    let head: &[u8; CHUNK_HEAD] = bytes.first_chunk()?;
    let number = |at: usize| head[at..].first_chunk().map(|bytes| u64::from_le_bytes(*bytes));
    let length = number(CHUNK_HEAD - 8)?;
    let record = length.checked_add(CHUNK_HEAD as u64 - 9)?;
    let has_no_name = head[CHUNK_HEAD - 12..CHUNK_HEAD - 8] == [0; 4];
    let is_chunk =
        head[0] == mcap::records::op::CHUNK && number(1) == Some(record) && number(25) == Some(length);
    (is_chunk && has_no_name).then_some(length)
}
