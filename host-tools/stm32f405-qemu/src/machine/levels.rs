//! Levels on pins that come from outside.

use std::collections::{BTreeMap, VecDeque};

use super::chip::Chip;
use super::wiring::{self, PinIndex};
use crate::given::{PinInput, Since};

/// A change of the level on a pin, `at_ns` after power-up or the first scan.
#[derive(Debug, Clone, Copy)]
struct LevelChange {
    at_ns: u64,
    pin: PinIndex,
    high: bool,
}

/// All changes of level that are still to come, in order of time: a queue for each origin of time.
#[derive(Debug, Clone)]
pub(super) struct Levels([(Since, VecDeque<LevelChange>); 2]);

impl Levels {
    /// The levels that these inputs give. Every pin with an input is low at first.
    pub(super) fn new(inputs: &[PinInput], chip: &mut Chip) -> Self {
        Self([Since::PowerUp, Since::FirstScan].map(|since| {
            let mut levels = Vec::new();
            for input in inputs.iter().filter(|input| input.since == since) {
                let pin = wiring::known_pin(&input.pin);
                chip.units.gpio[pin.0].drive(pin.1, false);
                for (n, &at_ns) in input.changes_ns.iter().enumerate() {
                    let high = n % 2 == 0;
                    levels.push(LevelChange { at_ns, pin, high });
                }
            }
            levels.sort_by_key(|level| level.at_ns);
            (since, levels.into())
        }))
    }

    /// Adds a change at a time after power-up.
    pub(super) fn add(&mut self, pin: PinIndex, at_ns: u64, high: bool) {
        let level = LevelChange { at_ns, pin, high };
        if let Some((_, levels)) = self.0.iter_mut().find(|(since, _)| *since == Since::PowerUp) {
            let place = levels.partition_point(|other| other.at_ns <= at_ns);
            levels.insert(place, level);
        }
    }

    pub(super) fn count(&self) -> usize {
        self.0.iter().map(|(_, levels)| levels.len()).sum()
    }

    /// Time of the next change. Changes timed from the first scan have no time before that scan.
    pub(super) fn next(&self, chip: &Chip) -> Option<u64> {
        Some(self.soonest(chip)?.0)
    }

    /// Time of the next change, and the number of its queue.
    fn soonest(&self, chip: &Chip) -> Option<(u64, usize)> {
        let fronts = self.0.iter().enumerate().filter_map(|(queue, (since, levels))| {
            let at = since.plus(levels.front()?.at_ns, chip.first_scan_ns())?;
            Some((at, queue))
        });
        fronts.min()
    }

    pub(super) fn change(&mut self, at: u64, chip: &mut Chip) {
        let next = self.soonest(chip);
        let Some(level) = next.and_then(|(_, queue)| self.0[queue].1.pop_front()) else {
            return;
        };
        chip.units.gpio[level.pin.0].drive(level.pin.1, level.high);
        chip.level_changed(level.pin, level.high, at);
    }

    /// Describes the changes that have not come, by pin.
    pub(super) fn left(&self, chip: &Chip) -> Vec<String> {
        let mut pins = BTreeMap::new();
        for (since, levels) in &self.0 {
            for level in levels {
                *pins.entry((level.pin, *since)).or_insert(0) += 1;
            }
        }
        let sampled = chip.first_scan_ns().is_some();
        let line = |((pin, since), changes): (&(PinIndex, Since), &u32)| {
            let (pin, why) = (wiring::pin_name(*pin), since.missed(sampled));
            format!("{changes} changes of the level on {pin}{why}")
        };
        pins.iter().map(line).collect()
    }

    /// Time of the next change that will raise an interrupt line, by a timer that captures it or by EXTI, or
    /// wake the part.
    pub(super) fn next_capture(&self, chip: &Chip) -> Option<u64> {
        let tim = &chip.units.tim;
        // Without this, every wake would search through all edges, even if nothing listens to them.
        let captures = tim.iter().any(|tim| tim.captures_interrupt());
        if !captures && chip.units.exti.watched() == 0 && !chip.sleeps() {
            return None;
        }
        let interrupts = |level: &&LevelChange| {
            let timer = chip.timer_input(level.pin).filter(|_| captures);
            timer.is_some_and(|(n, input)| tim[n].edge_interrupts(input, level.high))
                || chip.listens_to(level.pin, level.high)
        };
        let captures = self.0.iter().filter_map(|(since, levels)| {
            let next = levels.iter().find(interrupts)?;
            since.plus(next.at_ns, chip.first_scan_ns())
        });
        captures.min()
    }
}
