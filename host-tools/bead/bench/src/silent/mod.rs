//! Strikes for which a bead would be silently wrong, played through the flash image to see whether a flag
//! names the cause.
//!
//! # Design
//! A case is a real chain, and its difference from what the settings state. Settings are derived from the
//! real chain, as for any emulated bead, and then changed. The signal is that of the simulated strike, of
//! two such strikes in a row, of a sensor that clips, or of springs that follow another law (`law`).

mod case;
mod cases;
mod law;

pub use case::{SILENT, SilentCase, SilentOutcome};
pub use cases::cases;
