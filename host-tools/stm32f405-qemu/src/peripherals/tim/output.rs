//! Levels of a timer's compare outputs: OCxREF, PWM and complementary outputs (RM0090, sections 17.3.9 to
//! 17.3.12 and 18.3.8 to 18.3.11).

use super::super::register::field;
use super::{MOE, Tim};

impl Tim {
    /// The level that a compare output puts on its pin. `None` if it drives none: the channel is an input, is
    /// off, or the main output of an advanced timer is off.
    pub(crate) fn output(&self, channel: usize) -> Option<bool> {
        let nibble = field(self.ccer, 4 * channel as u32, 4);
        let is_on = nibble & 1 == 1 && self.outputs_are_on();
        let inverts = nibble & 2 != 0;
        (is_on && !self.is_input(channel)).then_some(self.references[channel] != inverts)
    }

    /// The level that a complementary output puts on its pin: the opposite of OCxREF, or OCxREF itself if the
    /// channel's own output is off (section 17.4.9, table of the output control bits).
    pub(crate) fn complement(&self, channel: usize) -> Option<bool> {
        let nibble = field(self.ccer, 4 * channel as u32, 4);
        let is_on = nibble & 4 != 0 && self.outputs_are_on();
        let inverts = (nibble & 8 != 0) != (nibble & 1 != 0);
        (is_on && !self.is_input(channel)).then_some(self.references[channel] != inverts)
    }

    pub(super) fn outputs_are_on(&self) -> bool {
        self.kind.bdtr == 0 || self.bdtr & MOE != 0
    }

    /// Returns `true` if a channel is on: most timers have none.
    pub(crate) fn drives(&self) -> bool {
        self.ccer & 0x5555 != 0
    }

    /// When a compare will next move an output by itself.
    pub(crate) fn next_output(&self) -> Option<u64> {
        if !self.drives() || !self.counter.counts() {
            return None;
        }
        let on = |channel: &usize| self.output(*channel).or(self.complement(*channel)).is_some();
        let soonest = (0..self.kind.channels).filter(on).filter_map(|channel| {
            let moves = self.matched(channel) != self.references[channel];
            if self.is_modulated(channel) {
                self.next_edge(channel)
            } else {
                moves.then(|| self.next_match(channel))
            }
        });
        Some(self.time_of_event(soonest.min()?))
    }

    /// PWM modes 1 and 2.
    pub(super) fn is_modulated(&self, channel: usize) -> bool {
        self.mode(channel) >= 0b110 && !self.is_input(channel)
    }

    /// OCxREF in a PWM mode: mode 1 is high as long as the counter is below the compare value, mode 2 low
    /// (section 18.3.10).
    pub(super) fn modulated(&self, channel: usize, tick: u64) -> bool {
        let below = self.counter.count_at(tick) < self.ccr[channel].active;
        below == (self.mode(channel) == 0b110)
    }

    /// The tick of the next edge in a PWM mode: the match, or the overflow. Values to be loaded may make
    /// another.
    pub(super) fn next_edge(&self, channel: usize) -> Option<u64> {
        let compare = self.ccr[channel].active;
        let below = self.references[channel] == (self.mode(channel) == 0b110);
        let edge = if below {
            (compare <= self.counter.reload.active).then(|| self.next_match(channel))
        } else {
            (compare > 0).then(|| self.counter.compare_after(0, self.seen))
        };
        let load = self
            .has_pending_load()
            .then(|| self.counter.update_after(self.seen));
        edge.into_iter().chain(load).min()
    }

    /// Gives the outputs in a PWM mode their levels at a tick from the counter's origin.
    pub(super) fn modulate(&mut self, tick: u64) {
        // Most timers have none.
        if !self.modulates {
            return;
        }
        for channel in 0..self.kind.channels {
            if self.is_modulated(channel) {
                self.references[channel] = self.modulated(channel, tick);
            }
        }
    }

    /// The tick of the next match of a channel.
    pub(super) fn next_match(&self, channel: usize) -> u64 {
        self.counter.compare_after(self.ccr[channel].active, self.seen)
    }

    /// The time of an event. A load at the next update may move everything after it: then look again at that
    /// time.
    pub(super) fn time_of_event(&self, tick: u64) -> u64 {
        let update = self.counter.update_after(self.seen);
        self.counter.time_of(if self.has_pending_load() {
            tick.min(update)
        } else {
            tick
        })
    }

    /// OCxREF of an output after a match, as OCxM says (section 18.4.7).
    pub(super) fn matched(&self, channel: usize) -> bool {
        let reference = self.references[channel];
        match self.mode(channel) {
            0b001 => true,
            0b010 => false,
            0b011 => !reference,
            _ => reference,
        }
    }

    /// OCxM.
    pub(super) fn mode(&self, channel: usize) -> u32 {
        field(self.ccmr[channel / 2], 4 + 8 * (channel as u32 % 2), 3)
    }

    /// Outputs that are forced have their level at once.
    pub(super) fn force_outputs(&mut self) {
        for channel in 0..self.kind.channels {
            match self.mode(channel) {
                _ if self.is_input(channel) => {}
                0b100 => self.references[channel] = false,
                0b101 => self.references[channel] = true,
                _ => {}
            }
        }
    }
}
