//! The three converters and their common registers (RM0090 section 13.13.15 to 13.13.17).

use super::adc::Adc;
use super::peripheral::{NoRegister, Notes, Peripheral};
use super::register::{bit, field};

/// Register bits that request unmodelled features.
const UNMODELLED: [(u32, u32, &str); 1] = [(0x04, 0x1f, "CCR.MULTI: dual and triple modes are not modelled")];

#[derive(Debug, Clone)]
pub(crate) struct Adcs {
    pub(crate) converters: [Adc; 3],
    ccr: u32,
    pub(crate) notes: Notes,
}

impl Adcs {
    pub(crate) fn new(pclk2: u32) -> Self {
        Self {
            converters: std::array::from_fn(|_| Adc::new(pclk2)),
            ccr: 0,
            notes: Notes::default(),
        }
    }

    /// Returns `true` if the temperature sensor and the internal reference voltage are on (CCR.TSVREFE).
    /// Otherwise their channels float.
    pub(crate) fn sensors_on(&self) -> bool {
        bit(self.ccr, 23)
    }

    /// Returns `true` if the divider of the battery voltage is on (CCR.VBATE). It hides the temperature
    /// sensor in parts where both share a channel; in this one they do not.
    pub(crate) fn battery_on(&self) -> bool {
        bit(self.ccr, 22)
    }

    fn set_ccr(&mut self, value: u32) {
        self.ccr = value & 0x00c3_ef1f;
        for converter in &mut self.converters {
            converter.divider = 2 * (field(self.ccr, 16, 2) + 1);
        }
    }
}

/// The common registers. Each converter models its own.
impl Peripheral for Adcs {
    fn read(&mut self, offset: u32, _now: u64) -> Result<u32, NoRegister> {
        match offset {
            // CSR: the flags of all three, 8 bits apart.
            0x00 => {
                let flags = self.converters.iter().rev().map(|adc| adc.sr);
                Ok(flags.fold(0, |all, flags| all << 8 | flags))
            }
            0x04 => Ok(self.ccr),
            _ => Err(NoRegister),
        }
    }

    fn write(&mut self, offset: u32, value: u32, _now: u64) -> Result<(), NoRegister> {
        self.notes.note_bits(&UNMODELLED, offset, value);
        match offset {
            0x00 => {}
            0x04 => self.set_ccr(value),
            _ => return Err(NoRegister),
        }
        Ok(())
    }

    fn reset(&mut self, _now: u64) {
        self.set_ccr(0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_prescaler_serves_all_three_and_one_register_shows_all_flags() {
        let mut adcs = Adcs::new(84_000_000);
        adcs.write(0x04, 0b11 << 16, 0).unwrap();
        for converter in &mut adcs.converters[1..] {
            converter.write(0x08, 1 | 1 << 30, 0).unwrap();
            // 3 + 12 cycles at PCLK2 / 8.
            assert_eq!(converter.next_conversion(), Some(1_429));
        }
        adcs.converters[2].finish(0, 1_429);
        assert_eq!(adcs.read(0x00, 0), Ok(1 << 4 << 8 | (1 << 4 | 1 << 1) << 16));
        adcs.reset(0);
        assert_eq!((adcs.read(0x04, 0), adcs.converters[0].divider), (Ok(0), 2));
    }
}
