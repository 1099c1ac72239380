//! Strikes at which a bead would be wrong without a word, played through the flash image: what it says of
//! each, and whether a flag names the cause.
//!
//! # Design
//! A case is a real chain, and how it differs from what the settings state. Settings are derived from the
//! real chain, as for any emulated bead, and then restated. A signal is the simulated one, two of it one
//! after the other, one that a sensor clips, or that of springs with a law of their own (`law`).

mod case;
mod cases;
mod law;

pub use case::{SILENT, SilentCase, SilentOutcome};
pub use cases::cases;
