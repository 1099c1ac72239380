//! The work of the bead, apart from its hardware: it measures strikes, watches its sensors, does what a host
//! asks for, and queues frames.
//!
//! # Design
//! [`BeadState`] is the state that tasks of every priority share. All of it is empty or zero at first, so
//! that a static takes no flash. [`Estimation`] and [`Commands`] each belong to one task. They reach the
//! hardware only through the trait [`Device`], which the image implements for the STM32F405, and tests for a
//! computer.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

mod answer;
mod bead;
mod block;
mod boot;
mod built_in;
mod commands;
mod conditions;
mod counters;
mod device;
mod estimate;
mod exchange;
mod frames;
mod health;
mod keep;
mod known_answer;
mod load;
mod offer;
mod outbox;
mod played;
mod played_scans;
mod progress;
mod raw;
mod report;
mod self_test;
mod settings;
mod shared;
#[cfg(test)]
mod tests;
mod trigger_line;
mod update;

pub use bead::{BeadState, RING};
pub use block::{BLOCK_US, BlockCodes, CHANNELS, SAMPLE_RATE_HZ, SCANS_PER_BLOCK, ScanBlock};
pub use boot::{BootFault, BootRecord, FramesWaiting, ThisBoot};
pub use commands::Commands;
pub use counters::BeadCounters;
pub use device::{Device, FactoryCodes, InternalChannel, LineTimer, MS};
pub use estimate::Estimation;
pub use health::SensorWatch;
pub use progress::Progress;
pub use settings::{Loaded, RefusedSettings};
pub use trigger_line::CLOCKS_PER_SAMPLE;
