//! Live beads on a terminal, a web page and in other programs.
//!
//! # Design
//! One [`Monitor`] has the state of all beads. A recorder or a follower of a recording feeds it frame by
//! frame, and never waits for a reader: pages take a [`MonitorView`], and the strikes after the last one that
//! they have, when they are ready for them. The last [`HISTORY`](model::HISTORY) strikes are kept. A page
//! that is too slow for that misses strikes and learns how many; the recording has them.

mod control;
mod feed;
pub mod foxglove;
pub mod model;
mod publish;
pub mod strike;
pub mod terminal;
#[cfg(test)]
mod tests;
pub mod udp;
pub mod web;

pub use control::Control;
pub use feed::{Feed, follow};
pub use model::{Monitor, MonitorView, SharedMonitor};
