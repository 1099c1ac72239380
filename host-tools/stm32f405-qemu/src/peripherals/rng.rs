//! The random number generator (RM0090 section 24).
//!
//! A word is ready 40 clocks of PLL48CLK after the generator was enabled or the last word was read (section
//! 24.3). The words come from a seed, so that the same run gives the same bytes. Seed errors do not happen.

use super::clock::{self, ClockTree};
use super::peripheral::{NoRegister, Notes, Peripheral};

const RNGEN: u32 = 1 << 2;
const IE: u32 = 1 << 3;
const DRDY: u32 = 1 << 0;
const CECS: u32 = 1 << 1;
const CEIS: u32 = 1 << 5;
const SEIS: u32 = 1 << 6;
/// Clocks of PLL48CLK from one word to the next.
const CLOCKS: u64 = 40;

#[derive(Debug, Clone, Default)]
pub(crate) struct Rng {
    cr: u32,
    /// CEIS and SEIS.
    flags: u32,
    state: u64,
    word: u32,
    ready: bool,
    /// When the word that is on its way will be ready.
    ready_at: Option<u64>,
    pll48: u32,
    hclk: u32,
    pub(crate) notes: Notes,
}

impl Rng {
    pub(crate) fn new(seed: u64) -> Self {
        Self {
            state: seed,
            ..Self::default()
        }
    }

    /// PLL48CLK is below a sixteenth of HCLK (section 24.4.2, CECS).
    fn clock_is_wrong(&self) -> bool {
        self.cr & RNGEN != 0 && self.pll48 < self.hclk / 16
    }

    /// Fills in what has happened up to `now`.
    pub(crate) fn advance(&mut self, now: u64) {
        self.ready |= self.ready_at.take_if(|at| *at <= now).is_some();
    }

    /// Begins the next word: SplitMix64 (Steele, Lea and Flood, 2014).
    fn begin(&mut self, now: u64) {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.state;
        bits = (bits ^ bits >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ bits >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        // 0 would be taken for a failure.
        self.word = ((bits ^ bits >> 31) as u32).max(1);
        self.ready = false;
        self.ready_at = Some(now.saturating_add(clock::edge(CLOCKS, self.pll48)));
    }

    fn check_clock(&mut self) {
        if self.clock_is_wrong() {
            self.flags |= CEIS;
        }
    }
}

impl Peripheral for Rng {
    fn read(&mut self, offset: u32, now: u64) -> Result<u32, NoRegister> {
        self.advance(now);
        Ok(match offset {
            0x00 => self.cr,
            0x04 => {
                let wrong = if self.clock_is_wrong() { CECS } else { 0 };
                self.flags | wrong | if self.ready { DRDY } else { 0 }
            }
            0x08 if self.ready => {
                let word = self.word;
                self.begin(now);
                word
            }
            0x08 => 0,
            _ => return Err(NoRegister),
        })
    }

    fn holds_until(&self, offset: u32, _now: u64) -> Option<u64> {
        match offset {
            0x08 => None,
            0x04 => Some(self.ready_at.unwrap_or(u64::MAX)),
            _ => Some(u64::MAX),
        }
    }

    fn write(&mut self, offset: u32, value: u32, now: u64) -> Result<(), NoRegister> {
        match offset {
            0x00 => {
                let starts = value & !self.cr & RNGEN != 0;
                self.cr = value & (RNGEN | IE);
                if starts {
                    self.begin(now);
                    self.check_clock();
                } else if self.cr & RNGEN == 0 {
                    (self.ready, self.ready_at) = (false, None);
                }
            }
            // rc_w0.
            0x04 => self.flags &= value & (CEIS | SEIS),
            0x08 => {}
            _ => return Err(NoRegister),
        }
        Ok(())
    }

    /// The sequence of words continues.
    fn reset(&mut self, _now: u64) {
        let old = std::mem::take(self);
        (self.state, self.notes) = (old.state, old.notes);
        (self.pll48, self.hclk) = (old.pll48, old.hclk);
    }

    fn set_clocks(&mut self, clocks: &ClockTree, now: u64) {
        let changed = self.pll48 != clocks.pll48;
        (self.pll48, self.hclk) = (clocks.pll48, clocks.hclk);
        self.advance(now);
        if changed && self.ready_at.is_some() {
            self.ready_at = Some(now.saturating_add(clock::edge(CLOCKS, self.pll48)));
        }
        self.check_clock();
    }

    fn interrupt(&self, _output: usize) -> bool {
        self.cr & IE != 0 && (self.flags != 0 || self.ready)
    }

    fn next_interrupt(&self) -> Option<u64> {
        self.ready_at.filter(|_| self.cr & IE != 0 && !self.interrupt(0))
    }
}

#[cfg(test)]
mod tests {
    use super::super::peripheral::Access;
    use super::*;

    const CR: u32 = 0x00;
    const SR: u32 = 0x04;
    const DR: u32 = 0x08;

    fn clocked(pll48: u32) -> Rng {
        let mut rng = Rng::new(1);
        let hclk = 168_000_000;
        let clocks = ClockTree {
            pll48,
            hclk,
            ..ClockTree::HSI
        };
        rng.set_clocks(&clocks, 0);
        rng
    }

    #[test]
    fn a_word_is_ready_after_forty_clocks_and_each_is_another() {
        let mut rng = clocked(48_000_000);
        rng.put(1_000, [(CR, RNGEN | IE)]);
        // 40 / 48 MHz.
        assert_eq!(rng.next_interrupt(), Some(1_834));
        assert_eq!((rng.get(SR, 1_833), rng.get(DR, 1_833)), (0, 0));
        assert_eq!(rng.get(SR, 1_834), DRDY);
        assert!(rng.interrupt(0));
        let first = rng.get(DR, 2_000);
        assert_eq!((rng.get(SR, 2_833), rng.get(SR, 2_834)), (0, DRDY));
        // Of SplitMix64 with seed 1, the lower halves: 0x910a2dec89025cc1, 0xbeeb8da1658eec67.
        assert_eq!((first, rng.get(DR, 2_834)), (0x8902_5cc1, 0x658e_ec67));
    }

    #[test]
    fn a_clock_that_is_too_slow_is_an_error_until_it_is_cleared() {
        let mut rng = clocked(10_000_000);
        rng.put(0, [(CR, RNGEN | IE)]);
        assert_eq!(rng.get(SR, 0), CECS | CEIS);
        assert!(rng.interrupt(0));
        rng.put(0, [(SR, 0)]);
        assert_eq!(rng.get(SR, 0), CECS);
        let mut off = clocked(0);
        off.put(0, [(CR, RNGEN)]);
        assert_eq!(off.get(SR, 1_000_000_000) & DRDY, 0);
    }
}
