//! The flash interface (RM0090 section 3.9): wait states, and the locks. Programming and erasing are not modelled and
//! are noted when asked for.

use super::{NoRegister, Notes, bit};

const LOCK: u32 = 1 << 31;
const OPTLOCK: u32 = 1;
const KEYS: [u32; 2] = [0x4567_0123, 0xcdef_89ab];
const OPTION_KEYS: [u32; 2] = [0x0819_2a3b, 0x4c5d_6e7f];

/// FLASH's registers.
#[derive(Debug, Clone)]
pub struct Flash {
    acr: u32,
    cr: u32,
    optcr: u32,
    first_key_seen: bool,
    first_option_key_seen: bool,
    /// See [`Notes`].
    pub notes: Notes,
}

impl Default for Flash {
    fn default() -> Self {
        Self {
            acr: 0,
            cr: LOCK,
            optcr: 0x0fff_aaed,
            first_key_seen: false,
            first_option_key_seen: false,
            notes: Notes::default(),
        }
    }
}

impl Flash {
    /// A reset; the notes stay.
    pub fn reset(&mut self) {
        *self = Self {
            notes: std::mem::take(&mut self.notes),
            ..Self::default()
        };
    }

    /// Too few wait states for this processor clock read wrong words on silicon: table 10, for 2.7 V to 3.6 V, asks for
    /// one more every 30 MHz.
    pub fn check_latency(&mut self, hclk: u32) {
        let needed = hclk.saturating_sub(1) / 30_000_000;
        self.notes.note_if(
            self.acr & 7 < needed,
            "ACR.LATENCY is below table 10 for this HCLK",
        );
    }

    /// # Errors
    /// [`NoRegister`].
    pub fn read(&self, offset: u32) -> Result<u32, NoRegister> {
        Ok(match offset {
            0x00 => self.acr,
            // Keys cannot be read back; SR says idle, without errors.
            0x04 | 0x08 | 0x0c => 0,
            0x10 => self.cr,
            0x14 => self.optcr,
            _ => return Err(NoRegister),
        })
    }

    /// # Errors
    /// [`NoRegister`].
    pub fn write(&mut self, offset: u32, value: u32) -> Result<(), NoRegister> {
        match offset {
            0x00 => self.acr = value & 0x1f07,
            0x04 => {
                if self.first_key_seen && value == KEYS[1] {
                    self.cr &= !LOCK;
                }
                self.first_key_seen = value == KEYS[0];
            }
            0x08 => {
                if self.first_option_key_seen && value == OPTION_KEYS[1] {
                    self.optcr &= !OPTLOCK;
                }
                self.first_option_key_seen = value == OPTION_KEYS[0];
            }
            0x0c => {}
            0x10 if self.cr & LOCK == 0 => {
                self.cr = value & 0x8101_03fb;
                self.notes
                    .note_if(value & 0b111 != 0, "CR: programming and erasing are not modelled");
            }
            0x10 => self.cr |= value & LOCK,
            0x14 => {
                self.notes
                    .note_if(bit(value, 1), "OPTCR: option bytes are not modelled");
                self.optcr |= value & OPTLOCK;
            }
            _ => return Err(NoRegister),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wait_states_read_back_and_too_few_are_noted() {
        let mut flash = Flash::default();
        flash.write(0x00, 5).unwrap();
        flash.check_latency(168_000_000);
        assert_eq!((flash.read(0x00), flash.notes.iter().count()), (Ok(5), 0));
        flash.write(0x00, 4).unwrap();
        flash.check_latency(168_000_000);
        assert_eq!(flash.notes.iter().count(), 1);
    }

    #[test]
    fn the_control_register_opens_with_both_keys_in_order_only() {
        let mut flash = Flash::default();
        flash.write(0x04, KEYS[1]).unwrap();
        flash.write(0x04, KEYS[0]).unwrap();
        assert_eq!(flash.read(0x10), Ok(LOCK));
        flash.write(0x04, KEYS[1]).unwrap();
        assert_eq!(flash.read(0x10), Ok(0));
        flash.write(0x10, LOCK).unwrap();
        assert_eq!(flash.read(0x10), Ok(LOCK));
    }
}
