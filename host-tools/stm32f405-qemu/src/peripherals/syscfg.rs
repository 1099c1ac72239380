//! System configuration (RM0090 section 9.2): which port an EXTI line listens to. The memory at 0 is always
//! flash.

use super::peripheral::{NoRegister, Notes, Peripheral};
use super::register::field;

#[derive(Debug, Clone, Default)]
pub(crate) struct Syscfg {
    memrmp: u32,
    pmc: u32,
    exticr: [u32; 4],
    pub(crate) notes: Notes,
}

impl Syscfg {
    /// The port (A is 0) that an EXTI line from 0 to 15 listens to (section 9.2.3).
    pub(crate) fn port(&self, line: usize) -> usize {
        field(self.exticr[line / 4], 4 * (line as u32 % 4), 4) as usize
    }
}

impl Peripheral for Syscfg {
    fn read(&mut self, offset: u32, _now: u64) -> Result<u32, NoRegister> {
        Ok(match offset {
            0x00 => self.memrmp,
            0x04 => self.pmc,
            0x08 | 0x0c | 0x10 | 0x14 => self.exticr[(offset as usize - 0x08) / 4],
            // CMPCR: the compensation cell is off and says so.
            0x20 => 0,
            _ => return Err(NoRegister),
        })
    }

    fn write(&mut self, offset: u32, value: u32, _now: u64) -> Result<(), NoRegister> {
        match offset {
            0x00 => {
                self.memrmp = value & 3;
                self.notes
                    .note_if(value & 3 != 0, "MEMRMP: the memory at 0 stays flash");
            }
            0x04 => self.pmc = value & 1 << 23,
            0x08 | 0x0c | 0x10 | 0x14 => self.exticr[(offset as usize - 0x08) / 4] = value & 0xffff,
            _ => return Err(NoRegister),
        }
        Ok(())
    }

    fn reset(&mut self, _now: u64) {
        self.notes = std::mem::take(self).notes;
    }
}
