//! Lost frames, counted by their sequence numbers.
//!
//! # Design
//! The bead numbers every frame that it makes, from 0 at each reset. So the numbers that are missing between
//! two frames received are exactly the frames lost between them: on the line, or because the bead's queue was
//! full. Three things must not be taken for loss:
//!
//! - **A restart.** Another boot byte in the header begins a new run; the first number received of it is the
//!   number of frames lost. A power cycle counts boots anew and may repeat the boot byte. Then the new run
//!   shows by its opening frame, an identity with number 0, or by a step back of more than [`REORDER`]
//!   frames.
//! - **The wrap** after 2³² frames. Differences are taken modulo 2³²; less than half of that is forward.
//! - **A frame that comes late or twice.** A serial line never does this; relays and pipes may. A step back
//!   of at most [`REORDER`] frames fills its gap, or is a duplicate if there was no gap.
//!
//! Some losses cannot be known: frames before the first one received, frames after the last one, and a power
//! cycle within the first [`REORDER`] frames if its opening frame is lost as well.

use serde::Serialize;

/// Greatest number of frames by which a frame may be late.
pub const REORDER: u32 = 64;

/// Place of a frame among the earlier ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Arrival {
    /// The first frame received. Unless its number is 0, frames were missed before it.
    First,
    /// A later frame than all before.
    Next {
        /// Number of frames lost just before this one.
        lost: u32,
    },
    /// The first frame received after a restart of the bead.
    Restart {
        /// Number of frames of the new run lost before this one.
        lost: u32,
    },
    /// A frame that was counted as lost before.
    Late,
    /// A frame that was received before, or is older than the first one received.
    Duplicate,
}

/// State of a run of sequence numbers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SequenceRun {
    boot: u8,
    newest: u32,
    /// Bit `n` is set while the frame `n + 1` before the newest counts as lost.
    missing: u64,
}

impl SequenceRun {
    /// Takes the next frame. `opens_boot` says that it can only be the first of a boot.
    pub(crate) fn follow(run: &mut Option<Self>, boot: u8, sequence: u32, opens_boot: bool) -> Arrival {
        let Some(now) = run else {
            // Frames before the first one received are not counted as lost.
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

/// A number whose `count` lowest bits are set, or all 64.
fn trailing_ones(count: u32) -> u64 {
    1u64.checked_shl(count).map_or(u64::MAX, |next| next - 1)
}
