//! Frames from a stream of bytes in which anything may happen.
//!
//! # Design
//! [`Deframer`] finds what stands between two delimiters; here it is checked, and every byte and every frame
//! ends in exactly one counter.

use serde::Serialize;

use crate::cause::{Reject, Rejected};
use crate::deframer::Deframer;
use crate::frame::{Checked, Frame, Header, MAX_ENCODED};
use crate::sequence::{Arrival, Run};

/// What came, what was refused and what never came.
///
/// A frame damaged on the way is in `rejected` *and* in `lost`: nothing in it can be believed, its number
/// included, so nobody knows that the two are one. A frame refused with its CRC right is in `rejected` only.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counters {
    /// Bytes received, delimiters included.
    pub bytes: u64,
    /// Frames accepted, late and duplicate ones included.
    pub frames: u64,
    /// Frames lost, by the numbers missing between two received.
    pub lost: u64,
    /// Frames that came after being counted as lost; they no longer are.
    pub late: u64,
    /// Frames received again.
    pub duplicates: u64,
    /// Restarts of the bead seen.
    pub restarts: u64,
    /// Sequence number of the first frame; of several beads, the highest such number. Unless it is 0, frames were missed
    /// before it: how many is unknown, as the bead may have been sending before anyone listened.
    pub first_sequence: Option<u32>,
    /// Bytes between delimiters that are no frame, by cause.
    pub rejected: Rejected,
}

impl Counters {
    /// Whether the stream was received from the first frame of a boot: if not, what was lost before
    /// [`first_sequence`](Self::first_sequence) is unknown.
    pub fn from_start(&self) -> bool {
        self.first_sequence == Some(0)
    }
}

/// Takes bytes as they come, gives frames and rejects.
#[derive(Clone, Debug)]
pub struct Decoder {
    deframer: Deframer<MAX_ENCODED>,
    /// One run of sequence numbers for each address.
    runs: [Option<Run>; 256],
    counters: Counters,
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

impl Decoder {
    /// A decoder that has received nothing. Joining in the middle of a frame costs one reject.
    pub const fn new() -> Self {
        Self {
            deframer: Deframer::new(),
            runs: [None; 256],
            counters: Counters {
                bytes: 0,
                frames: 0,
                lost: 0,
                late: 0,
                duplicates: 0,
                restarts: 0,
                first_sequence: None,
                rejected: Rejected::NONE,
            },
        }
    }

    /// What was received so far.
    pub const fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Bytes received since the last delimiter: at the end of a stream, an unfinished frame.
    pub const fn pending(&self) -> u64 {
        self.deframer.pending()
    }

    /// Takes any number of bytes, and hands on each frame and each reject as its delimiter comes.
    pub fn feed(&mut self, bytes: &[u8], mut sink: impl FnMut(Result<Frame, Reject>)) {
        for &byte in bytes {
            if let Some(result) = self.push(byte) {
                sink(result);
            }
        }
    }

    /// Takes one byte; a delimiter may give a frame or a reject.
    pub fn push(&mut self, byte: u8) -> Option<Result<Frame, Reject>> {
        self.counters.bytes += 1;
        let between = self.deframer.push(byte)?;
        let result = between.payload.and_then(|payload| {
            let checked = Checked::new(payload)?;
            // Even where the body is not one that we know, the frame itself was not lost.
            let Header {
                address,
                boot,
                sequence,
                ..
            } = checked.header;
            let run = &mut self.runs[usize::from(address)];
            let arrival = Run::follow(run, boot, sequence, checked.opens_boot());
            self.counters.follow(arrival, sequence);
            Ok(Frame {
                version: checked.version,
                header: checked.header,
                arrival,
                message: checked.message()?,
            })
        });
        match result {
            Ok(_) => self.counters.frames += 1,
            Err(cause) => self.counters.rejected.count(cause),
        }
        Some(result.map_err(|cause| Reject {
            cause,
            bytes: between.bytes,
        }))
    }
}

impl Counters {
    fn follow(&mut self, arrival: Arrival, sequence: u32) {
        match arrival {
            Arrival::First => self.first_sequence = self.first_sequence.max(Some(sequence)),
            Arrival::Next { lost } => self.lost += u64::from(lost),
            Arrival::Restart { lost } => {
                self.lost += u64::from(lost);
                self.restarts += 1;
            }
            Arrival::Late => {
                self.lost -= 1;
                self.late += 1;
            }
            Arrival::Duplicate => self.duplicates += 1,
        }
    }
}
