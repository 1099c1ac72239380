//! The device electronic signature (RM0090 section 39): the chip's identifier, its flash size, the
//! calibration of its converters' inner channels.

use super::peripheral::{NoRegister, Notes, Peripheral};

/// VREFIN_CAL: the code of the internal reference voltage (1.21 V) at a supply of 3.3 V (DocID022152,
/// internal reference voltage calibration values).
pub(crate) const REFERENCE_CODE: u32 = 1502;
/// TS_CAL1 and TS_CAL2: the codes of the temperature sensor at 30 and 110 °C, from its typical values in the
/// same data sheet: 0.76 V at 25 °C, and 2.5 mV/°C.
const TEMPERATURE_CODES: [u32; 2] = [959, 1207];

#[derive(Debug, Clone, Default)]
pub(crate) struct Signature {
    /// 96-bit unique identifier, as bytes in address order.
    pub(crate) uid: [u8; 12],
    /// Size of flash, KiB.
    pub(crate) flash_kib: u32,
    pub(crate) notes: Notes,
}

impl Peripheral for Signature {
    fn read(&mut self, offset: u32, _now: u64) -> Result<u32, NoRegister> {
        match offset {
            0x00 | 0x04 | 0x08 => {
                let at = offset as usize;
                let word = [self.uid[at], self.uid[at + 1], self.uid[at + 2], self.uid[at + 3]];
                Ok(u32::from_le_bytes(word))
            }
            // F_SIZE is the halfword at 0x1fff_7a22.
            0x10 => Ok(self.flash_kib << 16),
            // VREFIN_CAL is the halfword at 0x1fff_7a2a.
            0x18 => Ok(REFERENCE_CODE << 16),
            // TS_CAL1 and TS_CAL2 are the halfwords at 0x1fff_7a2c and 0x1fff_7a2e.
            0x1c => Ok(TEMPERATURE_CODES[1] << 16 | TEMPERATURE_CODES[0]),
            _ => Err(NoRegister),
        }
    }

    fn write(&mut self, _offset: u32, _value: u32, _now: u64) -> Result<(), NoRegister> {
        Ok(())
    }

    fn reset(&mut self, _now: u64) {}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_identifier_lies_in_address_order_and_the_flash_is_1024_kib() {
        let mut signature = Signature {
            flash_kib: 1024,
            ..Signature::default()
        };
        signature.uid.copy_from_slice(b"0123456789ab");
        assert_eq!(signature.read(0x04, 0), Ok(u32::from_le_bytes(*b"4567")));
        assert_eq!(signature.read(0x10, 0).unwrap() >> 16, 1024);
        assert_eq!(signature.read(0x18, 0).unwrap() >> 16, 1502);
        assert_eq!(signature.read(0x1c, 0), Ok(1207 << 16 | 959));
    }
}
