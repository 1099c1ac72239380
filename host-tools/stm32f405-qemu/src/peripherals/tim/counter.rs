//! The counter of a timer, with its prescaler and its repetition counter.
//!
//! # Design
//!
//! The counter is a function of time: the edges of the timer's clock since an *origin*. So it costs nothing
//! while it runs. Ticks are numbered from the origin, and events are found by arithmetic on these numbers.
//! The origin is an edge of the clock and not a time, so nothing drifts however often it moves.

use super::super::clock;
use crate::ramp::Ramp;

/// A register with a buffer behind it: `written` is loaded into `active` at an update event.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct BufferedRegister {
    pub(super) written: u32,
    pub(super) active: u32,
}

impl BufferedRegister {
    pub(super) const fn new(value: u32) -> Self {
        Self {
            written: value,
            active: value,
        }
    }

    pub(super) fn load(&mut self) {
        self.active = self.written;
    }

    pub(super) fn is_pending(&self) -> bool {
        self.written != self.active
    }
}

#[derive(Debug, Clone, Default)]
pub(super) struct Counter {
    pub(super) max: u32,
    pub(super) enabled: bool,
    /// True if edges at inputs move the counter, not the timer's clock.
    pub(super) by_edges: bool,
    pub(super) prescaler: BufferedRegister,
    pub(super) reload: BufferedRegister,
    /// RCR: an update event comes with every `active + 1`st overflow.
    pub(super) repetition: BufferedRegister,
    /// The timer's clock, and when it began to have this frequency.
    pub(super) hz: u32,
    since_ns: u64,
    /// The origin, as an edge of that clock.
    origin: u64,
    /// At the origin: the prescaler's own count, the counter, and the overflows that pass without an update.
    phase: u32,
    count: u32,
    repeats: u32,
}

impl Counter {
    pub(super) fn new(max: u32, hz: u32) -> Self {
        Self {
            max,
            hz,
            reload: BufferedRegister::new(max),
            ..Self::default()
        }
    }

    /// Returns `true` if it counts with time. It is blocked while the period is zero (section 18.3.1).
    pub(super) fn counts(&self) -> bool {
        self.enabled && !self.by_edges && self.reload.active != 0
    }

    fn edges(&self, now: u64) -> u64 {
        clock::ticks(now.saturating_sub(self.since_ns), self.hz)
    }

    fn divider(&self) -> u64 {
        u64::from(self.prescaler.active) + 1
    }

    // Ticks from the origin.

    pub(super) fn ticks(&self, now: u64) -> u64 {
        if !self.counts() {
            return 0;
        }
        let edges = self.edges(now).saturating_sub(self.origin);
        (edges + u64::from(self.phase)) / self.divider()
    }

    /// The edge of the clock that makes a tick.
    fn edge_of(&self, tick: u64) -> u64 {
        let edges = tick.saturating_mul(self.divider());
        self.origin
            .saturating_add(edges.saturating_sub(u64::from(self.phase)))
    }

    pub(super) fn time_of(&self, tick: u64) -> u64 {
        self.since_ns
            .saturating_add(clock::edge(self.edge_of(tick), self.hz))
    }

    /// Ticks from one overflow to the next.
    pub(super) fn period(&self) -> u64 {
        u64::from(self.reload.active) + 1
    }

    /// Ticks from one update event to the next.
    pub(super) fn update_period(&self) -> u64 {
        self.period() * (u64::from(self.repetition.active) + 1)
    }

    /// Ticks to the first overflow. A counter beyond the period runs on to its end.
    fn first_overflow(&self) -> u64 {
        let beyond = self.count > self.reload.active;
        let last = if beyond { self.max } else { self.reload.active };
        u64::from(last) + 1 - u64::from(self.count)
    }

    pub(super) fn count(&self, now: u64) -> u32 {
        self.count_at(self.ticks(now))
    }

    /// The counter at a tick from the origin.
    pub(super) fn count_at(&self, ticks: u64) -> u32 {
        let first = self.first_overflow();
        let past = ticks.checked_sub(first).map(|past| past % self.period());
        past.unwrap_or(u64::from(self.count) + ticks) as u32
    }

    /// The ramp of the counter up to its next overflow.
    pub(super) fn ramp(&self, now: u64) -> Ramp {
        let (ticks, first) = (self.ticks(now), self.first_overflow());
        let overflow = match ticks.checked_sub(first) {
            None => first,
            Some(past) => first + (past / self.period() + 1) * self.period(),
        };
        Ramp {
            hz: u64::from(self.hz).div_ceil(self.divider()) as u32,
            falls: false,
            until_ns: self.time_of(overflow),
        }
    }

    /// Number of overflows to come without an update event.
    fn repeats(&self, now: u64) -> u32 {
        let past = self.ticks(now).checked_sub(self.first_overflow());
        let overflows = past.map_or(0, |past| past / self.period() + 1);
        let left = match u64::from(self.repeats).checked_sub(overflows) {
            Some(left) => left,
            None => {
                let repetition = u64::from(self.repetition.active);
                repetition - (overflows - u64::from(self.repeats) - 1) % (repetition + 1)
            }
        };
        left as u32
    }

    /// The first update event after tick `n`.
    pub(super) fn update_after(&self, n: u64) -> u64 {
        let first = self.first_overflow() + u64::from(self.repeats) * self.period();
        repeated_after(first, self.update_period(), n)
    }

    /// The first tick after `n` at which the counter equals `compare`. A compare value beyond the period
    /// matches at the overflow (section 18.4.5, CC1IF).
    pub(super) fn compare_after(&self, compare: u32, n: u64) -> u64 {
        let (first_overflow, period) = (self.first_overflow(), self.period());
        if compare > self.reload.active {
            return repeated_after(first_overflow, period, n);
        }
        if let Some(ahead) = compare.checked_sub(self.count).map(u64::from)
            && n < ahead
            && ahead < first_overflow
        {
            return ahead;
        }
        repeated_after(first_overflow + u64::from(compare), period, n)
    }

    pub(super) fn has_pending_load(&self) -> bool {
        [self.prescaler, self.reload, self.repetition]
            .iter()
            .any(BufferedRegister::is_pending)
    }

    // Moves of the origin.

    /// Moves the origin to `now`. Nothing else changes: the prescaler keeps its phase.
    pub(super) fn go_on(&mut self, now: u64) {
        let (count, repeats) = (self.count(now), self.repeats(now));
        let edges = self.edges(now);
        if self.counts() {
            let passed = edges.saturating_sub(self.origin) + u64::from(self.phase);
            self.phase = (passed % self.divider()) as u32;
        }
        (self.origin, self.count, self.repeats) = (edges, count, repeats);
    }

    /// Sets the counter at `now`.
    pub(super) fn set_count(&mut self, count: u32, now: u64) {
        self.go_on(now);
        self.count = count & self.max;
    }

    /// An update by software: counter and prescaler start again (section 18.4.6, UG).
    pub(super) fn start_again(&mut self, now: u64) {
        (self.origin, self.phase, self.count) = (self.edges(now), 0, 0);
        self.repeats = self.repetition.active;
    }

    /// The counter passes the update event at a tick, with its buffers loaded if `load`.
    pub(super) fn pass_update(&mut self, tick: u64, load: bool) {
        self.origin = self.edge_of(tick);
        if load {
            self.load();
        }
        (self.phase, self.count) = (0, 0);
        self.repeats = self.repetition.active;
    }

    /// Moves the counter by an edge, if the prescaler lets it through. Returns `None` if not, else `true` if
    /// there is an update event.
    pub(super) fn step(&mut self, down: bool) -> Option<bool> {
        if !self.enabled || self.reload.active == 0 {
            return None;
        }
        self.phase += 1;
        if self.phase <= self.prescaler.active {
            return None;
        }
        self.phase = 0;
        let last = match (down, self.first_overflow()) {
            (true, _) => self.count == 0,
            (false, ticks) => ticks == 1,
        };
        self.count = match (last, down) {
            (true, true) => self.reload.active,
            (true, false) => 0,
            (false, true) => self.count - 1,
            (false, false) => self.count + 1,
        };
        if !last {
            return Some(false);
        }
        let left = self.repeats.checked_sub(1);
        self.repeats = left.unwrap_or(self.repetition.active);
        Some(left.is_none())
    }

    pub(super) fn load(&mut self) {
        self.prescaler.load();
        self.reload.load();
        self.repetition.load();
    }

    /// Changes the clock's frequency at `now`. The part of a clock that had passed is lost.
    pub(super) fn set_clock(&mut self, hz: u32, now: u64) {
        self.go_on(now);
        (self.hz, self.since_ns, self.origin) = (hz, now, 0);
    }
}

/// The first tick after `n` of those that are whole periods from `first` on.
fn repeated_after(first: u64, period: u64, n: u64) -> u64 {
    match n.checked_sub(first) {
        None => first,
        Some(past) => first + (past / period + 1) * period,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 84 MHz by 84, a period of 10 us.
    fn running() -> Counter {
        let mut counter = Counter::new(0xffff, 84_000_000);
        counter.prescaler = BufferedRegister::new(83);
        counter.reload = BufferedRegister::new(9);
        counter.enabled = true;
        counter
    }

    #[test]
    fn moving_the_origin_changes_no_time_and_never_drifts() {
        let still = running();
        let mut moved = running();
        for n in 1..5_000 {
            moved.go_on(n * 777);
        }
        let next = |counter: &Counter, now: u64| counter.time_of(counter.update_after(counter.ticks(now)));
        for now in [4_000_000, 4_123_456, 9_999_999] {
            assert_eq!(moved.count(now), still.count(now));
            assert_eq!(next(&moved, now), next(&still, now));
        }
    }

    #[test]
    fn a_stopped_counter_keeps_the_phase_of_its_prescaler() {
        let mut counter = running();
        counter.go_on(2_500);
        counter.enabled = false;
        counter.go_on(700_000);
        counter.enabled = true;
        assert_eq!(counter.count(700_499), 2);
        assert_eq!(counter.count(700_500), 3, "the second half of the third tick");
    }
}
