//! Stand-ins for the parts of a bead, shared by the tests of firmware and host.

mod bodies;
mod collector;
mod flash;
mod request;
mod settings;
mod speaker;
mod strike;

pub use bodies::bodies;
pub use collector::Collector;
pub use flash::{FlashFailure, PowerCutFlash};
pub use request::{framed, write};
pub use settings::{any_settings, block, block_of, paper_settings, settings_at, struck_codes};
pub use speaker::Speaker;
pub use strike::{fetched, one_sample_strike, xorshift};
