//! TIM3, whose update events start the scans and count them.
//!
//! # Design
//! The timer runs at the sample rate from the first scan on and is never stopped. Trigger number `i` comes
//! `i` sample periods after the start, whatever happens to the acquisition. Between epochs only the timer's
//! output to the ADC is closed. The index of a scan is the number of its trigger, so the index is the time.
//!
//! The time driver counts the triggers while the output is closed. Both timers count the same clock, and a
//! tick is a sample period. So a count of ticks is an exact count of triggers, if it is read away from the
//! edges of both. The timer is started right after a tick. Hence ticks come right before its updates, and
//! neither is near in the first half of a period.

use bead_app::{CLOCKS_PER_SAMPLE, SAMPLE_RATE_HZ};
use embassy_stm32::Peri;
use embassy_stm32::pac::{TIM3, timer::vals::Mms};
use embassy_stm32::peripherals;
use embassy_stm32::timer::low_level::Timer;
use embassy_time::Instant;

use crate::clocks::TIMER_HZ;
use crate::masked;

/// Timer clocks in a sample period.
const PERIOD: u32 = CLOCKS_PER_SAMPLE as u32;

const _: () = assert!(
    TIMER_HZ == PERIOD * SAMPLE_RATE_HZ,
    "the sample period is a whole number of clocks"
);
const _: () = assert!(
    embassy_time::TICK_HZ == SAMPLE_RATE_HZ as u64,
    "a tick is a sample period"
);

/// Counts at which the output may be opened between epochs: at least a tenth of a period after the timer's
/// update and the driver's tick, and at least six tenths of a period, which is longer than a scan, before the
/// next.
const CALM: core::ops::RangeInclusive<u32> = PERIOD / 10..=PERIOD * 4 / 10;
/// Counts at which a scan is over and neither the timer's update nor the driver's tick is near.
const BETWEEN_SCANS: core::ops::RangeInclusive<u32> = PERIOD * 6 / 10..=PERIOD * 9 / 10;

/// Starts the scans.
pub(crate) struct SampleClock {
    timer: Timer<'static, peripherals::TIM3>,
    /// The tick at which the timer was started, if it was.
    started: Option<u64>,
}

impl SampleClock {
    /// The clock at rest, its output closed.
    pub(crate) fn new(timer: Peri<'static, peripherals::TIM3>) -> Self {
        let timer = Timer::new(timer);
        timer.set_max_compare_value(PERIOD as u16 - 1);
        let mut clock = Self { timer, started: None };
        clock.close();
        clock
    }

    /// Lets the triggers through. Returns the number of the last trigger before, which is the count of
    /// triggers so far.
    ///
    /// Takes at most one and a half periods.
    pub(crate) fn open(&mut self) -> u64 {
        let Some(started) = self.started else {
            critical_section::with(|_| {
                let before = Instant::now();
                let mut now = before;
                while now == before {
                    now = Instant::now();
                }
                TIM3.cr2().modify(|w| w.set_mms(Mms::UPDATE));
                self.timer.start();
                self.started = Some(now.as_ticks());
            });
            // Discards the wait for a tick, which was the longest: no sample waited for it.
            let _ = masked::take_longest();
            return 0;
        };
        loop {
            let triggers = critical_section::with(|_| {
                let early = TIM3.cnt().read().cnt();
                let ticks = Instant::now().as_ticks() - started;
                let late = TIM3.cnt().read().cnt();
                let calm = CALM.contains(&u32::from(early)) && (early..=*CALM.end() as u16).contains(&late);
                calm.then(|| {
                    TIM3.cr2().modify(|w| w.set_mms(Mms::UPDATE));
                    ticks
                })
            });
            if let Some(triggers) = triggers {
                return triggers;
            }
        }
    }

    /// Calls `count` with the number of triggers so far, if this is the time between a scan and the next
    /// trigger.
    pub(crate) fn between_scans<T>(&self, count: impl FnOnce(u64) -> T) -> Option<T> {
        critical_section::with(|_| {
            let started = self.started?;
            if !BETWEEN_SCANS.contains(&u32::from(TIM3.cnt().read().cnt())) {
                return None;
            }
            Some(count(Instant::now().as_ticks() - started))
        })
    }

    /// Keeps the triggers from the ADC; the count goes on.
    pub(crate) fn close(&mut self) {
        TIM3.cr2().modify(|w| w.set_mms(Mms::RESET));
    }
}
