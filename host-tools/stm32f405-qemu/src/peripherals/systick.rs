//! The processor's own timer (ARMv7-M ARM, B3.3), on HCLK or an eighth of it (RM0090 section 12.1.3).
//!
//! # Design
//!
//! QEMU has one, but its clock does not follow RCC, and it never runs if its reload value is still 0 when it
//! is enabled. Like the other timers this one is a function of time. Ticks count from an origin: the last
//! time at which a register was written that changes what follows.

use super::clock::{self, Clocks};
use super::peripheral::{NoRegister, Peripheral};

const ENABLE: u32 = 1 << 0;
const TICKINT: u32 = 1 << 1;
const CLKSOURCE: u32 = 1 << 2;
const COUNTFLAG: u32 = 1 << 16;
/// The counter has 24 bits.
const MAX: u32 = 0x00ff_ffff;
/// TENMS: ticks in 1 ms at 18.75 MHz, an eighth of 150 MHz (section 12.1.3).
const CALIBRATION: u32 = 18_750;

/// The four registers.
#[derive(Debug, Clone)]
pub struct SysTick {
    hclk: u32,
    control: u32,
    reload: u32,
    /// The counter at the origin.
    count: u32,
    origin_ns: u64,
    /// Ticks from the origin that were looked at.
    seen: u64,
    counted: bool,
    /// The counter reached 0 with its interrupt on. Whoever passes it on clears this.
    pub fired: bool,
}

impl SysTick {
    /// After reset.
    pub fn new(hclk: u32) -> Self {
        Self {
            hclk,
            control: 0,
            reload: 0,
            count: 0,
            origin_ns: 0,
            seen: 0,
            counted: false,
            fired: false,
        }
    }

    fn hz(&self) -> u32 {
        match self.control & CLKSOURCE {
            0 => self.hclk / 8,
            _ => self.hclk,
        }
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

    /// The first tick after `n` at which the counter gets from 1 to 0.
    fn zero_after(&self, n: u64) -> Option<u64> {
        let first = u64::from(self.count);
        if n < first {
            return Some(first);
        }
        let period = u64::from(self.reload) + 1;
        (self.reload > 0).then(|| first + ((n - first) / period + 1) * period)
    }

    /// Fills in what has happened up to `now`.
    pub fn advance(&mut self, now: u64) {
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
        self.origin_ns = match self.control & ENABLE {
            0 => now,
            _ => self
                .origin_ns
                .saturating_add(clock::edge(ticks, self.hz()))
                .min(now),
        };
        self.seen = 0;
    }
}

impl Peripheral for SysTick {
    fn read(&mut self, offset: u32, now: u64) -> Result<u32, NoRegister> {
        self.advance(now);
        Ok(match offset {
            0x00 => {
                self.control
                    | if std::mem::take(&mut self.counted) {
                        COUNTFLAG
                    } else {
                        0
                    }
            }
            0x04 => self.reload,
            0x08 => self.value(self.ticks(now)),
            0x0c => CALIBRATION,
            _ => return Err(NoRegister),
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

    fn set_clocks(&mut self, clocks: &Clocks, now: u64) {
        self.settle(now);
        self.origin_ns = now;
        self.hclk = clocks.hclk;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CSR: u32 = 0x00;
    const RVR: u32 = 0x04;
    const CVR: u32 = 0x08;

    fn at(hclk: u32, writes: &[(u32, u32)]) -> SysTick {
        let mut systick = SysTick::new(hclk);
        for (offset, value) in writes {
            systick.write(*offset, *value, 0).unwrap();
        }
        systick
    }

    #[test]
    fn it_counts_down_on_hclk_or_an_eighth_and_follows_the_clock() {
        let mut fast = at(168_000_000, &[(RVR, 9_999_999), (CVR, 0), (CSR, 0b101)]);
        // One tick to load the reload value.
        assert_eq!(fast.read(CVR, 1_000_000), Ok(9_999_999 + 1 - 168_000));
        let mut slow = at(168_000_000, &[(RVR, 9_999_999), (CVR, 0), (CSR, 0b001)]);
        assert_eq!(slow.read(CVR, 1_000_000), Ok(9_999_999 + 1 - 21_000));
        fast.set_clocks(&Clocks::HSI, 1_000_000);
        assert_eq!(fast.read(CVR, 2_000_000), Ok(9_999_999 + 1 - 184_000));
    }

    #[test]
    fn a_period_is_one_tick_longer_than_the_reload_value_and_the_flag_is_read_once() {
        // 16 000 ticks of 16 MHz: 1 ms.
        let mut systick = at(16_000_000, &[(RVR, 15_999), (CVR, 0), (CSR, 0b111)]);
        assert_eq!(systick.next_interrupt(), Some(1_000_000));
        systick.advance(999_999);
        assert!(!systick.fired);
        systick.advance(1_000_000);
        assert!(std::mem::take(&mut systick.fired));
        assert_eq!(systick.next_interrupt(), Some(2_000_000));
        assert_eq!(systick.read(CSR, 1_000_000), Ok(COUNTFLAG | 0b111));
        assert_eq!(systick.read(CSR, 1_000_000), Ok(0b111));
        assert_eq!(systick.read(CVR, 2_000_062), Ok(0), "in the tick of the zero");
        assert_eq!(systick.read(CVR, 2_000_063), Ok(15_999));
    }

    #[test]
    fn a_reload_value_that_comes_after_the_start_starts_it() {
        let mut systick = at(16_000_000, &[(CSR, 0b111)]);
        assert_eq!(
            (systick.next_interrupt(), systick.read(CVR, 500_000)),
            (None, Ok(0))
        );
        systick.write(RVR, 15_999, 500_000).unwrap();
        assert_eq!(systick.next_interrupt(), Some(1_500_000));
    }

    #[test]
    fn a_new_reload_value_counts_from_the_next_zero_on_and_0_stops_it_there() {
        let mut systick = at(16_000_000, &[(RVR, 15_999), (CVR, 0), (CSR, 0b111)]);
        systick.write(RVR, 31_999, 500_000).unwrap();
        assert_eq!(systick.next_interrupt(), Some(1_000_000));
        systick.advance(1_000_000);
        assert_eq!(systick.next_interrupt(), Some(3_000_000));
        systick.write(RVR, 0, 2_000_000).unwrap();
        systick.advance(3_000_000);
        assert_eq!(
            (systick.next_interrupt(), systick.read(CVR, 9_000_000)),
            (None, Ok(0))
        );
    }

    #[test]
    fn a_write_to_the_counter_clears_it_and_makes_no_interrupt() {
        let mut systick = at(16_000_000, &[(RVR, 15_999), (CVR, 0), (CSR, 0b111)]);
        systick.write(CVR, 77, 400_000).unwrap();
        assert_eq!(systick.read(CVR, 400_000), Ok(0));
        assert!(!systick.fired);
        assert_eq!(systick.next_interrupt(), Some(1_400_000));
        systick.write(CSR, 0, 1_000_000).unwrap();
        assert_eq!(
            (systick.next_interrupt(), systick.read(CVR, 9_000_000)),
            (None, Ok(6_400))
        );
    }
}
