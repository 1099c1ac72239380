//! The two digital-to-analog converters (RM0090 section 14): codes by software, by a timer's trigger, and by
//! DMA.
//!
//! # Design
//!
//! The data registers are views of one holding register for each channel. Its code goes to the output at
//! once, or at the trigger that TSEL selects. The model does nothing by itself: the owner passes on triggers
//! and serves requests. The model returns the level at a pin, so that a wire can carry it to an input.
//!
//! Silicon takes one or three clocks of APB1 from a write or a trigger to the output (section 14.3.4), and
//! the output 3 µs, 6 at most, to settle (DocID022152, DAC characteristics). Neither is modelled: an input
//! that is converted within 3 µs of a change by a trigger is noted. Generators of noise and triangles are
//! not modelled.

use super::peripheral::{NoRegister, Notes, Peripheral};
use super::register::{bit, field};

const EN: u32 = 1 << 0;
const BOFF: u32 = 1 << 1;
const TEN: u32 = 1 << 2;
const DMAEN: u32 = 1 << 12;
const DMAUDRIE: u32 = 1 << 13;
/// Bit of SR, at the position of its interrupt enable in CR.
const DMAUDR: u32 = 1 << 13;

/// Distance of channel 2's bits of CR, SR and the dual registers from those of channel 1.
const SECOND: u32 = 16;
pub(crate) const CHANNELS: usize = 2;

/// TSEL of EXTI line 9 and of the software trigger (section 14.5.1). Those below are timers.
const BY_LINE: u32 = 0b110;
const BY_SOFTWARE: u32 = 0b111;

/// The buffer reaches to 0.2 V from ground and from the supply (DocID022152, DAC characteristics).
const BUFFER_END_MV: u32 = 200;
/// Typical settling time (the same table).
const SETTLES_NS: u64 = 3_000;

const WAVES: &str = "CR.WAVE: noise and triangles are not modelled";
const LINE: &str = "CR.TSEL: EXTI line 9 as trigger is not modelled";
const BUFFER_ENDS: &str = "CR.BOFF is clear: the output ends 0.2 V before the rails, as under full load; under less load, silicon comes closer";
const UNSETTLED: &str =
    "an input was converted less than 3 us after a trigger had changed the output at its wire";

#[derive(Debug, Clone, Copy, Default)]
struct Channel {
    holding: u32,
    output: u32,
    /// The output before its last change, and the time of that change, ns.
    before: u32,
    changed_ns: u64,
    request: bool,
    /// Time at which the output has settled after a trigger, ns.
    settled_ns: u64,
    /// Triggers since the channel was last enabled.
    triggers: u64,
}

#[derive(Debug, Clone, Default)]
pub(crate) struct Dac {
    cr: u32,
    sr: u32,
    channels: [Channel; CHANNELS],
    /// Numbers of the triggers that are missed, counted from 0 since the channel was enabled.
    pub(crate) misses: Vec<u64>,
    pub(crate) notes: Notes,
}

impl Dac {
    /// The bits of CR of a channel.
    fn control(&self, channel: usize) -> u32 {
        field(self.cr, SECOND * channel as u32, 16)
    }

    /// TSEL of the trigger that a channel waits for. `None` if it waits for none from outside.
    pub(crate) fn external_trigger(&self, channel: usize) -> Option<u32> {
        let control = self.control(channel);
        let waits = control & EN != 0 && control & TEN != 0;
        Some(field(control, 3, 3)).filter(|tsel| waits && *tsel < BY_LINE)
    }

    /// Triggers a channel from outside. This requests DMA, if that is on (section 14.3.7).
    pub(crate) fn trigger(&mut self, channel: usize, now: u64) {
        let number = self.channels[channel].triggers;
        self.channels[channel].triggers += 1;
        if self.misses.contains(&number) {
            return;
        }
        let before = self.channels[channel].output;
        self.convert(channel, now);
        if self.channels[channel].output != before {
            self.channels[channel].settled_ns = now + SETTLES_NS;
        }
        let (at, requests) = (SECOND * channel as u32, self.control(channel) & DMAEN != 0);
        let c = &mut self.channels[channel];
        if c.request {
            // The request of the trigger before was not served: none follows until the flag is cleared.
            self.sr |= DMAUDR << at;
            c.request = false;
        } else if requests && self.sr & DMAUDR << at == 0 {
            c.request = true;
        }
    }

    /// Returns `true` if the DMA request of a channel is pending.
    pub(crate) fn request(&self, channel: usize) -> bool {
        self.channels[channel].request
    }

    /// The DMA has moved what the request asked for.
    pub(crate) fn served(&mut self, channel: usize) {
        self.channels[channel].request = false;
    }

    /// Returns `true` if each trigger makes a DMA request.
    pub(crate) fn requests_dma(&self, channel: usize) -> bool {
        self.control(channel) & DMAEN != 0 && self.sr & DMAUDR << (SECOND * channel as u32) == 0
    }

    /// Returns `true` if a trigger may raise the line: by an underrun.
    pub(crate) fn may_interrupt(&self, channel: usize) -> bool {
        self.control(channel) & DMAUDRIE != 0 && self.requests_dma(channel) && !self.interrupt(0)
    }

    /// The code at a channel's output pin, relative to the supply, at a time after the last change but one.
    /// `None` while the channel is off and the pin is open.
    pub(crate) fn level(&self, channel: usize, supply_mv: u32, at: u64) -> Option<u32> {
        let control = self.control(channel);
        let end = (BUFFER_END_MV * 4095).div_ceil(supply_mv.max(1)).min(2047);
        let buffered = control & BOFF == 0;
        let c = &self.channels[channel];
        let output = if at < c.changed_ns { c.before } else { c.output };
        (control & EN != 0).then(|| {
            if buffered {
                output.clamp(end, 4095 - end)
            } else {
                output
            }
        })
    }

    /// Returns `true` if a channel drives its pin.
    pub(crate) fn is_on(&self) -> bool {
        (0..CHANNELS).any(|channel| self.control(channel) & EN != 0)
    }

    /// Notes a conversion of an input at the pin or wire of a channel, if its output is not settled yet.
    pub(crate) fn converted(&mut self, channel: usize, now: u64) {
        let unsettled = now < self.channels[channel].settled_ns;
        self.notes.note_if(unsettled, UNSETTLED);
    }

    /// The code that a converter finds at a channel's own pin. `None` while the channel is off.
    pub(crate) fn level_at_pin(&mut self, channel: usize, supply_mv: u32, at: u64) -> Option<u32> {
        let level = self.level(channel, supply_mv, at)?;
        self.converted(channel, at);
        let c = &self.channels[channel];
        self.notes
            .note_if(at >= c.changed_ns && level != c.output, BUFFER_ENDS);
        Some(level)
    }

    fn convert(&mut self, channel: usize, now: u64) {
        let c = &mut self.channels[channel];
        if c.output != c.holding {
            c.before = std::mem::replace(&mut c.output, c.holding);
            c.changed_ns = now;
        }
    }

    /// Section 14.3.4: without a trigger, the code goes to the output at once.
    fn hold(&mut self, channel: usize, code: u32, now: u64) {
        self.channels[channel].holding = code;
        if self.control(channel) & TEN == 0 {
            self.convert(channel, now);
        }
    }

    fn write_cr(&mut self, value: u32, now: u64) {
        let before = std::mem::replace(&mut self.cr, value & 0x3fff_3fff);
        for channel in 0..CHANNELS {
            let at = SECOND * channel as u32;
            let control = self.control(channel);
            let triggered = control & EN != 0 && control & TEN != 0;
            self.notes.note_if(triggered && field(control, 6, 2) != 0, WAVES);
            self.notes
                .note_if(triggered && field(control, 3, 3) == BY_LINE, LINE);
            if control & EN != 0 && before >> at & EN == 0 {
                self.channels[channel].triggers = 0;
            }
            if control & DMAEN == 0 {
                self.channels[channel].request = false;
            }
            if control & TEN == 0 {
                self.convert(channel, now);
            }
        }
    }

    fn by_software(&mut self, value: u32, now: u64) {
        for channel in (0..CHANNELS).filter(|channel| bit(value, *channel as u32)) {
            let control = self.control(channel);
            if control & EN != 0 && control & TEN != 0 && field(control, 3, 3) == BY_SOFTWARE {
                self.convert(channel, now);
            }
        }
    }
}

/// A data register (sections 14.5.3 to 14.5.11): its channels, and the place of a code in it.
#[derive(Debug, Clone, Copy)]
enum View {
    /// Bits of the code, and by how many it is shifted to the left.
    Right,
    Left,
    Byte,
}

impl View {
    fn of(offset: u32) -> Option<Self> {
        match offset % 12 {
            8 => Some(Self::Right),
            0 => Some(Self::Left),
            4 => Some(Self::Byte),
            _ => None,
        }
    }

    /// The code in the halfword, or byte, of a channel.
    fn code(self, part: u32) -> u32 {
        match self {
            Self::Right => part & 0xfff,
            Self::Left => part >> 4 & 0xfff,
            Self::Byte => (part & 0xff) << 4,
        }
    }

    fn part(self, code: u32) -> u32 {
        match self {
            Self::Right => code,
            Self::Left => code << 4,
            Self::Byte => code >> 4,
        }
    }

    /// Where the second channel's part is in a dual register.
    fn second(self) -> u32 {
        match self {
            Self::Byte => 8,
            _ => SECOND,
        }
    }
}

impl Peripheral for Dac {
    fn read(&mut self, offset: u32, _now: u64) -> Result<u32, NoRegister> {
        let held = self.channels.map(|channel| channel.holding);
        Ok(match (offset, View::of(offset)) {
            (0x00, _) => self.cr,
            // The bits are cleared as soon as they have taken effect.
            (0x04, _) => 0,
            (0x08..=0x10, Some(view)) => view.part(held[0]),
            (0x14..=0x1c, Some(view)) => view.part(held[1]),
            (0x20..=0x28, Some(view)) => view.part(held[0]) | view.part(held[1]) << view.second(),
            (0x2c, _) => self.channels[0].output,
            (0x30, _) => self.channels[1].output,
            (0x34, _) => self.sr,
            _ => return Err(NoRegister),
        })
    }

    fn write(&mut self, offset: u32, value: u32, now: u64) -> Result<(), NoRegister> {
        match (offset, View::of(offset)) {
            (0x00, _) => self.write_cr(value, now),
            (0x04, _) => self.by_software(value, now),
            (0x08..=0x10, Some(view)) => self.hold(0, view.code(value), now),
            (0x14..=0x1c, Some(view)) => self.hold(1, view.code(value), now),
            (0x20..=0x28, Some(view)) => {
                self.hold(0, view.code(value), now);
                self.hold(1, view.code(value >> view.second()), now);
            }
            (0x2c | 0x30, _) => {}
            // A 1 clears.
            (0x34, _) => self.sr &= !value,
            _ => return Err(NoRegister),
        }
        Ok(())
    }

    fn reset(&mut self, _now: u64) {
        let old = std::mem::take(self);
        (self.misses, self.notes) = (old.misses, old.notes);
    }

    fn interrupt(&self, _output: usize) -> bool {
        self.sr & self.cr & (DMAUDR | DMAUDR << SECOND) != 0
    }
}

#[cfg(test)]
mod tests {
    use super::super::peripheral::Access;
    use super::*;

    const CR: u32 = 0x00;
    const SWTRIGR: u32 = 0x04;
    const DHR12R1: u32 = 0x08;
    const DHR12RD: u32 = 0x20;
    const DOR1: u32 = 0x2c;
    const SR: u32 = 0x34;
    /// TIM7 as trigger.
    const BY_TIM7: u32 = EN | TEN | 0b010 << 3;

    fn levels(dac: &Dac) -> [Option<u32>; 2] {
        [0, 1].map(|channel| dac.level(channel, 3300, u64::MAX))
    }

    #[test]
    fn a_code_goes_to_the_pin_at_once_or_with_its_trigger() {
        let mut dac = Dac::default();
        dac.put(0, [(DHR12RD, 3000 << 16 | 1000)]);
        assert_eq!(levels(&dac), [None, None], "off");
        dac.put(0, [(CR, EN | EN << 16)]);
        assert_eq!(levels(&dac), [Some(1000), Some(3000)]);
        dac.put(0, [(CR, BY_TIM7 | EN << 16), (DHR12RD, 2000 << 16 | 2000)]);
        assert_eq!(levels(&dac), [Some(1000), Some(2000)]);
        assert_eq!(
            [0, 1].map(|channel| dac.external_trigger(channel)),
            [Some(2), None]
        );
        dac.trigger(0, 0);
        assert_eq!((levels(&dac), dac.get(DOR1, 0)), ([Some(2000); 2], 2000));
        let software = EN | TEN | BY_SOFTWARE << 3;
        dac.put(0, [(CR, software), (DHR12R1, 1500)]);
        assert_eq!(dac.external_trigger(0), None);
        assert_eq!((dac.get(DOR1, 0), levels(&dac)[1]), (2000, None));
        dac.put(0, [(SWTRIGR, 0b11)]);
        assert_eq!((dac.get(DOR1, 0), dac.request(0)), (1500, false));
    }

    #[test]
    fn the_level_before_the_last_change_is_known() {
        let mut dac = Dac::default();
        dac.put(1_000, [(CR, EN), (DHR12R1, 1000)]);
        dac.put(2_000, [(DHR12R1, 1200)]);
        let levels = [1_999, 2_000].map(|at| dac.level(0, 3300, at));
        assert_eq!(levels, [Some(1000), Some(1200)]);
    }

    #[test]
    fn every_data_register_is_a_view_of_the_same_code() {
        for (offset, value, codes) in [
            (0x08, 0xabc, [0xabc, 0]),
            (0x0c, 0xabc0, [0xabc, 0]),
            (0x10, 0xab, [0xab0, 0]),
            (0x14, 0xabc, [0, 0xabc]),
            (0x18, 0xabc0, [0, 0xabc]),
            (0x1c, 0xab, [0, 0xab0]),
            (0x20, 0x0123_0abc, [0xabc, 0x123]),
            (0x24, 0x1230_abc0, [0xabc, 0x123]),
            (0x28, 0x12ab, [0xab0, 0x120]),
        ] {
            let mut dac = Dac::default();
            dac.put(0, [(offset, value)]);
            assert_eq!(
                [DOR1, DOR1 + 4].map(|output| dac.get(output, 0)),
                codes,
                "{offset:#x}"
            );
            assert_eq!(dac.get(offset, 0), value);
        }
    }

    #[test]
    fn the_buffer_does_not_reach_the_rails() {
        let mut dac = Dac::default();
        for (control, code, level) in [
            (EN, 0, 249),
            (EN, 4095, 3846),
            (EN | BOFF, 0, 0),
            (EN | BOFF, 4095, 4095),
        ] {
            dac.put(0, [(CR, control), (DHR12R1, code)]);
            assert_eq!(levels(&dac)[0], Some(level));
        }
    }

    #[test]
    fn a_trigger_asks_for_dma_and_a_request_that_nobody_serves_ends_them_all() {
        let mut dac = Dac::default();
        dac.put(0, [(CR, BY_TIM7 | DMAEN | DMAUDRIE)]);
        dac.trigger(0, 0);
        assert!(dac.request(0) && !dac.request(1) && dac.may_interrupt(0));
        dac.served(0);
        dac.trigger(0, 0);
        assert!(dac.request(0) && !dac.interrupt(0));
        dac.trigger(0, 0);
        assert_eq!(
            (dac.get(SR, 0), dac.request(0), dac.interrupt(0)),
            (DMAUDR, false, true)
        );
        dac.trigger(0, 0);
        assert!(!dac.request(0) && !dac.requests_dma(0));
        dac.put(0, [(SR, DMAUDR)]);
        dac.trigger(0, 0);
        assert!(dac.request(0) && !dac.interrupt(0));
    }

    #[test]
    fn an_input_that_is_converted_before_its_output_has_settled_after_a_trigger_is_noted() {
        for (after, noted) in [(2_999, 1), (3_000, 0)] {
            let mut dac = Dac::default();
            dac.put(1_000, [(CR, BY_TIM7), (DHR12R1, 1000)]);
            dac.trigger(0, 1_000);
            // An equal code changes nothing, and software that switches a level waits for it by itself.
            dac.trigger(0, 3_500);
            dac.put(3_500, [(CR, EN), (DHR12R1, 2000)]);
            dac.converted(0, 1_000 + after);
            assert_eq!(dac.notes.iter().count(), noted);
        }
    }

    #[test]
    fn a_trigger_that_is_missed_leaves_the_output_and_what_is_held() {
        let mut dac = Dac {
            misses: vec![1],
            ..Dac::default()
        };
        dac.put(0, [(CR, BY_TIM7 | DMAEN)]);
        let mut outputs = Vec::new();
        for code in [100, 200, 300] {
            dac.put(0, [(DHR12R1, code)]);
            dac.trigger(0, 0);
            dac.served(0);
            outputs.push(dac.get(DOR1, 0));
        }
        assert_eq!(outputs, [100, 100, 300]);
        dac.put(
            0,
            [(CR, BY_TIM7 | 0b01 << 6 | EN << 16 | TEN << 16 | BY_LINE << 19)],
        );
        assert_eq!(dac.notes.iter().collect::<Vec<_>>(), [LINE, WAVES]);
    }
}
