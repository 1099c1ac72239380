//! The clock tree's frequencies, and ticks of a clock against ns of virtual time, without drift.
//!
//! An edge is placed by its number, counted from an origin. Rounded periods are never added up. Edge `n` is
//! at the first whole nanosecond at or after its true time, so [`ticks`] and [`edge`] are exact inverses.

const NS_PER_S: u64 = 1_000_000_000;

/// Frequency of the internal oscillator (section 7.2.2), in Hz.
pub(crate) const HSI_HZ: u32 = 16_000_000;
/// Frequency of the internal low-speed oscillator, typical (section 7.2.5), in Hz.
pub(crate) const LSI_HZ: u32 = 32_000;

/// Frequency of the crystal on the LSE pins (section 7.2.4), in Hz.
pub(crate) const LSE_HZ: u32 = 32_768;

/// Frequencies of the clock tree, in Hz (section 7.2, figure 21).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ClockTree {
    pub(crate) sysclk: u32,
    /// AHB and processor.
    pub(crate) hclk: u32,
    pub(crate) pclk1: u32,
    pub(crate) pclk2: u32,
    /// Timers on APB1: TIM2-7, 12-14.
    pub(crate) timers1: u32,
    /// Timers on APB2: TIM1, 8-11.
    pub(crate) timers2: u32,
    /// RNG, USB and SDIO (PLLCFGR.PLLQ).
    pub(crate) pll48: u32,
    /// RTCCLK: a frequency, and its divider.
    pub(crate) rtc: (u32, u32),
    /// The crystal for the RTC, and its divider (CFGR.RTCPRE).
    pub(crate) crystal: (u32, u32),
}

#[derive(Debug, Clone, Copy, Default)]
pub(crate) enum Apb {
    #[default]
    One,
    Two,
}

impl ClockTree {
    /// After reset: the internal oscillator, undivided.
    pub(crate) const HSI: Self = Self {
        sysclk: HSI_HZ,
        hclk: HSI_HZ,
        pclk1: HSI_HZ,
        pclk2: HSI_HZ,
        timers1: HSI_HZ,
        timers2: HSI_HZ,
        pll48: 0,
        rtc: (0, 1),
        crystal: (0, 0),
    };

    pub(crate) fn of_bus(&self, apb: Apb) -> u32 {
        match apb {
            Apb::One => self.pclk1,
            Apb::Two => self.pclk2,
        }
    }

    pub(crate) fn of_timers(&self, apb: Apb) -> u32 {
        match apb {
            Apb::One => self.timers1,
            Apb::Two => self.timers2,
        }
    }
}

/// Number of edges of a clock of `hz` within `ns`.
pub(crate) fn ticks(ns: u64, hz: u32) -> u64 {
    match ns.checked_mul(u64::from(hz)) {
        Some(product) => product / NS_PER_S,
        None => (u128::from(ns) * u128::from(hz) / u128::from(NS_PER_S)) as u64,
    }
}

/// Time until edge `n` of a clock of `hz`, ns. `u64::MAX` for a clock that stands still.
pub(crate) fn edge(n: u64, hz: u32) -> u64 {
    if hz == 0 {
        return u64::MAX;
    }
    match n.checked_mul(NS_PER_S) {
        Some(product) => product.div_ceil(u64::from(hz)),
        None => {
            let ns = (u128::from(n) * u128::from(NS_PER_S)).div_ceil(u128::from(hz));
            u64::try_from(ns).unwrap_or(u64::MAX)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_edge_has_come_at_its_time_and_not_a_nanosecond_before() {
        for hz in [32_000, 16_000_000, 84_000_000, 168_000_000] {
            for n in [1, 2, 839, 840, 1 << 20, 1 << 40] {
                let at = edge(n, hz);
                let passed = (ticks(at, hz), ticks(at - 1, hz));
                assert_eq!(passed, (n, n - 1), "{hz} Hz, edge {n}");
            }
        }
    }

    #[test]
    fn a_day_of_a_fast_clock_does_not_drift() {
        let day = 86_400 * NS_PER_S;
        assert_eq!(ticks(day, 168_000_000), 86_400 * 168_000_000);
        assert_eq!(edge(86_400 * 168_000_000, 168_000_000), day);
    }
}
