//! The line to a bead: ports, conversations over them, and the recorder.

pub mod conversation;
pub mod exchanges;
pub mod gaps;
pub mod key;
pub mod lines;
pub mod listener;
pub mod port;
pub mod recorder;
pub mod rom_loader;
pub mod update;

mod silence;
