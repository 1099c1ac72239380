use crate::body::body;
use crate::codes::Codes;
use crate::message::waveform::PIECE;

body! {
    /// A run of samples as they came from the converter, whether there is a strike or not: while a raw stream lasts.
    pub struct Raw {
        /// Sample index of the first scan here. Scans missing between two frames were dropped: see the link frame.
        pub first_index: u64,
        /// The scans at the high gain.
        pub codes: Codes<PIECE>,
    }
}

#[cfg(test)]
pub(crate) fn example() -> Raw {
    Raw {
        first_index: 41_168,
        codes: Codes::pack([[0x123, 0xABC], [0, 0xFFF]]).unwrap(),
    }
}

#[cfg(test)]
pub(crate) const GOLDEN: &str = "000a031102040302010c0b01020a01010907d0c1020623c1ab07f0ff139970b500";
