//! A row of beads that felt the same strikes, against one simulation of their chain.
//!
//! # Design
//! Each bead is held against the chain as a bead alone is ([`crate::strike`]), and judged by the
//! same goals. What only a row tells comes from what several beads said of one strike:
//!
//! - **Which strikes are one.** By the host's time, on which a strike is within a millisecond at all beads,
//!   less the wave's way.
//! - **When the wave came**, on the time that the beads have in common by their sync edges. The recording
//!   does not say when the striker hit, so each strike is placed where the differences from the simulation
//!   have the mean 0.
//! - **Energy along the row**, E(n): what came to the first bead, less what the first n intruders took.
//! - **Later waves** behind the main one.
//!
//! A bead of which something is missing has no value there, and a note says so. The others go on without it.

mod arrivals;
mod chain;
mod compare;
mod energy;
mod later;
mod member;
mod members;
mod pictures;
mod report;
mod strikes;

pub use arrivals::{Arrivals, BeadArrival, Speed};
pub use chain::RowChain;
pub use compare::{RowComparison, compare};
pub use energy::{After, EnergyAlong, FourSides, Transmission, TransmissionLine};
pub use later::{LaterWave, Wave};
pub use member::{BeadOfRow, DeviceAndChain, FeltStrike, RowBead};
pub use members::{PlacedBead, among};
pub use pictures::charts;
pub use report::ComparedRow;
pub use strikes::BeadRow;
