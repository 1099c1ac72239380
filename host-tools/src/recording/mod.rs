//! What is kept: files of received bytes, and the frames, strikes and clocks in them.

pub mod again;
pub mod arrival;
pub mod clock;
pub mod fields;
pub mod file;
pub mod frames;
pub mod json;
pub(crate) mod parquet;
mod parquet_structs;
pub mod physical;
pub mod printable;
pub mod protobuf;
pub mod raw;
pub mod received;
pub mod signal;
pub mod strikes;
mod thrift;
pub mod time_series;
pub mod whole;
