//! What a host asks of the bead.
//!
//! # Design
//! ```text
//! 0x00  COBS( version u8 | kind u8 | number u16 | body | CRC-32 u32 )  0x00
//! ```
//!
//! The frame is that of the bead's own messages but for its header: a host needs no boot and has no samples. It
//! chooses a number, and the bead's [`Reply`](crate::Reply) has the same one. The first four bytes are what they are in every
//! version, so that a bead can say that it does not understand.
//!
//! Whatever may be asked may be asked twice: a host that hears no reply asks again, under the same number.

use serde::{Deserialize, Serialize};

use crate::decoder::Rejected;
use crate::deframer::Deframer;
use crate::frame::{CRC_LENGTH, Cause, EncodeError, VERSION, checked, frame, whole, within};
use crate::message::{MAX_BLOCK, slice};

/// Version, kind, number.
const HEADER: usize = 1 + 1 + 2;
/// The settings block is the longest body.
const MAX_BODY: usize = slice(MAX_BLOCK);
const MAX_PAYLOAD: usize = HEADER + MAX_BODY + CRC_LENGTH;
const MAX_ENCODED: usize = corncobs::max_encoded_len(MAX_PAYLOAD) - 1;
/// Longest request on the wire with both delimiters, in bytes: a buffer this long always does.
pub const MAX_REQUEST: usize = 1 + MAX_ENCODED + 1;

/// What a host may ask. Numbers of kinds are from 64 up, so that none is taken for a message of the bead.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(tag = "request", rename_all = "snake_case")]
pub enum Request<'a> {
    /// Send an identity frame.
    Identity,
    /// Send status, health and link frames.
    Status,
    /// Send the settings block in force.
    ReadSettings,
    /// Check, store and use this settings block.
    WriteSettings {
        /// The block, as `bead-model` encodes it; at most [`MAX_BLOCK`] bytes.
        block: &'a [u8],
    },
    /// Forget the stored settings: back to those that a debug probe put into flash, or else the built-in ones.
    EraseSettings,
    /// Look for strikes.
    Arm,
    /// Look for none from the end of the one that is being measured, until armed again or reset.
    Disarm,
    /// Send one self-test frame for each check.
    SelfTest,
    /// Send every scan for so long, as far as the link carries them.
    Raw {
        /// In ms; 0 ends the stream.
        duration_ms: u32,
    },
    /// Set the counts of status, health and link frames to 0, as far as nothing else is counted by them.
    ResetCounters,
    /// Reply, send what waits, and reset.
    Reboot,
}

#[derive(Serialize, Deserialize)]
struct Block<'a> {
    block: &'a [u8],
}

#[derive(Serialize, Deserialize)]
struct Duration {
    duration_ms: u32,
}

impl<'a> Request<'a> {
    /// The second byte of its frame.
    pub const fn kind(&self) -> u8 {
        match self {
            Self::Identity => 64,
            Self::Status => 65,
            Self::ReadSettings => 66,
            Self::WriteSettings { .. } => 67,
            Self::EraseSettings => 68,
            Self::Arm => 69,
            Self::Disarm => 70,
            Self::SelfTest => 71,
            Self::Raw { .. } => 72,
            Self::ResetCounters => 73,
            Self::Reboot => 74,
        }
    }

    fn decode(kind: u8, body: &'a [u8]) -> Result<Self, Cause> {
        let bare = |request| match body {
            [] => Ok(request),
            _ => Err(Cause::Trailing),
        };
        match kind {
            64 => bare(Self::Identity),
            65 => bare(Self::Status),
            66 => bare(Self::ReadSettings),
            67 => whole(body).map(|Block { block }| Self::WriteSettings { block }),
            68 => bare(Self::EraseSettings),
            69 => bare(Self::Arm),
            70 => bare(Self::Disarm),
            71 => bare(Self::SelfTest),
            72 => whole(body).map(|Duration { duration_ms }| Self::Raw { duration_ms }),
            73 => bare(Self::ResetCounters),
            74 => bare(Self::Reboot),
            _ => Err(Cause::Kind(kind)),
        }
    }

    fn encode(&self, buffer: &mut [u8]) -> Result<usize, EncodeError> {
        let room = buffer.len();
        let written = match self {
            Self::WriteSettings { block } => {
                within(block, MAX_BLOCK)?;
                postcard::to_slice(&Block { block }, buffer)
            }
            Self::Raw { duration_ms } => postcard::to_slice(
                &Duration {
                    duration_ms: *duration_ms,
                },
                buffer,
            ),
            _ => return Ok(0),
        };
        // `MAX_BODY` covers the longest block, so this cannot fail.
        Ok(written.map_err(|_| EncodeError::BufferTooSmall(room))?.len())
    }
}

/// Writes one request, with both its delimiters, to the head of `buffer` and returns it.
///
/// # Errors
/// A settings block longer than [`MAX_BLOCK`], or a buffer shorter than the frame.
pub fn encode_request<'b>(
    number: u16,
    request: &Request<'_>,
    buffer: &'b mut [u8],
) -> Result<&'b [u8], EncodeError> {
    let mut payload = [0; MAX_PAYLOAD];
    let [low, high] = number.to_le_bytes();
    payload[..HEADER].copy_from_slice(&[VERSION, request.kind(), low, high]);
    let body = request.encode(&mut payload[HEADER..HEADER + MAX_BODY])?;
    frame(&mut payload, HEADER + body, buffer)
}

/// A request with its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Numbered<'a> {
    /// What the reply is to have.
    pub number: u16,
    /// What is asked.
    pub request: Request<'a>,
}

/// Bytes between two delimiters that are no request.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct RejectedRequest {
    /// Why not.
    pub cause: Cause,
    /// Its number, where the CRC is right: somebody waits for a reply.
    pub number: Option<u16>,
}

/// What came in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct RequestCounters {
    /// Bytes received, delimiters included.
    pub bytes: u64,
    /// Requests accepted.
    pub requests: u64,
    /// Bytes between delimiters that are no request, by cause.
    pub rejected: Rejected,
}

/// Takes bytes as they come, gives requests and rejects. Keeps one request, allocates nothing, cannot panic.
#[derive(Clone, Debug)]
pub struct RequestDecoder {
    deframer: Deframer<MAX_ENCODED>,
    counters: RequestCounters,
}

impl Default for RequestDecoder {
    fn default() -> Self {
        Self::new()
    }
}

impl RequestDecoder {
    /// A decoder that has received nothing.
    pub const fn new() -> Self {
        Self {
            deframer: Deframer::new(),
            counters: RequestCounters {
                bytes: 0,
                requests: 0,
                rejected: Rejected::NONE,
            },
        }
    }

    /// What was received so far.
    pub const fn counters(&self) -> &RequestCounters {
        &self.counters
    }

    /// What was received so far, to be counted elsewhere: from here on it counts anew. What stands since the last
    /// delimiter is kept.
    pub fn take_counters(&mut self) -> RequestCounters {
        core::mem::take(&mut self.counters)
    }

    /// Takes one byte; a delimiter may give a request or a reject.
    pub fn push(&mut self, byte: u8) -> Option<Result<Numbered<'_>, RejectedRequest>> {
        self.counters.bytes += 1;
        let result = match self.deframer.push(byte)?.payload {
            Ok(payload) => read(payload),
            Err(cause) => Err(RejectedRequest { cause, number: None }),
        };
        match &result {
            Ok(_) => self.counters.requests += 1,
            Err(reject) => self.counters.rejected.count(reject.cause),
        }
        Some(result)
    }
}

fn read(payload: &[u8]) -> Result<Numbered<'_>, RejectedRequest> {
    let (&[version, kind, low, high], body) =
        checked::<HEADER>(payload).map_err(|cause| RejectedRequest { cause, number: None })?;
    let number = u16::from_le_bytes([low, high]);
    let request = match version {
        VERSION => Request::decode(kind, body),
        other => Err(Cause::Version(other)),
    };
    request
        .map(|request| Numbered { number, request })
        .map_err(|cause| RejectedRequest {
            cause,
            number: Some(number),
        })
}
