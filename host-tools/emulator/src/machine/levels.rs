//! Levels on pins that come from outside.

use std::collections::VecDeque;

use super::chip::Chip;
use super::wiring::timer_input;
use crate::given::{PinInput, Since};

/// A change of the level on a pin, `at_ns` after power-up or the first scan.
#[derive(Debug, Clone, Copy)]
struct Level {
    at_ns: u64,
    port: usize,
    pin: usize,
    high: bool,
}

impl Level {
    /// The timer and its input that the pin leads to, as the pin is set.
    fn captured_by(&self, chip: &Chip) -> Option<(usize, usize)> {
        let function = chip.units.gpio[self.port].alternate(self.pin)?;
        timer_input(self.port, self.pin, function)
    }
}

/// All changes of level that are still to come: for each beginning, in order of time.
#[derive(Debug, Clone)]
pub(super) struct Levels([(Since, VecDeque<Level>); 2]);

impl Levels {
    /// The levels that these inputs give. Every pin with an input is low at first.
    ///
    /// # Panics
    /// There is no such pin.
    pub(super) fn new(inputs: &[PinInput], chip: &mut Chip) -> Self {
        Self([Since::PowerUp, Since::FirstScan].map(|since| {
            let mut levels = Vec::new();
            for input in inputs.iter().filter(|input| input.since == since) {
                let (port, pin) = input
                    .place()
                    .unwrap_or_else(|| panic!("there is no pin {:?}", input.pin));
                chip.units.gpio[port].drive(pin, false);
                let changes = input.changes_ns.iter().enumerate();
                levels.extend(changes.map(|(n, at_ns)| Level {
                    at_ns: *at_ns,
                    port,
                    pin,
                    high: n % 2 == 0,
                }));
            }
            levels.sort_by_key(|level| level.at_ns);
            (since, levels.into())
        }))
    }

    /// When the next one changes. Those since the first scan are not known before it.
    pub(super) fn next(&self, chip: &Chip) -> Option<u64> {
        Some(self.soonest(chip)?.0)
    }

    /// The time of the next one, and its queue.
    fn soonest(&self, chip: &Chip) -> Option<(u64, usize)> {
        let fronts = self.0.iter().enumerate().filter_map(|(queue, (since, levels))| {
            let at = since.plus(levels.front()?.at_ns, chip.first_scan_ns())?;
            Some((at, queue))
        });
        fronts.min()
    }

    /// The next one changes.
    pub(super) fn change(&mut self, at: u64, chip: &mut Chip) {
        let next = self.soonest(chip).map(|(_, queue)| queue);
        let Some(level) = next.and_then(|queue| self.0[queue].1.pop_front()) else {
            return;
        };
        chip.units.gpio[level.port].drive(level.pin, level.high);
        if let Some((tim, input)) = level.captured_by(chip) {
            chip.units.tim[tim].edge(input, level.high, at);
        }
    }

    /// When a timer will next capture a change and raise its interrupt line.
    pub(super) fn next_capture(&self, chip: &Chip) -> Option<u64> {
        let tim = &chip.units.tim;
        // Without this, every wake would search through all edges, even if no timer listens to them.
        if !tim.iter().any(|tim| tim.captures_interrupt()) {
            return None;
        }
        let interrupts = |level: &&Level| {
            level
                .captured_by(chip)
                .is_some_and(|(n, input)| tim[n].edge_interrupts(input, level.high))
        };
        let captures = self.0.iter().filter_map(|(since, levels)| {
            let next = levels.iter().find(interrupts)?;
            since.plus(next.at_ns, chip.first_scan_ns())
        });
        captures.min()
    }
}
