//! Timers TIM1 to TIM14 (RM0090 sections 17 to 20): up-counting with update and compare events, input
//! capture, compare and PWM outputs, DMA requests, and a start or restart by another timer or an input.
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

use super::clock::{self, ClockTree};
use super::peripheral::{NoRegister, Notes, Peripheral};
use super::register::{bit, field, index};
use counter::{BufferedRegister, Counter};
pub(crate) use kind::TimerKind;

const CEN: u32 = 1 << 0;
const UDIS: u32 = 1 << 1;
const URS: u32 = 1 << 2;
const OPM: u32 = 1 << 3;
const ARPE: u32 = 1 << 7;
/// UIF, and UIE in DIER.
const UPDATE: u32 = 1 << 0;
/// TIF: the trigger came.
const TRIGGER: u32 = 1 << 6;
/// BIF: the break came.
const BREAK: u32 = 1 << 7;
/// BDTR.MOE.
const MOE: u32 = 1 << 15;
/// CCxP and CCxNP.
const POLARITIES: u32 = 0xaaaa;
const CHANNELS: usize = 4;
/// The enables of DMA requests in DIER: update, channels, trigger.
const REQUESTS: u32 = 0x5f00;
/// SMCR.SMS.
const RESTARTS: u32 = 0b100;
const STARTS: u32 = 0b110;

/// Least prescaler with which a counter keeps its value for some turns of a loop.
const SLOW: u32 = 32;
/// OR.TI1_RMP of TIM11: the crystal, divided for the RTC, is its input (section 19.5.11).
const BY_CRYSTAL: u32 = 0b10;
/// Of [`Tim::crystal_seen`]: the crystal is not captured.
const NOT_SEEN: u64 = u64::MAX;

const CRYSTAL_INTERRUPT: &str = "OR: an interrupt by the crystal's edges is not modelled";
const DEAD_TIME: &str = "BDTR.DTG: dead time is not modelled: both outputs move at once";
const FILTERS: &str = "CCMR: input filters and prescalers are not modelled";
const CAPTURE_ON_TRIGGER: &str = "CCMR: capture on the trigger input is not modelled";
const SLAVE_MODES: &str = "SMCR: gated and encoder mode, external clocks and the input ETR are not modelled";

/// Bits of registers that ask for what is not modelled.
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
    /// DMA requests that nobody has served, by their enable bits in DIER.
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

    /// Returns `true` if no event to come changes how the counter counts.
    fn counts_on(&self) -> bool {
        self.cr1 & OPM == 0 && self.or != BY_CRYSTAL && !self.has_pending_load()
    }

    /// The internal trigger (ITR0 to ITR3) that starts this timer: in slave mode *trigger* (section 18.4.3),
    /// while it does not run yet.
    pub(crate) fn waits_for(&self) -> Option<u32> {
        self.internal_trigger()
            .filter(|_| self.slave_mode() == STARTS && !self.counter.enabled)
    }

    /// The internal trigger that restarts this timer: in slave mode *reset*.
    pub(crate) fn restarted_by(&self) -> Option<u32> {
        self.internal_trigger().filter(|_| self.slave_mode() == RESTARTS)
    }

    /// SMCR.SMS.
    fn slave_mode(&self) -> u32 {
        field(self.smcr, 0, 3)
    }

    /// SMCR.TS, if it is one of the internal triggers.
    fn internal_trigger(&self) -> Option<u32> {
        Some(field(self.smcr, 4, 3)).filter(|trigger| *trigger < 4)
    }

    /// The trigger in slave mode *reset*: the counter starts again, with an update event.
    pub(crate) fn restart(&mut self, at: u64) {
        self.advance(at);
        self.generate(UPDATE, at);
        self.take_trigger();
        self.modulate(0);
    }

    fn take_trigger(&mut self) {
        self.sr |= TRIGGER;
        self.request(TRIGGER);
    }

    /// Asks the DMA, if the request of a flag is on: its enable stands eight bits above the flag.
    fn request(&mut self, flags: u32) {
        self.requests |= flags << 8 & self.dier;
    }

    /// The requests that stand, as flags: update, channels 1 to 4, trigger.
    pub(crate) fn requests(&self) -> u32 {
        self.requests >> 8
    }

    /// The DMA has served the request of a flag.
    pub(crate) fn served(&mut self, flag: u32) {
        self.requests &= !(flag << 8);
    }

    /// Returns `true` if it requests DMA, or another timer may restart it.
    pub(crate) fn is_linked(&self) -> bool {
        self.dier & REQUESTS != 0 || self.restarted_by().is_some()
    }

    /// When the counter will next make a DMA request.
    pub(crate) fn next_request(&self) -> Option<u64> {
        if self.dier & REQUESTS == 0 || !self.counter.counts() {
            return None;
        }
        let update = self.counter.update_after(self.seen);
        let updates = ((self.dier >> 8) & UPDATE != 0 && self.cr1 & UDIS == 0).then_some(update);
        let compares = (0..self.kind.channels)
            .filter(|channel| (self.dier >> 8) & (2 << channel) != 0 && !self.is_input(*channel))
            .map(|channel| self.next_match(channel));
        let soonest = updates.into_iter().chain(compares).min()?;
        Some(self.time_of_event(soonest))
    }

    /// An edge at an input is the trigger of the slave mode: TI1 by TI1F_ED (both edges) or TI1FP1, TI2 by
    /// TI2FP2, which have the polarity of their channels (section 18.4.3).
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
        self.take_trigger();
    }

    /// An edge comes at an input: TI1 to TI4 are 0 to 3.
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
                _ => {}
            }
        }
    }

    /// Captures the counter. CCxOF is set if the flag of an earlier capture still stands (section 18.4.5), or
    /// if others came before.
    fn latch(&mut self, channel: usize, at: u64, others: bool) {
        self.ccr[channel] = BufferedRegister::new(self.counter.count(at));
        let over = bit(self.sr, 1 + channel as u32) || others;
        self.sr |= 2 << channel | u32::from(over) << (9 + channel);
        self.request(2 << channel);
    }

    /// Returns `true` if an edge at this input would raise an interrupt line.
    pub(crate) fn edge_interrupts(&self, input: usize, rising: bool) -> bool {
        let raises = |channel: usize| self.captures(channel, input, rising) && self.may_raise(2 << channel);
        let triggers = self.slave_mode() != 0 && self.is_trigger(input, rising);
        (0..self.kind.channels).any(raises) || triggers && self.may_raise(TRIGGER | UPDATE)
    }

    /// Returns `true` if an edge at any input could raise an interrupt line.
    pub(crate) fn captures_interrupt(&self) -> bool {
        let waits = |channel: usize| self.is_input(channel) && self.may_raise(2 << channel);
        let by_trigger = matches!(self.slave_mode(), RESTARTS | STARTS) && self.may_raise(TRIGGER | UPDATE);
        (0..self.kind.channels).any(waits) || by_trigger
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
    fn is_modulated(&self, channel: usize) -> bool {
        self.mode(channel) >= 0b110 && !self.is_input(channel)
    }

    /// OCxREF in a PWM mode: mode 1 is high as long as the counter is below the compare value, mode 2 low
    /// (section 18.3.10).
    fn modulated(&self, channel: usize, tick: u64) -> bool {
        let below = self.counter.count_at(tick) < self.ccr[channel].active;
        below == (self.mode(channel) == 0b110)
    }

    /// The tick of the next edge in a PWM mode: the match, or the overflow. Values to be loaded may make
    /// another.
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

    /// The time of an event. A load at the next update may move everything after it: then look again at that
    /// time.
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

    /// Outputs that are forced have their level at once.
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
        self.cr1 = value & self.kind.cr1 & !CEN;
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
        self.sr |= value & !UPDATE;
        self.request(value & !UPDATE);
        if value & BREAK != 0 {
            self.bdtr &= !MOE;
        }
        if value & UPDATE == 0 {
            return;
        }
        if self.cr1 & UDIS == 0 {
            self.counter.load();
            self.ccr.iter_mut().for_each(BufferedRegister::load);
            if self.cr1 & URS == 0 {
                self.sr |= UPDATE;
                self.request(UPDATE);
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
            self.sr |= UPDATE;
            self.request(UPDATE);
        }
        for channel in 0..self.kind.channels {
            if !self.is_input(channel) && self.next_match(channel) <= to {
                self.sr |= 2 << channel;
                self.request(2 << channel);
                self.references[channel] = self.matched(channel);
            }
        }
        self.seen = to;
        self.modulate(to);
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

    fn write(&mut self, offset: u32, value: u32, now: u64) -> Result<(), NoRegister> {
        self.kind.check(offset)?;
        self.advance(now);
        match offset {
            0x00 => self.write_cr1(value, now),
            0x04 => self.write_cr2(value),
            0x08 => {
                self.smcr = value & self.kind.smcr;
                let (mode, trigger) = (self.slave_mode(), field(value, 4, 3));
                let modelled = matches!(mode, 0 | RESTARTS | STARTS) && (mode == 0 || trigger != 0b111);
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
        self.notes.note_bits(&UNMODELLED, offset, value);
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
        if !self.counter.counts() {
            return None;
        }
        let update = self.counter.update_after(self.seen);
        let updates = (self.cr1 & UDIS == 0 && self.would_raise(UPDATE)).then_some(update);
        let compares = (0..self.kind.channels)
            .filter(|channel| self.would_raise(2 << channel) && !self.is_input(*channel))
            .map(|channel| self.next_match(channel));
        let soonest = updates.into_iter().chain(compares).min()?;
        Some(self.time_of_event(soonest))
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

#[cfg(test)]
mod tests {
    use super::super::peripheral::Access;
    use super::*;

    const CR1: u32 = 0x00;
    const CR2: u32 = 0x04;
    const SMCR: u32 = 0x08;
    const DIER: u32 = 0x0c;
    const SR: u32 = 0x10;
    const EGR: u32 = 0x14;
    const CCMR1: u32 = 0x18;
    const CCER: u32 = 0x20;
    const CNT: u32 = 0x24;
    const PSC: u32 = 0x28;
    const ARR: u32 = 0x2c;
    const CCR1: u32 = 0x34;

    /// 84 MHz, a period of 840 ticks: 10 µs.
    fn at_100_khz() -> Tim {
        let mut tim = Tim::new(TimerKind::GENERAL, 84_000_000);
        tim.put(0, [(ARR, 839), (EGR, 1), (SR, 0), (CR1, CEN)]);
        tim
    }

    #[test]
    fn the_crystal_is_captured_by_the_timer_whose_input_it_can_be() {
        const OR: u32 = 0x50;
        let captures = |kind: TimerKind, crystal: (u32, u32)| {
            let mut tim = Tim::new(kind.on_apb2(), 16_000_000);
            tim.set_clocks(
                &ClockTree {
                    crystal,
                    ..ClockTree::HSI
                },
                0,
            );
            let has = tim.write(OR, BY_CRYSTAL, 0).is_ok();
            // Every eighth edge; on.
            tim.put(100, [(CCMR1, 0b1101), (CCER, 1), (CR1, CEN)]);
            let mut values = Vec::new();
            for at in (200..400_000).step_by(200) {
                if tim.get(SR, at) & 2 != 0 {
                    values.push(tim.get(CCR1, at));
                }
            }
            assert_eq!(tim.get(SR, 400_000) & 1 << 9, 0, "each was read");
            tim.get(SR, 900_000);
            (has, values, tim.get(SR, 900_000) & 1 << 9 != 0)
        };
        for (mhz, ticks) in [(8, 496.0), (12, 330.7), (25, 158.7)] {
            let (has, values, over) = captures(TimerKind::WITH_CRYSTAL, (mhz * 1_000_000, 31));
            let last = f64::from(values[values.len() - 1] - values[0]) / (values.len() - 1) as f64;
            assert!((last - ticks).abs() < 0.2 && has && over, "{mhz} MHz: {last}");
        }
        assert_eq!(captures(TimerKind::WITH_CRYSTAL, (0, 0)), (true, vec![], false));
        assert_eq!(
            captures(TimerKind::ONE_CHANNEL, (8_000_000, 31)),
            (false, vec![], false)
        );
    }

    #[test]
    fn the_counter_counts_up_and_starts_again_after_the_period() {
        let mut tim = at_100_khz();
        let counts = [5_000, 9_999, 10_000, 1_000_005_000].map(|at| tim.get(CNT, at));
        assert_eq!(counts, [420, 839, 0, 420]);
    }

    #[test]
    fn the_update_flag_rises_at_the_period_and_a_zero_clears_it() {
        let mut tim = at_100_khz();
        assert_eq!([9_999, 10_000].map(|at| tim.get(SR, at) & 1), [0, 1]);
        tim.put(10_100, [(SR, !2)]);
        assert_eq!(tim.get(SR, 10_100) & 1, 1, "a 1 leaves the flag");
        tim.put(10_100, [(SR, !1)]);
        assert_eq!([19_999, 20_000].map(|at| tim.get(SR, at) & 1), [0, 1]);
    }

    #[test]
    fn the_next_interrupt_is_known_before_it_comes_and_only_if_enabled() {
        let mut tim = at_100_khz();
        assert_eq!(tim.next_interrupt(), None);
        tim.put(3_000, [(DIER, 1)]);
        assert_eq!(tim.next_interrupt(), Some(10_000));
        tim.advance(10_000);
        assert!(tim.interrupt(0));
        assert_eq!(tim.next_interrupt(), None, "the line is up already");
    }

    #[test]
    fn settings_say_when_the_next_interrupt_comes_and_the_one_after_it() {
        // A compare value beyond the period matches at the update. A count beyond it runs to its end first. A
        // preloaded period takes effect at the update, a direct one at once.
        for (cr1, writes, [first, second]) in [
            (CEN, [(CCR1, 84), (DIER, 2)], [1_000, 11_000]),
            (CEN, [(CCR1, 900), (DIER, 2)], [10_000, 20_000]),
            (CEN, [(CNT, 0xffff - 83), (DIER, 1)], [1_000, 11_000]),
            (CEN, [(ARR, 419), (DIER, 1)], [5_000, 10_000]),
            (CEN | ARPE, [(ARR, 419), (DIER, 1)], [10_000, 15_000]),
        ] {
            let mut tim = at_100_khz();
            tim.put(0, [(CR1, cr1)]);
            tim.put(0, writes);
            assert_eq!(tim.next_interrupt(), Some(first), "{writes:?}");
            tim.put(first, [(SR, 0)]);
            assert_eq!(tim.next_interrupt(), Some(second), "{writes:?}");
        }
    }

    #[test]
    fn a_compare_moves_its_output_at_the_match_as_its_mode_says() {
        let mut tim = at_100_khz();
        let state = |tim: &Tim| (tim.output(0), tim.next_output());
        tim.put(0, [(CCR1, 84), (CCMR1, 0b101 << 4)]);
        assert_eq!(state(&tim), (None, None), "it is off");
        tim.put(0, [(CCER, 1)]);
        assert_eq!(state(&tim), (Some(true), None), "forced");
        // Inactive on match.
        tim.put(500, [(CCMR1, 0b010 << 4)]);
        assert_eq!(state(&tim), (Some(true), Some(1_000)));
        tim.advance(999);
        assert_eq!(tim.output(0), Some(true));
        tim.advance(1_000);
        assert_eq!(state(&tim), (Some(false), None));
        // Active on match, and inverted.
        tim.put(2_000, [(CCMR1, 0b001 << 4), (CCER, 0b11)]);
        assert_eq!(state(&tim), (Some(true), Some(11_000)));
        tim.advance(11_000);
        assert_eq!(tim.output(0), Some(false));
        // Toggle.
        tim.put(12_000, [(CCMR1, 0b011 << 4)]);
        for (at, level) in [(21_000, true), (31_000, false)] {
            assert_eq!(tim.next_output(), Some(at));
            tim.advance(at);
            assert_eq!(tim.output(0), Some(level));
        }
    }

    #[test]
    fn ug_restarts_the_counter_loads_the_prescaler_and_flags_unless_urs() {
        let mut tim = at_100_khz();
        tim.put(4_000, [(PSC, 83)]);
        assert_eq!(tim.get(CNT, 5_000), 420, "the prescaler waits for an update");
        tim.put(5_000, [(EGR, 1)]);
        assert_eq!(tim.get(SR, 5_000) & 1, 1);
        assert_eq!(tim.get(CNT, 15_000), 10, "1 MHz from here");
        let mut tim = at_100_khz();
        tim.put(5_000, [(CR1, CEN | URS), (EGR, 1)]);
        assert_eq!(tim.get(SR, 5_000) & 1, 0);
    }

    #[test]
    fn a_new_prescaler_takes_effect_at_the_update() {
        let mut tim = at_100_khz();
        tim.put(4_000, [(PSC, 1)]);
        assert_eq!([9_999, 20_000].map(|at| tim.get(CNT, at)), [839, 420]);
    }

    #[test]
    fn a_preloaded_compare_value_waits_for_the_update() {
        let mut tim = at_100_khz();
        tim.put(2_000, [(CCMR1, 1 << 3), (CCR1, 84)]);
        assert_eq!(tim.get(SR, 9_999) & 2, 0, "still 0, which has not come");
        tim.put(10_000, [(SR, 0)]);
        assert_eq!([10_999, 11_000].map(|at| tim.get(SR, at) & 2), [0, 2]);
    }

    #[test]
    fn one_pulse_mode_stops_at_the_update() {
        let mut tim = at_100_khz();
        tim.put(0, [(CR1, CEN | OPM)]);
        assert_eq!([9_999, 10_000].map(|at| tim.get(CR1, at) & CEN), [CEN, 0]);
        assert_eq!((tim.get(SR, 50_000) & 1, tim.get(CNT, 50_000)), (1, 0));
    }

    #[test]
    fn the_trigger_output_follows_the_update_and_never_drifts() {
        // 84 MHz / 1000: a period of 11904.76 ns, which no sum of whole ns can follow.
        let mut tim = at_100_khz();
        tim.put(0, [(CR2, 0b010 << 4), (ARR, 999)]);
        let mut last = 0;
        for _ in 0..84_000 {
            last = tim.trigger(0).unwrap();
            tim.advance(last);
        }
        assert_eq!(last, 1_000_000_000);
        assert_eq!(tim.trigger(83_999), Some(2_000_000_000));
    }

    #[test]
    fn udis_stops_updates_and_their_trigger() {
        let mut tim = at_100_khz();
        tim.put(0, [(CR2, 0b010 << 4), (CR1, CEN | UDIS)]);
        assert_eq!((tim.trigger(0), tim.get(SR, 50_000) & 1), (None, 0));
    }

    #[test]
    fn a_slower_clock_keeps_the_count_and_stretches_what_is_left() {
        let mut tim = at_100_khz();
        tim.put(0, [(DIER, 1)]);
        let mut slower = ClockTree::HSI;
        slower.timers1 = 42_000_000;
        tim.set_clocks(&slower, 5_000);
        assert_eq!((tim.get(CNT, 5_000), tim.next_interrupt()), (420, Some(15_000)));
    }

    /// Channel 1 of a timer of 32 bits captures its own input, with these bits of CCER.
    fn capturing(ccer: u32) -> Tim {
        let mut tim = Tim::new(TimerKind::GENERAL_32, 84_000_000);
        tim.put(0, [(CCMR1, 0b01), (CCER, ccer), (CR1, CEN)]);
        tim
    }

    #[test]
    fn an_edge_latches_the_counter_and_reading_it_clears_the_flag() {
        let mut tim = capturing(1);
        tim.edge(0, true, 60_000_000_000);
        let now = 60_000_100_000;
        assert_eq!(tim.get(SR, now) & 2, 2);
        let expected = (60u64 * 84_000_000 - (1 << 32)) as u32;
        assert_eq!(tim.get(CCR1, now), expected, "of 32 bits");
        assert_eq!(tim.get(SR, now) & 2, 0);
        tim.put(now, [(CCR1, 5)]);
        assert_eq!(tim.get(CCR1, now), expected, "read-only");
    }

    #[test]
    fn the_polarity_says_which_edges_count_and_a_channel_that_is_off_sees_none() {
        let seen = |ccer: u32| {
            [true, false].map(|rising| {
                let mut tim = capturing(ccer);
                tim.edge(0, rising, 1_000);
                tim.edge(1, rising, 1_000);
                tim.get(SR, 1_000) == 2
            })
        };
        assert_eq!(seen(0b0001), [true, false], "rising");
        assert_eq!(seen(0b0011), [false, true], "falling");
        assert_eq!(seen(0b1011), [true, true], "both");
        assert_eq!(seen(0b1010), [false, false], "CC1E is clear");
    }

    #[test]
    fn a_channel_may_take_its_neighbours_input() {
        let mut tim = capturing(0);
        tim.put(0, [(CCMR1, 0b10 << 8), (CCER, 1 << 4)]);
        tim.edge(0, true, 1_000);
        assert_eq!((tim.get(SR, 1_000), tim.get(CCR1 + 4, 1_000)), (4, 84));
    }

    #[test]
    fn a_second_edge_before_the_first_was_read_overwrites_it_and_is_told() {
        let mut tim = capturing(1);
        tim.edge(0, true, 1_000);
        tim.edge(0, true, 2_000);
        assert_eq!((tim.get(SR, 2_000), tim.get(CCR1, 2_000)), (2 | 1 << 9, 168));
        assert_eq!(tim.get(SR, 2_000), 1 << 9, "CC1OF is cleared by a write only");
        tim.put(2_000, [(SR, !(1 << 9))]);
        assert_eq!(tim.get(SR, 2_000), 0);
    }

    #[test]
    fn a_capture_interrupts_if_enabled_and_an_input_never_compares() {
        let mut tim = capturing(1);
        assert!(!tim.edge_interrupts(0, true));
        tim.put(0, [(DIER, 2)]);
        // The counter passes CCR1, which is 0, unnoticed.
        assert_eq!(tim.next_interrupt(), None);
        assert!(tim.edge_interrupts(0, true) && !tim.edge_interrupts(0, false));
        tim.edge(0, true, 1_000);
        assert!(tim.interrupt(0));
        assert!(!tim.edge_interrupts(0, true), "the line is up already");
    }

    /// The edges of the first output: times in ns and levels.
    fn edges(tim: &mut Tim, count: usize) -> Vec<(u64, Option<bool>)> {
        let next = |tim: &mut Tim| {
            let at = tim.next_output()?;
            tim.advance(at);
            Some((at, tim.output(0)))
        };
        (0..count).map_while(|_| next(tim)).collect()
    }

    /// 10 us, with a preloaded compare value.
    fn modulated(mode: u32, compare: u32) -> Tim {
        let mut tim = at_100_khz();
        tim.put(
            0,
            [(CCR1, compare), (CCMR1, mode << 4 | 1 << 3), (EGR, 1), (CCER, 1)],
        );
        tim
    }

    #[test]
    fn a_pwm_output_is_high_below_its_compare_value_or_above_it() {
        let (high, low) = (Some(true), Some(false));
        let mut one = modulated(0b110, 210);
        assert_eq!(one.output(0), high);
        assert_eq!(
            edges(&mut one, 4),
            [(2_500, low), (10_000, high), (12_500, low), (20_000, high)]
        );
        let mut two = modulated(0b111, 210);
        assert_eq!(
            (two.output(0), edges(&mut two, 2)),
            (low, vec![(2_500, high), (10_000, low)])
        );
        for (compare, level) in [(0, low), (840, high)] {
            let mut still = modulated(0b110, compare);
            assert_eq!((still.output(0), edges(&mut still, 1)), (level, vec![]));
        }
    }

    #[test]
    fn a_preloaded_compare_value_counts_from_the_next_period_on() {
        let (high, low) = (Some(true), Some(false));
        let mut tim = modulated(0b110, 210);
        tim.put(1_000, [(CCR1, 420)]);
        assert_eq!(edges(&mut tim, 3), [(2_500, low), (10_000, high), (15_000, low)]);
        tim.put(16_000, [(CCR1, 0)]);
        // At the update it looks again, and stays low.
        assert_eq!(edges(&mut tim, 2), [(20_000, low)]);
    }

    #[test]
    fn a_complementary_output_is_the_opposite_or_stands_alone_and_needs_moe() {
        let mut tim = Tim::new(TimerKind::ADVANCED, 84_000_000);
        tim.put(0, [(CCMR1, 0b101 << 4), (CCER, 0b101)]);
        assert_eq!((tim.output(0), tim.complement(0)), (None, None));
        tim.put(0, [(0x44, MOE)]);
        assert_eq!((tim.output(0), tim.complement(0)), (Some(true), Some(false)));
        tim.put(0, [(CCER, 0b100)]);
        assert_eq!((tim.output(0), tim.complement(0)), (None, Some(true)));
        tim.put(0, [(CCER, 0b1100)]);
        assert_eq!(tim.complement(0), Some(false), "CC1NP");
    }

    /// PWM input (section 18.3.7): TI1 restarts the counter, and both its edges are captured.
    #[test]
    fn a_timer_restarted_by_its_input_measures_period_and_width() {
        let mut tim = Tim::new(TimerKind::GENERAL, 84_000_000);
        tim.put(
            0,
            [
                (CCMR1, 0b10 << 8 | 0b01),
                (CCER, 0b0011_0001),
                (SMCR, 0b101 << 4 | RESTARTS),
                (CR1, CEN),
            ],
        );
        for (at, rising) in [(5_000, true), (8_000, false), (15_000, true), (18_000, false)] {
            tim.edge(0, rising, at);
        }
        assert_eq!((tim.get(CCR1, 18_000), tim.get(CCR1 + 4, 18_000)), (840, 252));
        assert_eq!(tim.get(CNT, 20_000), 420, "since 15 us");
        assert_eq!(tim.get(SR, 20_000) & TRIGGER, TRIGGER);
        assert_eq!(tim.notes.iter().count(), 0);
    }

    #[test]
    fn updates_matches_and_captures_ask_the_dma_until_they_are_served() {
        let mut tim = at_100_khz();
        tim.put(0, [(CCR1, 210), (DIER, 0b11 << 8)]);
        assert_eq!(tim.next_request(), Some(2_500));
        tim.advance(2_500);
        assert_eq!((tim.requests(), tim.next_request()), (2, Some(10_000)));
        tim.advance(10_000);
        assert_eq!(tim.requests(), 3);
        tim.served(2);
        assert_eq!(tim.requests(), 1);
        let mut tim = capturing(1);
        tim.edge(0, true, 1_000);
        assert_eq!(tim.requests(), 0);
        tim.put(0, [(DIER, 2 << 8)]);
        assert!(tim.edge_interrupts(0, true), "a stream may interrupt");
        tim.edge(0, true, 2_000);
        assert_eq!(tim.requests(), 2);
    }

    #[test]
    fn a_timer_in_trigger_mode_starts_with_its_master_and_only_then() {
        let mut tim2 = Tim::new(TimerKind::GENERAL_32, 84_000_000);
        assert_eq!(tim2.waits_for(), None);
        tim2.put(0, [(SMCR, 0b010 << 4 | 0b110)]);
        assert_eq!((tim2.waits_for(), tim2.get(CNT, 5_000)), (Some(2), 0), "ITR2");
        tim2.start(10_000);
        assert_eq!((tim2.waits_for(), tim2.get(SR, 10_000)), (None, TRIGGER));
        assert_eq!(tim2.get(CNT, 20_000), 840);
        assert_eq!(tim2.notes.iter().count(), 0);
    }

    #[test]
    fn what_is_not_modelled_is_noted() {
        let mut tim = at_100_khz();
        tim.put(0, [(SMCR, 7), (CR1, CEN | 1 << 4)]);
        assert_eq!(tim.notes.iter().count(), 2);
        assert_eq!(tim.write(0x48, 0, 0), Err(NoRegister));
        let mut pwm = Tim::new(TimerKind::ADVANCED, 84_000_000);
        pwm.put(0, [(CCMR1, 0b110 << 4), (CCER, 0b101)]);
        assert_eq!(pwm.notes.iter().count(), 0);
        pwm.put(0, [(0x44, 10)]);
        assert_eq!(pwm.notes.iter().collect::<Vec<_>>(), [DEAD_TIME]);
    }
}
