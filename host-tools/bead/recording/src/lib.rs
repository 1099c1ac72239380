//! Recordings of beads: files of received bytes, and the frames, strikes, clocks and tables in them.

pub mod arrival;
pub mod assembly;
pub mod beads;
pub mod clock;
pub mod export;
mod fetched;
pub mod fields;
pub mod file;
pub mod frames;
pub mod json;
pub mod note;
pub mod physical;
pub mod protobuf;
pub mod raw;
pub mod received;
pub mod recover;
pub mod schemas;
pub mod signal;
pub mod statuses;
pub mod strike;
pub mod strikes;
pub mod uncertainties;
