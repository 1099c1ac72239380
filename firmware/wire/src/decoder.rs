//! Frames from a stream in which any byte may be missing or wrong.
//!
//! # Design
//! [`Deframer`] finds the bytes between two delimiters. [`Decoder`] checks them: they are a frame or a
//! reject, and are counted once.

use serde::Serialize;

use crate::cause::{Reject, Rejected};
use crate::deframer::Deframer;
use crate::frame::{Checked, Frame, Header, MAX_ENCODED};
use crate::sequence::{Arrival, SequenceRun};

/// Counts of frames received, refused and missing.
///
/// A frame damaged on the way is in `rejected` *and* in `lost`. Its number cannot be trusted, so the two
/// counts cannot be joined. A frame that is refused although its CRC is right is in `rejected` only.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counters {
    /// Number of bytes received, with delimiters.
    pub bytes: u64,
    /// Number of frames accepted, with late and duplicate ones.
    pub frames: u64,
    /// Number of frames lost: the sequence numbers that are missing between two received frames.
    pub lost: u64,
    /// Number of frames that came late: they were counted as lost before, and no longer are.
    pub late: u64,
    /// Number of frames received again.
    pub duplicates: u64,
    /// Number of restarts of the bead.
    pub restarts: u64,
    /// Sequence number of the first frame; with several beads, the highest of theirs. Unless it is 0, frames
    /// were missed before it. Their number is unknown, as the bead may have sent before anyone listened.
    pub first_sequence: Option<u32>,
    /// Runs between delimiters that are no frame, by cause.
    pub rejected: Rejected,
}

impl Counters {
    /// Returns `true` if the first frame received of each bead was the first of its boot. If not, it is
    /// unknown what was lost before it.
    pub fn from_start(&self) -> bool {
        self.first_sequence == Some(0)
    }

    /// The sums of the counts of this line and of another.
    #[must_use]
    pub fn and(&self, other: &Self) -> Self {
        Self {
            bytes: self.bytes + other.bytes,
            frames: self.frames + other.frames,
            lost: self.lost + other.lost,
            late: self.late + other.late,
            duplicates: self.duplicates + other.duplicates,
            restarts: self.restarts + other.restarts,
            first_sequence: self.first_sequence.max(other.first_sequence),
            rejected: self.rejected.and(&other.rejected),
        }
    }
}

/// Takes bytes in any pieces and returns frames and rejects.
#[derive(Clone, Debug)]
pub struct Decoder {
    deframer: Deframer<MAX_ENCODED>,
    /// A run of sequence numbers for each address.
    runs: [Option<SequenceRun>; 256],
    counters: Counters,
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

impl Decoder {
    /// A decoder that has received nothing. Joining in the middle of a frame costs one reject.
    pub fn new() -> Self {
        Self {
            deframer: Deframer::new(),
            runs: [None; 256],
            counters: Counters::default(),
        }
    }

    /// Counts so far.
    pub const fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Number of bytes received since the last delimiter. At the end of a stream they are an unfinished
    /// frame.
    pub const fn pending(&self) -> u64 {
        self.deframer.pending()
    }

    /// Takes any number of bytes, and hands each frame and each reject to `sink`.
    pub fn feed(&mut self, bytes: &[u8], mut sink: impl FnMut(Result<Frame, Reject>)) {
        for &byte in bytes {
            if let Some(result) = self.push(byte) {
                sink(result);
            }
        }
    }

    /// Takes one byte. A delimiter may complete a frame or a reject.
    pub fn push(&mut self, byte: u8) -> Option<Result<Frame, Reject>> {
        self.counters.bytes += 1;
        let between = self.deframer.push(byte)?;
        let result = between.payload.and_then(|payload| {
            let checked = Checked::new(payload)?;
            // The frame counts as received even if its body cannot be read.
            let Header {
                address,
                boot,
                sequence,
                ..
            } = checked.header;
            let run = &mut self.runs[usize::from(address)];
            let arrival = SequenceRun::follow(run, boot, sequence, checked.opens_boot());
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_of_two_lines_are_added_and_the_later_start_of_the_two_counts() {
        let counters = |factor: u64, first_sequence| {
            let mut rejected = Rejected::default();
            (0..factor).for_each(|_| rejected.count(crate::cause::Cause::Crc));
            Counters {
                bytes: 3 * factor,
                frames: 5 * factor,
                lost: 7 * factor,
                late: 11 * factor,
                duplicates: 13 * factor,
                restarts: 17 * factor,
                first_sequence,
                rejected,
            }
        };
        for (one, other, both) in [
            (None, None, None),
            (Some(0), Some(9), Some(9)),
            (Some(9), Some(0), Some(9)),
            (Some(4), None, Some(4)),
            (Some(0), Some(0), Some(0)),
        ] {
            let sum = counters(1, one).and(&counters(3, other));
            assert_eq!(sum, counters(4, both));
            assert_eq!(sum.from_start(), both == Some(0));
        }
    }
}
