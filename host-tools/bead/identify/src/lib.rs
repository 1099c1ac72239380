#![doc = include_str!("../README.md")]

pub mod bead;
pub mod chain;
pub mod chain_runs;
pub mod chain_strike;
pub mod consistency;
pub mod degeneracy;
pub mod fit;
pub mod identified;
pub mod method;
pub mod model;
pub mod noise;
pub mod normal;
pub mod pair;
pub mod picture;
pub mod quantity;
pub mod report;
pub mod ring_down;
pub mod series;
pub mod settings;
pub mod spread;
pub mod table;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
