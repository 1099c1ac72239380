//! A recorded strike held against replay, f64 estimates and the full chain; and the page that shows it.

pub mod answers;
pub mod f64_estimators;
pub mod given;
pub mod page;
pub mod pictures;
pub mod reference;
pub mod reference_page;
pub mod replay;
pub mod row;
pub mod run;
mod signal;
pub mod spread;
mod statistics;
pub mod strike;
#[cfg(test)]
mod testing;
pub mod velocity;
pub mod verdict;
