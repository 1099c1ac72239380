//! The CRC calculation unit (RM0090 section 4): CRC-32 with Ethernet's polynomial, over words, most
//! significant bit first. A word takes no time here; on silicon it takes four clocks of AHB, for which the
//! bus waits.

use super::peripheral::{NoRegister, Notes, Peripheral};

/// Section 4.2.
const POLYNOMIAL: u32 = 0x04c1_1db7;
/// Of CR.
const RESET: u32 = 1 << 0;

#[derive(Debug, Clone)]
pub(crate) struct Crc {
    value: u32,
    idr: u32,
    pub(crate) notes: Notes,
}

impl Default for Crc {
    fn default() -> Self {
        Self {
            value: u32::MAX,
            idr: 0,
            notes: Notes::default(),
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
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::super::peripheral::Access;
    use super::*;

    const DR: u32 = 0x00;
    const IDR: u32 = 0x04;
    const CR: u32 = 0x08;

    /// CRC-32/MPEG-2 has the same polynomial, order and start; 0xdf8a8a2b is its value of 12345678, and that
    /// of a message with its own value behind it is 0.
    #[test]
    fn words_give_the_values_of_crc_32_mpeg_2() {
        let mut crc = Crc::default();
        crc.put(0, [(DR, 0x1234_5678)]);
        assert_eq!(crc.get(DR, 0), 0xdf8a_8a2b);
        crc.put(0, [(IDR, 0x1a5), (CR, RESET)]);
        assert_eq!((crc.get(DR, 0), crc.get(IDR, 0)), (u32::MAX, 0xa5));
        crc.put(0, [(DR, 0x3132_3334), (DR, 0x3536_3738)]);
        let value = crc.get(DR, 0);
        assert_ne!(value, 0);
        crc.put(0, [(DR, value)]);
        assert_eq!(crc.get(DR, 0), 0);
        crc.reset(0);
        assert_eq!(crc.get(IDR, 0), 0);
    }
}
