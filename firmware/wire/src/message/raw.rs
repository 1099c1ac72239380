use crate::body::body;
use crate::codes::Codes;
use crate::message::waveform::PIECE;

body! {
    /// Consecutive scans as they came from the converter, with or without a strike. A host asks for such a
    /// stream.
    pub struct Raw {
        /// Sample index of the first scan in `codes`. Scans that are missing between two frames were dropped
        /// and are counted in the link frame.
        pub first_index: u64,
        /// The scans at the high gain, at most 32.
        pub codes: Codes<PIECE>,
    }
}
