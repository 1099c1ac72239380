//! The processor's cycle counter (ARMv7-M ARM, C1.8.8), which QEMU lacks. It follows HCLK, whether the
//! processor sleeps or not, once DEMCR.TRCENA lets the unit run.
//!
//! Under `-icount shift=3` an instruction takes 8 ns, which is 1.34 cycles at 168 MHz. The counter measures
//! this virtual time. It does not measure what the pipeline of a real Cortex-M4 would take.

use super::clock::{self, ClockTree};
use super::peripheral::{NoRegister, Notes, Peripheral};
use super::register::bit;
use crate::ramp::Ramp;

/// NUMCOMP: the Cortex-M4 has four comparators. NOCYCCNT is clear: there is a cycle counter.
const NUMCOMP: u32 = 4 << 28;

/// DWT's registers, as far as the counter goes.
#[derive(Debug, Clone, Default)]
pub(crate) struct Dwt {
    hclk: u32,
    ctrl: u32,
    /// The counter's value at `since_ns`.
    count: u32,
    since_ns: u64,
    /// DEMCR.TRCENA.
    traces: bool,
    pub(crate) notes: Notes,
}

impl Dwt {
    pub(crate) fn new(hclk: u32) -> Self {
        Self {
            hclk,
            ctrl: NUMCOMP,
            ..Self::default()
        }
    }

    /// Lets the unit run or not, as DEMCR.TRCENA says.
    pub(crate) fn enable(&mut self, traces: bool, now: u64) {
        if self.traces != traces {
            self.settle(now);
            self.traces = traces;
        }
    }

    fn settle(&mut self, now: u64) {
        self.count = self.cycles(now);
        self.since_ns = now;
    }

    fn cycles(&self, now: u64) -> u32 {
        let runs = bit(self.ctrl, 0) && self.traces;
        let passed = clock::ticks(now.saturating_sub(self.since_ns), self.hclk) as u32;
        self.count.wrapping_add(if runs { passed } else { 0 })
    }
}

impl Peripheral for Dwt {
    fn read(&mut self, offset: u32, now: u64) -> Result<u32, NoRegister> {
        match offset {
            0x00 => Ok(self.ctrl),
            0x04 => Ok(self.cycles(now)),
            _ => Err(NoRegister),
        }
    }

    fn holds_until(&self, offset: u32, now: u64) -> Option<u64> {
        let runs = bit(self.ctrl, 0) && self.traces;
        // The counter moves on within a turn of a loop.
        Some(if offset == 0x04 && runs { now } else { u64::MAX })
    }

    fn ramp(&self, offset: u32, _now: u64) -> Option<Ramp> {
        let runs = bit(self.ctrl, 0) && self.traces;
        (offset == 0x04 && runs).then_some(Ramp {
            hz: self.hclk,
            falls: false,
            until_ns: u64::MAX,
        })
    }

    fn write(&mut self, offset: u32, value: u32, now: u64) -> Result<(), NoRegister> {
        self.settle(now);
        match offset {
            0x00 => {
                self.ctrl = NUMCOMP | (value & 1);
                let traces = value & 0x00ff_f000 != 0;
                self.notes
                    .note_if(traces, "CTRL: events and tracing are not modelled");
            }
            0x04 => self.count = value,
            // The lock access register. There is no lock for accesses by software.
            0xfb0 => {}
            _ => return Err(NoRegister),
        }
        Ok(())
    }

    fn reset(&mut self, _now: u64) {
        let old = std::mem::replace(self, Self::new(self.hclk));
        (self.notes, self.traces) = (old.notes, old.traces);
    }

    fn set_clocks(&mut self, clocks: &ClockTree, now: u64) {
        self.settle(now);
        self.hclk = clocks.hclk;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_counter_runs_with_hclk_while_enabled_and_keeps_its_value_while_not() {
        let mut dwt = Dwt::new(168_000_000);
        dwt.write(0x00, 1, 0).unwrap();
        assert_eq!(dwt.read(0x04, 1_000_000), Ok(0), "DEMCR.TRCENA is clear");
        dwt.enable(true, 1_000_000);
        assert_eq!(dwt.read(0x04, 2_000_000), Ok(168_000));
        dwt.set_clocks(&ClockTree::HSI, 2_000_000);
        assert_eq!(dwt.read(0x04, 3_000_000), Ok(184_000));
        dwt.write(0x00, 0, 3_000_000).unwrap();
        assert_eq!(dwt.read(0x04, 9_000_000), Ok(184_000));
    }

    #[test]
    fn the_counter_wraps_at_32_bits() {
        let mut dwt = Dwt::new(1_000_000_000);
        dwt.enable(true, 0);
        dwt.write(0x00, 1, 0).unwrap();
        dwt.write(0x04, u32::MAX, 0).unwrap();
        assert_eq!(dwt.read(0x04, 3), Ok(2));
    }
}
