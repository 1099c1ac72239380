//! General-purpose timers TIM2 to TIM5 (RM0090 section 18): up-counting with update and compare events, input
//! capture, and a start by another timer.
//!
//! # Design
//!
//! The counter is a function of time: the ticks since an *origin*, the last time at which counting started
//! afresh. So a timer costs nothing while it runs. Ticks are numbered from the origin, and events are found
//! by arithmetic on these numbers. Flags of the past are filled in at the next access. A new origin is made
//! only where counting starts afresh by the reference manual: a write to the counter, UG, a clock change, or
//! an update that loads a new prescaler or period.
//!
//! An edge at an input latches the counter at the time of the edge. Silicon takes a clock or two to
//! synchronise an edge, and also the trigger of another timer (sections 18.3.5, 18.3.15). This delay is the
//! same every time, and is not modelled.

use super::clock::{self, Clocks};
use super::peripheral::{NoRegister, Notes, Peripheral};
use super::register::{bit, field, index};

const CEN: u32 = 1 << 0;
const UDIS: u32 = 1 << 1;
const URS: u32 = 1 << 2;
const OPM: u32 = 1 << 3;
const ARPE: u32 = 1 << 7;
/// UIF, and UIE in DIER.
const UPDATE: u32 = 1 << 0;
/// TIF: the trigger came.
const TRIGGER: u32 = 1 << 6;
/// UIF, CC1IF..CC4IF, TIF: flags with an interrupt (section 18.4.4, 18.4.5).
const FLAGS: u32 = 0x5f;
const CHANNELS: usize = 4;

/// Bits of registers that ask for what is not modelled.
const UNMODELLED: [(u32, u32, &str); 3] = [
    (0x00, 0x70, "CR1: only up-counting is modelled"),
    (0x04, 0x40, "CR2.MMS: OCxREF as trigger output is not modelled"),
    (0x0c, 0x5f00, "DIER: timer DMA requests are not modelled"),
];

/// One timer.
#[derive(Debug, Clone, Default)]
pub struct Tim {
    /// Highest counter value: TIM2 and TIM5 have 32 bits, TIM3 and TIM4 16.
    max: u32,
    hz: u32,
    cr1: u32,
    cr2: u32,
    smcr: u32,
    dier: u32,
    sr: u32,
    ccmr: [u32; 2],
    ccer: u32,
    psc: Loaded,
    arr: Loaded,
    ccr: [Loaded; CHANNELS],
    origin_ns: u64,
    /// The counter at the origin.
    origin_count: u32,
    /// Flags have been filled in up to this tick from the origin.
    seen: u64,
    /// UG or an enable was written, and TRGO passes it on at once. Whoever passes it on clears this.
    pub trigger_now: bool,
    notes: Notes,
}

/// A register with a buffer behind it: `written` is loaded into `active` at an update event.
#[derive(Debug, Clone, Copy, Default)]
struct Loaded {
    written: u32,
    active: u32,
}

impl Loaded {
    const fn new(value: u32) -> Self {
        Self {
            written: value,
            active: value,
        }
    }

    fn load(&mut self) {
        self.active = self.written;
    }
}

impl Tim {
    /// A timer with a counter of 16 or 32 bits on a clock of `hz`.
    pub fn new(bits: u32, hz: u32) -> Self {
        let max = u32::MAX >> (32 - bits);
        Self {
            max,
            hz,
            arr: Loaded::new(max),
            ..Self::default()
        }
    }

    /// Fills in what has happened up to `now`.
    pub fn advance(&mut self, now: u64) {
        while self.counting() {
            let ticks = self.ticks(now);
            if ticks <= self.seen {
                return;
            }
            let update = self.update_after(self.seen);
            let reload = self.cr1 & OPM != 0 || (self.cr1 & UDIS == 0 && self.has_pending_load());
            let to = if reload { ticks.min(update) } else { ticks };
            self.fill_in(to);
            if reload && to == update {
                let at = self.time_of(update);
                if self.cr1 & UDIS == 0 {
                    self.load();
                }
                self.start_afresh(at, 0);
                if self.cr1 & OPM != 0 {
                    self.cr1 &= !CEN;
                }
            }
        }
    }

    /// The timer (TIM2 is 0) whose trigger output starts this one: in slave mode *trigger* (section 18.4.3),
    /// while this one does not run yet. `this` is the number of this timer.
    pub fn waits_for(&self, this: usize) -> Option<usize> {
        /// ITR0 to ITR3 (table 93), as far as they are timers modelled here.
        const MASTERS: [[Option<usize>; 4]; 4] = [
            [None, None, Some(1), Some(2)],
            [None, Some(0), Some(3), Some(2)],
            [None, Some(0), Some(1), None],
            [Some(0), Some(1), Some(2), None],
        ];
        let master = MASTERS[this].get(field(self.smcr, 4, 3) as usize)?;
        master.filter(|_| field(self.smcr, 0, 3) == 0b110 && self.cr1 & CEN == 0)
    }

    /// The trigger that it waited for comes.
    pub fn start(&mut self, at: u64) {
        self.advance(at);
        let count = self.count(at);
        self.cr1 |= CEN;
        self.sr |= TRIGGER;
        self.start_afresh(at, count);
    }

    /// An edge comes at an input: TI1 to TI4 are 0 to 3.
    pub fn edge(&mut self, input: usize, rising: bool, at: u64) {
        self.advance(at);
        for channel in 0..CHANNELS {
            if self.captures(channel, input, rising) {
                let count = self.count(at);
                self.ccr[channel] = Loaded::new(count);
                // CCxOF is set if the flag of an earlier capture still stands (section 18.4.5).
                self.sr |= ((self.sr >> (1 + channel)) & 1) << (9 + channel);
                self.sr |= 2 << channel;
            }
        }
    }

    /// Whether an edge at this input would raise the interrupt line.
    pub fn edge_interrupts(&self, input: usize, rising: bool) -> bool {
        let raises = |channel| self.captures(channel, input, rising) && bit(self.dier, 1 + channel as u32);
        !self.interrupt(0) && (0..CHANNELS).any(raises)
    }

    /// Whether an edge at any input could raise the interrupt line.
    pub fn captures_interrupt(&self) -> bool {
        let waits = |channel: usize| self.is_input(channel) && bit(self.dier, 1 + channel as u32);
        !self.interrupt(0) && (0..CHANNELS).any(waits)
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

    /// CCxS: 0 is an output (section 18.4.7).
    fn selection(&self, channel: usize) -> u32 {
        field(self.ccmr[channel / 2], 8 * (channel as u32 % 2), 2)
    }

    fn is_input(&self, channel: usize) -> bool {
        self.selection(channel) != 0
    }

    /// When the trigger output TRGO will pulse by itself for the `n`-th time from now (0 is the next), as
    /// CR2.MMS selects (section 18.4.2). If an update in between loads a new period, only the first is known.
    pub fn trigger(&self, n: u64) -> Option<u64> {
        if !self.counting() {
            return None;
        }
        let first = match field(self.cr2, 4, 3) {
            0b010 if self.cr1 & UDIS == 0 => self.update_after(self.seen),
            0b011 => self.compare_after(self.ccr[0].active, self.seen),
            _ => return None,
        };
        if n > 0 && (self.has_pending_load() || self.cr1 & OPM != 0) {
            return None;
        }
        Some(self.time_of(first + n * self.period()))
    }

    fn write_cr1(&mut self, value: u32, now: u64) {
        let count = self.count(now);
        let was_enabled = self.cr1 & CEN != 0;
        self.cr1 = value & 0x3ff;
        let enabled = self.cr1 & CEN != 0;
        if was_enabled != enabled {
            self.start_afresh(now, count);
            self.trigger_now |= enabled && field(self.cr2, 4, 3) == 0b001;
        }
        if self.cr1 & ARPE == 0 && self.arr.active != self.arr.written {
            self.arr.load();
            self.start_afresh(now, count);
        }
    }

    /// EGR (section 18.4.6).
    fn generate(&mut self, value: u32, now: u64) {
        self.sr |= value & 0x5e;
        if value & 1 == 0 {
            return;
        }
        if self.cr1 & UDIS == 0 {
            self.load();
            if self.cr1 & URS == 0 {
                self.sr |= UPDATE;
            }
            // MMS reset and update.
            self.trigger_now |= matches!(field(self.cr2, 4, 3), 0b000 | 0b010);
        }
        self.start_afresh(now, 0);
    }

    fn load(&mut self) {
        self.psc.load();
        self.arr.load();
        self.ccr.iter_mut().for_each(Loaded::load);
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
        let differs = |r: &Loaded| r.written != r.active;
        differs(&self.psc) || differs(&self.arr) || self.ccr.iter().any(differs)
    }

    /// The counter is blocked while the period is zero (section 18.3.1).
    fn counting(&self) -> bool {
        self.cr1 & CEN != 0 && self.arr.active != 0
    }

    fn start_afresh(&mut self, now: u64, count: u32) {
        self.origin_ns = now;
        self.origin_count = count;
        self.seen = 0;
    }

    // Ticks from the origin.

    fn ticks(&self, now: u64) -> u64 {
        match self.counting() {
            true => {
                clock::ticks(now.saturating_sub(self.origin_ns), self.hz) / (u64::from(self.psc.active) + 1)
            }
            false => 0,
        }
    }

    fn time_of(&self, tick: u64) -> u64 {
        self.origin_ns
            .saturating_add(clock::edge(tick * (u64::from(self.psc.active) + 1), self.hz))
    }

    fn period(&self) -> u64 {
        u64::from(self.arr.active) + 1
    }

    /// Ticks to the first update. A counter beyond the period runs on to its end.
    fn first_update(&self) -> u64 {
        let beyond = self.origin_count > self.arr.active;
        let end = if beyond {
            u64::from(self.max) + 1
        } else {
            self.period()
        };
        end - u64::from(self.origin_count)
    }

    fn count(&self, now: u64) -> u32 {
        let (ticks, first) = (self.ticks(now), self.first_update());
        let count = match ticks.checked_sub(first) {
            None => u64::from(self.origin_count) + ticks,
            Some(past) => past % self.period(),
        };
        count as u32
    }

    /// The first update after tick `n`.
    fn update_after(&self, n: u64) -> u64 {
        self.repeated_after(self.first_update(), n)
    }

    /// The first tick after `n` of those that are whole periods from `first` on.
    fn repeated_after(&self, first: u64, n: u64) -> u64 {
        match n.checked_sub(first) {
            None => first,
            Some(past) => first + (past / self.period() + 1) * self.period(),
        }
    }

    /// The first tick after `n` at which the counter equals `compare`. A compare value beyond the period
    /// matches at the update (section 18.4.5, CC1IF).
    fn compare_after(&self, compare: u32, n: u64) -> u64 {
        if compare > self.arr.active {
            return self.update_after(n);
        }
        let first_update = self.first_update();
        if let Some(ahead) = compare.checked_sub(self.origin_count).map(u64::from)
            && n < ahead
            && ahead < first_update
        {
            return ahead;
        }
        self.repeated_after(first_update + u64::from(compare), n)
    }

    /// Sets the flags of ticks after `seen` up to `to`.
    fn fill_in(&mut self, to: u64) {
        if self.cr1 & UDIS == 0 && self.update_after(self.seen) <= to {
            self.sr |= UPDATE;
        }
        for channel in 0..CHANNELS {
            if !self.is_input(channel) && self.compare_after(self.ccr[channel].active, self.seen) <= to {
                self.sr |= 2 << channel;
            }
        }
        self.seen = to;
    }
}

impl Peripheral for Tim {
    fn read(&mut self, offset: u32, now: u64) -> Result<u32, NoRegister> {
        self.advance(now);
        Ok(match offset {
            0x00 => self.cr1,
            0x04 => self.cr2,
            0x08 => self.smcr,
            0x0c => self.dier,
            0x10 => self.sr,
            0x14 => 0,
            0x18 | 0x1c => self.ccmr[index(offset, 0x18)],
            0x20 => self.ccer,
            0x24 => self.count(now),
            0x28 => self.psc.written,
            0x2c => self.arr.written,
            0x34..=0x40 if offset.is_multiple_of(4) => {
                let channel = index(offset, 0x34);
                // Reading what was captured clears its flag (section 18.4.5).
                if self.is_input(channel) {
                    self.sr &= !(2 << channel);
                }
                self.ccr[channel].written
            }
            _ => return Err(NoRegister),
        })
    }

    fn write(&mut self, offset: u32, value: u32, now: u64) -> Result<(), NoRegister> {
        self.notes.note_bits(&UNMODELLED, offset, value);
        self.advance(now);
        match offset {
            0x00 => self.write_cr1(value, now),
            0x04 => self.cr2 = value & 0xf8,
            0x08 => {
                self.smcr = value & 0xfff7;
                let started = matches!((field(value, 0, 3), field(value, 4, 3)), (0b110, 0b000..=0b011));
                self.notes.note_if(
                    value & 0x4000 != 0 || (value & 7 != 0 && !started),
                    "SMCR: of the slave modes only the start by another timer is modelled, of the external clocks none",
                );
            }
            0x0c => self.dier = value & 0x5f5f,
            // rc_w0: a 0 clears, a 1 leaves (section 18.4.5).
            0x10 => self.sr &= value,
            0x14 => self.generate(value, now),
            0x18 | 0x1c => {
                self.ccmr[index(offset, 0x18)] = value & 0xffff;
                for half in [value, value >> 8] {
                    self.notes.note_if(
                        half & 3 != 0 && half & 0xfc != 0,
                        "CCMR: input filters and prescalers are not modelled",
                    );
                    self.notes.note_if(
                        half & 3 == 3,
                        "CCMR: capture on the trigger input is not modelled",
                    );
                }
                self.load_unbuffered();
            }
            0x20 => {
                self.ccer = value & 0xbbbb;
                let outputs = (0..CHANNELS).filter(|channel| !self.is_input(*channel));
                let on = outputs.fold(0, |on, channel| on | value & (1 << (4 * channel)));
                self.notes.note_if(on != 0, "CCER: compare outputs move no pin");
            }
            0x24 => self.start_afresh(now, value & self.max),
            0x28 => self.psc.written = value & 0xffff,
            0x2c => {
                let count = self.count(now);
                self.arr.written = value & self.max;
                if self.cr1 & ARPE == 0 {
                    self.arr.load();
                    // Only the period changes: the part of the tick that has passed is kept.
                    let tick = self.time_of(self.ticks(now));
                    self.start_afresh(if self.counting() { tick } else { now }, count);
                }
            }
            0x34..=0x40 if offset.is_multiple_of(4) => {
                let channel = index(offset, 0x34);
                // What was captured cannot be written (section 18.4.13).
                if !self.is_input(channel) {
                    self.ccr[channel].written = value & self.max;
                    self.load_unbuffered();
                }
            }
            _ => return Err(NoRegister),
        }
        Ok(())
    }

    /// The clock stays.
    fn reset(&mut self, _now: u64) {
        *self = Self {
            notes: std::mem::take(&mut self.notes),
            ..Self::new(32 - self.max.leading_zeros(), self.hz)
        };
    }

    fn interrupt(&self, _output: usize) -> bool {
        self.sr & self.dier & FLAGS != 0
    }

    fn next_interrupt(&self) -> Option<u64> {
        let wanted = self.dier & FLAGS & !self.sr;
        if !self.counting() || self.interrupt(0) || wanted == 0 {
            return None;
        }
        let update = (wanted & UPDATE != 0 && self.cr1 & UDIS == 0).then(|| self.update_after(self.seen));
        let compares = (0..CHANNELS)
            .filter(|c| bit(wanted, 1 + *c as u32) && !self.is_input(*c))
            .map(|c| self.compare_after(self.ccr[c].active, self.seen));
        // A load at the next update may move everything after it: look again at that time.
        let reload = self.has_pending_load().then(|| self.update_after(self.seen));
        update
            .into_iter()
            .chain(compares)
            .chain(reload)
            .min()
            .map(|tick| self.time_of(tick))
    }

    /// The part of a tick that had passed is lost.
    fn set_clocks(&mut self, clocks: &Clocks, now: u64) {
        if clocks.timers1 != self.hz {
            self.advance(now);
            let count = self.count(now);
            self.hz = clocks.timers1;
            self.start_afresh(now, count);
        }
    }

    fn notes(&self) -> &Notes {
        &self.notes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CR1: u32 = 0x00;
    const CR2: u32 = 0x04;
    const DIER: u32 = 0x0c;
    const SR: u32 = 0x10;
    const EGR: u32 = 0x14;
    const CCMR1: u32 = 0x18;
    const CNT: u32 = 0x24;
    const PSC: u32 = 0x28;
    const ARR: u32 = 0x2c;
    const CCR1: u32 = 0x34;

    /// 84 MHz, a period of 840 ticks: 10 µs.
    fn at_100_khz() -> Tim {
        let mut tim = Tim::new(16, 84_000_000);
        tim.write(ARR, 839, 0).unwrap();
        tim.write(EGR, 1, 0).unwrap();
        tim.write(SR, 0, 0).unwrap();
        tim.write(CR1, CEN, 0).unwrap();
        tim
    }

    #[test]
    fn the_counter_counts_up_and_starts_again_after_the_period() {
        let mut tim = at_100_khz();
        assert_eq!(tim.read(CNT, 5_000), Ok(420));
        assert_eq!(tim.read(CNT, 9_999), Ok(839));
        assert_eq!(tim.read(CNT, 10_000), Ok(0));
        assert_eq!(tim.read(CNT, 1_000_005_000), Ok(420));
    }

    #[test]
    fn the_update_flag_rises_at_the_period_and_a_zero_clears_it() {
        let mut tim = at_100_khz();
        assert_eq!(tim.read(SR, 9_999).unwrap() & 1, 0);
        assert_eq!(tim.read(SR, 10_000).unwrap() & 1, 1);
        tim.write(SR, !2, 10_100).unwrap();
        assert_eq!(tim.read(SR, 10_100).unwrap() & 1, 1, "a 1 leaves the flag");
        tim.write(SR, !1, 10_100).unwrap();
        assert_eq!(tim.read(SR, 19_999).unwrap() & 1, 0);
        assert_eq!(tim.read(SR, 20_000).unwrap() & 1, 1);
    }

    #[test]
    fn the_next_interrupt_is_known_before_it_comes_and_only_if_enabled() {
        let mut tim = at_100_khz();
        assert_eq!(tim.next_interrupt(), None);
        tim.write(DIER, 1, 3_000).unwrap();
        assert_eq!(tim.next_interrupt(), Some(10_000));
        tim.advance(10_000);
        assert!(tim.interrupt(0));
        assert_eq!(tim.next_interrupt(), None, "the line is up already");
    }

    #[test]
    fn a_compare_matches_once_a_period() {
        let mut tim = at_100_khz();
        tim.write(CCR1, 84, 0).unwrap();
        tim.write(DIER, 2, 0).unwrap();
        assert_eq!(tim.next_interrupt(), Some(1_000));
        tim.write(SR, 0, 1_000).unwrap();
        assert_eq!(tim.next_interrupt(), Some(11_000));
        tim.write(SR, 0, 123_456).unwrap();
        assert_eq!(tim.next_interrupt(), Some(131_000));
    }

    #[test]
    fn a_compare_value_beyond_the_period_matches_at_the_update() {
        let mut tim = at_100_khz();
        tim.write(CCR1, 900, 0).unwrap();
        tim.write(DIER, 2, 0).unwrap();
        assert_eq!(tim.next_interrupt(), Some(10_000));
    }

    #[test]
    fn ug_restarts_the_counter_loads_the_prescaler_and_flags_unless_urs() {
        let mut tim = at_100_khz();
        tim.write(PSC, 83, 4_000).unwrap();
        assert_eq!(tim.read(CNT, 5_000), Ok(420), "the prescaler waits for an update");
        tim.write(EGR, 1, 5_000).unwrap();
        assert_eq!(tim.read(SR, 5_000).unwrap() & 1, 1);
        assert_eq!(tim.read(CNT, 15_000), Ok(10), "1 MHz from here");

        let mut tim = at_100_khz();
        tim.write(CR1, CEN | URS, 0).unwrap();
        tim.write(EGR, 1, 5_000).unwrap();
        assert_eq!(tim.read(SR, 5_000).unwrap() & 1, 0);
    }

    #[test]
    fn a_new_prescaler_takes_effect_at_the_update() {
        let mut tim = at_100_khz();
        tim.write(PSC, 1, 4_000).unwrap();
        assert_eq!(tim.read(CNT, 9_999), Ok(839));
        assert_eq!(tim.read(CNT, 20_000), Ok(420));
    }

    #[test]
    fn a_preloaded_period_takes_effect_at_the_update_and_a_direct_one_at_once() {
        let mut tim = at_100_khz();
        tim.write(CR1, CEN | ARPE, 0).unwrap();
        tim.write(ARR, 419, 1_000).unwrap();
        tim.write(DIER, 1, 1_000).unwrap();
        assert_eq!(tim.next_interrupt(), Some(10_000));
        tim.write(SR, 0, 10_000).unwrap();
        assert_eq!(tim.next_interrupt(), Some(15_000));

        let mut tim = at_100_khz();
        tim.write(ARR, 419, 1_000).unwrap();
        tim.write(DIER, 1, 1_000).unwrap();
        assert_eq!(tim.next_interrupt(), Some(5_000));
    }

    #[test]
    fn a_preloaded_compare_value_waits_for_the_update() {
        let mut tim = at_100_khz();
        tim.write(CCMR1, 1 << 3, 0).unwrap();
        tim.write(CCR1, 84, 2_000).unwrap();
        assert_eq!(tim.read(SR, 9_999).unwrap() & 2, 0, "still 0, which has not come");
        tim.write(SR, 0, 10_000).unwrap();
        assert_eq!(tim.read(SR, 10_999).unwrap() & 2, 0);
        assert_eq!(tim.read(SR, 11_000).unwrap() & 2, 2);
    }

    #[test]
    fn one_pulse_mode_stops_at_the_update() {
        let mut tim = at_100_khz();
        tim.write(CR1, CEN | OPM, 0).unwrap();
        assert_eq!(tim.read(CR1, 9_999).unwrap() & CEN, CEN);
        assert_eq!(tim.read(CR1, 10_000).unwrap() & CEN, 0);
        assert_eq!(tim.read(SR, 50_000).unwrap() & 1, 1);
        assert_eq!(tim.read(CNT, 50_000), Ok(0));
    }

    #[test]
    fn a_counter_set_beyond_the_period_runs_to_its_end_first() {
        let mut tim = at_100_khz();
        tim.write(CNT, 0xffff - 83, 0).unwrap();
        tim.write(DIER, 1, 0).unwrap();
        assert_eq!(tim.next_interrupt(), Some(1_000));
        assert_eq!(tim.read(CNT, 6_000), Ok(420));
    }

    #[test]
    fn the_trigger_output_follows_the_update_and_never_drifts() {
        // 84 MHz / 1000: a period of 11904.76 ns, which no sum of whole ns can follow.
        let mut tim = at_100_khz();
        tim.write(CR2, 0b010 << 4, 0).unwrap();
        tim.write(ARR, 999, 0).unwrap();
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
        tim.write(CR2, 0b010 << 4, 0).unwrap();
        tim.write(CR1, CEN | UDIS, 0).unwrap();
        assert_eq!(tim.trigger(0), None);
        assert_eq!(tim.read(SR, 50_000).unwrap() & 1, 0);
    }

    #[test]
    fn a_slower_clock_keeps_the_count_and_stretches_what_is_left() {
        let mut tim = at_100_khz();
        tim.write(DIER, 1, 0).unwrap();
        let slower = Clocks {
            timers1: 42_000_000,
            ..Clocks::HSI
        };
        tim.set_clocks(&slower, 5_000);
        assert_eq!(tim.read(CNT, 5_000), Ok(420));
        assert_eq!(tim.next_interrupt(), Some(15_000));
    }

    #[test]
    fn a_stopped_timer_keeps_its_count() {
        let mut tim = at_100_khz();
        tim.write(CR1, 0, 5_000).unwrap();
        assert_eq!(tim.read(CNT, 90_000), Ok(420));
        tim.write(CR1, CEN, 90_000).unwrap();
        assert_eq!(tim.read(CNT, 91_000), Ok(504));
    }

    #[test]
    fn a_thirty_two_bit_timer_wraps_where_its_period_says() {
        let mut tim = Tim::new(32, 84_000_000);
        tim.write(CR1, CEN, 0).unwrap();
        assert_eq!(
            tim.read(CNT, 60_000_000_000).unwrap(),
            (60u64 * 84_000_000 - (1 << 32)) as u32
        );
    }

    const CCER: u32 = 0x20;

    /// Channel 1 captures its own input, with these bits of CCER.
    fn capturing(ccer: u32) -> Tim {
        let mut tim = Tim::new(32, 84_000_000);
        tim.write(CCMR1, 0b01, 0).unwrap();
        tim.write(CCER, ccer, 0).unwrap();
        tim.write(CR1, CEN, 0).unwrap();
        tim
    }

    #[test]
    fn an_edge_latches_the_counter_and_reading_it_clears_the_flag() {
        let mut tim = capturing(1);
        tim.edge(0, true, 60_000_000_000);
        assert_eq!(tim.read(SR, 60_000_100_000).unwrap() & 2, 2);
        let expected = (60u64 * 84_000_000 - (1 << 32)) as u32;
        assert_eq!(tim.read(CCR1, 60_000_100_000), Ok(expected), "of 32 bits");
        assert_eq!(tim.read(SR, 60_000_100_000).unwrap() & 2, 0);
        tim.write(CCR1, 5, 60_000_100_000).unwrap();
        assert_eq!(tim.read(CCR1, 60_000_100_000), Ok(expected), "read-only");
    }

    #[test]
    fn the_polarity_says_which_edges_count_and_a_channel_that_is_off_sees_none() {
        let seen = |ccer: u32| {
            [true, false].map(|rising| {
                let mut tim = capturing(ccer);
                tim.edge(0, rising, 1_000);
                tim.edge(1, rising, 1_000);
                tim.read(SR, 1_000).unwrap() == 2
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
        tim.write(CCMR1, 0b10 << 8, 0).unwrap();
        tim.write(CCER, 1 << 4, 0).unwrap();
        tim.edge(0, true, 1_000);
        assert_eq!((tim.read(SR, 1_000), tim.read(CCR1 + 4, 1_000)), (Ok(4), Ok(84)));
    }

    #[test]
    fn a_second_edge_before_the_first_was_read_overwrites_it_and_is_told() {
        let mut tim = capturing(1);
        tim.edge(0, true, 1_000);
        tim.edge(0, true, 2_000);
        assert_eq!(tim.read(SR, 2_000), Ok(2 | 1 << 9));
        assert_eq!(tim.read(CCR1, 2_000), Ok(168));
        assert_eq!(
            tim.read(SR, 2_000),
            Ok(1 << 9),
            "CC1OF is cleared by a write only"
        );
        tim.write(SR, !(1 << 9), 2_000).unwrap();
        assert_eq!(tim.read(SR, 2_000), Ok(0));
    }

    #[test]
    fn a_capture_interrupts_if_enabled_and_an_input_never_compares() {
        let mut tim = capturing(1);
        assert!(!tim.edge_interrupts(0, true));
        tim.write(DIER, 2, 0).unwrap();
        assert_eq!(
            tim.next_interrupt(),
            None,
            "the counter passes CCR1, which is 0, unnoticed"
        );
        assert_eq!(
            (tim.edge_interrupts(0, true), tim.edge_interrupts(0, false)),
            (true, false)
        );
        tim.edge(0, true, 1_000);
        assert!(tim.interrupt(0));
        assert!(!tim.edge_interrupts(0, true), "the line is up already");
    }

    #[test]
    fn a_timer_in_trigger_mode_starts_with_its_master_and_only_then() {
        let mut tim2 = Tim::new(32, 84_000_000);
        assert_eq!(tim2.waits_for(0), None);
        tim2.write(0x08, 0b010 << 4 | 0b110, 0).unwrap();
        assert_eq!(tim2.waits_for(0), Some(1), "ITR2 of TIM2 is TIM3");
        assert_eq!(tim2.read(CNT, 5_000), Ok(0));
        tim2.start(10_000);
        assert_eq!((tim2.waits_for(0), tim2.read(SR, 10_000)), (None, Ok(TRIGGER)));
        assert_eq!(tim2.read(CNT, 20_000), Ok(840));
        assert_eq!(tim2.notes.iter().count(), 0);
    }

    #[test]
    fn what_is_not_modelled_is_noted() {
        let mut tim = at_100_khz();
        tim.write(0x08, 7, 0).unwrap();
        tim.write(CR1, CEN | 1 << 4, 0).unwrap();
        assert_eq!(tim.notes.iter().count(), 2);
        assert_eq!(tim.write(0x48, 0, 0), Err(NoRegister));
    }
}
