//! External interrupts (RM0090 section 12.3): edges on pins (lines 0 to 15), of the voltage detector (16),
//! and of the RTC's alarm (17) and wake-up timer (22), and the software trigger for all lines. Only that
//! trigger moves lines 18 to 21 here.
//!
//! An edge sets the pending bit if the line's interrupt is enabled (section 12.2.4). An event (EMR) wakes
//! from STOP, and makes no interrupt.

use super::peripheral::{NoRegister, Notes, Peripheral};

/// Lines 0..=22.
const LINES: u32 = 0x007f_ffff;

/// The lines that share an interrupt: for each output of the model, in the order of [`Exti::INTERRUPTS`].
const SHARED: [u32; 14] = [
    0x1, 0x2, 0x4, 0x8, 0x10, 0x3e0, 0xfc00, 0x1_0000, 0x2_0000, 0x4_0000, 0x8_0000, 0x10_0000, 0x20_0000,
    0x40_0000,
];

#[derive(Debug, Clone, Default)]
pub(crate) struct Exti {
    imr: u32,
    emr: u32,
    rtsr: u32,
    ftsr: u32,
    swier: u32,
    pr: u32,
    /// The inputs of the edge detectors, `None` while no edge is watched.
    inputs: Option<u32>,
    /// An enabled edge has come. Cleared once it is passed on.
    pub(crate) edge_came: bool,
    pub(crate) notes: Notes,
}

impl Exti {
    /// The interrupts of the outputs (table 61): EXTI0 to EXTI4, EXTI9_5, EXTI15_10, the voltage detector,
    /// RTC alarm, USB FS, Ethernet and USB HS wake-up, tamper, RTC wake-up.
    pub(crate) const INTERRUPTS: [usize; 14] = [6, 7, 8, 9, 10, 23, 40, 1, 41, 42, 62, 76, 2, 3];

    pub(crate) fn watched(&self) -> u32 {
        self.rtsr | self.ftsr
    }

    /// Returns `true` if an edge on a line would raise an interrupt, or wake from STOP.
    pub(crate) fn listens(&self, line: usize, rising: bool) -> bool {
        let edges = if rising { self.rtsr } else { self.ftsr };
        edges & (self.imr & !self.pr | self.emr) & 1 << line != 0
    }

    /// Returns `true` if an edge on some pin would interrupt.
    pub(crate) fn listens_to_pins(&self) -> bool {
        self.watched() & self.imr & 0xffff != 0
    }

    /// The levels at the inputs of the watched lines. `None` if no line is watched.
    pub(crate) fn input(&mut self, levels: Option<u32>) {
        if let (Some(before), Some(now)) = (self.inputs, levels) {
            let edges = (now & !before & self.rtsr) | (before & !now & self.ftsr);
            self.pr |= edges & self.imr;
            self.edge_came |= edges & (self.imr | self.emr) != 0;
        }
        self.inputs = levels;
    }

    pub(crate) fn pending(&self) -> bool {
        self.pr & self.imr != 0
    }
}

impl Peripheral for Exti {
    fn read(&mut self, offset: u32, _now: u64) -> Result<u32, NoRegister> {
        Ok(match offset {
            0x00 => self.imr,
            0x04 => self.emr,
            0x08 => self.rtsr,
            0x0c => self.ftsr,
            0x10 => self.swier,
            0x14 => self.pr,
            _ => return Err(NoRegister),
        })
    }

    fn write(&mut self, offset: u32, value: u32, _now: u64) -> Result<(), NoRegister> {
        let value = value & LINES;
        match offset {
            0x00 => self.imr = value,
            0x04 => self.emr = value,
            0x08 => self.rtsr = value,
            0x0c => self.ftsr = value,
            0x10 => {
                // A bit that goes from 0 to 1 sets the pending bit, if the interrupt is enabled (section
                // 12.3.5).
                self.pr |= value & !self.swier & self.imr;
                self.swier |= value;
            }
            // Writing 1 clears, here and in SWIER.
            0x14 => {
                self.pr &= !value;
                self.swier &= !value;
            }
            _ => return Err(NoRegister),
        }
        Ok(())
    }

    fn reset(&mut self, _now: u64) {
        *self = Self::default();
    }

    fn interrupt(&self, output: usize) -> bool {
        self.pr & self.imr & SHARED[output] != 0
    }
}

#[cfg(test)]
mod tests {
    use super::super::peripheral::Access;
    use super::*;

    const IMR: u32 = 0x00;
    const EMR: u32 = 0x04;
    const RTSR: u32 = 0x08;
    const FTSR: u32 = 0x0c;
    const PR: u32 = 0x14;

    #[test]
    fn an_edge_is_pending_if_its_direction_and_its_interrupt_are_asked_for() {
        let mut exti = Exti::default();
        exti.put(0, [(IMR, 0b0111), (EMR, 0b1000), (RTSR, 0b1101), (FTSR, 0b0110)]);
        exti.input(Some(0b0000));
        exti.input(Some(0b1111));
        assert_eq!(exti.get(PR, 0), 0b0101, "rising: lines 0 and 2; 3 is an event");
        assert!(std::mem::take(&mut exti.edge_came));
        exti.put(0, [(PR, 0b0101)]);
        exti.input(Some(0b0000));
        assert_eq!(exti.get(PR, 0), 0b0110, "falling: lines 1 and 2");
        let listens = [(0, true), (2, true), (3, false)].map(|(line, rising)| exti.listens(line, rising));
        assert_eq!(listens, [true, false, false]);
        let up = (0..SHARED.len()).filter(|output| exti.interrupt(*output));
        let up: Vec<_> = up.map(|output| Exti::INTERRUPTS[output]).collect();
        assert_eq!(up, [7, 8]);
    }

    #[test]
    fn what_the_levels_were_before_an_edge_was_asked_for_is_no_edge() {
        let mut exti = Exti::default();
        exti.input(None);
        exti.put(0, [(IMR, 1), (RTSR, 1)]);
        exti.input(Some(1));
        exti.input(Some(1));
        assert!(!exti.pending());
    }
}
