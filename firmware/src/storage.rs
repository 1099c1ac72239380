//! The store for settings that came over the link, in flash sectors 10 and 11.
//!
//! # Design
//! The driver waits until a word is programmed. In these 16 µs the core cannot fetch from flash and stands
//! still, which is much less than acquisition can bear. Only [`open`] erases, before anything else runs
//! ([`bead_store`] says why). The driver erases by bytes: 2 s a sector, at most 4 s (DocID022152, flash
//! memory programming). A start may erase five or six of them, after power cuts and on flash that wears out.
//!
//! # An erase and the time
//! No interrupt runs while a sector is erased, as the handlers are in flash. The time driver counts turns of
//! 0.33 s by interrupts, and has only two flags for those that it misses. Its time is right only if it has
//! missed an even number; after an odd one, each reading between a turn and its interrupt is 0.66 s too low.
//! So its timer, TIM5, is stopped meanwhile.

use bead_store::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use bead_store::{Opened, Store, Vault};
use embassy_stm32::flash::{self, Blocking};
use embassy_stm32::pac::TIM5;
use embassy_stm32::{Peri, peripherals};

use crate::{clocks, watchdog};

/// Region STORE of `memory.x`, as offsets from the start of flash.
const RANGE: core::ops::Range<u32> = 0xC_0000..0x10_0000;

/// The store of this bead.
pub(crate) type SettingsStore = Vault<SettingsFlash>;

/// The driver of the flash. It feeds the watchdog before an erase, and stops the time during it.
pub(crate) struct SettingsFlash(Driver);

type Driver = flash::Flash<'static, Blocking>;

impl ErrorType for SettingsFlash {
    type Error = flash::Error;
}

impl ReadNorFlash for SettingsFlash {
    const READ_SIZE: usize = Driver::READ_SIZE;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), flash::Error> {
        self.0.blocking_read(offset, bytes)
    }

    fn capacity(&self) -> usize {
        self.0.capacity()
    }
}

impl NorFlash for SettingsFlash {
    const WRITE_SIZE: usize = Driver::WRITE_SIZE;
    const ERASE_SIZE: usize = Driver::ERASE_SIZE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), flash::Error> {
        watchdog::feed();
        without_time(|| self.0.blocking_erase(from, to))
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), flash::Error> {
        let written = self.0.blocking_write(offset, bytes);
        // Otherwise a check of the word would read the cache's copy, and not the flash.
        clocks::forget_data();
        written
    }
}

/// Erases while the time stands still: see the module's documentation.
pub(crate) fn without_time<T>(erase: impl FnOnce() -> T) -> T {
    TIM5.cr1().modify(|w| w.set_cen(false));
    let erased = erase();
    TIM5.cr1().modify(|w| w.set_cen(true));
    erased
}

/// Opens the store. This may take seconds, so it is called before acquisition begins. At a low supply nothing
/// is erased: a block that reads wrongly now may be intact.
pub(crate) fn open(
    flash: Peri<'static, peripherals::FLASH>,
    supply_is_good: bool,
) -> (SettingsStore, Opened) {
    let flash = SettingsFlash(flash::Flash::new_blocking(flash));
    let (store, opened) = if supply_is_good {
        Store::open(flash, RANGE)
    } else {
        (Store::open_as_it_is(flash, RANGE), Opened::default())
    };
    (Vault::new(store), opened)
}
