//! Invariants of every input from outside, whatever its bytes are.
//!
//! # Design
//! Each module has one function `check`. It gives bytes to every reader of their kind, and panics where an
//! invariant does not hold. libFuzzer calls it with the bytes that it finds (`cargo xtask fuzz`), and the
//! tests of this crate with the seeds in `corpus` and with mutations of them.
//!
//! **Checksums are mended** before bytes are read a second time ([`mod@line`]): with wrong ones no mutation
//! would get past them.

pub mod beads;
pub mod campaign;
pub mod faults;
mod file;
pub mod frames;
pub mod limits;
pub mod line;
pub mod recordings;
pub mod requests;
pub mod scenarios;
pub mod settings;
pub mod strikes;
pub mod sweeps;
pub mod tables;
mod text;
pub mod waveforms;

/// A target: its name, which is that of its folder in `corpus`, and its check.
pub type FuzzTarget = (&'static str, fn(&[u8]));

/// All targets.
pub const TARGETS: &[FuzzTarget] = &[
    ("frames", frames::check),
    ("requests", requests::check),
    ("settings", settings::check),
    ("strikes", strikes::check),
    ("recordings", recordings::check),
    ("waveforms", waveforms::check),
    ("tables", tables::check),
    ("scenarios", scenarios::check),
    ("faults", faults::check),
    ("sweeps", sweeps::check),
    ("beads", beads::check),
    ("limits", limits::check),
];
