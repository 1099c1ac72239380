//! A recorded strike compared with replay, f64 estimates and the full chain, and the report on it.

pub mod agreement;
pub mod bead;
pub mod budget;
pub mod drift;
pub mod emulated;
pub mod energy_uncertainties;
pub mod error;
pub mod f64_estimators;
pub mod front_end;
pub mod given;
pub mod goal;
pub mod incident;
mod pictures;
mod quantities;
pub mod reference;
pub mod reference_report;
pub mod replay;
pub mod report;
pub mod row;
pub mod sensed;
mod signal;
pub mod spread;
mod statistics;
pub mod strike;
pub mod strike_report;
pub mod student;
#[cfg(test)]
mod testing;
mod traces;
pub mod values;
pub mod velocity;
pub mod verdict;
