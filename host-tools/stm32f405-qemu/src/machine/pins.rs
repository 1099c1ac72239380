//! Levels on pins, and where they lead.

use std::mem::take;

use super::chip::Chip;
use super::wiring::{CONNECTIONS, PinIndex};

impl Chip {
    /// Puts the levels that outputs drive on the pins at the other ends of wires.
    pub(super) fn drive_wires(&mut self, now: u64) {
        let driven = |(from, to): (PinIndex, PinIndex)| (to, self.units.gpio[from.0].driven(from.1));
        let levels: Vec<_> = self.wires.ends().map(driven).collect();
        for (pin, level) in levels {
            if let Some(high) = self.units.gpio[pin.0].drive_by_wire(pin.1, level) {
                self.level_changed(pin, high, now);
            }
        }
    }

    /// The setting of a timer or of a pin may have changed.
    pub(super) fn update_outputs(&mut self, now: u64) {
        let timers = self.units.tim.iter().enumerate();
        self.driving |= timers.fold(0, |bits, (n, tim)| bits | u32::from(tim.drives()) << n);
        let driving = self.driving;
        for tim in (0..self.units.tim.len()).filter(|tim| driving >> tim & 1 == 1) {
            self.move_outputs(tim, now);
        }
    }

    /// Gives the pins of a timer's compare outputs the levels that they have now.
    pub(super) fn move_outputs(&mut self, tim: usize, now: u64) {
        for output in CONNECTIONS.timer_pins.get(&tim).into_iter().flatten() {
            let (pin, timer) = (output.pin, &self.units.tim[tim]);
            let port = &mut self.units.gpio[pin.0];
            if port.alternate(pin.1) == Some(output.function) {
                let level = if output.complementary {
                    timer.complement(output.channel)
                } else {
                    timer.output(output.channel)
                };
                port.move_by_timer(pin.1, level, now);
            }
        }
        if !self.wires.is_empty() {
            self.drive_wires(now);
        }
    }

    /// The level on a pin has changed, from outside or by a wire.
    pub(super) fn level_changed(&mut self, pin: PinIndex, high: bool, at: u64) {
        if let Some((tim, input)) = self.timer_input(pin) {
            self.units.tim[tim].edge(input, high, at);
            if input < 2 && self.units.tim[tim].is_encoder() {
                let other = self.input_level(tim, 1 - input);
                self.units.tim[tim].encode(input, high, other, at);
            }
            if self.driving >> tim & 1 == 1 {
                self.move_outputs(tim, at);
            }
        }
        self.sense_lines(at);
        self.sense_wake_up_pin(pin, high);
    }

    /// Passes the levels of the pins, the voltage detector and the RTC on to EXTI.
    pub(super) fn sense_lines(&mut self, now: u64) {
        /// The line of the voltage detector.
        const DETECTOR: usize = 16;
        /// Lines of the RTC.
        const ALARM: usize = 17;
        const WAKE_UP: usize = 22;
        let units = &mut self.units;
        let watched = units.exti.watched();
        let level = |line: usize| match line {
            0..DETECTOR => units
                .gpio
                .get(units.syscfg.port(line))
                .map_or(0, |port| port.input() >> line & 1),
            DETECTOR => u32::from(units.pwr.below),
            ALARM => u32::from(units.rtc.alarm_line()),
            WAKE_UP => u32::from(units.rtc.wake_up_line()),
            _ => 0,
        };
        let levels = (watched != 0).then(|| {
            let lines = (0..=WAKE_UP).filter(|line| watched >> line & 1 == 1);
            lines.fold(0, |levels, line| levels | level(line) << line)
        });
        units.exti.input(levels);
        if take(&mut units.exti.edge_came) {
            self.wake_from_stop(now);
        }
    }

    /// Returns `true` if a change of the level on a pin would come through EXTI, or wake the part.
    pub(super) fn listens_to(&self, pin: PinIndex, high: bool) -> bool {
        let units = &self.units;
        (units.syscfg.port(pin.1) == pin.0 && units.exti.listens(pin.1, high)) || self.waits_for(pin, high)
    }

    /// The level at an input of a timer, low if no pin leads there.
    fn input_level(&self, tim: usize, input: usize) -> bool {
        let leads =
            |(pin, function): &(PinIndex, u32)| self.units.gpio[pin.0].alternate(pin.1) == Some(*function);
        let pins = CONNECTIONS.timer_inputs.iter();
        let mut pins = pins.filter(|(pin, to)| **to == (tim, input) && leads(pin));
        pins.any(|((pin, _), _)| self.units.gpio[pin.0].input() >> pin.1 & 1 == 1)
    }

    /// The timer, and its input, that a pin currently leads to.
    pub(super) fn timer_input(&self, pin: PinIndex) -> Option<(usize, usize)> {
        let function = self.units.gpio[pin.0].alternate(pin.1)?;
        CONNECTIONS.timer_inputs.get(&(pin, function)).copied()
    }
}
