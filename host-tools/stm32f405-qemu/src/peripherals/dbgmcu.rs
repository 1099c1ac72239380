//! Debug support (RM0090 section 38.16): the device's identity, and bits for a debugger that have no effect
//! here.

use super::peripheral::{NoRegister, Notes, Peripheral};

/// Revision Z (section 38.6.1).
const REVISION: u32 = 0x1001_6000;

#[derive(Debug, Clone, Default)]
pub(crate) struct Dbgmcu {
    pub(crate) dev_id: u16,
    cr: u32,
    freeze: [u32; 2],
    pub(crate) notes: Notes,
}

impl Dbgmcu {
    pub(crate) fn new(dev_id: u16) -> Self {
        Self {
            dev_id,
            ..Self::default()
        }
    }
}

impl Peripheral for Dbgmcu {
    fn read(&mut self, offset: u32, _now: u64) -> Result<u32, NoRegister> {
        match offset {
            0x00 => Ok(REVISION | u32::from(self.dev_id)),
            0x04 => Ok(self.cr),
            0x08 | 0x0c => Ok(self.freeze[(offset as usize - 0x08) / 4]),
            _ => Err(NoRegister),
        }
    }

    fn write(&mut self, offset: u32, value: u32, _now: u64) -> Result<(), NoRegister> {
        match offset {
            0x00 => {}
            0x04 => self.cr = value & 0xe7,
            0x08 => self.freeze[0] = value & 0x06e0_1dff,
            0x0c => self.freeze[1] = value & 0x0007_0003,
            _ => return Err(NoRegister),
        }
        Ok(())
    }

    fn reset(&mut self, _now: u64) {
        *self = Self::new(self.dev_id);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_identity_is_the_parts_and_cannot_be_written() {
        let mut dbgmcu = Dbgmcu::new(0x413);
        dbgmcu.write(0x00, 0, 0).unwrap();
        dbgmcu.reset(0);
        assert_eq!(dbgmcu.read(0x00, 0).unwrap() & 0xfff, 0x413);
    }
}
