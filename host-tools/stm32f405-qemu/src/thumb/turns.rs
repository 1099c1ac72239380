//! Turns of a loop that are all the same.
//!
//! # Design
//!
//! At a branch backwards the registers are compared with those at an earlier one (Brent 1980: it moves on
//! after 1, 2, 4, ... branches). If they are equal, if memory and the registers that were written are too,
//! and if what was read keeps its value, then the same turn follows again and again.

use super::registers::Registers;

#[derive(Debug, Default)]
pub(super) struct Turns {
    earlier: Registers,
    /// Time of the earlier branch, and number of instructions up to it.
    began: (u64, u64),
    /// Time up to which everything keeps its value that was read since.
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

/// A branch backwards, by what came before it.
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

    /// A branch backwards, at this time and after so many instructions. `is_as_kept` says if memory is as at
    /// the earlier one.
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

    /// The turns that repeat were counted: what follows is looked at anew.
    pub(super) fn restart(&mut self) {
        *self = Self::default();
    }
}
