//! The overlay's virtual time, and how QEMU's own clock is read as it.
//!
//! # Design
//! QEMU's clock moves by the same time with each instruction, whatever the firmware does with its clocks. A
//! core takes a cycle of HCLK for an instruction at least. While a cycle is longer than QEMU's time, the
//! overlay's time moves by a multiple of QEMU's: an instruction takes the least multiple that is not shorter
//! than a cycle.

use std::sync::atomic::{AtomicU32, AtomicU64, Ordering::Relaxed};

const NS_PER_S: u64 = 1_000_000_000;

/// Factor of QEMU's time, and the time in both clocks since which it holds.
pub(super) struct Pace {
    hclk: AtomicU32,
    factor: AtomicU64,
    since: AtomicU64,
    qemu_since: AtomicU64,
}

impl Pace {
    pub(super) const fn new() -> Self {
        Self {
            hclk: AtomicU32::new(0),
            factor: AtomicU64::new(1),
            since: AtomicU64::new(0),
            qemu_since: AtomicU64::new(0),
        }
    }

    /// The processor has a clock of `hclk` Hz from now on. Without one it executes nothing, and the factor
    /// stays.
    pub(super) fn follow(&self, hclk: u32, instruction_ns: u64, qemu_ns: impl FnOnce() -> u64) {
        if self.hclk.swap(hclk, Relaxed) == hclk || hclk == 0 {
            return;
        }
        let qemu_ns = qemu_ns();
        self.since.store(self.time(qemu_ns), Relaxed);
        self.qemu_since.store(qemu_ns, Relaxed);
        let factor = NS_PER_S.div_ceil(u64::from(hclk) * instruction_ns);
        self.factor.store(factor, Relaxed);
    }

    pub(super) fn factor(&self) -> u64 {
        self.factor.load(Relaxed)
    }

    /// The overlay's time when QEMU's clock says `qemu_ns`.
    pub(super) fn time(&self, qemu_ns: u64) -> u64 {
        self.since.load(Relaxed) + (qemu_ns - self.qemu_since.load(Relaxed)) * self.factor()
    }

    /// The first time of QEMU's clock at which the overlay's is not before `ns`.
    pub(super) fn qemu_time(&self, ns: u64) -> u64 {
        let left = ns.saturating_sub(self.since.load(Relaxed));
        self.qemu_since.load(Relaxed) + left.div_ceil(self.factor())
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
        assert_eq!(clocks.map(&mut instruction), [8, 8, 16, 64, 64, 32_000]);
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
}
