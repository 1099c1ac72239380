//! The line to a bead: ports, and conversations over them.

pub mod conversation;
pub mod gaps;
pub mod key;
pub mod listener;
pub mod port;
pub mod queue;

mod seen;
