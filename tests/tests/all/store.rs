//! The bead's settings store as a test reads and prepares it: flash sectors 10 and 11 (`memory.x`).

use std::ops::Range;

use bead_testing::PowerCutFlash;

const SECTOR: usize = 128 * 1024;

/// Flash with the sectors of the STM32F405's second half.
pub(crate) type StoreFlash = PowerCutFlash<SECTOR>;

/// Where the store lies in a [`StoreFlash`] of two sectors.
pub(crate) const STORE_RANGE: Range<u32> = 0..2 * SECTOR as u32;

/// Its address (`memory.x`).
pub(crate) const STORE_ADDRESS: u32 = 0x080C_0000;
