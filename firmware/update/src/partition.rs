//! A part of flash as `embassy-boot` sees it.

use core::cell::RefCell;
use core::ops::Range;

use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};

/// A part of the flash `F`, which other parts share. It is erased by `ERASE` bytes and written by `WORD`.
pub(crate) struct Partition<'a, F, const ERASE: usize, const WORD: usize> {
    flash: &'a RefCell<F>,
    range: Range<u32>,
}

impl<'a, F, const ERASE: usize, const WORD: usize> Partition<'a, F, ERASE, WORD> {
    pub(crate) const fn new(flash: &'a RefCell<F>, range: Range<u32>) -> Self {
        Self { flash, range }
    }
}

impl<F: NorFlash, const ERASE: usize, const WORD: usize> ErrorType for Partition<'_, F, ERASE, WORD> {
    type Error = F::Error;
}

impl<F: NorFlash, const ERASE: usize, const WORD: usize> ReadNorFlash for Partition<'_, F, ERASE, WORD> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), F::Error> {
        self.flash.borrow_mut().read(self.range.start + offset, bytes)
    }

    fn capacity(&self) -> usize {
        self.range.len()
    }
}

impl<F: NorFlash, const ERASE: usize, const WORD: usize> NorFlash for Partition<'_, F, ERASE, WORD> {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = ERASE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), F::Error> {
        let start = self.range.start;
        self.flash.borrow_mut().erase(start + from, start + to)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), F::Error> {
        self.flash.borrow_mut().write(self.range.start + offset, bytes)
    }
}
