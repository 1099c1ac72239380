//! NOR flash in memory that can lose power, misread, refuse erases and forget writes.

use std::ops::Range;

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};

/// NOR flash with sectors of `SECTOR` bytes and words of four bytes. Programming only clears bits.
#[derive(Clone, Debug)]
pub struct PowerCutFlash<const SECTOR: usize> {
    /// The contents.
    pub bytes: Vec<u8>,
    /// Bytes that may be programmed and erased; an access elsewhere panics.
    pub writable: Range<u32>,
    /// Operations (a word programmed, a sector erased) until the power is cut: the last of them is done in
    /// part, and all later ones fail. `None` for a good supply.
    pub power_left: Option<u32>,
    /// State of the generator that draws the contents of a word or sector after a cut; not 0.
    pub seed: u32,
    /// Reads before one that returns each bit inverted, as under a flickering supply. `None` for no such
    /// read.
    pub misread_after: Option<u32>,
    /// Erases that fail before one succeeds.
    pub refused_erases: u32,
    /// True for flash that reports each write as done and keeps none.
    pub forgets: bool,
}

/// Error of a [`PowerCutFlash`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FlashFailure;

impl NorFlashError for FlashFailure {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl<const SECTOR: usize> PowerCutFlash<SECTOR> {
    /// Erased flash of this many sectors, all of it writable.
    pub fn blank(sectors: usize) -> Self {
        Self::holding(vec![0xFF; sectors * SECTOR])
    }

    /// Flash with these contents, all of it writable.
    ///
    /// # Panics
    /// The contents are not a whole number of sectors.
    pub fn holding(bytes: Vec<u8>) -> Self {
        assert!(bytes.len().is_multiple_of(SECTOR), "whole sectors");
        let size = u32::try_from(bytes.len()).expect("flash below 4 GiB");
        Self {
            bytes,
            writable: 0..size,
            power_left: None,
            seed: 1,
            misread_after: None,
            refused_erases: 0,
            forgets: false,
        }
    }

    /// Counts one operation. Returns false if the power is cut in it.
    fn has_power(&mut self) -> Result<bool, FlashFailure> {
        match &mut self.power_left {
            None => Ok(true),
            Some(0) => Err(FlashFailure),
            Some(left) => {
                *left -= 1;
                Ok(*left > 0)
            }
        }
    }

    /// The next number of a xorshift32 generator (Marsaglia 2003).
    fn random(&mut self) -> u32 {
        self.seed ^= self.seed << 13;
        self.seed ^= self.seed >> 17;
        self.seed ^= self.seed << 5;
        self.seed
    }

    /// Leaves a sector as a power cut during its erase does. The controller programs zeros first; then each
    /// bit rises in its own time.
    fn erase_in_part(&mut self, start: usize) {
        let risen = self.random() % 5;
        for at in start..start + SECTOR {
            let bits = (self.random() | if risen > 1 { self.random() } else { 0 }) as u8;
            self.bytes[at] = match risen {
                0 => self.bytes[at] & bits,
                4 => 0xFF,
                _ => bits,
            };
        }
    }
}

impl<const SECTOR: usize> ErrorType for PowerCutFlash<SECTOR> {
    type Error = FlashFailure;
}

impl<const SECTOR: usize> ReadNorFlash for PowerCutFlash<SECTOR> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashFailure> {
        bytes.copy_from_slice(&self.bytes[offset as usize..][..bytes.len()]);
        if self.misread_after == Some(0) {
            bytes.iter_mut().for_each(|byte| *byte = !*byte);
        }
        self.misread_after = self.misread_after.and_then(|left| left.checked_sub(1));
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.bytes.len()
    }
}

impl<const SECTOR: usize> NorFlash for PowerCutFlash<SECTOR> {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashFailure> {
        if let Some(left) = self.refused_erases.checked_sub(1) {
            self.refused_erases = left;
            return Err(FlashFailure);
        }
        assert!(
            self.writable.contains(&from) && to <= self.writable.end,
            "an erase outside the store"
        );
        for start in (from as usize..to as usize).step_by(SECTOR) {
            if !self.has_power()? {
                self.erase_in_part(start);
                return Err(FlashFailure);
            }
            self.bytes[start..start + SECTOR].fill(0xFF);
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashFailure> {
        assert!(self.writable.contains(&offset), "a write outside the store");
        assert!(offset.is_multiple_of(4) && bytes.len().is_multiple_of(4));
        if self.forgets {
            return Ok(());
        }
        for (at, word) in (offset as usize..).step_by(4).zip(bytes.as_chunks::<4>().0) {
            let whole = self.has_power()?;
            for (old, new) in self.bytes[at..at + 4].iter_mut().zip(word) {
                // After a cut some of the bits have fallen.
                self.seed = self.seed.wrapping_mul(0x9E37_79B1) ^ 0x85EB_CA6B;
                *old &= if whole { *new } else { *new | self.seed as u8 };
            }
            if !whole {
                return Err(FlashFailure);
            }
        }
        Ok(())
    }
}
