//! Recordings as tables and in the file formats of other fields.
//!
//! # Design
//! The table `strikes` has a row for each strike of each bead, `samples` a row for each sample of their
//! windows; `id` joins them. The columns do not depend on the data, and unknown values are null. A column's
//! name ends with its unit, as in JSON. Quantities stand beside the bits that they are made of, and doubles
//! are exact. Rows are written in groups, so memory does not grow with the recordings.

pub mod samples;
pub mod strikes;
pub mod uff;
