//! Recordings as tables and as files of other trades.
//!
//! # Design
//! Two tables: `strikes` has a row for each strike of each bead, `samples` a row for each sample of their
//! windows; `id` joins them. A table has the same columns whatever the data, and what is not known is null.
//! The unit of a column ends its name, as it does in JSON. Quantities stand beside the bits that they are
//! made of, so nothing is lost on the way; doubles are exact. Rows are written in groups, so memory does not
//! grow with the recordings.

pub mod samples;
pub mod strikes;
pub mod uff;
