//! What a host asks of the bead: the table of all requests, their frame, and its decoder.
//!
//! # Design
//! ```text
//! 0x00  COBS( version u8 | kind u8 | number u16 | address u8 | body | CRC-32 u32 )  0x00
//! ```
//!
//! The frame is that of the bead's own messages but for its header: a host has no boot and no samples. It chooses a
//! number, and the bead's [`Reply`](crate::Reply) has the same one. The header is frozen, so that a bead can answer a
//! request of any later version with [`Outcome::Version`](crate::Outcome::Version).
//!
//! A request may always be repeated: a host that hears no reply asks again, under the same number.

use serde::Serialize;

use crate::body::{Field, FieldDoc};
use crate::cause::{Cause, Rejected};
use crate::deframer::Deframer;
use crate::payload::{BufferTooSmall, CRC_LENGTH, VERSION, open, seal, whole};
use crate::table::requests;
use crate::text::Block;

/// Version, kind, number.
const HEADER: usize = 1 + 1 + 2;
const MAX_PAYLOAD: usize = HEADER + 1 + MAX_BODY + CRC_LENGTH;
const MAX_ENCODED: usize = corncobs::max_encoded_len(MAX_PAYLOAD) - 1;
/// Longest request on the wire with both delimiters, in bytes: a buffer this long always does.
pub const MAX_REQUEST: usize = 1 + MAX_ENCODED + 1;

/// The address that every bead answers to.
pub const ANY: u8 = 0xFF;

requests! {
    /// Send an identity frame.
    64 "identity" Identity,
    /// Send status, health and link frames.
    65 "status" Status,
    /// Send a settings frame with the block in force.
    66 "read settings" ReadSettings,
    /// Check this settings block, store it, read it back, and use it from the end of a strike that is being measured;
    /// then send a settings frame.
    67 "write settings" WriteSettings {
        /// The block, as `bead-model` encodes it.
        block: Block,
    },
    /// Forget the stored settings: back to those that a debug probe put into flash, or else the built-in ones; then send
    /// a settings frame.
    68 "erase settings" EraseSettings,
    /// Look for strikes, as after a reset.
    69 "arm" Arm,
    /// Look for no strikes from the end of the one that is being measured, until armed again or reset.
    70 "disarm" Disarm,
    /// Send one self-test frame for each check.
    71 "self-test" SelfTest,
    /// Send every scan for a time, as far as the link carries them.
    72 "raw" Raw {
        /// The time in ms, at most 10 000; 0 ends the stream.
        duration_ms: u32,
    },
    /// Set counts to 0: in the status frame overruns, dropped blocks and dropped frames; all counts of health and link.
    73 "reset counters" ResetCounters,
    /// Reply, send the frames that wait, and reset.
    74 "reboot" Reboot,
}

/// Writes one request to the bead with this address, or to [`ANY`], with both its delimiters, to the head of `buffer` and
/// returns it.
///
/// # Errors
/// A buffer too small; [`MAX_REQUEST`] bytes always suffice.
pub fn encode_request<'b>(
    address: u8,
    number: u16,
    request: &Request,
    buffer: &'b mut [u8],
) -> Result<&'b [u8], BufferTooSmall> {
    let mut payload = [0; MAX_PAYLOAD];
    let [low, high] = number.to_le_bytes();
    payload[..=HEADER].copy_from_slice(&[VERSION, request.number(), low, high, address]);
    let start = HEADER + 1;
    // `MAX_BODY` covers every body, so this cannot fail.
    let length = request
        .encode(&mut payload[start..start + MAX_BODY])
        .map_err(|_| BufferTooSmall(buffer.len()))?;
    seal(&mut payload, start + length, buffer)
}

/// A frame of a host whose CRC is right: somebody waits for a reply.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Heard {
    /// Address of the bead that is asked, or [`ANY`]. Version 2 had no address; its requests are for any bead.
    pub address: u8,
    /// The number that the reply must have.
    pub number: u16,
    /// What is asked, or why it is not understood.
    pub request: Result<Request, Cause>,
}

/// What came in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct RequestCounters {
    /// Bytes received, delimiters included.
    pub bytes: u64,
    /// Requests understood, to whatever address.
    pub requests: u64,
    /// Bytes between delimiters that are no request, by cause.
    pub rejected: Rejected,
}

impl RequestCounters {
    const NONE: Self = Self {
        bytes: 0,
        requests: 0,
        rejected: Rejected::NONE,
    };
}

/// Takes bytes as they come, gives requests. Keeps one request, allocates nothing, cannot panic.
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
            counters: RequestCounters::NONE,
        }
    }

    /// What was received so far.
    pub const fn counters(&self) -> &RequestCounters {
        &self.counters
    }

    /// What was received so far, to be counted elsewhere: the count starts again. Bytes since the last delimiter are
    /// kept.
    pub fn take_counters(&mut self) -> RequestCounters {
        core::mem::replace(&mut self.counters, RequestCounters::NONE)
    }

    /// Takes one byte. A delimiter may give a request, or the cause for which bytes are no frame at all: nobody waits for
    /// a reply to those.
    pub fn push(&mut self, byte: u8) -> Option<Result<Heard, Cause>> {
        self.counters.bytes += 1;
        let heard = self.deframer.push(byte)?.payload.and_then(read);
        match &heard {
            Ok(Heard { request: Ok(_), .. }) => self.counters.requests += 1,
            Ok(Heard {
                request: Err(cause), ..
            })
            | Err(cause) => self.counters.rejected.count(*cause),
        }
        Some(heard)
    }
}

fn read(payload: &[u8]) -> Result<Heard, Cause> {
    let (&[version, kind, low, high], rest) = open::<HEADER>(payload)?;
    let (address, request) = match (version, rest.split_first()) {
        (VERSION.., None) => return Err(Cause::TooShort),
        (VERSION, Some((&address, body))) => (address, Request::decode(kind, body)),
        (later @ VERSION.., Some((&address, _))) => (address, Err(Cause::Version(later))),
        (older, _) => (ANY, Err(Cause::Version(older))),
    };
    Ok(Heard {
        address,
        number: u16::from_le_bytes([low, high]),
        request,
    })
}
