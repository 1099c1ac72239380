//! Rigs simulated around the bit-exact code of a bead, to learn a procedure without hardware, and to count
//! how often the results hold the truth.
//!
//! # Design
//! The truth is drawn from the distributions that an operator states (JCGM 101, 6.4): the ball's real
//! mass, the real height of a series, the real axis. The front end converts what the sensors then feel, the
//! bead's code measures it with its settings, and a recording holds what a bead would have sent. The
//! procedure reads only the recording.

mod bead;
pub mod coverage;
pub mod drop;
pub mod ring_down;
pub mod sines;

pub use bead::{GAIN_SPREAD, SimulatedBead, chance, deviate};
