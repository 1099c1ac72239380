//! A row of beads that felt the same strikes, against one simulation of their chain.
//!
//! # Design
//! Each bead is compared with the chain and judged as a single bead is ([`crate::bead`]). A row adds:
//!
//! - **Equal strikes**, by the host's time, in which all beads place a strike within a millisecond.
//! - **Arrivals of the wave**, in the common time that the beads' sync edges define. Each strike is placed
//!   where the differences from the simulation have the mean 0.
//! - **Energy along the row**, E(n), and **later waves** behind the main one.
//!
//! Where a bead lacks data it has no value, and a note says so.

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
