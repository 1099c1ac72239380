//! The overlay's virtual time, and how QEMU's own clock is read as it.
//!
//! # Design
//! QEMU's clock advances by a fixed time with each instruction, whatever the firmware does with its clocks. A
//! core takes at least one cycle of HCLK for an instruction. While a cycle is longer than QEMU's time, the
//! overlay's time runs faster: an instruction takes a cycle, rounded up to whole ns. Since the overlay's time
//! is never slower than QEMU's, its time at the end of an instruction corresponds exactly to one of QEMU's.

use std::sync::atomic::{AtomicU32, AtomicU64, Ordering::Relaxed};

const NS_PER_S: u64 = 1_000_000_000;

/// Time of an instruction, and when it was set, in both clocks.
pub(super) struct Pace {
    hclk: AtomicU32,
    /// Time of an instruction by QEMU's clock, ns.
    qemu_instruction_ns: AtomicU64,
    instruction_ns: AtomicU64,
    since: AtomicU64,
    qemu_since: AtomicU64,
}

impl Pace {
    pub(super) const fn new() -> Self {
        Self {
            hclk: AtomicU32::new(0),
            qemu_instruction_ns: AtomicU64::new(1),
            instruction_ns: AtomicU64::new(1),
            since: AtomicU64::new(0),
            qemu_since: AtomicU64::new(0),
        }
    }

    /// Sets the processor's clock to `hclk` Hz, while QEMU's clock advances by `qemu_instruction_ns` with an
    /// instruction. At 0 Hz the processor executes nothing, and the pace is kept.
    pub(super) fn follow(&self, hclk: u32, qemu_instruction_ns: u64, qemu_ns: impl FnOnce() -> u64) {
        if self.hclk.swap(hclk, Relaxed) == hclk || hclk == 0 {
            return;
        }
        let qemu_ns = qemu_ns();
        self.since.store(self.time(qemu_ns), Relaxed);
        self.qemu_since.store(qemu_ns, Relaxed);
        self.qemu_instruction_ns.store(qemu_instruction_ns, Relaxed);
        let cycle_ns = NS_PER_S.div_ceil(hclk.into());
        self.instruction_ns
            .store(qemu_instruction_ns.max(cycle_ns), Relaxed);
    }

    /// Time of an instruction, ns.
    pub(super) fn instruction_ns(&self) -> u64 {
        self.instruction_ns.load(Relaxed)
    }

    /// The overlay's time at `qemu_ns` of QEMU's clock.
    pub(super) fn time(&self, qemu_ns: u64) -> u64 {
        let passed = u128::from(qemu_ns - self.qemu_since.load(Relaxed));
        let passed = passed * u128::from(self.instruction_ns()) / self.qemu_step();
        self.since.load(Relaxed) + passed as u64
    }

    /// The first time of QEMU's clock at which the overlay's has reached `ns`.
    pub(super) fn qemu_time(&self, ns: u64) -> u64 {
        let left = u128::from(ns.saturating_sub(self.since.load(Relaxed)));
        let left = (left * self.qemu_step()).div_ceil(self.instruction_ns().into());
        self.qemu_since.load(Relaxed) + left as u64
    }

    fn qemu_step(&self) -> u128 {
        self.qemu_instruction_ns.load(Relaxed).into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_instruction_takes_a_cycle_at_least_and_time_goes_on_where_the_clock_changes() {
        let pace = Pace::new();
        let mut qemu_ns = 0;
        let mut instruction = |hclk| {
            let before = pace.time(qemu_ns);
            pace.follow(hclk, 8, || qemu_ns);
            assert_eq!(pace.time(qemu_ns), before);
            qemu_ns += 8;
            pace.time(qemu_ns) - before
        };
        let clocks = [
            168_000_000,
            125_000_000,
            124_000_000,
            16_000_000,
            0,
            16_000_000 / 512,
        ];
        assert_eq!(clocks.map(&mut instruction), [8, 8, 9, 63, 63, 32_000]);
    }

    #[test]
    fn a_time_is_reached_by_the_first_of_qemus_times_that_is_not_before_it() {
        let pace = Pace::new();
        pace.follow(16_000_000, 8, || 1000);
        for ns in 1000..1100 {
            let at = pace.qemu_time(ns);
            assert!(
                pace.time(at) >= ns && (at == 1000 || pace.time(at - 1) < ns),
                "{ns}"
            );
        }
    }

    /// The interpreter starts from any time, and QEMU continues where it ends.
    #[test]
    fn after_some_instructions_both_times_are_each_others() {
        for (hclk, ns) in [(16_000_000, 63), (100_000_000, 10), (168_000_000, 8)] {
            let pace = Pace::new();
            pace.follow(hclk, 8, || 1000);
            for qemu_ns in 1000..1100 {
                let now = pace.time(qemu_ns);
                for n in 1..10 {
                    assert_eq!(pace.time(qemu_ns + 8 * n), now + ns * n);
                    assert_eq!(pace.qemu_time(now + ns * n), qemu_ns + 8 * n);
                }
            }
        }
    }
}
