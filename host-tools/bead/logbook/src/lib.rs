//! The recordings of a folder: an index, a search, and trends over days.
//!
//! # Design
//! [`recording`] holds the facts of one recording and reads them from its file. [`index`] keeps those of a
//! folder in one table, which is made anew where a file has changed: every fact in the table is in a
//! recording too. [`filter`] chooses, [`control`] computes limits, [`trend`] puts both together, and
//! [`picture`] draws it.

pub mod control;
pub mod date;
pub mod filter;
pub mod index;
pub mod picture;
pub mod quantity;
pub mod recording;
mod table;
pub mod trend;
