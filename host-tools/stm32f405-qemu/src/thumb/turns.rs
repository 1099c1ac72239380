//! Turns of a loop that are all the same.
//!
//! # Design
//!
//! At a branch backwards the registers are compared with those at an earlier one, which moves on after 1, 2,
//! 4, ... branches (Brent 1980). If they are equal, if memory and the registers that were written are too,
//! and if everything that was read keeps its value, the turn repeats.

use super::registers::Registers;

#[derive(Debug, Default)]
pub(super) struct Turns {
    earlier: Registers,
    /// Time of the earlier branch, and number of instructions up to it.
    began: (u64, u64),
    /// Time up to which everything that was read since then keeps its value.
    holds_until: u64,
    changed_memory: bool,
    branches: u32,
    next_earlier: u32,
}

/// A turn that repeats.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Turn {
    pub(super) ns: u64,
    pub(super) instructions: u64,
    /// The time before which it has to end.
    pub(super) holds_until: u64,
}

/// Role of a branch backwards.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Branch {
    /// The end of a turn that repeats.
    Repeats(Turn),
    /// The branch that later ones are compared with.
    Earlier,
    Other,
}

impl Turns {
    pub(super) fn read(&mut self, holds_until: u64) {
        self.holds_until = self.holds_until.min(holds_until);
    }

    pub(super) fn changed_memory(&mut self) {
        self.changed_memory = true;
    }

    /// Classifies a branch backwards, at this time and after a number of instructions. `is_as_kept` returns
    /// `true` if memory is as it was at the earlier branch.
    pub(super) fn branch(
        &mut self,
        registers: &Registers,
        now: u64,
        instructions: u64,
        is_as_kept: impl FnOnce() -> bool,
    ) -> Branch {
        self.branches += 1;
        let over = now >= self.holds_until;
        if self.next_earlier > 0
            && !self.changed_memory
            && !over
            && *registers == self.earlier
            && is_as_kept()
        {
            let (at, before) = self.began;
            return Branch::Repeats(Turn {
                ns: now - at,
                instructions: instructions - before,
                holds_until: self.holds_until,
            });
        }
        if over || self.branches >= self.next_earlier {
            self.next_earlier = if over { 1 } else { (2 * self.next_earlier).max(1) };
            self.branches = 0;
            self.earlier = *registers;
            self.began = (now, instructions);
            self.holds_until = u64::MAX;
            self.changed_memory = false;
            return Branch::Earlier;
        }
        Branch::Other
    }

    /// Starts anew, after repeated turns were counted.
    pub(super) fn restart(&mut self) {
        *self = Self::default();
    }
}
