use crate::body::body;
use crate::names::bits;
use crate::text::Text;

/// Longest package version sent, in bytes.
pub const MAX_FIRMWARE: usize = 24;
/// Longest git description sent, in bytes: a full hash with `-dirty` fits.
pub const MAX_GIT: usize = 48;

body! {
    /// Who the bead is, and the unit of its sample index. It is the first frame after a reset, and comes
    /// every second.
    ///
    /// This body is frozen: a reader of any version understands it in a frame of any later version.
    pub struct Identity {
        /// Package version of the image.
        pub firmware: Text<MAX_FIRMWARE>,
        /// Git description of the tree that the image was built from.
        pub git: Text<MAX_GIT>,
        /// Unique device id, 96 bits (RM0090 section 39.1).
        pub uid: [u8; 12],
        /// Number of resets since power-up. Its low byte is in every header.
        pub boot: u32,
        /// Causes of the last reset: bits 31 to 24 of RCC_CSR (RM0090 section 7.3.21).
        pub reset_cause: ResetCauses,
        /// Scans per second, in Hz. A sample index over this rate is a time in s.
        pub sample_rate_hz: u32,
        /// Number of ADC channels in a scan.
        pub channels: u8,
    }
}

bits! {
    /// Causes of the last reset.
    pub struct ResetCauses(u8) {
        /// The supply fell below the brown-out threshold.
        1 "brown_out" BROWN_OUT,
        /// The reset pin was low.
        2 "pin" PIN,
        /// The power was switched on.
        3 "power_on" POWER_ON,
        /// The firmware reset the bead.
        4 "software" SOFTWARE,
        /// The independent watchdog was not fed in time.
        5 "independent_watchdog" INDEPENDENT_WATCHDOG,
        /// The window watchdog was not fed within its window.
        6 "window_watchdog" WINDOW_WATCHDOG,
        /// The core entered a low-power mode that is not allowed.
        7 "low_power" LOW_POWER,
    }
}
