//! The instructions of a loop, decoded once.

use super::decode::{Instruction, is_wide, narrow, wide};

/// Number of instructions, by bits 1 to 9 of their addresses.
const PLACES: usize = 512;
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

/// The instructions that were fetched, each at the place of its address.
pub(super) struct Code {
    places: Box<[Fetched; PLACES]>,
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
            places: Box::new([nothing; PLACES]),
            ends: [NOWHERE, 0],
        }
    }

    fn place(address: u32) -> usize {
        address as usize >> 1 & (PLACES - 1)
    }

    /// The instruction at the place of an address, which may have another address.
    #[inline(always)]
    pub(super) fn at(&self, address: u32) -> &Fetched {
        &self.places[Self::place(address)]
    }

    #[inline(always)]
    pub(super) fn count(&mut self, address: u32) {
        self.places[Self::place(address)].executed += 1;
    }

    /// Fetches the instruction at an address by its halfwords. `None` if that is refused, or if another one
    /// with counts is at its place.
    pub(super) fn fetch(&mut self, pc: u32, mut half: impl FnMut(u32) -> Option<u16>) -> Option<()> {
        let fetched = &mut self.places[Self::place(pc)];
        if fetched.executed > 0 || pc & 1 == 1 {
            return None;
        }
        let first = half(pc)?;
        let (instruction, next) = if is_wide(first) {
            let second = half(pc.wrapping_add(2))?;
            (wide(first, second, pc), pc.wrapping_add(4))
        } else {
            (narrow(first, pc), pc.wrapping_add(2))
        };
        *fetched = Fetched {
            at: pc,
            next,
            instruction,
            executed: 0,
        };
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
        let executed = self.places.iter().filter(|fetched| fetched.executed > 0);
        executed.map(|fetched| (fetched.at, fetched.executed))
    }

    /// How often each was executed, place by place.
    pub(super) fn counts(&self) -> Vec<u64> {
        self.places.iter().map(|fetched| fetched.executed).collect()
    }

    /// Counts what was executed since these counts for a number of further times.
    pub(super) fn count_again(&mut self, before: &[u64], times: u64) {
        for (fetched, before) in self.places.iter_mut().zip(before) {
            fetched.executed += (fetched.executed - before) * times;
        }
    }
}
