//! Power control (RM0090 section 5.4). The regulator is ready at once; the supply never dips.

use super::{NoRegister, Notes, bit};

const VOS: u32 = 1 << 14;
const DBP: u32 = 1 << 8;

/// PWR's registers.
#[derive(Debug, Clone)]
pub struct Pwr {
    cr: u32,
    csr: u32,
    /// See [`Notes`].
    pub notes: Notes,
}

impl Default for Pwr {
    fn default() -> Self {
        Self {
            cr: VOS,
            csr: 0,
            notes: Notes::default(),
        }
    }
}

impl Pwr {
    /// A reset; the notes stay.
    pub fn reset(&mut self) {
        *self = Self {
            notes: std::mem::take(&mut self.notes),
            ..Self::default()
        };
    }

    /// The backup domain may be written (CR.DBP).
    pub fn backup_domain_open(&self) -> bool {
        self.cr & DBP != 0
    }

    /// # Errors
    /// [`NoRegister`].
    pub fn read(&self, offset: u32) -> Result<u32, NoRegister> {
        match offset {
            0x00 => Ok(self.cr),
            // VOSRDY always; BRR follows BRE.
            0x04 => Ok(self.csr | 1 << 14 | (u32::from(bit(self.csr, 9)) << 3)),
            _ => Err(NoRegister),
        }
    }

    /// # Errors
    /// [`NoRegister`].
    pub fn write(&mut self, offset: u32, value: u32) -> Result<(), NoRegister> {
        match offset {
            0x00 => {
                // CWUF and CSBF read as 0.
                self.cr = value & 0x43f3;
                self.notes
                    .note_if(bit(value, 4), "CR.PVDE: the supply is always above the threshold");
            }
            0x04 => self.csr = value & 0x300,
            _ => return Err(NoRegister),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_regulator_is_ready_and_dbp_opens_the_backup_domain() {
        let mut pwr = Pwr::default();
        assert_eq!(pwr.read(0x04), Ok(1 << 14));
        assert!(!pwr.backup_domain_open());
        pwr.write(0x00, VOS | DBP).unwrap();
        assert!(pwr.backup_domain_open());
        assert_eq!(pwr.read(0x00), Ok(VOS | DBP));
    }

    #[test]
    fn the_backup_regulator_is_ready_when_on() {
        let mut pwr = Pwr::default();
        pwr.write(0x04, 1 << 9).unwrap();
        assert_eq!(pwr.read(0x04), Ok(1 << 14 | 1 << 9 | 1 << 3));
    }
}
