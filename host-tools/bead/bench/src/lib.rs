//! A bead in the emulator: its image in QEMU, faults, and the comparison of a run with the simulation.

pub mod accuracy;
pub mod bridge;
pub mod emulation;
pub mod error;
mod fault_reports;
pub mod faults;
pub mod image;
mod playback;
pub mod recording;
pub mod run;
pub mod several;
pub mod silent;
pub mod tables;
