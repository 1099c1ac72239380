//! External interrupts (RM0090 section 12.3). Only the software trigger moves the lines; levels on pins do
//! not.

use super::peripheral::{NoRegister, Peripheral};

/// Lines 0..=22.
const LINES: u32 = 0x007f_ffff;

/// The lines that share an interrupt, in the order of the interrupts' numbers (table 61).
const SHARED: [u32; 7] = [1, 1 << 1, 1 << 2, 1 << 3, 1 << 4, 0x03e0, 0xfc00];

/// EXTI's registers.
#[derive(Debug, Clone, Default)]
pub struct Exti {
    imr: u32,
    emr: u32,
    rtsr: u32,
    ftsr: u32,
    swier: u32,
    pr: u32,
}

impl Peripheral for Exti {
    fn read(&mut self, offset: u32, _now: u64) -> Result<u32, NoRegister> {
        Ok(match offset {
            0x00 => self.imr,
            0x04 => self.emr,
            0x08 => self.rtsr,
            0x0c => self.ftsr,
            0x10 => self.swier,
            0x14 => self.pr,
            _ => return Err(NoRegister),
        })
    }

    fn write(&mut self, offset: u32, value: u32, _now: u64) -> Result<(), NoRegister> {
        let value = value & LINES;
        match offset {
            0x00 => self.imr = value,
            0x04 => self.emr = value,
            0x08 => self.rtsr = value,
            0x0c => self.ftsr = value,
            0x10 => {
                // A bit that goes from 0 to 1 sets the pending bit, if the interrupt is enabled (section
                // 12.3.5).
                self.pr |= value & !self.swier & self.imr;
                self.swier |= value;
            }
            // Writing 1 clears, here and in SWIER.
            0x14 => {
                self.pr &= !value;
                self.swier &= !value;
            }
            _ => return Err(NoRegister),
        }
        Ok(())
    }

    fn reset(&mut self, _now: u64) {
        *self = Self::default();
    }

    fn interrupt(&self, output: usize) -> bool {
        self.pr & self.imr & SHARED[output] != 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_software_trigger_stands_until_one_is_written_to_pr() {
        let mut exti = Exti::default();
        exti.write(0x00, 1 << 3, 0).unwrap();
        exti.write(0x10, 1 << 3 | 1 << 4, 0).unwrap();
        assert_eq!(exti.read(0x14, 0), Ok(1 << 3), "line 4 is not enabled");
        assert!(exti.interrupt(3));
        exti.write(0x14, 1 << 3, 0).unwrap();
        assert!((0..SHARED.len()).all(|output| !exti.interrupt(output)));
        assert_eq!(exti.read(0x10, 0), Ok(1 << 4));
    }
}
