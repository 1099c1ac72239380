//! The part's own flash (RM0090 section 3).
//!
//! # Design
//! Sectors are erased by words, which takes half the time of erasing by bytes; it needs 2.7 V, as programming
//! words does. Meanwhile the core cannot fetch an instruction and stalls. Blank words are not programmed, and
//! every other word is read back.

use core::ptr;

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};
use stm32_metapac::FLASH;
use stm32_metapac::flash::regs::Sr;
use stm32_metapac::flash::vals::Psize;

use crate::layout::FLASH as START;

/// Size of flash, bytes.
const SIZE: u32 = 1024 * 1024;
/// Size of its smallest sectors, bytes.
const SMALLEST: u32 = 16 * 1024;
/// The two keys that open CR (section 3.6.1).
const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

/// The part's own flash.
pub struct InternalFlash {
    /// Called before each sector that is erased: it takes up to 2 s.
    pub feed: fn(),
}

/// The flash reports an error, or does not keep what was written.
#[derive(Debug)]
pub struct FlashError;

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl ErrorType for InternalFlash {
    type Error = FlashError;
}

impl ReadNorFlash for InternalFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        check(offset, bytes.len())?;
        for (byte, at) in bytes.iter_mut().zip(START + offset..) {
            // SAFETY: it lies in flash, which can always be read, and any byte is a `u8`. Volatile, since
            // flash is written behind the compiler's back.
            *byte = unsafe { ptr::with_exposed_provenance::<u8>(at as usize).read_volatile() };
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        SIZE as usize
    }
}

impl NorFlash for InternalFlash {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SMALLEST as usize;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        let mut at = from;
        while at < to {
            let (sector, size) = sector(at);
            check(at, size as usize)?;
            (self.feed)();
            erase(sector)?;
            at += size;
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        check(offset, bytes.len())?;
        let (words, []) = bytes.as_chunks() else {
            return Err(FlashError);
        };
        if !offset.is_multiple_of(4) {
            return Err(FlashError);
        }
        opened(|| {
            FLASH.cr().write(|w| {
                w.set_pg(true);
                w.set_psize(Psize::PSIZE32);
            });
            for (word, at) in words.iter().zip((START + offset..).step_by(4)) {
                let word = u32::from_le_bytes(*word);
                if word == u32::MAX {
                    continue;
                }
                let place = ptr::with_exposed_provenance_mut::<u32>(at as usize);
                // SAFETY: it lies in flash, where a store programs a word of a sector that holds no code that
                // runs: no caller has another range. Aligned, as `offset` is.
                unsafe { place.write_volatile(word) };
                finish()?;
                // SAFETY: as for the store.
                if unsafe { place.read_volatile() } != word {
                    return Err(FlashError);
                }
            }
            Ok(())
        })
    }
}

/// Number and size of the sector that holds a place (table 5).
fn sector(offset: u32) -> (u8, u32) {
    const LARGE: u32 = 8 * SMALLEST;
    match offset / SMALLEST {
        small @ 0..4 => (small as u8, SMALLEST),
        4..8 => (4, 4 * SMALLEST),
        _ => ((4 + offset / LARGE) as u8, LARGE),
    }
}

fn check(offset: u32, length: usize) -> Result<(), FlashError> {
    let end = offset.checked_add(length as u32);
    end.filter(|end| *end <= SIZE).map(drop).ok_or(FlashError)
}

/// Erases a sector. Cached contents of it would be stale, so the caches are off meanwhile and emptied
/// (section 3.5.2).
fn erase(sector: u8) -> Result<(), FlashError> {
    let before = FLASH.acr().read();
    FLASH.acr().modify(|w| {
        w.set_icen(false);
        w.set_dcen(false);
    });
    let erased = opened(|| {
        FLASH.cr().write(|w| {
            w.set_ser(true);
            w.set_snb(sector);
            w.set_psize(Psize::PSIZE32);
        });
        FLASH.cr().modify(|w| w.set_strt(true));
        finish()
    });
    for now in [true, false] {
        FLASH.acr().modify(|w| {
            w.set_icrst(now);
            w.set_dcrst(now);
        });
    }
    FLASH.acr().write_value(before);
    erased
}

/// Lets `act` change flash.
fn opened(act: impl FnOnce() -> Result<(), FlashError>) -> Result<(), FlashError> {
    if FLASH.cr().read().lock() {
        for key in KEYS {
            FLASH.keyr().write_value(key);
        }
    }
    // Writing ones clears the flags of an earlier operation.
    FLASH.sr().write_value(Sr(0xF3));
    let done = act();
    FLASH.cr().write(|w| w.set_lock(true));
    done
}

/// Waits for the end of an operation.
fn finish() -> Result<(), FlashError> {
    cortex_m::asm::dsb();
    loop {
        let status = FLASH.sr().read();
        if !status.bsy() {
            let failed = status.pgserr() || status.pgperr() || status.pgaerr() || status.wrperr();
            return if failed { Err(FlashError) } else { Ok(()) };
        }
    }
}
