//! The window watchdog (RM0090 section 22): a counter of seven bits that resets the machine when it falls
//! below 0x40, or when it is loaded while it is above the window.

use super::clock::{self, ClockTree};
use super::peripheral::{NoRegister, Notes, Peripheral};
use super::register::field;

const WDGA: u32 = 1 << 7;
const EWI: u32 = 1 << 9;
/// Bit of the counter: the machine is reset when it is clear.
const T6: u32 = 0x40;
const COUNTS: u32 = 0x80;

#[derive(Debug, Clone, Default)]
pub(crate) struct Wwdg {
    /// The counter when it was loaded.
    loaded: u32,
    /// When it was loaded.
    since_ns: u64,
    /// Counts since then whose flag is filled in.
    seen: u64,
    enabled: bool,
    cfr: u32,
    ewif: bool,
    /// True if the watchdog resets the machine at once. Cleared once that is passed on.
    pub(crate) bites: bool,
    pclk: u32,
    pub(crate) notes: Notes,
}

impl Wwdg {
    pub(crate) fn new(pclk: u32) -> Self {
        Self {
            loaded: 0x7f,
            cfr: 0x7f,
            pclk,
            ..Self::default()
        }
    }

    /// Bus clocks of a count: 4096 times 1, 2, 4 or 8 (section 22.4).
    fn divider(&self) -> u64 {
        4096 << field(self.cfr, 7, 2)
    }

    /// Counts since it was loaded.
    fn counts(&self, now: u64) -> u64 {
        clock::ticks(now.saturating_sub(self.since_ns), self.pclk) / self.divider()
    }

    fn count(&self, now: u64) -> u32 {
        let counts = self.counts(now) % u64::from(COUNTS);
        (self.loaded + COUNTS - counts as u32) % COUNTS
    }

    fn time_of(&self, counts: u64) -> u64 {
        let clocks = counts.saturating_mul(self.divider());
        self.since_ns.saturating_add(clock::edge(clocks, self.pclk))
    }

    /// The first count after those that were seen at which the counter is 0x40.
    fn next_early(&self) -> u64 {
        let (first, round) = (u64::from((self.loaded + COUNTS - T6) % COUNTS), u64::from(COUNTS));
        match self.seen.checked_sub(first) {
            None => first,
            Some(past) => first + (past / round + 1) * round,
        }
    }

    /// Fills in what has happened up to `now`, if the processor may be interrupted by it.
    pub(crate) fn advance(&mut self, now: u64) {
        if self.cfr & EWI != 0 {
            self.fill_in(now);
        }
    }

    fn fill_in(&mut self, now: u64) {
        let counts = self.counts(now);
        self.ewif |= self.next_early() <= counts;
        self.seen = counts;
    }

    /// When it resets the machine by itself.
    pub(crate) fn runs_out(&self) -> Option<u64> {
        let counts = u64::from(self.loaded.saturating_sub(T6 - 1));
        self.enabled.then(|| self.time_of(counts))
    }

    fn load(&mut self, count: u32, now: u64) {
        (self.loaded, self.since_ns, self.seen) = (count, now, 0);
        self.ewif |= count == T6;
    }
}

impl Peripheral for Wwdg {
    fn read(&mut self, offset: u32, now: u64) -> Result<u32, NoRegister> {
        self.fill_in(now);
        Ok(match offset {
            0x00 => self.count(now) | if self.enabled { WDGA } else { 0 },
            0x04 => self.cfr,
            0x08 => u32::from(self.ewif),
            _ => return Err(NoRegister),
        })
    }

    fn write(&mut self, offset: u32, value: u32, now: u64) -> Result<(), NoRegister> {
        self.fill_in(now);
        match offset {
            0x00 => {
                let early = self.count(now) > field(self.cfr, 0, 7);
                self.bites |= self.enabled && early;
                self.enabled |= value & WDGA != 0;
                self.load(value & 0x7f, now);
                self.bites |= self.enabled && value & T6 == 0;
            }
            0x04 => {
                let count = self.count(now);
                // EWI is cleared by a reset only.
                self.cfr = (value & 0x3ff) | (self.cfr & EWI);
                self.load(count, now);
            }
            0x08 => self.ewif &= value & 1 != 0,
            _ => return Err(NoRegister),
        }
        Ok(())
    }

    fn reset(&mut self, now: u64) {
        let notes = std::mem::take(&mut self.notes);
        *self = Self {
            since_ns: now,
            notes,
            ..Self::new(self.pclk)
        };
    }

    fn set_clocks(&mut self, clocks: &ClockTree, now: u64) {
        if clocks.pclk1 != self.pclk {
            self.fill_in(now);
            let count = self.count(now);
            self.pclk = clocks.pclk1;
            self.load(count, now);
        }
    }

    fn interrupt(&self, _output: usize) -> bool {
        self.ewif && self.cfr & EWI != 0
    }

    fn next_interrupt(&self) -> Option<u64> {
        let early = (self.cfr & EWI != 0 && !self.ewif).then(|| self.time_of(self.next_early()));
        early.into_iter().chain(self.runs_out()).min()
    }
}

#[cfg(test)]
mod tests {
    use super::super::peripheral::Access;
    use super::*;

    const CR: u32 = 0x00;
    const CFR: u32 = 0x04;
    const SR: u32 = 0x08;

    /// At 30 MHz, as in the table of section 22.4.
    fn started(timebase: u32, count: u32) -> Wwdg {
        let mut wwdg = Wwdg::new(30_000_000);
        wwdg.put(0, [(CFR, timebase << 7 | 0x7f), (CR, WDGA | count)]);
        wwdg
    }

    #[test]
    fn the_timeouts_are_those_of_the_manual() {
        let ns = |timebase, count| started(timebase, count).runs_out().unwrap();
        // 136.53 us to 1092.27 us, and 8.74 ms to 69.91 ms.
        let shortest = [0, 1, 2, 3].map(|timebase| ns(timebase, 0x40));
        assert_eq!(shortest, [136_534, 273_067, 546_134, 1_092_267]);
        let longest = [0, 3].map(|timebase| ns(timebase, 0x7f));
        assert_eq!(longest, [8_738_134, 69_905_067]);
    }

    #[test]
    fn it_warns_a_count_before_it_runs_out_and_once() {
        let mut wwdg = started(0, 0x42);
        wwdg.put(0, [(CFR, EWI | 0x7f)]);
        assert_eq!(wwdg.next_interrupt(), Some(273_067));
        wwdg.advance(273_067);
        assert!(wwdg.interrupt(0));
        wwdg.put(300_000, [(SR, 0)]);
        assert_eq!((wwdg.interrupt(0), wwdg.get(CR, 300_000)), (false, WDGA | 0x40));
        assert_eq!(wwdg.next_interrupt(), Some(409_600));
    }

    #[test]
    fn a_load_above_the_window_or_below_0x40_resets_at_once() {
        let bites = |window, at, count| {
            let mut wwdg = Wwdg::new(30_000_000);
            wwdg.put(0, [(CFR, window), (CR, WDGA | 0x7f)]);
            wwdg.put(at, [(CR, count)]);
            wwdg.bites
        };
        // 0x7f counts down to 0x50 within 47 counts of 136.5 us.
        assert!(bites(0x50, 6_000_000, 0x7f));
        assert!(!bites(0x50, 6_420_000, 0x7f));
        assert!(bites(0x7f, 1_000, 0x3f));
        let mut off = Wwdg::new(30_000_000);
        off.put(0, [(CFR, 0x40), (CR, 0x3f)]);
        assert!(!off.bites && off.runs_out().is_none(), "it is not enabled");
    }
}
