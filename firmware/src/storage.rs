//! The store for settings that came over the link, in flash sectors 10 and 11.
//!
//! # Design
//! The driver waits until a word is programmed. In these 16 µs the core cannot fetch from flash and stands
//! still, which is much less than acquisition can bear. Only [`open`] erases, before anything else runs
//! ([`bead_store`] says why). The driver erases by bytes: 2 s a sector, at most 4 s (DocID022152, flash
//! memory programming).

use bead_store::{Opened, Store, Vault};
use embassy_stm32::flash::{Blocking, Flash};
use embassy_stm32::{Peri, peripherals};

/// Region STORE of `memory.x`, as offsets from the start of flash.
const RANGE: core::ops::Range<u32> = 0xC_0000..0x10_0000;

/// The store of this bead.
pub(crate) type SettingsStore = Vault<Flash<'static, Blocking>>;

const _: () = assert!(
    bead_store::MAX_SETTINGS == bead_wire::MAX_BLOCK,
    "a block that a request carries fits the store"
);

/// Opens the store. It may take seconds, so it is called before acquisition begins. With a supply that is not
/// good it erases nothing: what reads wrongly now may be whole.
pub(crate) fn open(
    flash: Peri<'static, peripherals::FLASH>,
    supply_is_good: bool,
) -> (SettingsStore, Opened) {
    let flash = Flash::new_blocking(flash);
    let (store, opened) = match supply_is_good {
        true => Store::open(flash, RANGE),
        false => (Store::open_as_it_is(flash, RANGE), Opened::default()),
    };
    (Vault::new(store), opened)
}
