//! What is kept: files of received bytes, and the frames, strikes and clocks in them.

pub mod again;
pub mod arrival;
pub mod clock;
pub mod fields;
pub mod file;
pub mod frames;
pub mod json;
pub mod note;
pub mod physical;
pub mod protobuf;
pub mod raw;
pub mod received;
pub mod signal;
pub mod strikes;
