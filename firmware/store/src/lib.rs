//! The bead's memory: its settings in flash, which survive a loss of power, and its last windows in RAM,
//! which survive a reset ([`Windows`]). The settings are written while the bead runs.
//!
//! # Design
//! The store is `sequential-storage` on two sectors. Each write appends the block with its checksum, and the
//! last whole block counts. A write that is cut leaves the block before it.
//!
//! **Nothing is erased while the bead runs.** Flash of one bank cannot be read while a sector is erased, and
//! it holds the code. The core would stall for one or two seconds, longer than the watchdog, the time driver
//! and the ring of the converter can bear. So only [`Store::open`] erases, at start-up, before there are
//! samples, and it leaves room for at least one block. A write that finds no room is refused as
//! [`StoreError::Full`], and the next start makes room. A sector of 128 KiB holds about 500 blocks of 250
//! bytes.
//!
//! Programming a word takes about 16 µs, so a write takes about a millisecond.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

mod pace;
mod sectors;
mod store;
mod vault;
mod windows;

/// The traits of a [`Store`]'s flash.
pub use embedded_storage::nor_flash;

pub use pace::{BURST, EVERY_MS, Pace};
pub use store::{MAX_BLOCK, Opened, Store, StoreError};
pub use vault::{MAX_SETTINGS, Secret, Vault};
pub use windows::{Cursor, GaveWay, KeptWindow, WINDOWS, WindowMemory, WindowPart, Windows};
