//! The independent watchdog (RM0090 section 21). Once it is started, it resets the machine unless it is fed.

use super::clock;
use super::peripheral::{NoRegister, Notes, Peripheral};

const FEED: u32 = 0xaaaa;
const START: u32 = 0xcccc;
const UNLOCK: u32 = 0x5555;

#[derive(Debug, Clone, Default)]
pub(crate) struct Iwdg {
    prescaler: u32,
    reload: u32,
    unlocked: bool,
    fed_ns: Option<u64>,
    /// Frequency of its oscillator.
    pub(crate) lsi_hz: u32,
    pub(crate) notes: Notes,
}

impl Iwdg {
    pub(crate) fn new(lsi_hz: u32) -> Self {
        Self {
            reload: 0xfff,
            lsi_hz,
            ..Self::default()
        }
    }
}

impl Peripheral for Iwdg {
    fn read(&mut self, offset: u32, _now: u64) -> Result<u32, NoRegister> {
        Ok(match offset {
            // KR reads as 0. SR: no update is in progress.
            0x00 | 0x0c => 0,
            0x04 => self.prescaler,
            0x08 => self.reload,
            _ => return Err(NoRegister),
        })
    }

    fn write(&mut self, offset: u32, value: u32, now: u64) -> Result<(), NoRegister> {
        match offset {
            0x00 => {
                match value & 0xffff {
                    FEED if self.fed_ns.is_some() => self.fed_ns = Some(now),
                    START => self.fed_ns = Some(now),
                    _ => {}
                }
                self.unlocked = value & 0xffff == UNLOCK;
            }
            0x04 if self.unlocked => self.prescaler = value & 7,
            0x08 if self.unlocked => self.reload = value & 0xfff,
            0x04 | 0x08 | 0x0c => {}
            _ => return Err(NoRegister),
        }
        Ok(())
    }

    fn reset(&mut self, _now: u64) {
        *self = Self::new(self.lsi_hz);
    }

    /// When it resets the machine, if nothing feeds it.
    fn next_interrupt(&self) -> Option<u64> {
        // Prescaler 4 << PR, at most 256 (section 21.4.2).
        let divider = (4u64 << self.prescaler).min(256);
        self.fed_ns
            .map(|fed| fed + clock::edge(divider * u64::from(self.reload + 1), self.lsi_hz))
    }
}

#[cfg(test)]
mod tests {
    use super::super::clock::LSI_HZ;
    use super::super::peripheral::Access;
    use super::*;

    const KR: u32 = 0x00;
    const PR: u32 = 0x04;
    const RLR: u32 = 0x08;

    fn started(prescaler: u32, reload: u32) -> Iwdg {
        let mut iwdg = Iwdg::new(LSI_HZ);
        iwdg.put(0, [(KR, START), (KR, UNLOCK), (PR, prescaler)]);
        iwdg.put(0, [(RLR, reload), (KR, FEED)]);
        iwdg
    }

    #[test]
    fn the_timeout_is_that_of_table_107() {
        // 512 ms, 32.768 s and 0.125 ms.
        for (prescaler, reload, ns) in [
            (0, 0xfff, 512_000_000),
            (6, 0xfff, 32_768_000_000),
            (0, 0, 125_000),
        ] {
            assert_eq!(started(prescaler, reload).next_interrupt(), Some(ns));
        }
    }

    #[test]
    fn feeding_puts_it_off_and_does_not_start_it() {
        let mut iwdg = Iwdg::new(LSI_HZ);
        iwdg.put(0, [(KR, FEED)]);
        assert_eq!(iwdg.next_interrupt(), None);
        let mut iwdg = started(0, 0xfff);
        iwdg.put(100_000_000, [(KR, FEED)]);
        assert_eq!(iwdg.next_interrupt(), Some(612_000_000));
    }
}
