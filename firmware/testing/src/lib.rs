//! Stand-ins for the parts of a bead, shared by the tests of firmware and host.

mod flash;

pub use flash::{FlashFailure, PowerCutFlash};
