//! Timers TIM1 to TIM14 (RM0090 sections 17 to 20): up-counting with update and compare events, input
//! capture, compare and PWM outputs, DMA requests, a start or restart by another timer or an input, and
//! counting of edges: one input's up, those of an encoder up and down.
//!
//! # Design
//!
//! A [`TimerKind`] states the features of a timer. Its `counter` knows the count at any time by arithmetic.
//! Flags of the past are filled in at the next access. The counter's origin moves where its settings change:
//! a write to the counter, UG, a clock change, or an update that loads a new prescaler or period.
//!
//! An edge at an input latches the counter at the time of the edge. Silicon takes a clock or two to
//! synchronise an edge, and also the trigger of another timer (sections 18.3.5, 18.3.15). This delay is the
//! same every time, and is not modelled.

mod counter;
mod kind;
#[cfg(test)]
mod tests;

use super::clock::{self, ClockTree};
use super::peripheral::{NoRegister, Notes, Peripheral};
use super::register::{bit, field, index};
use crate::ramp::Ramp;
use counter::{BufferedRegister, Counter};
pub(crate) use kind::TimerKind;

const CEN: u32 = 1 << 0;
const UDIS: u32 = 1 << 1;
const URS: u32 = 1 << 2;
const OPM: u32 = 1 << 3;
/// DIR: the last edge of an encoder counted down.
const DIR: u32 = 1 << 4;
const ARPE: u32 = 1 << 7;
/// UIF, and UIE in DIER.
const UPDATE: u32 = 1 << 0;
/// TIF: the trigger came.
const TRIGGER: u32 = 1 << 6;
/// BIF: the break came.
const BREAK: u32 = 1 << 7;
/// BDTR.AOE, and BDTR.MOE, which it sets.
const AOE: u32 = 1 << 14;
const MOE: u32 = 1 << 15;
/// CCxP and CCxNP.
const POLARITIES: u32 = 0xaaaa;
const CHANNELS: usize = 4;
/// The enables of DMA requests in DIER: update, channels, trigger.
const REQUESTS: u32 = 0x5f00;
/// SMCR.SMS.
const RESTARTS: u32 = 0b100;
const STARTS: u32 = 0b110;
/// External clock mode 1: the trigger's edges are counted.
const COUNTS_EDGES: u32 = 0b111;

/// Least prescaler with which a counter keeps its value for some turns of a loop.
const SLOW: u32 = 32;
/// OR.TI1_RMP of TIM11: the crystal, divided for the RTC, is its input (section 19.5.11).
const BY_CRYSTAL: u32 = 0b10;
/// Value of [`Tim::crystal_seen`] while the crystal is not captured.
const NOT_SEEN: u64 = u64::MAX;

const CRYSTAL_INTERRUPT: &str = "OR: an interrupt by the crystal's edges is not modelled";
const DEAD_TIME: &str = "BDTR.DTG: dead time is not modelled: both outputs move at once";
const FILTERS: &str = "CCMR: input filters and prescalers are not modelled";
const CAPTURE_ON_TRIGGER: &str = "CCMR: capture on the trigger input is not modelled";
const SLAVE_MODES: &str = "SMCR: gated mode and the input ETR are not modelled";
const TRIGGER_BY_EDGES: &str =
    "CR2.MMS: a timer that counts edges makes no trigger output for its updates and compares";

/// Register bits that request unmodelled features.
const UNMODELLED: [(u32, u32, &str); 5] = [
    (0x00, 0x70, "CR1: only up-counting is modelled"),
    (0x04, 0x40, "CR2.MMS: OCxREF as trigger output is not modelled"),
    (
        0x04,
        0x05,
        "CR2.CCPC: preloaded compare controls are not modelled",
    ),
    (
        0x0c,
        0x2000,
        "DIER.COMDE: the DMA request of commutation is not modelled",
    ),
    (0x44, 0x1000, "BDTR.BKE: the break input is not modelled"),
];

#[derive(Debug, Clone, Default)]
pub(crate) struct Tim {
    kind: TimerKind,
    cr1: u32,
    cr2: u32,
    smcr: u32,
    dier: u32,
    sr: u32,
    ccmr: [u32; 2],
    ccer: u32,
    bdtr: u32,
    or: u32,
    crystal: (u32, u32),
    /// Captures of the crystal that were made, counted from power-up.
    crystal_seen: u64,
    ccr: [BufferedRegister; CHANNELS],
    references: [bool; CHANNELS],
    /// A channel is in a PWM mode.
    modulates: bool,
    /// Pending DMA requests, by their enable bits in DIER.
    requests: u32,
    counter: Counter,
    /// Flags have been filled in up to this tick from the counter's origin.
    seen: u64,
    /// UG or an enable was written, and TRGO passes it on at once. Cleared once it is passed on.
    pub(crate) trigger_now: bool,
    pub(crate) notes: Notes,
}

impl Tim {
    pub(crate) fn new(kind: TimerKind, hz: u32) -> Self {
        let counter = Counter::new(kind.max, hz);
        Self {
            kind,
            counter,
            ..Self::default()
        }
    }

    /// Fills in what has happened up to `now`.
    pub(crate) fn advance(&mut self, now: u64) {
        self.pass_counter(now);
        self.capture_crystal(now);
    }

    /// The last edge of the crystal latches the counter, if it is captured (ICxPSC: every 1st to 8th).
    fn capture_crystal(&mut self, now: u64) {
        let (hz, divider) = self.crystal;
        if self.or != BY_CRYSTAL || hz == 0 || !self.captures(0, 0, true) {
            self.crystal_seen = NOT_SEEN;
            return;
        }
        let every = u64::from(divider) << field(self.ccmr[0], 2, 2);
        let passed = clock::ticks(now, hz) / every;
        let before = std::mem::replace(&mut self.crystal_seen, passed);
        if before < passed {
            let at = clock::edge(passed * every, hz);
            self.latch(0, at, passed - before > 1);
        }
    }

    fn pass_counter(&mut self, now: u64) {
        while self.counter.counts() {
            let ticks = self.counter.ticks(now);
            if ticks <= self.seen {
                return;
            }
            let update = self.counter.update_after(self.seen);
            let loads = self.cr1 & UDIS == 0;
            let reload = self.cr1 & OPM != 0 || (loads && self.has_pending_load());
            let to = if reload { ticks.min(update) } else { ticks };
            self.fill_in(to);
            if reload && to == update {
                self.counter.pass_update(update, loads);
                self.seen = 0;
                if loads {
                    self.ccr.iter_mut().for_each(BufferedRegister::load);
                }
                if self.cr1 & OPM != 0 {
                    self.counter.enabled = false;
                }
                self.modulate(0);
            }
        }
    }

    /// Returns `true` if no coming event changes how the counter counts.
    fn counts_on(&self) -> bool {
        self.cr1 & OPM == 0 && self.or != BY_CRYSTAL && !self.has_pending_load()
    }

    /// The internal trigger (ITR0 to ITR3) that starts this timer: in slave mode *trigger* (section 18.4.3),
    /// while it does not run yet.
    pub(crate) fn waits_for(&self) -> Option<u32> {
        self.internal_trigger()
            .filter(|_| self.slave_mode() == STARTS && !self.counter.enabled)
    }

    /// The internal trigger that moves this timer each time: it restarts it in slave mode *reset*, and is its
    /// clock in external clock mode 1.
    pub(crate) fn moved_by(&self) -> Option<u32> {
        let moves = matches!(self.slave_mode(), RESTARTS | COUNTS_EDGES);
        self.internal_trigger().filter(|_| moves)
    }

    /// Handles the internal trigger that moves this timer.
    pub(crate) fn take_internal_trigger(&mut self, at: u64) {
        if self.slave_mode() == RESTARTS {
            self.restart(at);
        } else {
            self.flag(TRIGGER);
            self.step(false, at);
        }
    }

    /// Returns `true` if the internal trigger that moves this timer may raise an interrupt line.
    pub(crate) fn internal_trigger_interrupts(&self) -> bool {
        self.moved_by().is_some() && (self.may_raise(TRIGGER | UPDATE) || self.steps_may_raise())
    }

    /// SMCR.SMS.
    fn slave_mode(&self) -> u32 {
        field(self.smcr, 0, 3)
    }

    /// Returns `true` in the three encoder modes.
    pub(crate) fn is_encoder(&self) -> bool {
        matches!(self.slave_mode(), 0b001..=0b011)
    }

    /// Returns `true` in external clock mode 1 with edges of TI1 or TI2, or another timer's trigger output.
    fn counts_edges(&self) -> bool {
        self.slave_mode() == COUNTS_EDGES && field(self.smcr, 4, 3) != 0b111
    }

    /// Handles an edge at TI1 or TI2 of an encoder, while the other input has the level `other` (section
    /// 18.3.12, table of counting direction versus encoder signals).
    pub(crate) fn encode(&mut self, input: usize, rising: bool, other: bool, at: u64) {
        // Mode 1 counts TI2's edges, mode 2 those of TI1, mode 3 both.
        if self.slave_mode() & (0b10 >> input) == 0 {
            return;
        }
        let inverts = |input: usize| bit(self.ccer, 4 * input as u32 + 1);
        let (rising, other) = (rising != inverts(input), other != inverts(1 - input));
        let up = (rising == other) == (input == 1);
        self.cr1 = if up { self.cr1 & !DIR } else { self.cr1 | DIR };
        self.step(!up, at);
    }

    /// Moves the counter by an edge.
    fn step(&mut self, down: bool, at: u64) {
        self.advance(at);
        let Some(updates) = self.counter.step(down) else {
            return;
        };
        for channel in 0..self.kind.channels {
            if !self.is_input(channel) && self.ccr[channel].active == self.counter.count(at) {
                self.flag(2 << channel);
                self.references[channel] = self.matched(channel);
            }
        }
        if updates && self.cr1 & UDIS == 0 {
            self.flag(UPDATE);
            self.turn_outputs_on();
            self.load();
        }
        if updates && self.cr1 & OPM != 0 {
            self.counter.enabled = false;
        }
        self.modulate(0);
    }

    /// SMCR.TS, if it is one of the internal triggers.
    fn internal_trigger(&self) -> Option<u32> {
        Some(field(self.smcr, 4, 3)).filter(|trigger| *trigger < 4)
    }

    /// The trigger in slave mode *reset*: the counter starts again, with an update event.
    pub(crate) fn restart(&mut self, at: u64) {
        self.advance(at);
        self.generate(UPDATE, at);
        self.flag(TRIGGER);
        self.modulate(0);
    }

    /// Sets flags, and asks the DMA if their requests are on: an enable is eight bits above its flag.
    fn flag(&mut self, flags: u32) {
        self.sr |= flags;
        self.requests |= flags << 8 & self.dier;
    }

    /// Loads what is buffered.
    fn load(&mut self) {
        self.counter.load();
        self.ccr.iter_mut().for_each(BufferedRegister::load);
    }

    /// The pending requests, as flags: update, channels 1 to 4, trigger.
    pub(crate) fn requests(&self) -> u32 {
        self.requests >> 8
    }

    /// The DMA has served the request of a flag.
    pub(crate) fn served(&mut self, flag: u32) {
        self.requests &= !(flag << 8);
    }

    /// Returns `true` if the timer requests DMA, or another timer may restart it.
    pub(crate) fn is_linked(&self) -> bool {
        self.dier & REQUESTS != 0 || self.moved_by().is_some()
    }

    /// When the counter will next make a DMA request.
    pub(crate) fn next_request(&self) -> Option<u64> {
        if self.dier & REQUESTS == 0 {
            return None;
        }
        self.next_flag(|flag| (self.dier >> 8) & flag != 0)
    }

    /// When the counter will next set one of the flags that are wanted.
    fn next_flag(&self, wanted: impl Fn(u32) -> bool) -> Option<u64> {
        if !self.counter.counts() {
            return None;
        }
        let update = self.counter.update_after(self.seen);
        let updates = (self.cr1 & UDIS == 0 && wanted(UPDATE)).then_some(update);
        let compares = (0..self.kind.channels)
            .filter(|channel| wanted(2 << channel) && !self.is_input(*channel))
            .map(|channel| self.next_match(channel));
        let soonest = updates.into_iter().chain(compares).min()?;
        Some(self.time_of_event(soonest))
    }

    /// Returns `true` if an edge at an input is the trigger of the slave mode: TI1 by TI1F_ED (both edges)
    /// or TI1FP1, TI2 by TI2FP2, which have the polarity of their channels (section 18.4.3).
    fn is_trigger(&self, input: usize, rising: bool) -> bool {
        let falls = bit(self.ccer, 4 * input as u32 + 1);
        match (field(self.smcr, 4, 3), input) {
            (0b100, 0) => true,
            (0b101, 0) | (0b110, 1) => rising != falls,
            _ => false,
        }
    }

    pub(crate) fn start(&mut self, at: u64) {
        self.advance(at);
        self.counter.go_on(at);
        self.counter.enabled = true;
        self.seen = 0;
        self.flag(TRIGGER);
    }

    /// Handles an edge at an input: TI1 to TI4 are 0 to 3.
    pub(crate) fn edge(&mut self, input: usize, rising: bool, at: u64) {
        self.advance(at);
        for channel in 0..self.kind.channels {
            if self.captures(channel, input, rising) {
                self.latch(channel, at, false);
            }
        }
        if self.is_trigger(input, rising) {
            match self.slave_mode() {
                RESTARTS => self.restart(at),
                STARTS if !self.counter.enabled => self.start(at),
                COUNTS_EDGES => {
                    self.flag(TRIGGER);
                    self.step(false, at);
                }
                _ => {}
            }
        }
    }

    /// Captures the counter. CCxOF is set if the flag of an earlier capture is still set (section 18.4.5),
    /// or if there were `others` in between.
    fn latch(&mut self, channel: usize, at: u64, others: bool) {
        self.ccr[channel] = BufferedRegister::new(self.counter.count(at));
        let over = bit(self.sr, 1 + channel as u32) || others;
        self.sr |= u32::from(over) << (9 + channel);
        self.flag(2 << channel);
    }

    /// Returns `true` if an edge at this input would raise an interrupt line.
    pub(crate) fn edge_interrupts(&self, input: usize, rising: bool) -> bool {
        let raises = |channel: usize| self.captures(channel, input, rising) && self.may_raise(2 << channel);
        let triggers = self.slave_mode() != 0 && self.is_trigger(input, rising);
        (0..self.kind.channels).any(raises)
            || triggers && self.may_raise(TRIGGER | UPDATE)
            || self.steps_may_raise()
    }

    /// Returns `true` if an edge at any input could raise an interrupt line.
    pub(crate) fn captures_interrupt(&self) -> bool {
        // Asked at each access, of all timers, most of which are off.
        if self.dier == 0 {
            return false;
        }
        let waits = |channel: usize| self.is_input(channel) && self.may_raise(2 << channel);
        let by_trigger = matches!(self.slave_mode(), RESTARTS | STARTS) && self.may_raise(TRIGGER | UPDATE);
        (0..self.kind.channels).any(waits) || by_trigger || self.steps_may_raise()
    }

    /// Returns `true` if an edge that is counted could raise an interrupt line.
    fn steps_may_raise(&self) -> bool {
        let channels = (0..self.kind.channels).filter(|channel| !self.is_input(*channel));
        self.counter.by_edges && self.may_raise(channels.fold(UPDATE | TRIGGER, |flags, n| flags | 2 << n))
    }

    /// Returns `true` if one of these flags raises a line, or asks the DMA, which may raise one.
    fn may_raise(&self, flags: u32) -> bool {
        let asks = self.dier >> 8 & flags != 0;
        asks || (0..7).any(|n| flags >> n & 1 == 1 && self.would_raise(1 << n))
    }

    /// Returns `true` if this flag, when it is set, raises a line that is down now.
    fn would_raise(&self, flag: u32) -> bool {
        let is_up = |line: &&u32| *line & flag != 0 && self.sr & self.dier & *line != 0;
        self.dier & flag != 0 && self.kind.lines.iter().find(is_up).is_none()
    }

    fn captures(&self, channel: usize, input: usize, rising: bool) -> bool {
        let nibble = field(self.ccer, 4 * channel as u32, 4);
        let polarity_fits = match (nibble >> 1) & 0b101 {
            0b000 => rising,
            0b001 => !rising,
            // CCxNP and CCxP: both edges.
            0b101 => true,
            _ => false,
        };
        let selected = match self.selection(channel) {
            0b01 => channel,
            0b10 => channel ^ 1,
            _ => return false,
        };
        nibble & 1 == 1 && polarity_fits && selected == input
    }

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

    fn outputs_are_on(&self) -> bool {
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
        if self.bdtr & (AOE | MOE) == AOE && self.cr1 & UDIS == 0 {
            return Some(self.counter.time_of(self.counter.update_after(self.seen)));
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

    /// Returns `true` for an output in PWM mode 1 or 2.
    fn is_modulated(&self, channel: usize) -> bool {
        self.mode(channel) >= 0b110 && !self.is_input(channel)
    }

    /// OCxREF in a PWM mode: mode 1 is high while the counter is below the compare value, mode 2 low
    /// (section 18.3.10).
    fn modulated(&self, channel: usize, tick: u64) -> bool {
        let below = self.counter.count_at(tick) < self.ccr[channel].active;
        below == (self.mode(channel) == 0b110)
    }

    /// The tick of the next edge in a PWM mode: the match, or the overflow. An update that loads new values
    /// counts as an edge.
    fn next_edge(&self, channel: usize) -> Option<u64> {
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
    fn modulate(&mut self, tick: u64) {
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
    fn next_match(&self, channel: usize) -> u64 {
        self.counter.compare_after(self.ccr[channel].active, self.seen)
    }

    /// The time of an event, or of an earlier update that loads new values and may move the event: then look
    /// again at that time.
    fn time_of_event(&self, tick: u64) -> u64 {
        let update = self.counter.update_after(self.seen);
        self.counter.time_of(if self.has_pending_load() {
            tick.min(update)
        } else {
            tick
        })
    }

    /// OCxREF of an output after a match, as OCxM says (section 18.4.7).
    fn matched(&self, channel: usize) -> bool {
        let reference = self.references[channel];
        match self.mode(channel) {
            0b001 => true,
            0b010 => false,
            0b011 => !reference,
            _ => reference,
        }
    }

    /// OCxM.
    fn mode(&self, channel: usize) -> u32 {
        field(self.ccmr[channel / 2], 4 + 8 * (channel as u32 % 2), 3)
    }

    /// Gives forced outputs their level at once.
    fn force_outputs(&mut self) {
        for channel in 0..self.kind.channels {
            match self.mode(channel) {
                _ if self.is_input(channel) => {}
                0b100 => self.references[channel] = false,
                0b101 => self.references[channel] = true,
                _ => {}
            }
        }
    }

    /// CCxS: 0 is an output (section 18.4.7).
    fn selection(&self, channel: usize) -> u32 {
        field(self.ccmr[channel / 2], 8 * (channel as u32 % 2), 2)
    }

    fn is_input(&self, channel: usize) -> bool {
        self.selection(channel) != 0
    }

    /// When the trigger output TRGO will pulse by itself for the `n`-th time from now (0 is the next), as
    /// CR2.MMS selects (section 18.4.2). If an update in between loads a new period, only the first is known.
    pub(crate) fn trigger(&self, n: u64) -> Option<u64> {
        if !self.counter.counts() {
            return None;
        }
        let (first, period) = match field(self.cr2, 4, 3) {
            0b010 if self.cr1 & UDIS == 0 => {
                (self.counter.update_after(self.seen), self.counter.update_period())
            }
            0b011 => (self.next_match(0), self.counter.period()),
            _ => return None,
        };
        if n > 0 && (self.has_pending_load() || self.cr1 & OPM != 0) {
            return None;
        }
        Some(self.counter.time_of(first + n * period))
    }

    fn write_cr1(&mut self, value: u32, now: u64) {
        let was_enabled = self.counter.enabled;
        let direction = if self.is_encoder() { DIR } else { 0 };
        self.cr1 = self.cr1 & direction | value & self.kind.cr1 & !CEN & !direction;
        self.counter.go_on(now);
        self.seen = 0;
        self.counter.enabled = value & CEN != 0;
        self.trigger_now |= !was_enabled && value & CEN != 0 && field(self.cr2, 4, 3) == 0b001;
        if self.cr1 & ARPE == 0 {
            self.counter.reload.load();
        }
    }

    /// EGR (section 18.4.6).
    fn generate(&mut self, value: u32, now: u64) {
        let value = value & self.kind.egr;
        self.flag(value & !UPDATE);
        if value & BREAK != 0 {
            self.bdtr &= !MOE;
        }
        if value & UPDATE == 0 {
            return;
        }
        if self.cr1 & UDIS == 0 {
            self.turn_outputs_on();
            self.load();
            if self.cr1 & URS == 0 {
                self.flag(UPDATE);
            }
            // MMS reset and update.
            self.trigger_now |= matches!(field(self.cr2, 4, 3), 0b000 | 0b010);
        }
        self.counter.start_again(now);
        self.seen = 0;
    }

    /// Compare values without preload (CCMRx.OCxPE is 0) take effect at once.
    fn load_unbuffered(&mut self) {
        for channel in 0..CHANNELS {
            let preloads = bit(self.ccmr[channel / 2], 3 + 8 * (channel as u32 % 2));
            if self.is_input(channel) || !preloads {
                self.ccr[channel].load();
            }
        }
    }

    fn has_pending_load(&self) -> bool {
        self.counter.has_pending_load() || self.ccr.iter().any(BufferedRegister::is_pending)
    }

    /// Sets the flags of ticks after `seen` up to `to`.
    fn fill_in(&mut self, to: u64) {
        if self.cr1 & UDIS == 0 && self.counter.update_after(self.seen) <= to {
            self.flag(UPDATE);
            self.turn_outputs_on();
        }
        for channel in 0..self.kind.channels {
            if !self.is_input(channel) && self.next_match(channel) <= to {
                self.flag(2 << channel);
                self.references[channel] = self.matched(channel);
            }
        }
        self.seen = to;
        self.modulate(to);
    }

    /// An update event sets MOE if AOE is set (section 17.4.18). The break input is not active.
    fn turn_outputs_on(&mut self) {
        if self.bdtr & AOE != 0 {
            self.bdtr |= MOE;
        }
    }

    /// BDTR.LOCK (section 17.4.18): 0 to 3.
    fn lock(&self) -> u32 {
        field(self.bdtr, 8, 2)
    }

    fn write_cr2(&mut self, value: u32) {
        // OISx and OISxN.
        let locked = if self.lock() >= 1 { 0x7f00 } else { 0 };
        self.cr2 = (self.cr2 & locked) | (value & self.kind.cr2 & !locked);
    }

    fn write_ccmr(&mut self, n: usize, value: u32) {
        // OCxM and OCxPE of outputs.
        let locked = match self.lock() {
            3 => (0..2)
                .filter(|half| !self.is_input(2 * n + half))
                .fold(0, |bits, half| bits | 0x78 << (8 * half)),
            _ => 0,
        };
        let mask = if self.kind.channels == 1 { 0xff } else { 0xffff };
        self.ccmr[n] = (self.ccmr[n] & locked) | (value & mask & !locked);
        for half in [value, value >> 8] {
            let modelled = if self.or == BY_CRYSTAL { 0x0c } else { 0 };
            let filtered = half & 3 != 0 && half & 0xfc & !modelled != 0;
            self.notes.note_if(filtered, FILTERS);
            self.notes.note_if(half & 3 == 3, CAPTURE_ON_TRIGGER);
        }
        self.load_unbuffered();
        self.force_outputs();
    }

    fn write_ccer(&mut self, value: u32) {
        let locked = if self.lock() >= 2 { POLARITIES } else { 0 };
        self.ccer = (self.ccer & locked) | (value & self.kind.ccer & !locked);
        self.force_outputs();
        self.note_dead_time();
    }

    /// DTG delays the rising edges of a pair of outputs.
    fn note_dead_time(&mut self) {
        let pairs = (0..self.kind.channels).any(|channel| field(self.ccer, 4 * channel as u32, 4) & 5 == 5);
        self.notes
            .note_if(pairs && field(self.bdtr, 0, 8) != 0, DEAD_TIME);
    }

    /// LOCK can be written once after a reset, and protects more with each level.
    fn write_bdtr(&mut self, value: u32) {
        // LOCK, DTG, BKE, BKP and AOE; and from level 2 on OSSI and OSSR.
        let locked = [0, 0x73ff, 0x7fff, 0x7fff][self.lock() as usize];
        self.bdtr = (self.bdtr & locked) | (value & self.kind.bdtr & !locked);
        self.note_dead_time();
    }
}

impl Peripheral for Tim {
    fn read(&mut self, offset: u32, now: u64) -> Result<u32, NoRegister> {
        self.kind.check(offset)?;
        if offset == 0x24 && self.counts_on() {
            return Ok(self.counter.count(now));
        }
        self.advance(now);
        Ok(match offset {
            0x00 => self.cr1 | u32::from(self.counter.enabled),
            0x04 => self.cr2,
            0x08 => self.smcr,
            0x0c => self.dier,
            0x10 => self.sr,
            0x14 => 0,
            0x18 | 0x1c => self.ccmr[index(offset, 0x18)],
            0x20 => self.ccer,
            0x24 => self.counter.count(now),
            0x28 => self.counter.prescaler.written,
            0x2c => self.counter.reload.written,
            0x30 => self.counter.repetition.written,
            0x34..=0x40 => {
                let channel = index(offset, 0x34);
                // Reading what was captured clears its flag (section 18.4.5).
                if self.is_input(channel) {
                    self.sr &= !(2 << channel);
                }
                self.ccr[channel].written
            }
            0x44 => self.bdtr,
            0x50 => self.or,
            _ => return Err(NoRegister),
        })
    }

    fn holds_until(&self, offset: u32, now: u64) -> Option<u64> {
        // Reading a captured value clears its flag.
        if self.or == BY_CRYSTAL || matches!(offset, 0x34..=0x40) {
            return None;
        }
        if !self.counter.counts() {
            return Some(u64::MAX);
        }
        if offset == 0x24 {
            // Within a loop's turn a faster counter moves on anyway.
            let slow = self.counter.prescaler.active >= SLOW;
            return Some(if slow {
                self.counter.time_of(self.counter.ticks(now) + 1)
            } else {
                now
            });
        }
        let matches = (0..self.kind.channels).map(|channel| self.next_match(channel));
        let update = self.counter.update_after(self.seen);
        let soonest = matches.chain([update]).min();
        soonest.map(|tick| self.time_of_event(tick))
    }

    fn ramp(&self, offset: u32, now: u64) -> Option<Ramp> {
        (offset == 0x24 && self.or != BY_CRYSTAL && self.counter.counts()).then(|| self.counter.ramp(now))
    }

    fn write(&mut self, offset: u32, value: u32, now: u64) -> Result<(), NoRegister> {
        self.kind.check(offset)?;
        self.advance(now);
        match offset {
            0x00 => self.write_cr1(value, now),
            0x04 => self.write_cr2(value),
            0x08 => {
                self.smcr = value & self.kind.smcr;
                let by_trigger =
                    matches!(self.slave_mode(), RESTARTS | STARTS) && field(value, 4, 3) != 0b111;
                self.counter.go_on(now);
                self.seen = 0;
                self.counter.by_edges = self.is_encoder() || self.slave_mode() == COUNTS_EDGES;
                let modelled =
                    self.slave_mode() == 0 || by_trigger || self.is_encoder() || self.counts_edges();
                self.notes.note_if(value & 0x4000 != 0 || !modelled, SLAVE_MODES);
            }
            0x0c => {
                self.dier = value & self.kind.dier;
                self.requests &= self.dier;
            }
            // rc_w0: a 0 clears, a 1 leaves (section 18.4.5).
            0x10 => self.sr &= value,
            0x14 => self.generate(value, now),
            0x18 | 0x1c => self.write_ccmr(index(offset, 0x18), value),
            0x20 => self.write_ccer(value),
            0x24 => {
                self.counter.set_count(value, now);
                self.seen = 0;
            }
            0x28 => self.counter.prescaler.written = value & 0xffff,
            0x2c => {
                self.counter.go_on(now);
                self.seen = 0;
                self.counter.reload.written = value & self.kind.max;
                if self.cr1 & ARPE == 0 {
                    self.counter.reload.load();
                }
            }
            0x30 => self.counter.repetition.written = value & self.kind.rcr,
            0x34..=0x40 => {
                let channel = index(offset, 0x34);
                // A captured value cannot be written (section 18.4.13).
                if !self.is_input(channel) {
                    self.ccr[channel].written = value & self.kind.max;
                    self.load_unbuffered();
                }
            }
            0x44 => self.write_bdtr(value),
            0x50 => self.or = value & self.kind.or,
            _ => return Err(NoRegister),
        }
        self.modulates = (0..self.kind.channels).any(|channel| self.is_modulated(channel));
        if self.modulates {
            let tick = self.counter.ticks(now);
            self.modulate(tick);
        }
        // The direction of an encoder is not written.
        let shown = if self.is_encoder() && offset == 0 {
            value & !DIR
        } else {
            value
        };
        self.notes.note_bits(&UNMODELLED, offset, shown);
        let by_counter = matches!(field(self.cr2, 4, 3), 0b010 | 0b011);
        self.notes
            .note_if(self.counter.by_edges && by_counter, TRIGGER_BY_EDGES);
        let interrupts = self.or == BY_CRYSTAL && self.dier & 2 != 0;
        self.notes.note_if(interrupts, CRYSTAL_INTERRUPT);
        Ok(())
    }

    fn reset(&mut self, now: u64) {
        let mut counter = Counter::new(self.kind.max, 0);
        counter.set_clock(self.counter.hz, now);
        let old = std::mem::replace(self, Self::new(self.kind, 0));
        (self.counter, self.notes, self.crystal) = (counter, old.notes, old.crystal);
    }

    fn interrupt(&self, output: usize) -> bool {
        self.sr & self.dier & self.kind.lines[output] != 0
    }

    fn next_interrupt(&self) -> Option<u64> {
        if self.dier == 0 {
            return None;
        }
        self.next_flag(|flag| self.would_raise(flag))
    }

    fn set_clocks(&mut self, clocks: &ClockTree, now: u64) {
        let hz = clocks.of_timers(self.kind.apb);
        if clocks.crystal != self.crystal {
            self.advance(now);
            (self.crystal, self.crystal_seen) = (clocks.crystal, NOT_SEEN);
        }
        if hz != self.counter.hz {
            self.advance(now);
            self.counter.set_clock(hz, now);
            self.seen = 0;
        }
    }
}
