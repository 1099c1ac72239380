//! A bead's settings in physical quantities, SI units: what its owner writes, and what is shown.
//!
//! # Design
//! A settings block has the bits that the bead computes with. [`Physical`] has the numbers that these bits
//! stand for: masses, springs, what a code is worth, when a strike is taken. It is the content of a file
//! `bead.toml`, the `settings` of the JSON, and what `bead settings set` changes. [`KEYS`] lists every key
//! once: file, messages and changes follow from it.
//!
//! **There and back.** From physical quantities to bits there is one way, `bead_model::design`. Back from
//! bits to numbers, many numbers give the same bits. The shortest of them is taken, so that 40 kHz comes back
//! as 40000 and not as 39999.7. What a mass has beyond seven digits a block does not hold.

mod derived;
mod keys;
mod quantities;
mod text;

pub use keys::{KEYS, Key};
pub use quantities::{Contact, Host, Intruder, Physical, SensorScale, Taking};
pub use text::Change;
