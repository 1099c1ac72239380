//! The instructions of a loop, decoded once.

use super::decode::{Instruction, is_wide, narrow, wide};

/// Places of instructions, by bits 1 to 13 of their addresses: a handler and what it calls may be far apart.
const PLACES: usize = 1 << 13;
/// An address of no instruction.
const NOWHERE: u32 = u32::MAX;

/// An instruction that was fetched.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fetched {
    pub(super) at: u32,
    pub(super) next: u32,
    /// `None` if the interpreter does not know it.
    pub(super) instruction: Option<Instruction>,
    pub(super) executed: u64,
}

/// The instructions that were fetched, one at most for each place.
pub(super) struct Code {
    /// Numbers of instructions in `fetched`.
    places: Box<[u16]>,
    /// The first stands for no instruction.
    fetched: Vec<Fetched>,
    /// Addresses of the first instruction and of the last one.
    ends: [u32; 2],
}

impl Code {
    pub(super) fn new() -> Self {
        let nothing = Fetched {
            at: NOWHERE,
            next: 0,
            instruction: None,
            executed: 0,
        };
        Self {
            places: vec![0; PLACES].into(),
            fetched: vec![nothing],
            ends: [NOWHERE, 0],
        }
    }

    fn place(address: u32) -> usize {
        address as usize >> 1 & (PLACES - 1)
    }

    /// The instruction at the place of an address, which may have another address.
    #[inline(always)]
    pub(super) fn at(&self, address: u32) -> &Fetched {
        &self.fetched[self.number(address)]
    }

    #[inline(always)]
    fn number(&self, address: u32) -> usize {
        self.places[Self::place(address)].into()
    }

    #[inline(always)]
    pub(super) fn count(&mut self, address: u32) {
        let number = self.number(address);
        self.fetched[number].executed += 1;
    }

    /// Fetches the instruction at an address by its halfwords. `None` if a halfword is refused, or if
    /// another instruction that was counted is at its place.
    pub(super) fn fetch(&mut self, pc: u32, mut half: impl FnMut(u32) -> Option<u16>) -> Option<()> {
        if self.at(pc).executed > 0 || pc & 1 == 1 {
            return None;
        }
        let first = half(pc)?;
        let (instruction, next) = if is_wide(first) {
            let second = half(pc.wrapping_add(2))?;
            (wide(first, second, pc), pc.wrapping_add(4))
        } else {
            (narrow(first, pc), pc.wrapping_add(2))
        };
        let fetched = Fetched {
            at: pc,
            next,
            instruction,
            executed: 0,
        };
        match self.number(pc) {
            0 => {
                self.places[Self::place(pc)] = self.fetched.len() as u16;
                self.fetched.push(fetched);
            }
            number => self.fetched[number] = fetched,
        }
        self.ends = [self.ends[0].min(pc), self.ends[1].max(pc)];
        Some(())
    }

    /// Returns `true` if an instruction reaches into the word at an address, or begins beside it.
    #[inline(always)]
    pub(super) fn holds_near(&self, address: u32) -> bool {
        let first = (address & !1).saturating_sub(2);
        if first > self.ends[1] || first.saturating_add(6) < self.ends[0] {
            return false;
        }
        (0..4).any(|n| {
            let at = first.wrapping_add(2 * n);
            self.at(at).at == at
        })
    }

    /// Addresses of executed instructions, with their counts.
    pub(super) fn executed(&self) -> impl Iterator<Item = (u32, u64)> {
        let executed = self.fetched.iter().filter(|fetched| fetched.executed > 0);
        executed.map(|fetched| (fetched.at, fetched.executed))
    }

    /// Counts of executions, in the order in which the instructions were first fetched.
    pub(super) fn counts(&self) -> Vec<u64> {
        self.fetched.iter().map(|fetched| fetched.executed).collect()
    }

    /// Counts everything that was executed since `before` for `times` more times.
    pub(super) fn count_again(&mut self, before: &[u64], times: u64) {
        for (fetched, before) in self.fetched.iter_mut().zip(before) {
            fetched.executed += (fetched.executed - before) * times;
        }
    }
}
