//! Motions of a driven chain that repeat with each period of the drive.
//!
//! # Design
//! A motion is a point of the phase space at the start of a period, and a period maps this point to another
//! one. A motion that repeats is a point that is mapped to itself. Newton's method finds it, stable or not
//! ([`PeriodicState`]), with the derivative of the map from the variational equations ([`crate::tangents`]).
//! The eigenvalues of this derivative are the Floquet multipliers: a small disturbance grows or shrinks by
//! their magnitudes in each period. A [`Branch`] follows the motion as the drive changes, around folds too.

mod branch;
mod error;
mod extremes;
mod map;
mod state;

pub use branch::{Bifurcation, Branch, BranchEnd, BranchOptions, BranchPoint, DriveParameter};
pub use error::PeriodicError;
pub use extremes::PeriodExtremes;
pub use state::PeriodicState;
