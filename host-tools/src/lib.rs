//! Host tools of the sensing absorber bead.
//!
//! # Design
//! The library has nine rooms. A file imports from its own room and from the rooms below it, never from a
//! higher one.
//!
//! | room | holds |
//! |---|---|
//! | [`cli`] | the command line: commands, options, output, exit statuses |
//! | [`mod@sweep`] | many scenarios over axes of parameters: points, chunks, parts, clusters |
//! | [`export`] | strikes and samples as tables, and as files of other trades |
//! | [`mod@bench`] | a bead in the emulator: its image in QEMU, faults, and the comparison of a run |
//! | [`comparison`] | signals at a bead, replay, estimates in f64, a strike held against the simulation, reports |
//! | [`waveform`] | force and acceleration over time from files of other instruments |
//! | [`mod@line`] | ports, conversations with a bead, and the recorder |
//! | [`recording`] | files of received bytes, their frames, strikes and clocks |
//! | [`tables`] | Parquet, CSV, units, printable text, files that appear whole |

pub mod bench;
pub mod cli;
pub mod comparison;
pub mod export;
pub mod line;
pub mod recording;
pub mod sweep;
pub mod tables;
pub mod waveform;
