//! Requests of a host to the bead: the table of all of them, their frame, and its decoder.
//!
//! # Design
//! ```text
//! 0x00  COBS( version u8 | kind u8 | number u16 | address u8 | body | CRC-32 u32 )  0x00
//! ```
//!
//! Only the header differs from that of the bead's frames, as a host has no boot and no samples. The host
//! chooses a number, and the bead's [`Reply`](crate::Reply) has the same one. This header is frozen too, so a
//! bead can answer a request of any later version with [`Outcome::Version`](crate::Outcome::Version).
//!
//! Every request may be repeated: a host that receives no reply asks again, with the same number.

use serde::Serialize;

use crate::body::{Field, FieldDoc};
use crate::cause::{Cause, Rejected};
use crate::deframer::Deframer;
use crate::payload::{BufferTooSmall, CRC_LENGTH, open, seal, whole};
use crate::table::requests;
use crate::text::{Block, Inner, Manifest, Piece};
use crate::version::VERSION;

/// Version, kind, number, address.
const HEADER: usize = 1 + 1 + 2 + 1;
const MAX_PAYLOAD: usize = HEADER + MAX_BODY + CRC_LENGTH;
const MAX_ENCODED: usize = cobs::max_encoding_length(MAX_PAYLOAD);
/// Longest request on the wire with both delimiters, in bytes. A buffer of this length is always long enough.
pub const MAX_REQUEST: usize = 1 + MAX_ENCODED + 1;

/// The address that every bead answers.
pub const ANY: u8 = 0xFF;

requests! {
    /// Send an identity frame and a board frame.
    64 "identity" Identity,
    /// Send status, health and link frames.
    65 "status" Status,
    /// Send a settings frame with the block in force.
    66 "read settings" ReadSettings,
    /// Check this settings block, store it and read it back. Use it from the end of a strike that is being
    /// measured. Then send a settings frame.
    67 "write settings" WriteSettings {
        /// The block, as `bead-model` encodes it.
        block: Block,
    },
    /// Forget the settings that came over the link, and use those that a debug probe put into flash, or else
    /// the built-in ones. Then send a settings frame.
    68 "erase settings" EraseSettings,
    /// Look for strikes, as after a reset.
    69 "arm" Arm,
    /// Look for no strikes until armed again or reset. A strike that is being measured is finished first.
    70 "disarm" Disarm,
    /// Check the bead, and send a self-test frame for each check.
    71 "self-test" SelfTest,
    /// Send every scan for this time, in raw frames, as far as the link can carry them.
    72 "raw" Raw {
        /// The time, in ms, at most 10 000; 0 ends the stream.
        duration_ms: u32,
    },
    /// Set counts to 0: in the status frame overruns, dropped blocks and dropped frames; in the health frame
    /// and in the link frame all counts; in the guard frame those of strikes and refusals.
    73 "reset counters" ResetCounters,
    /// Reply, send the frames that wait, and reset the bead.
    74 "reboot" Reboot,
    /// Keep this key: from now on the bead carries out a request that changes its state only if it is signed.
    /// A bead with a key takes another one only in a signed request.
    75 "set key" SetKey {
        /// The key, or zeros for none; masked in a signed request.
        key: [u8; 16],
    },
    /// Do the request that this one carries, if its code is right, its counter higher than that of every one
    /// before, and its time not over.
    76 "signed" Signed {
        /// Its counter.
        counter: u64,
        /// The boot for which it holds.
        boot: u32,
        /// The last sample index at which it holds.
        until: u64,
        /// Kind of the request that it carries.
        kind: u8,
        /// Body of that request.
        body: Inner,
        /// The code over all of this.
        code: [u8; 16],
    },
    /// Send a kept frame for each strike that the bead keeps, the oldest first.
    77 "list kept" ListKept,
    /// Send the frames of a strike that the bead keeps once more, as fetched frames. While strikes come,
    /// theirs go first.
    78 "fetch" Fetch {
        /// The boot in which the strike was measured.
        boot: u32,
        /// Number of the strike in that boot.
        strike: u32,
    },
    /// Measure the window in which the scan with this index counts as the one that triggers, whatever the
    /// force does. It needs an armed bead at that scan, and becomes a strike with the flag
    /// `triggered_on_request`. The scan has to be one that comes within a minute; while the crystal does not
    /// run, none comes. A new request takes the place of one whose scan has not come.
    79 "keep" Keep {
        /// The sample index of the scan.
        index: u64,
    },
    /// Take another image. A bead that measures judges its manifest, and resets: from the next start on it
    /// takes no samples and waits for the image, for ten seconds at most from request to request. A bead
    /// that waits makes room for it, which takes one to four seconds.
    80 "begin update" BeginUpdate {
        /// The signed manifest that stands at the end of the image's file: what is to come.
        manifest: Manifest,
        /// True to take an image that is older than the one that runs.
        older: bool,
    },
    /// Bytes of the image that was begun.
    81 "update data" UpdateData {
        /// The place of the first of them in the image; a multiple of 4.
        offset: u32,
        /// The bytes; a multiple of 4 of them, except for the last.
        bytes: Piece,
    },
    /// The image is whole: compare it with its manifest, reply, and reset. The next start tries it, and
    /// keeps it if it passes its self-test. Else the one after that goes back to the image before.
    82 "finish update" FinishUpdate,
    /// Send an image frame. It takes the bead some 50 ms to read its flash.
    88 "image" Image,
    /// On a bench: put these codes on the two outputs, PA4 and PA5, and send every scan for this time, in raw
    /// frames, as far as the link can carry them. Look for no strikes meanwhile. Then send a played frame.
    89 "hold" Hold {
        /// The code of PA4, 0 to 4095.
        force: u16,
        /// The code of PA5, 0 to 4095.
        acceleration: u16,
        /// The time, in ms, at most 400.
        duration_ms: u32,
    },
    /// On a bench: play a made-up strike on the outputs, so often, and look for strikes meanwhile, armed or
    /// not. A window that has any of this time in it is a strike with the flag `played`. Send a played frame
    /// after each.
    90 "play" Play {
        /// The number of strikes. All of them may take 400 ms.
        strikes: u32,
        /// The time from one to the next, in ms, at least 5.
        interval_ms: u32,
    },
    /// On a bench: reply, send the frames that wait, and hang, so that the watchdog resets the bead.
    91 "hang" Hang,
}

/// Writes one request, with both its delimiters, to the head of `buffer` and returns it. It is for the bead
/// with this address, or for any bead: [`ANY`].
///
/// # Errors
/// The buffer is too small. [`MAX_REQUEST`] bytes are always enough.
pub fn encode_request<'b>(
    address: u8,
    number: u16,
    request: &Request,
    buffer: &'b mut [u8],
) -> Result<&'b [u8], BufferTooSmall> {
    let mut payload = [0; MAX_PAYLOAD];
    let [low, high] = number.to_le_bytes();
    payload[..HEADER].copy_from_slice(&[VERSION, request.number(), low, high, address]);
    // `MAX_BODY` covers every body, so this cannot fail.
    let length = request
        .encode(&mut payload[HEADER..HEADER + MAX_BODY])
        .map_err(|_| BufferTooSmall(buffer.len()))?;
    seal(&mut payload, HEADER + length, buffer)
}

/// A frame of a host whose CRC is right. Its sender waits for a reply.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReceivedRequest {
    /// Address of the bead that is asked, or [`ANY`].
    pub address: u8,
    /// The number that the reply must have.
    pub number: u16,
    /// The request, or the reason why the bead does not understand it.
    pub request: Result<Request, Cause>,
}

/// Counts of requests received and refused.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct RequestCounters {
    /// Number of bytes received, with delimiters.
    pub bytes: u64,
    /// Number of requests understood, to any address.
    pub requests: u64,
    /// Runs between delimiters that are no request, by cause.
    pub rejected: Rejected,
}

/// Takes bytes one at a time and returns requests. It keeps at most one request, allocates nothing and cannot
/// panic.
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
    pub fn new() -> Self {
        Self {
            deframer: Deframer::new(),
            counters: RequestCounters::default(),
        }
    }

    /// Counts so far.
    pub const fn counters(&self) -> &RequestCounters {
        &self.counters
    }

    /// Takes what was received so far; the counts begin again at 0. Bytes since the last delimiter are kept.
    pub fn take_counters(&mut self) -> RequestCounters {
        core::mem::take(&mut self.counters)
    }

    /// Takes one byte. A delimiter may return a frame, or the reason why the bytes before it are no frame.
    /// Nobody waits for a reply to such bytes.
    pub fn push(&mut self, byte: u8) -> Option<Result<ReceivedRequest, Cause>> {
        self.counters.bytes += 1;
        let heard = self.deframer.push(byte)?.payload.and_then(read);
        match &heard {
            Ok(ReceivedRequest { request: Ok(_), .. }) => self.counters.requests += 1,
            Ok(ReceivedRequest {
                request: Err(cause), ..
            })
            | Err(cause) => self.counters.rejected.count(*cause),
        }
        Some(heard)
    }
}

fn read(payload: &[u8]) -> Result<ReceivedRequest, Cause> {
    let (&[version, kind, low, high, address], body) = open::<HEADER>(payload)?;
    Ok(ReceivedRequest {
        address,
        number: u16::from_le_bytes([low, high]),
        request: match version {
            VERSION => Request::decode(kind, body),
            other => Err(Cause::Version(other)),
        },
    })
}
