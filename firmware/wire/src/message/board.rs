use crate::body::body;
use crate::text::Text;

/// Longest name of a board, in bytes.
pub const MAX_BOARD: usize = 24;

body! {
    /// Board, crystal and part that the image runs on. It comes with each identity frame.
    pub struct Board {
        /// Name of the board that the image was built for.
        pub name: Text<MAX_BOARD>,
        /// Crystal that the clocks are made of, MHz; 0 for the internal oscillator. It was measured at the
        /// start.
        pub crystal_mhz: u8,
        /// DEV_ID of the part (RM0090 section 38.6.1): 0x413 is the STM32F405.
        pub part: u16,
        /// REV_ID of the part.
        pub revision: u16,
        /// Brown-out level of the option bytes, 1 to 3; 0 if it is off (RM0090 section 3.9.7). At 3 the part
        /// is in reset below about 2.8 V.
        pub brown_out_level: u8,
        /// Level of the read protection, 0 to 2 (RM0090 section 3.6.4).
        pub read_protection: u8,
    }
}
