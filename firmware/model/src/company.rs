//! The intruders of the beads around: a bead in company.
//!
//! # Design
//!
//! In a row of absorbers the beads behind the host hold intruders too, and these take energy out of the wave
//! and give some of it back to the host. Estimate B reckons with them: each of its followers may hold an
//! intruder, and all of these are alike. How a bead in company rings depends on its neighbours, so the
//! ringing tells of a drift only where a bead is alone.

use fixed::types::I0F32;
use serde::Serialize;

/// Beads behind the host in the reduced chain of estimate B.
pub const FOLLOWERS: usize = 4;

/// Where there are other intruders, and coefficients of those behind. All zeros for a bead that is alone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Company {
    /// The followers that hold an intruder: bit 0 stands for the bead right behind the host.
    pub behind: u8,
    /// True if beads near by hold one that no follower stands for: those in front, or further behind.
    pub elsewhere: bool,
    /// 2^2/12 · k dt²/m of that intruder.
    pub stiffness: I0F32,
    /// 1/12 · c dt/m of that intruder.
    pub damping: I0F32,
    /// m/(M - m): effect of its springs on the follower. It has as many powers of two more as the masses of
    /// the host ([`Scale::masses`](crate::scale::Scale::masses)).
    pub ratio: I0F32,
}

impl Company {
    /// True if no other bead near by holds an intruder.
    pub fn is_alone(&self) -> bool {
        self.behind == 0 && !self.elsewhere
    }

    /// True if the follower with this number, from 0, holds an intruder.
    #[inline(always)]
    pub(crate) fn holds(&self, follower: usize) -> bool {
        self.behind >> follower & 1 == 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bead_is_alone_if_no_other_holds_an_intruder_and_each_bit_stands_for_a_follower() {
        for behind in 0..16 {
            for elsewhere in [false, true] {
                let company = Company {
                    behind,
                    elsewhere,
                    ..Company::default()
                };
                assert_eq!(company.is_alone(), behind == 0 && !elsewhere);
                let held = [0, 1, 2, 3].map(|follower| company.holds(follower));
                let stated = [1, 2, 4, 8].map(|bit| behind % (2 * bit) >= bit);
                assert_eq!(held, stated, "{behind}");
            }
        }
    }
}
