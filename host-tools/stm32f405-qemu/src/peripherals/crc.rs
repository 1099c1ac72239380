//! The CRC calculation unit (RM0090 section 4): CRC-32 with Ethernet's polynomial, over words, most
//! significant bit first. A word takes no time here; on silicon it takes four clocks of AHB, for which the
//! bus waits.

use super::peripheral::{NoRegister, Notes, Peripheral};

/// Section 4.2.
const POLYNOMIAL: u32 = 0x04c1_1db7;
/// Of CR.
const RESET: u32 = 1 << 0;

#[derive(Debug, Clone, Default)]
pub(crate) struct Crc {
    value: u32,
    idr: u32,
    pub(crate) notes: Notes,
}

impl Crc {
    pub(crate) fn new() -> Self {
        Self {
            value: u32::MAX,
            ..Self::default()
        }
    }
}

impl Peripheral for Crc {
    fn read(&mut self, offset: u32, _now: u64) -> Result<u32, NoRegister> {
        Ok(match offset {
            0x00 => self.value,
            0x04 => self.idr,
            // CR is write-only.
            0x08 => 0,
            _ => return Err(NoRegister),
        })
    }

    fn holds_until(&self, _offset: u32, _now: u64) -> Option<u64> {
        Some(u64::MAX)
    }

    fn write(&mut self, offset: u32, value: u32, _now: u64) -> Result<(), NoRegister> {
        match offset {
            0x00 => {
                self.value = (0..32).fold(self.value ^ value, |rest, _| {
                    let carry = if rest >> 31 == 1 { POLYNOMIAL } else { 0 };
                    rest << 1 ^ carry
                });
            }
            0x04 => self.idr = value & 0xff,
            // IDR stays (section 4.4.3).
            0x08 if value & RESET != 0 => self.value = u32::MAX,
            0x08 => {}
            _ => return Err(NoRegister),
        }
        Ok(())
    }

    fn reset(&mut self, _now: u64) {
        *self = Self::new();
    }
}
