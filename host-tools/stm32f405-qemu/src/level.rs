//! A level on a pin.

use serde::{Deserialize, Serialize};

/// A new level on a pin from outside.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Level {
    /// For example `PA15`.
    pub pin: String,
    /// Virtual time of the edge, in ns since power-up.
    pub at_ns: u64,
    /// True if the level is high from then on.
    pub high: bool,
}
