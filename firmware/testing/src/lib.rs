//! Stand-ins for the parts of a bead, shared by the tests of firmware and host.

mod collector;
mod flash;
mod speaker;

pub use collector::Collector;
pub use flash::{FlashFailure, PowerCutFlash};
pub use speaker::{Speaker, block_of};
