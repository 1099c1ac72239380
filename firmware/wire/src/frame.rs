//! One frame: how it is laid out, made and taken apart.
//!
//! # Design
//! ```text
//! 0x00  COBS( version u8 | kind u8 | boot u8 | sequence u32 | sample index u64 | address u8 | body | CRC-32 u32 )  0x00
//! ```
//!
//! Little-endian. The CRC is CRC-32/ISO-HDLC of everything before it. A delimiter stands on *both* sides:
//! with one at the end only, a bit flipped in it, or a reset in the middle of a frame, would take the next
//! frame along; with two, the damage ends where the next frame begins.
//!
//! **The header is frozen**, and so are the bodies of [`Identity`](crate::Identity) and [`Reply`](crate::Reply). A later
//! version may change all other frames and may append to these two bodies. So every host can say to which bead it
//! talks and why it does not understand the rest, and every bead can say that it does not understand its host.
//!
//! Version 2 had no address; its frames are read as those of address 0. Version 1 is refused.

use crate::cause::Cause;
use crate::message::{Kind, MAX_BODY, Message};
use crate::payload::{BufferTooSmall, CRC_LENGTH, VERSION, open, seal};
use crate::sequence::Arrival;

/// The last version whose header had no address.
const WITHOUT_ADDRESS: u8 = 2;
/// Version, kind, boot, sequence, sample index.
const HEADER: usize = 1 + 1 + 1 + 4 + 8;
/// Longest frame before COBS, in bytes.
const MAX_PAYLOAD: usize = HEADER + 1 + MAX_BODY + CRC_LENGTH;
/// Longest frame between its delimiters, in bytes.
pub(crate) const MAX_ENCODED: usize = corncobs::max_encoded_len(MAX_PAYLOAD) - 1;
/// Longest frame on the wire with both delimiters, in bytes: a buffer this long always does.
pub const MAX_FRAME: usize = 1 + MAX_ENCODED + 1;

/// What stands before the body of every frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Address of the bead, from its settings: tells beads apart on a shared line and in merged streams. 0 where nobody
    /// gave it one.
    pub address: u8,
    /// Low byte of the number of resets since power-up: another one is another run of sequence numbers.
    pub boot: u8,
    /// Counts every frame made since the reset from 0, sent or not; wraps.
    pub sequence: u32,
    /// Index of the newest scan when the frame was made.
    pub sample_index: u64,
}

/// A frame that passed every check.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Version of the sender: above [`VERSION`] for an identity or a reply of a later one.
    pub version: u8,
    /// Its header.
    pub header: Header,
    /// How it follows on the frames of this address before it.
    pub arrival: Arrival,
    /// Its message.
    pub message: Message,
}

/// Writes one frame, with both its delimiters, to the head of `buffer` and returns it.
///
/// # Errors
/// A buffer too small; [`MAX_FRAME`] bytes always suffice.
pub fn encode<'b>(
    header: &Header,
    message: &Message,
    buffer: &'b mut [u8],
) -> Result<&'b [u8], BufferTooSmall> {
    let mut payload = [0; MAX_PAYLOAD];
    payload[0] = VERSION;
    payload[1] = message.kind() as u8;
    payload[2] = header.boot;
    payload[3..7].copy_from_slice(&header.sequence.to_le_bytes());
    payload[7..HEADER].copy_from_slice(&header.sample_index.to_le_bytes());
    payload[HEADER] = header.address;
    let start = HEADER + 1;
    // `MAX_BODY` covers every body, so this cannot fail; were that sum ever wrong, one frame is refused instead of
    // the bead stopped.
    let length = message
        .encode(&mut payload[start..start + MAX_BODY])
        .map_err(|_| BufferTooSmall(buffer.len()))?;
    seal(&mut payload, start + length, buffer)
}

/// A payload whose CRC is right and whose header can be read: its numbers can be believed, its body not yet.
pub(crate) struct Checked<'a> {
    pub(crate) version: u8,
    kind: u8,
    pub(crate) header: Header,
    body: &'a [u8],
}

impl<'a> Checked<'a> {
    /// Checks the result of COBS decoding.
    pub(crate) fn new(payload: &'a [u8]) -> Result<Self, Cause> {
        let (head, rest) = open::<HEADER>(payload)?;
        let [version, kind, boot, s0, s1, s2, s3, index @ ..] = *head;
        let (address, body) = match version {
            WITHOUT_ADDRESS => (0, rest),
            WITHOUT_ADDRESS.. => {
                let (&address, body) = rest.split_first().ok_or(Cause::TooShort)?;
                (address, body)
            }
            older => return Err(Cause::Version(older)),
        };
        let header = Header {
            address,
            boot,
            sequence: u32::from_le_bytes([s0, s1, s2, s3]),
            sample_index: u64::from_le_bytes(index),
        };
        Ok(Self {
            version,
            kind,
            header,
            body,
        })
    }

    /// Whether this claims to be the first frame of a boot.
    pub(crate) fn opens_boot(&self) -> bool {
        self.kind == Kind::Identity as u8 && self.header.sequence == 0
    }

    /// Decodes the body.
    pub(crate) fn message(&self) -> Result<Message, Cause> {
        let later = self.version > VERSION;
        let kind = match Kind::from_byte(self.kind) {
            Some(frozen @ (Kind::Identity | Kind::Reply)) => frozen,
            _ if later => return Err(Cause::Version(self.version)),
            kind => kind.ok_or(Cause::Kind(self.kind))?,
        };
        match Message::decode(kind, self.body) {
            Ok((message, rest)) if rest.is_empty() || later => Ok(message),
            Ok(_) => Err(Cause::Trailing),
            Err(_) => Err(Cause::Body),
        }
    }
}
