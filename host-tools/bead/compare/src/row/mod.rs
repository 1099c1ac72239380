//! A row of beads that felt the same strikes, against one simulation of their chain.
//!
//! # Design
//! Each bead is held against the chain, and judged, as a bead alone is ([`crate::bead`]). A row also tells:
//!
//! - **Equal strikes**, by the host's time, on which a strike is within a millisecond at all beads.
//! - **Arrivals of the wave**, on the time that the beads have in common by their sync edges. Each strike is
//!   placed where the differences from the simulation have the mean 0.
//! - **Energy along the row**, E(n), and **later waves** behind the main one.
//!
//! A bead of which something is missing has no value there, and a note says so.

mod arrivals;
mod chain;
mod compare;
mod energy;
mod later;
mod mean;
mod member;
mod pictures;
mod report;
mod strikes;

pub use arrivals::{Arrivals, BeadArrival, Speed};
pub use chain::{PlacedBead, RowChain, among};
pub use compare::{RowComparison, compare};
pub use energy::{After, EnergyAlong, FourSides, Transmission};
pub use later::{LaterWave, Wave};
pub use member::{BeadOfRow, DeviceAndChain, RowBead};
pub use pictures::charts;
pub use report::ComparedRow;
pub use strikes::BeadRow;
