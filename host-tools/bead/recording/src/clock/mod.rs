//! Bead time to host time, and several beads to one time base.
//!
//! # Design
//! **Against the host.** Each frame has the sample index at which it was made, and the host notes when it
//! received the frame. Blocks, queue, line, USB and the host's own scheduling lie between the two: delays
//! that only add. In a plot of host time over bead time the frames therefore lie on or above a straight line,
//! and its slope is the drift. [`Fit`] takes the line that lies below all frames and whose summed distance to
//! them is least: the edge of their lower convex hull that lies below their mean (Moon, Skelly and Towsley,
//! INFOCOM 1999). A least-squares line would follow the mean delay, which changes with the load.
//!
//! For its uncertainty the time is cut into spans (`BINS`). The distance of a span's lowest frame from the
//! line says how well that span fixes the line. With `m`, the median of those distances, the uncertainty is
//! `COVERAGE` · m · √(12 / bins) / time. Over simulated delays of several kinds this interval holds the true
//! drift in nineteen cases of twenty (`the_drift_is_found_…`).
//!
//! The line does not show the least delay itself. Host times from the line are late by that delay: about 0.2
//! ms over UART and USB, and equal for beads on equal connections.
//!
//! **Against one another.** Edges on a line that all beads share ([`bead_wire::Sync`]) have no delay at all.
//! The fits against the host say which edges of two beads are the same. A straight line through the pairs, by
//! least squares, gives the [`Alignment`]. Residuals above the counters' step of 12 ns come from the crystals
//! between edges.
//!
//! A restart of a bead begins a new [`Segment`]. A new epoch does not, as the sample index continues. Beads
//! that share a line are told apart by their address: each has segments of its own.

mod alignment;
mod common;
mod comparison;
mod fit;
mod segments;
#[cfg(test)]
mod tests;

pub use alignment::Alignment;
pub use common::CommonTime;
pub use comparison::{AlignmentReport, ClockComparison, ClockReport, RecordedBoot, StrikeArrival, compare};
pub use fit::{CRYSTAL_PPM, Fit};
pub use segments::{Boots, Live, Segment, Segments, StrikePeak, Tracker};

/// Relative error of a bead's clock that uncertainties allow for: that of a typical quartz (docs/time.md).
pub const QUARTZ: f64 = 20e-6;
