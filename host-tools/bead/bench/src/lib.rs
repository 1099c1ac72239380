//! A bead in the emulator: its image in QEMU, faults, and the comparison of a run with the simulation; and
//! a bead without sensors, in the emulator or on a real board, that plays to itself ([`loopback`]).

pub mod accuracy;
pub mod bridge;
pub mod counted_cycles;
pub mod coverage;
pub mod emulation;
pub mod error;
mod fault_reports;
pub mod faults;
pub mod identification;
pub mod image;
pub mod live_beads;
pub mod loopback;
pub mod model_bead;
mod playback;
pub mod recording;
pub mod run;
pub mod several;
pub mod silent;
pub mod tables;
