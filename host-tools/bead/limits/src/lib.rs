//! User-defined limits for strikes: pass or fail by a stated rule.
//!
//! # Design
//! [`mod@file`] reads limits, [`values`] has the values of a strike with their uncertainties, and [`rule`]
//! decides with both (JCGM 106). [`judge`] compares the strikes of a recording with all limits; for each
//! limit the worst value counts. [`mask`] does this over frequency, [`drift`] and [`row`] over strikes and
//! beads.
//! [`report`] and [`junit`] show the result.

pub mod drift;
pub mod file;
pub mod judge;
pub mod judged;
pub mod junit;
pub mod mask;
mod pictures;
pub mod quantity;
pub mod report;
pub mod row;
pub mod rule;
pub mod template;
pub mod values;
pub mod words;
