//! Parts of the window of a strike, and the sizes that follow from them.
//!
//! ```text
//! |  baseline  |  noise  | lead |            strike, ring-down             |
//! 0           64               history                                  length
//!                                 ^ the sample that triggers is the last of the history
//! ```
//!
//! The first [`BASELINE`] samples are quiet and give the zeros of the channels. The whole pieces between them
//! and the last [`LEAD`] samples of the history give the noise. Both estimates run from the end of the noise
//! ([`WindowSettings::noise_end`]) to the end of the window.

use serde::{Deserialize, Serialize};

/// Samples at the start of a window whose mean is the zero of a channel: a power of two.
pub const BASELINE: u16 = 64;

/// Most samples that the estimators take at a time. Their sums of squares have room for this many.
pub const PIECE: usize = 32;

/// Samples before the trigger that do not count as noise: the foot of the wave is in them.
pub const LEAD: u16 = 32;

/// Longest history before the trigger, samples.
pub const HISTORY_MAX: usize = 256;

/// Longest window, samples.
pub const WINDOW_MAX: u16 = 1024;

/// Trigger and window of a strike.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct WindowSettings {
    /// Samples of the window up to and including the one that triggers.
    pub history: u16,
    /// Samples of the whole window.
    pub length: u16,
    /// Rise of the force code that triggers.
    pub threshold: u16,
    /// Samples over which the force must rise by the threshold.
    pub lookback: u16,
}

impl WindowSettings {
    /// Samples from the start of the window to the end of the noise: whole pieces.
    pub fn noise_end(&self) -> u16 {
        (self.history - LEAD) / PIECE as u16 * PIECE as u16
    }
}
