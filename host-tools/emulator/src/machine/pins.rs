//! Levels on pins, and where they lead.

use std::mem::take;

use super::chip::Chip;
use super::wiring::{self, Pin};

impl Chip {
    /// Puts the levels that outputs drive on the pins at the other ends of wires.
    pub(super) fn drive_wires(&mut self, now: u64) {
        let driven = |(from, to): (Pin, Pin)| (to, self.units.gpio[from.0].driven(from.1));
        let levels: Vec<_> = self.wires.ends().map(driven).collect();
        for (pin, level) in levels {
            if let Some(high) = self.units.gpio[pin.0].drive_by_wire(pin.1, level) {
                self.level_changed(pin, high, now);
            }
        }
    }

    /// The level on a pin has changed, from outside or by a wire.
    pub(super) fn level_changed(&mut self, pin: Pin, high: bool, at: u64) {
        if let Some((tim, input)) = self.timer_input(pin) {
            self.units.tim[tim].edge(input, high, at);
        }
        self.sense_lines(at);
        self.sense_wake_up_pin(pin, high);
    }

    /// Passes the levels on pins, and the voltage detector's, on to EXTI.
    pub(super) fn sense_lines(&mut self, now: u64) {
        /// The line of the voltage detector.
        const DETECTOR: usize = 16;
        let units = &mut self.units;
        let watched = units.exti.watched();
        let level = |line: usize| match line {
            0..DETECTOR => units
                .gpio
                .get(units.syscfg.port(line))
                .map_or(0, |port| port.input() >> line & 1),
            _ => u32::from(units.pwr.supply_low()),
        };
        let levels = (watched != 0).then(|| {
            let lines = (0..=DETECTOR).filter(|line| watched >> line & 1 == 1);
            lines.fold(0, |levels, line| levels | level(line) << line)
        });
        units.exti.input(levels);
        if take(&mut units.exti.edge_came) {
            self.wake_from_stop(now);
        }
    }

    /// Whether a change of the level on a pin would come through EXTI, or wake the part.
    pub(super) fn listens_to(&self, pin: Pin, high: bool) -> bool {
        let units = &self.units;
        (units.syscfg.port(pin.1) == pin.0 && units.exti.listens(pin.1, high)) || self.waits_for(pin, high)
    }

    /// The timer and its input that a pin leads to, as the pin is set.
    pub(super) fn timer_input(&self, pin: Pin) -> Option<(usize, usize)> {
        let function = self.units.gpio[pin.0].alternate(pin.1)?;
        wiring::timer_input(pin, function)
    }
}
