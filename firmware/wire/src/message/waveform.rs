use crate::body::body;
use crate::codes::{Codes, MAX_SCANS};
use crate::quantity::Energy;

/// Bytes of the scans in one frame.
pub(crate) const PIECE: usize = 3 * MAX_SCANS;
/// Bytes of those scans and of the two scans before them.
const PIECE_AND_BEFORE: usize = 3 * (2 + MAX_SCANS);

body! {
    /// Consecutive scans of a strike, and the two estimates after the last of these scans.
    pub struct Waveform {
        /// Number of the strike since the last reset, from 0.
        pub strike: u32,
        /// Sample index of the first scan in `codes`.
        pub first_index: u64,
        /// The scans at the high gain, at most 32.
        pub codes: Codes<PIECE>,
        /// The scans at the low gain, if the estimates used them: the two scans before `first_index`, then
        /// the scans of `codes`. Otherwise empty.
        pub wide: Codes<PIECE_AND_BEFORE>,
        /// Absorbed energy so far, estimated from the acceleration alone.
        pub absorbed_measured: Energy,
        /// Absorbed energy so far, estimated from the force alone.
        pub absorbed_predicted: Energy,
    }
}
