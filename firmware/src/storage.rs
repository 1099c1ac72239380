//! Flash sectors 10 and 11, where the settings are kept that came over the link.
//!
//! # Design
//! The driver waits until a word is programmed, 16 µs in which the core cannot fetch from flash and stands still: far
//! less than acquisition bears. Nothing is erased but here in [`open`], before anything else runs ([`bead_store`] says why).
//! The driver erases by bytes: 2 s a sector, 4 s at most (DocID022152, flash memory programming).

use bead_store::{Opened, Store};
use embassy_stm32::flash::{Blocking, Flash};
use embassy_stm32::{Peri, peripherals};

/// Region STORE of `memory.x`, from the start of flash.
const RANGE: core::ops::Range<u32> = 0xC_0000..0x10_0000;

/// The store of this bead.
pub(crate) type Settings = Store<Flash<'static, Blocking>>;

const _: () = assert!(
    bead_store::MAX_BLOCK == bead_wire::MAX_BLOCK,
    "what a request carries can be kept"
);

/// Opens the store. Before acquisition begins: it may take seconds.
pub(crate) fn open(flash: Peri<'static, peripherals::FLASH>) -> (Settings, Opened) {
    Store::open(Flash::new_blocking(flash), RANGE)
}
