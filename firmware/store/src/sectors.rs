//! Two sectors of flash for `sequential-storage`: erasing can be forbidden, and one sector can be hidden.

use core::ops::Range;

use embedded_storage::nor_flash::{NorFlash, NorFlashErrorKind};
use embedded_storage_async::nor_flash as asynchronous;

/// Number of sectors.
pub(crate) const COUNT: usize = 2;
/// A byte of erased flash.
const BLANK: u8 = 0xFF;
/// Bytes that are read at once.
const CHUNK: usize = 256;

pub(crate) struct Sectors<F> {
    pub(crate) flash: F,
    pub(crate) range: Range<u32>,
    /// If set, all other flash reads as blank.
    pub(crate) alone: Option<Range<u32>>,
    /// True if a sector may be erased.
    pub(crate) may_erase: bool,
    /// Number of sectors that were erased.
    pub(crate) erased: u32,
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum SectorError {
    /// A sector has to be erased, but erasing is not allowed now.
    EraseRefused,
    /// The flash reported an error.
    Flash,
}

impl<F: NorFlash> Sectors<F> {
    /// The sectors in `range`.
    ///
    /// # Panics
    /// There are not [`COUNT`] of them.
    pub(crate) fn new(flash: F, range: Range<u32>) -> Self {
        assert_eq!(range.len(), COUNT * F::ERASE_SIZE, "the store is two sectors");
        Self {
            flash,
            range,
            alone: None,
            may_erase: false,
            erased: 0,
        }
    }

    pub(crate) fn each(&self) -> [Range<u32>; COUNT] {
        let size = F::ERASE_SIZE as u32;
        let start = self.range.start;
        core::array::from_fn(|n| start + n as u32 * size..start + (n as u32 + 1) * size)
    }

    pub(crate) fn is_blank(&mut self, sector: &Range<u32>) -> Result<bool, SectorError> {
        for start in sector.clone().step_by(CHUNK) {
            if self.blank_tail(start)? < CHUNK {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Number of blank bytes at the end of the [`CHUNK`] bytes from `start` on, in whole words.
    fn blank_tail(&mut self, start: u32) -> Result<usize, SectorError> {
        let mut bytes = [0; CHUNK];
        self.read(start, &mut bytes)?;
        let words = bytes.as_chunks().0;
        Ok(4 * words.iter().rev().take_while(|word| **word == [BLANK; 4]).count())
    }

    /// Returns `true` if the library has marked the sector as full: at least half of the bits of its last
    /// byte are zeros.
    pub(crate) fn is_closed(&mut self, sector: &Range<u32>) -> Result<bool, SectorError> {
        let mut byte = [0];
        self.read(sector.end - 1, &mut byte)?;
        Ok(byte[0].count_zeros() >= 4)
    }

    /// Bytes that can still be appended: the blank bytes at the end of the sector in use, less its mark.
    pub(crate) fn room(&mut self) -> Result<u32, SectorError> {
        let mut room = F::ERASE_SIZE as u32;
        for sector in self.each() {
            if self.is_blank(&sector)? {
                continue;
            }
            let mut blank = 0;
            for start in sector.clone().step_by(CHUNK).rev() {
                let tail = self.blank_tail(start)?;
                blank += tail as u32;
                if tail < CHUNK {
                    break;
                }
            }
            room = room.min(blank.saturating_sub(F::WRITE_SIZE as u32));
        }
        Ok(room)
    }

    pub(crate) fn erase(&mut self, sectors: &Range<u32>) -> Result<(), SectorError> {
        if !self.may_erase || self.alone.is_some() {
            return Err(SectorError::EraseRefused);
        }
        self.erased += (sectors.len() / F::ERASE_SIZE) as u32;
        self.flash
            .erase(sectors.start, sectors.end)
            .map_err(|_| SectorError::Flash)
    }

    pub(crate) fn erase_all(&mut self) -> Result<(), SectorError> {
        self.erase(&self.range.clone())
    }

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), SectorError> {
        match &self.alone {
            Some(alone) if !alone.contains(&offset) => {
                bytes.fill(BLANK);
                Ok(())
            }
            _ => self.flash.read(offset, bytes).map_err(|_| SectorError::Flash),
        }
    }
}

impl asynchronous::NorFlashError for SectorError {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl<F: NorFlash> asynchronous::ErrorType for Sectors<F> {
    type Error = SectorError;
}

impl<F: NorFlash> asynchronous::ReadNorFlash for Sectors<F> {
    const READ_SIZE: usize = F::READ_SIZE;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), SectorError> {
        Self::read(self, offset, bytes)
    }

    fn capacity(&self) -> usize {
        self.flash.capacity()
    }
}

impl<F: NorFlash> asynchronous::NorFlash for Sectors<F> {
    const WRITE_SIZE: usize = F::WRITE_SIZE;
    const ERASE_SIZE: usize = F::ERASE_SIZE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), SectorError> {
        Self::erase(self, &(from..to))
    }

    /// Writes and reads back: flash that has worn out takes a word and does not keep it, and the library
    /// erases the sector that it has moved the block from.
    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), SectorError> {
        if self.alone.is_some() {
            return Err(SectorError::Flash);
        }
        self.flash.write(offset, bytes).map_err(|_| SectorError::Flash)?;
        for (at, word) in (offset..).step_by(4).zip(bytes.chunks(4)) {
            let mut kept = [0; 4];
            let kept = &mut kept[..word.len()];
            Self::read(self, at, kept)?;
            if kept != word {
                return Err(SectorError::Flash);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bead_testing::PowerCutFlash;

    const SECTOR: usize = 1024;

    /// The store is the middle of four sectors.
    const RANGE: Range<u32> = SECTOR as u32..3 * SECTOR as u32;

    /// Flash with zeros in the store, in each of these ranges of bytes: first, and one after the last.
    fn sectors(zeros: &[[usize; 2]]) -> Sectors<PowerCutFlash<SECTOR>> {
        let mut flash = PowerCutFlash::blank(4);
        for &[from, to] in zeros {
            flash.bytes[SECTOR + from..SECTOR + to].fill(0);
        }
        Sectors::new(flash, RANGE)
    }

    #[test]
    fn there_are_two_sectors_side_by_side() {
        let sectors = sectors(&[]);
        assert_eq!(sectors.each(), [1024..2048, 2048..3072]);
        assert_eq!(asynchronous::ReadNorFlash::capacity(&sectors), 4 * SECTOR);
    }

    #[test]
    fn nothing_is_erased_unless_it_is_allowed_and_no_sector_is_looked_at_alone() {
        for (may_erase, alone, erased) in [
            (false, None, 0),
            (false, Some(RANGE), 0),
            (true, Some(RANGE), 0),
            (true, None, 2),
        ] {
            let mut sectors = sectors(&[[0, 2 * SECTOR]]);
            (sectors.may_erase, sectors.alone) = (may_erase, alone);
            assert_eq!(sectors.erase_all().is_ok(), erased > 0);
            assert_eq!(sectors.erased, erased);
            let byte = if erased > 0 { BLANK } else { 0 };
            assert_eq!(sectors.flash.bytes[SECTOR..3 * SECTOR], [byte; 2 * SECTOR]);
        }
    }

    #[test]
    fn half_of_the_bits_of_the_last_byte_close_a_sector() {
        for zeros in 0..=8_u32 {
            let mut sectors = sectors(&[]);
            sectors.flash.bytes[2 * SECTOR - 1] = (0xFF_u32 << zeros) as u8;
            let closed = sectors.each().map(|sector| sectors.is_closed(&sector).unwrap());
            assert_eq!(closed, [zeros >= 4, false], "{zeros}");
        }
    }

    #[test]
    fn room_is_what_is_blank_behind_the_last_word_less_the_mark() {
        for (zeros, room) in [
            (&[][..], 1024),
            (&[[0, 1]], 1016),
            (&[[0, 200]], 820),
            (&[[0, 256]], 764),
            (&[[0, 257]], 760),
            // Blank bytes in front of the last word are a part of a block.
            (&[[0, 4], [700, 704]], 316),
            (&[[1020, 1024]], 0),
            // The sector with less room counts.
            (&[[0, 200], [1024, 1424]], 620),
            (&[[1024, 1424]], 620),
        ] {
            assert_eq!(sectors(zeros).room().unwrap(), room, "{zeros:?}");
        }
    }
}
