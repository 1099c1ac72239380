//! STOP and STANDBY (RM0090 section 5.3).
//!
//! # Design
//!
//! In both modes every oscillator stops except those of the watchdog and the RTC. The clock tree then has
//! frequencies of 0, so nothing else needs to know. An edge on an EXTI line whose interrupt or event is on
//! ends STOP: the processor goes on, on the internal oscillator. The pin WKUP, the RTC or the watchdog ends
//! STANDBY by a reset. The time that silicon takes to wake is not modelled.

use super::chip::{Chip, DeepSleep};
use super::wiring::PinIndex;
use crate::peripherals::Peripheral;

/// WKUP is PA0.
const WAKE_UP: PinIndex = (0, 0);

impl Chip {
    /// Puts the part to sleep, as the processor sleeps with SLEEPDEEP set. A pending interrupt of EXTI keeps
    /// it awake (section 5.3.5).
    pub(super) fn sleep(&mut self, now: u64) {
        if self.units.exti.pending() || self.deep_sleep.is_some() {
            return;
        }
        let standby = self.units.pwr.chooses_standby();
        let modes = [DeepSleep::Stop, DeepSleep::Standby];
        self.deep_sleep = Some(modes[usize::from(standby)]);
        self.units.rcc.asleep = true;
        if standby {
            // All pins float (section 5.3.5).
            for port in &mut self.units.gpio {
                port.reset(now);
            }
        }
        self.pass_on(now);
    }

    /// Returns `true` if the part is in STOP or STANDBY.
    pub(super) fn sleeps(&self) -> bool {
        self.deep_sleep.is_some()
    }

    pub(super) fn is_in_standby(&self) -> bool {
        matches!(self.deep_sleep, Some(DeepSleep::Standby | DeepSleep::StandbyEnds))
    }

    /// Ends STOP, at an edge on an enabled line of EXTI.
    pub(super) fn wake_from_stop(&mut self, now: u64) {
        if self.deep_sleep != Some(DeepSleep::Stop) {
            return;
        }
        self.deep_sleep = Some(DeepSleep::StopEnds);
        self.units.rcc.wake();
        // Bytes that were sent to the part meanwhile are lost.
        for usart in &mut self.units.usart {
            usart.missed(now);
        }
        self.pass_on(now);
    }

    /// Returns `true` if a change of the level on a pin would end STANDBY.
    pub(super) fn waits_for(&self, pin: PinIndex, high: bool) -> bool {
        let standby = self.deep_sleep == Some(DeepSleep::Standby);
        standby && pin == WAKE_UP && high && self.units.pwr.wakes_by_pin()
    }

    pub(super) fn sense_wake_up_pin(&mut self, pin: PinIndex, high: bool) {
        if self.waits_for(pin, high) {
            self.units.pwr.woken();
            self.deep_sleep = Some(DeepSleep::StandbyEnds);
        }
    }

    /// Sets a flag of the RTC, which may go through EXTI. An enabled interrupt ends STANDBY (section 5.3.6).
    pub(super) fn clock_flag(&mut self, now: u64) {
        let lines = |chip: &Self| [chip.units.rtc.alarm_line(), chip.units.rtc.wake_up_line()];
        let before = lines(self);
        self.units.rtc.advance(now);
        let rises = before
            .iter()
            .zip(lines(self))
            .any(|(before, after)| !before && after);
        if rises && self.deep_sleep == Some(DeepSleep::Standby) {
            self.units.pwr.woken();
            self.deep_sleep = Some(DeepSleep::StandbyEnds);
        }
        self.sense_lines(now);
    }

    /// Returns `true` if STOP has ended since the last call.
    pub(super) fn woken_from_stop(&mut self) -> bool {
        let woken = |sleep: &mut DeepSleep| *sleep == DeepSleep::StopEnds;
        self.deep_sleep.take_if(woken).is_some()
    }

    /// Returns `true` if STANDBY has ended: the part is to be reset.
    pub(super) fn woken_from_standby(&self) -> bool {
        self.deep_sleep == Some(DeepSleep::StandbyEnds)
    }
}
