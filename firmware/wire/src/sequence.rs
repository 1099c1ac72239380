//! How many frames were lost, from their sequence numbers.
//!
//! # Design
//! The bead numbers every frame that it makes from 0 at each reset, so the numbers missing between two
//! frames received are exactly the frames lost between them, on the wire or for want of queue. Three
//! things must not be taken for loss:
//!
//! - **A restart.** Another boot byte in the header opens a new run: its number so far is its loss. The
//!   boot byte is counted from power-up, so a power cycle may repeat it; then the run is told by its
//!   opening frame (an Identity numbered 0), or by a step back of more than [`REORDER`] frames.
//! - **The wrap** after 2³² frames: differences are taken modulo 2³²; less than half is forward.
//! - **A frame late or twice.** A serial line does neither, relays and pipes may: a step back within
//!   [`REORDER`] frames fills its gap again, or is a duplicate where there was none.
//!
//! What cannot be known: frames before the first one received, frames after the last, and a power cycle
//! within the first [`REORDER`] frames whose opening frame is lost as well.

use serde::Serialize;

/// How many frames back one may still arrive late.
pub const REORDER: u32 = 64;

/// How a frame follows on those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Arrival {
    /// The first one received; frames before it, if its number is not 0, are unknown.
    First,
    /// Further on by one, or by more when this many were lost between.
    Next {
        /// Frames lost just before this one.
        lost: u32,
    },
    /// The first one received after the bead restarted.
    Restart {
        /// Frames of the new run lost before this one.
        lost: u32,
    },
    /// Counted as lost before, and come after all.
    Late,
    /// Received before, or older than the first one received.
    Duplicate,
}

/// Where the run of sequence numbers stands.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Run {
    boot: u8,
    newest: u32,
    /// Bit `n` is set while the frame `n + 1` before the newest counts as lost.
    missing: u64,
}

impl Run {
    /// Follows one frame; `opens_boot` says that it can only be the first of a boot.
    pub(crate) fn follow(run: &mut Option<Self>, boot: u8, sequence: u32, opens_boot: bool) -> Arrival {
        let Some(now) = run else {
            // What came before the first frame was never counted as lost.
            *run = Some(Self {
                boot,
                newest: sequence,
                missing: 0,
            });
            return Arrival::First;
        };
        let ahead = sequence.wrapping_sub(now.newest);
        let behind = now.newest.wrapping_sub(sequence);
        let restarted =
            boot != now.boot || (opens_boot && ahead != 0) || (ahead >= 1 << 31 && behind > REORDER);
        if restarted {
            *now = Self {
                boot,
                newest: sequence,
                missing: trailing_ones(sequence),
            };
            Arrival::Restart { lost: sequence }
        } else if ahead == 0 {
            Arrival::Duplicate
        } else if ahead < 1 << 31 {
            let lost = ahead - 1;
            now.newest = sequence;
            now.missing = now.missing.checked_shl(ahead).unwrap_or(0) | trailing_ones(lost);
            Arrival::Next { lost }
        } else {
            let bit = 1 << (behind - 1);
            let late = now.missing & bit != 0;
            now.missing &= !bit;
            if late { Arrival::Late } else { Arrival::Duplicate }
        }
    }
}

/// The `count` lowest bits, all 64 where there are no more.
fn trailing_ones(count: u32) -> u64 {
    1u64.checked_shl(count).map_or(u64::MAX, |next| next - 1)
}
