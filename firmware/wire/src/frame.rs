//! One frame: how it is laid out, made and taken apart.
//!
//! # Design
//! ```text
//! 0x00  COBS( version u8 | kind u8 | boot u8 | sequence u32 | sample index u64 | body | CRC-32 u32 )  0x00
//! ```
//!
//! Little-endian. The CRC is CRC-32/ISO-HDLC of everything before it. A delimiter stands on *both* sides:
//! with one at the end only, a bit flipped in it, or a reset in the middle of a frame, would take the next
//! frame along; with two, what is damaged ends where the next frame begins.

use bead_crc::checksum;
use serde::{Deserialize, Serialize};

use crate::codes::MAX_SCANS;
use crate::message::{
    Fault, Identity, Kind, MAX_BLOCK, MAX_BODY, MAX_DETAIL, MAX_FIRMWARE, MAX_GIT, Message, Reply,
};
use crate::sequence::Arrival;

/// Version of the layout: the first byte of a frame. Raise it when a header or a body changes shape.
pub const VERSION: u8 = 2;

const HEADER: usize = 1 + 1 + 1 + 4 + 8;
pub(crate) const CRC_LENGTH: usize = 4;
/// Longest frame before COBS, in bytes.
const MAX_PAYLOAD: usize = HEADER + MAX_BODY + CRC_LENGTH;
/// Longest frame between its delimiters, in bytes.
pub(crate) const MAX_ENCODED: usize = corncobs::max_encoded_len(MAX_PAYLOAD) - 1;
/// Longest frame on the wire with both delimiters, in bytes: a buffer this long always does.
pub const MAX_FRAME: usize = 1 + MAX_ENCODED + 1;

pub(crate) const DELIMITER: u8 = 0;

/// What stands before the body of every frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Header {
    /// Low byte of the number of resets since power-up: another one is another run of sequence numbers.
    pub boot: u8,
    /// Counts every frame made since the reset from 0, sent or not; wraps.
    pub sequence: u32,
    /// Index of the newest scan when the frame was made.
    pub sample_index: u64,
}

/// A frame that passed every check.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Frame<'a> {
    /// Its header.
    pub header: Header,
    /// How it follows on the frames before it.
    pub arrival: Arrival,
    /// Its message.
    pub message: Message<'a>,
}

/// Bytes between two delimiters that are no frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, thiserror::Error)]
#[error("{bytes} bytes rejected: {cause}")]
pub struct Reject {
    /// Why not.
    pub cause: Cause,
    /// How many bytes there were, as received.
    pub bytes: u64,
}

/// Why bytes are no frame, in the order in which it is checked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, thiserror::Error)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// More bytes than any frame has.
    #[error("longer than a frame may be")]
    TooLong,
    /// Not COBS: a run ends beyond the delimiter.
    #[error("not COBS")]
    Cobs,
    /// Fewer bytes than header and CRC.
    #[error("shorter than a header")]
    TooShort,
    /// The CRC does not match.
    #[error("CRC differs")]
    Crc,
    /// Another version of the layout.
    #[error("version {0} is not ours")]
    Version(u8),
    /// A kind that this version does not know.
    #[error("kind {0} is unknown")]
    Kind(u8),
    /// The body is no message of its kind.
    #[error("body is no message of its kind")]
    Body,
    /// The body goes on after its message.
    #[error("body goes on after its message")]
    Trailing,
}

/// Why a message could not be encoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EncodeError {
    /// A slice of the message is longer than its frame allows, in bytes.
    #[error("{length} bytes where a frame takes at most {most}")]
    TooLong {
        /// Its length, in bytes.
        length: usize,
        /// The longest allowed, in bytes.
        most: usize,
    },
    /// The buffer cannot take the frame: give it [`MAX_FRAME`] bytes.
    #[error("the frame does not fit the buffer of {0} bytes")]
    BufferTooSmall(usize),
}

/// Writes one frame, with both its delimiters, to the head of `buffer` and returns it.
///
/// Texts longer than their frame allows are cut between characters; [`MAX_FRAME`] bytes always suffice.
///
/// # Errors
/// A settings block or waveform longer than its frame allows, or a buffer too small.
pub fn encode<'b>(
    header: &Header,
    message: &Message<'_>,
    buffer: &'b mut [u8],
) -> Result<&'b [u8], EncodeError> {
    let mut payload = [0; MAX_PAYLOAD];
    payload[0] = VERSION;
    payload[1] = message.kind() as u8;
    payload[2] = header.boot;
    payload[3..7].copy_from_slice(&header.sequence.to_le_bytes());
    payload[7..HEADER].copy_from_slice(&header.sample_index.to_le_bytes());
    let body = encode_body(message, &mut payload[HEADER..HEADER + MAX_BODY])?;
    frame(&mut payload, HEADER + body, buffer)
}

/// Puts the CRC behind the first `end` bytes of `payload`, COBS and delimiters around all, into `buffer`.
pub(crate) fn frame<'b>(
    payload: &mut [u8],
    end: usize,
    buffer: &'b mut [u8],
) -> Result<&'b [u8], EncodeError> {
    let too_small = EncodeError::BufferTooSmall(buffer.len());
    let crc = checksum(&payload[..end]);
    payload[end..end + CRC_LENGTH].copy_from_slice(&crc.to_le_bytes());
    let (first, rest) = buffer.split_first_mut().ok_or(too_small)?;
    *first = DELIMITER;
    let payload = &payload[..end + CRC_LENGTH];
    if rest.len() < corncobs::max_encoded_len(payload.len()) {
        return Err(too_small);
    }
    // With the delimiter at its end.
    let length = corncobs::encode_buf(payload, rest);
    Ok(&buffer[..1 + length])
}

fn encode_body(message: &Message<'_>, buffer: &mut [u8]) -> Result<usize, EncodeError> {
    let room = buffer.len();
    let written = match message {
        Message::Identity(identity) => postcard::to_slice(
            &Identity {
                firmware: cut(identity.firmware, MAX_FIRMWARE),
                git: cut(identity.git, MAX_GIT),
                ..*identity
            },
            buffer,
        ),
        Message::Status(status) => postcard::to_slice(status, buffer),
        Message::Strike(strike) => postcard::to_slice(strike, buffer),
        Message::Shape(shape) => postcard::to_slice(shape, buffer),
        Message::Waveform(waveform) => {
            within(waveform.codes.bytes(), 3 * MAX_SCANS)?;
            within(waveform.wide.bytes(), 3 * (2 + MAX_SCANS))?;
            postcard::to_slice(waveform, buffer)
        }
        Message::Fault(fault) => postcard::to_slice(
            &Fault {
                detail: cut(fault.detail, MAX_DETAIL),
                ..*fault
            },
            buffer,
        ),
        Message::Settings(settings) => {
            within(settings.block, MAX_BLOCK)?;
            postcard::to_slice(settings, buffer)
        }
        Message::Health(health) => postcard::to_slice(health, buffer),
        Message::Sync(sync) => postcard::to_slice(sync, buffer),
        Message::Reply(reply) => postcard::to_slice(
            &Reply {
                detail: cut(reply.detail, MAX_DETAIL),
                ..*reply
            },
            buffer,
        ),
        Message::Raw(raw) => {
            within(raw.codes.bytes(), 3 * MAX_SCANS)?;
            postcard::to_slice(raw, buffer)
        }
        Message::Link(link) => postcard::to_slice(link, buffer),
        Message::SelfTest(test) => postcard::to_slice(test, buffer),
    };
    // Slices are bounded above and `MAX_BODY` covers the rest, so this cannot fail; were that sum ever
    // wrong, one frame is refused instead of the bead stopped.
    Ok(written.map_err(|_| EncodeError::BufferTooSmall(room))?.len())
}

/// The longest head of `text` within `most` bytes that ends between characters.
fn cut(text: &str, most: usize) -> &str {
    &text[..text.floor_char_boundary(most)]
}

pub(crate) fn within(slice: &[u8], most: usize) -> Result<(), EncodeError> {
    if slice.len() <= most {
        Ok(())
    } else {
        Err(EncodeError::TooLong {
            length: slice.len(),
            most,
        })
    }
}

/// Header and body of a payload whose CRC is right.
pub(crate) fn checked<const HEADER: usize>(payload: &[u8]) -> Result<(&[u8; HEADER], &[u8]), Cause> {
    let (covered, crc) = payload.split_last_chunk().ok_or(Cause::TooShort)?;
    let parts = covered.split_first_chunk().ok_or(Cause::TooShort)?;
    match checksum(covered) == u32::from_le_bytes(*crc) {
        true => Ok(parts),
        false => Err(Cause::Crc),
    }
}

/// A payload whose CRC and version are right: its numbers can be believed, its body not yet.
pub(crate) struct Checked<'a> {
    kind: u8,
    pub(crate) header: Header,
    body: &'a [u8],
}

impl<'a> Checked<'a> {
    /// Checks what COBS decoding gave.
    pub(crate) fn new(payload: &'a [u8]) -> Result<Self, Cause> {
        let (head, body) = checked::<HEADER>(payload)?;
        let [
            version,
            kind,
            boot,
            s0,
            s1,
            s2,
            s3,
            i0,
            i1,
            i2,
            i3,
            i4,
            i5,
            i6,
            i7,
        ] = *head;
        if version != VERSION {
            return Err(Cause::Version(version));
        }
        let header = Header {
            boot,
            sequence: u32::from_le_bytes([s0, s1, s2, s3]),
            sample_index: u64::from_le_bytes([i0, i1, i2, i3, i4, i5, i6, i7]),
        };
        Ok(Self { kind, header, body })
    }

    /// Whether this claims to be the first frame of a boot.
    pub(crate) fn opens_boot(&self) -> bool {
        self.kind == Kind::Identity as u8 && self.header.sequence == 0
    }

    /// Decodes the body.
    pub(crate) fn message(&self) -> Result<Message<'a>, Cause> {
        let kind = Kind::from_byte(self.kind).ok_or(Cause::Kind(self.kind))?;
        Ok(match kind {
            Kind::Identity => Message::Identity(whole(self.body)?),
            Kind::Status => Message::Status(whole(self.body)?),
            Kind::Strike => Message::Strike(whole(self.body)?),
            Kind::Shape => Message::Shape(whole(self.body)?),
            Kind::Waveform => Message::Waveform(whole(self.body)?),
            Kind::Fault => Message::Fault(whole(self.body)?),
            Kind::Settings => Message::Settings(whole(self.body)?),
            Kind::Health => Message::Health(whole(self.body)?),
            Kind::Sync => Message::Sync(whole(self.body)?),
            Kind::Reply => Message::Reply(whole(self.body)?),
            Kind::Raw => Message::Raw(whole(self.body)?),
            Kind::Link => Message::Link(whole(self.body)?),
            Kind::SelfTest => Message::SelfTest(whole(self.body)?),
        })
    }
}

pub(crate) fn whole<'a, T: Deserialize<'a>>(body: &'a [u8]) -> Result<T, Cause> {
    match postcard::take_from_bytes(body) {
        Ok((message, [])) => Ok(message),
        Ok(_) => Err(Cause::Trailing),
        Err(_) => Err(Cause::Body),
    }
}
