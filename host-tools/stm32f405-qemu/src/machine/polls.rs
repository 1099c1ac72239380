//! Detection of the register that the processor polls.
//!
//! # Design
//!
//! A loop that waits for a register reads it again and again. Accesses are examined in windows. Within a
//! window, a majority vote (Boyer and Moore) finds the address that has more accesses than all others
//! together, with a single counter.

/// Accesses in a window: about a second of real time.
const WINDOW: u32 = 1 << 19;
/// A lead of 0.8 of the window: nine accesses of ten.
const CERTAIN: u32 = WINDOW / 10 * 8;
/// Least accesses in a window before its result replaces that of the previous one.
const FEW: u32 = 1000;

#[derive(Debug, Clone, Default)]
pub(super) struct Polls {
    candidate: u32,
    lead: u32,
    accesses: u32,
    before: Option<u32>,
}

impl Polls {
    /// Counts an access. If it ends a window in which nearly all accesses went to one register, returns the
    /// address of that register.
    pub(super) fn accessed(&mut self, address: u32) -> Option<u32> {
        self.accesses += 1;
        if address == self.candidate {
            self.lead += 1;
        } else if self.lead == 0 {
            (self.candidate, self.lead) = (address, 1);
        } else {
            self.lead -= 1;
        }
        if self.accesses < WINDOW {
            return None;
        }
        let certain = (self.lead > CERTAIN).then_some(self.candidate);
        let before = self.busy_with();
        *self = Self::default();
        self.before = before;
        certain
    }

    /// The register that most accesses went to.
    pub(super) fn busy_with(&self) -> Option<u32> {
        let now = (self.lead > self.accesses / 4).then_some(self.candidate);
        if self.accesses < FEW { self.before } else { now }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_loop_on_one_register_is_found_and_one_on_two_is_not() {
        let mut polls = Polls::default();
        let found = (0..2 * WINDOW).filter_map(|n| polls.accessed(if n % 20 == 0 { 4 } else { 8 }));
        assert_eq!(found.collect::<Vec<_>>(), [8, 8]);
        assert_eq!(polls.busy_with(), Some(8));
        let mut polls = Polls::default();
        assert_eq!((0..2 * WINDOW).find_map(|n| polls.accessed(4 * (n % 2))), None);
        assert_eq!(polls.busy_with(), None);
    }
}
