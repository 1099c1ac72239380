//! Registers of the processor that QEMU lacks, or has only in part: SCR (ARMv7-M ARM, B3.2.7) and the debug
//! registers (C1.6) as firmware sees them without a debugger.

use super::peripheral::{NoRegister, Notes, Peripheral};
use super::register::bit;

const SLEEPONEXIT: u32 = 1 << 1;
const SLEEPDEEP: u32 = 1 << 2;
const SEVONPEND: u32 = 1 << 4;
const TRCENA: u32 = 1 << 24;
const ON_EXIT: &str = "SLEEPONEXIT: the processor does not go to sleep when a handler returns";
const ON_PEND: &str = "SEVONPEND: WFE does not wait here, so nothing wakes it";

#[derive(Debug, Clone, Default)]
pub(crate) struct Scr {
    scr: u32,
    pub(crate) notes: Notes,
}

impl Scr {
    /// Returns `true` if a sleep is deep: STOP or STANDBY, as PWR selects.
    pub(crate) fn sleeps_deep(&self) -> bool {
        self.scr & SLEEPDEEP != 0
    }
}

impl Peripheral for Scr {
    fn read(&mut self, offset: u32, _now: u64) -> Result<u32, NoRegister> {
        (offset == 0).then_some(self.scr).ok_or(NoRegister)
    }

    fn write(&mut self, offset: u32, value: u32, _now: u64) -> Result<(), NoRegister> {
        self.scr = value & (SLEEPONEXIT | SLEEPDEEP | SEVONPEND);
        self.notes.note_if(value & SLEEPONEXIT != 0, ON_EXIT);
        self.notes.note_if(value & SEVONPEND != 0, ON_PEND);
        (offset == 0).then_some(()).ok_or(NoRegister)
    }

    fn reset(&mut self, _now: u64) {
        self.scr = 0;
    }
}

/// The debug registers DHCSR, DCRSR, DCRDR and DEMCR. No debugger is attached.
#[derive(Debug, Clone, Default)]
pub(crate) struct Debug {
    pub(crate) demcr: u32,
    pub(crate) notes: Notes,
}

impl Debug {
    pub(crate) fn traces(&self) -> bool {
        self.demcr & TRCENA != 0
    }
}

impl Peripheral for Debug {
    fn read(&mut self, offset: u32, _now: u64) -> Result<u32, NoRegister> {
        match offset {
            // C_DEBUGEN is clear, and the rest cannot be seen without a debugger.
            0x00 | 0x08 => Ok(0),
            0x0c => Ok(self.demcr),
            _ => Err(NoRegister),
        }
    }

    fn write(&mut self, offset: u32, value: u32, _now: u64) -> Result<(), NoRegister> {
        match offset {
            // Only a debugger can write them.
            0x00..=0x08 => {}
            0x0c => {
                self.demcr = value & (TRCENA | 0x000f_07f1);
                self.notes
                    .note_if(bit(value, 16), "DEMCR.MON_EN: the debug monitor is not modelled");
            }
            _ => return Err(NoRegister),
        }
        Ok(())
    }

    /// TRCENA survives a reset of the processor.
    fn reset(&mut self, _now: u64) {
        self.demcr &= TRCENA;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scr_says_how_deep_a_sleep_is_and_names_what_is_missing() {
        let mut scr = Scr::default();
        scr.write(0, SLEEPDEEP, 0).unwrap();
        assert!(scr.sleeps_deep());
        assert_eq!((scr.read(0, 0), scr.notes.iter().count()), (Ok(SLEEPDEEP), 0));
        scr.write(0, SLEEPONEXIT, 0).unwrap();
        assert_eq!((scr.sleeps_deep(), scr.notes.iter().count()), (false, 1));
    }

    #[test]
    fn without_a_debugger_only_demcr_can_be_written() {
        let mut debug = Debug::default();
        debug.write(0x00, 0xa05f_0003, 0).unwrap();
        assert_eq!(debug.read(0x00, 0), Ok(0));
        debug.write(0x0c, TRCENA, 0).unwrap();
        debug.reset(0);
        assert!(debug.traces());
        debug.demcr = 0;
        assert!(!debug.traces());
    }
}
