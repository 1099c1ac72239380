//! Stand-ins for the parts of a bead, shared by the tests of firmware and host.

mod collector;
mod flash;
mod settings;
mod speaker;
mod strike;

pub use collector::Collector;
pub use flash::{FlashFailure, PowerCutFlash};
pub use settings::any_settings;
pub use speaker::{Speaker, block_of, paper_settings};
pub use strike::{fetched, one_sample_strike, xorshift};
