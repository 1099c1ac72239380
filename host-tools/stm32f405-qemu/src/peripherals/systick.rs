//! The processor's own timer (ARMv7-M ARM, B3.3), on HCLK or an eighth of it (RM0090 section 12.1.3).
//!
//! # Design
//!
//! QEMU has one, but its clock does not follow RCC, and it never runs if its reload value is still 0 when it
//! is enabled. Like the other timers this one is a function of time. Ticks count from an origin: the last
//! time at which a register was written that changes what follows.

use super::clock::{self, ClockTree};
use super::peripheral::{NoRegister, Notes, Peripheral};
use crate::ramp::Ramp;

const ENABLE: u32 = 1 << 0;
const TICKINT: u32 = 1 << 1;
const CLKSOURCE: u32 = 1 << 2;
const COUNTFLAG: u32 = 1 << 16;
/// The counter has 24 bits.
const MAX: u32 = 0x00ff_ffff;
/// TENMS: ticks in 1 ms at 18.75 MHz, an eighth of 150 MHz (section 12.1.3).
const CALIBRATION: u32 = 18_750;

#[derive(Debug, Clone, Default)]
pub(crate) struct SysTick {
    hclk: u32,
    control: u32,
    reload: u32,
    count: u32,
    origin_ns: u64,
    /// Ticks from the origin that are already handled.
    seen: u64,
    counted: bool,
    /// The counter reached 0 with its interrupt on. Cleared once it is passed on.
    pub(crate) fired: bool,
    pub(crate) notes: Notes,
}

impl SysTick {
    pub(crate) fn new(hclk: u32) -> Self {
        Self {
            hclk,
            ..Self::default()
        }
    }

    fn hz(&self) -> u32 {
        let whole = self.control & CLKSOURCE != 0;
        if whole { self.hclk } else { self.hclk / 8 }
    }

    fn ticks(&self, now: u64) -> u64 {
        match self.control & ENABLE {
            0 => 0,
            _ => clock::ticks(now.saturating_sub(self.origin_ns), self.hz()),
        }
    }

    /// The counter after some ticks. After 0 comes the reload value. With a reload value of 0 it stays at 0.
    fn value(&self, ticks: u64) -> u32 {
        match ticks.checked_sub(u64::from(self.count) + 1) {
            None => self.count - ticks as u32,
            Some(since_reload) => self.reload - (since_reload % (u64::from(self.reload) + 1)) as u32,
        }
    }

    /// The first tick after `n` at which the counter goes from 1 to 0.
    fn zero_after(&self, n: u64) -> Option<u64> {
        let first = u64::from(self.count);
        if n < first {
            return Some(first);
        }
        let period = u64::from(self.reload) + 1;
        (self.reload > 0).then(|| first + ((n - first) / period + 1) * period)
    }

    /// Fills in what has happened up to `now`.
    pub(crate) fn advance(&mut self, now: u64) {
        let ticks = self.ticks(now);
        if self.zero_after(self.seen).is_some_and(|zero| zero <= ticks) {
            self.counted = true;
            self.fired |= self.control & TICKINT != 0;
        }
        self.seen = ticks;
    }

    /// Makes `now` the origin. The part of a tick that has passed is kept.
    fn settle(&mut self, now: u64) {
        self.advance(now);
        let ticks = self.ticks(now);
        self.count = self.value(ticks);
        let passed = clock::edge(ticks, self.hz());
        let moved = self.origin_ns.saturating_add(passed).min(now);
        self.origin_ns = if self.control & ENABLE == 0 { now } else { moved };
        self.seen = 0;
    }
}

impl Peripheral for SysTick {
    fn read(&mut self, offset: u32, now: u64) -> Result<u32, NoRegister> {
        self.advance(now);
        Ok(match offset {
            0x00 => {
                let counted = std::mem::take(&mut self.counted);
                self.control | if counted { COUNTFLAG } else { 0 }
            }
            0x04 => self.reload,
            0x08 => self.value(self.ticks(now)),
            0x0c => CALIBRATION,
            _ => return Err(NoRegister),
        })
    }

    fn holds_until(&self, offset: u32, now: u64) -> Option<u64> {
        let tick = match offset {
            _ if self.control & ENABLE == 0 && !self.counted => return Some(u64::MAX),
            // Reading COUNTFLAG clears it.
            0x00 if self.counted => return Some(now),
            0x00 => self.zero_after(self.seen),
            // The counter moves on within a turn of a loop.
            0x08 => return Some(now),
            _ => None,
        };
        let edge = |tick| self.origin_ns.saturating_add(clock::edge(tick, self.hz()));
        Some(tick.map_or(u64::MAX, edge))
    }

    fn ramp(&self, offset: u32, now: u64) -> Option<Ramp> {
        if offset != 0x08 || self.control & ENABLE == 0 {
            return None;
        }
        let zero = self.zero_after(self.ticks(now))?;
        Some(Ramp {
            hz: self.hz(),
            falls: true,
            until_ns: self.origin_ns.saturating_add(clock::edge(zero, self.hz())),
        })
    }

    fn write(&mut self, offset: u32, value: u32, now: u64) -> Result<(), NoRegister> {
        self.settle(now);
        match offset {
            0x00 => self.control = value & (ENABLE | TICKINT | CLKSOURCE),
            0x04 => self.reload = value & MAX,
            // Any write clears the counter and the flag.
            0x08 => {
                self.count = 0;
                self.origin_ns = now;
                self.counted = false;
            }
            0x0c => {}
            _ => return Err(NoRegister),
        }
        Ok(())
    }

    fn reset(&mut self, _now: u64) {
        *self = Self::new(self.hclk);
    }

    fn next_interrupt(&self) -> Option<u64> {
        if self.control & (ENABLE | TICKINT) != ENABLE | TICKINT || self.hz() == 0 {
            return None;
        }
        let zero = self.zero_after(self.seen)?;
        Some(self.origin_ns.saturating_add(clock::edge(zero, self.hz())))
    }

    fn set_clocks(&mut self, clocks: &ClockTree, now: u64) {
        self.settle(now);
        self.origin_ns = now;
        self.hclk = clocks.hclk;
    }
}

#[cfg(test)]
mod tests {
    use super::super::peripheral::Access;
    use super::*;

    const CSR: u32 = 0x00;
    const RVR: u32 = 0x04;
    const CVR: u32 = 0x08;

    /// On 16 MHz, where 16 000 ticks are 1 ms.
    fn with<const N: usize>(writes: [(u32, u32); N]) -> SysTick {
        let mut systick = SysTick::new(16_000_000);
        systick.put(0, writes);
        systick
    }

    #[test]
    fn it_counts_down_on_hclk_or_an_eighth_and_follows_the_clock() {
        // One tick to load the reload value.
        for (csr, ticks) in [(0b101, 16_000), (0b001, 2_000)] {
            let mut systick = with([(RVR, 9_999_999), (CVR, 0), (CSR, csr)]);
            assert_eq!(systick.get(CVR, 1_000_000), 9_999_999 + 1 - ticks);
            let mut faster = ClockTree::HSI;
            faster.hclk = 168_000_000;
            systick.set_clocks(&faster, 1_000_000);
            let faster = ticks / 16 * 168;
            assert_eq!(systick.get(CVR, 2_000_000), 9_999_999 + 1 - ticks - faster);
        }
    }

    #[test]
    fn a_period_is_one_tick_longer_than_the_reload_value_and_the_flag_is_read_once() {
        let mut systick = with([(RVR, 15_999), (CVR, 0), (CSR, 0b111)]);
        assert_eq!(systick.next_interrupt(), Some(1_000_000));
        systick.advance(999_999);
        assert!(!systick.fired);
        systick.advance(1_000_000);
        assert!(std::mem::take(&mut systick.fired));
        assert_eq!(systick.next_interrupt(), Some(2_000_000));
        let twice = [CSR; 2].map(|csr| systick.get(csr, 1_000_000));
        assert_eq!(twice, [COUNTFLAG | 0b111, 0b111]);
        assert_eq!(systick.get(CVR, 2_000_062), 0, "in the tick of the zero");
        assert_eq!(systick.get(CVR, 2_000_063), 15_999);
    }

    #[test]
    fn a_new_reload_value_counts_from_the_next_zero_on_and_0_stops_it_there() {
        let mut systick = with([(RVR, 15_999), (CVR, 0), (CSR, 0b111)]);
        systick.put(500_000, [(RVR, 31_999)]);
        assert_eq!(systick.next_interrupt(), Some(1_000_000));
        systick.advance(1_000_000);
        assert_eq!(systick.next_interrupt(), Some(3_000_000));
        systick.put(2_000_000, [(RVR, 0)]);
        systick.advance(3_000_000);
        assert_eq!((systick.next_interrupt(), systick.get(CVR, 9_000_000)), (None, 0));
    }

    #[test]
    fn a_write_to_the_counter_clears_it_and_makes_no_interrupt() {
        let mut systick = with([(RVR, 15_999), (CVR, 0), (CSR, 0b111)]);
        systick.put(400_000, [(CVR, 77)]);
        assert_eq!((systick.get(CVR, 400_000), systick.fired), (0, false));
        assert_eq!(systick.next_interrupt(), Some(1_400_000));
        systick.put(1_000_000, [(CSR, 0)]);
        assert_eq!(systick.next_interrupt(), None);
        assert_eq!(systick.get(CVR, 9_000_000), 6_400);
    }
}
