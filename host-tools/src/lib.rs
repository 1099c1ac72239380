//! Host tools of the sensing absorber bead.
//!
//! The command line `bead` is a thin shell over this library: `cli` is the command tree, and each command is a
//! file of `commands`.

pub mod f64_estimators;
pub mod failure;
pub mod figure;
pub mod front_end;
pub mod output;
