//! Host tools of the sensing absorber bead.
//!
//! The command line `bead` is a thin shell over this library: [`cli`] is the command tree, and each command is a
//! file of `commands`.

pub mod bridge;
pub mod cli;
pub mod clock;
mod commands;
pub mod comparison;
pub mod conversation;
pub mod emulation;
pub mod f64_estimators;
pub mod failure;
pub mod faults;
pub mod figure;
pub mod figures;
pub mod frames;
pub mod front_end;
mod front_end_options;
mod line_options;
pub mod output;
pub mod port;
pub mod received;
pub mod recording;
pub mod replay;
pub mod report;
pub mod sensed;
pub mod strikes;
#[cfg(test)]
mod testing;
pub mod time_series;
