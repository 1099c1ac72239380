//! The store's two sectors in RAM, to be made and looked at on this computer.

use std::convert::Infallible;
use std::ops::Range;

use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};

const SECTOR: usize = 128 * 1024;

/// Where the store lies in it.
pub(crate) const RANGE: Range<u32> = 0..2 * SECTOR as u32;

pub(crate) struct Ram {
    pub(crate) bytes: Vec<u8>,
}

impl Ram {
    pub(crate) fn blank() -> Self {
        Self::of(&[0xFF; 2 * SECTOR])
    }

    pub(crate) fn of(bytes: &[u8]) -> Self {
        assert_eq!(bytes.len(), 2 * SECTOR, "two sectors");
        Self {
            bytes: bytes.to_vec(),
        }
    }
}

impl ErrorType for Ram {
    type Error = Infallible;
}

impl ReadNorFlash for Ram {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Infallible> {
        let offset = offset as usize;
        bytes.copy_from_slice(&self.bytes[offset..offset + bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.bytes.len()
    }
}

impl NorFlash for Ram {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Infallible> {
        self.bytes[from as usize..to as usize].fill(0xFF);
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Infallible> {
        for (old, new) in self.bytes[offset as usize..].iter_mut().zip(bytes) {
            *old &= new;
        }
        Ok(())
    }
}
