//! The command line of the sensing absorber bead: commands, options, output, exit statuses.
//!
//! # Design
//! The work is done by the crates below, each of which stands alone.
//!
//! - [`bead_bench`]: a bead in the emulator: its image in QEMU, faults, the comparison of a run
//! - [`bead_compare`]: signals at a bead, replay, estimates in f64, comparison with the simulation, reports
//! - [`bead_console`]: output, files, signals and exit statuses of commands
//! - [`bead_instrument`]: force and acceleration over time from files of other instruments
//! - [`bead_line`]: ports, conversations with a bead, and the recorder
//! - [`bead_recording`]: files of received bytes, their frames, strikes, clocks and exports
//! - [`bead_tables`]: Parquet, CSV, units, printable text, files that appear whole
//! - [`hertz_commands`]: the simulator's commands

// For its macros: `failure!`, `bail!`, `note!`.
#[macro_use]
extern crate bead_console;

pub mod cli;
