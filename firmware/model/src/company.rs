//! The beads behind the host, where they are not like it: a bead in company.
//!
//! # Design
//!
//! In a row of absorbers the beads behind the host hold intruders too, and these take energy out of the wave
//! and give some of it back to the host. Estimate B takes them into account: each of its followers may hold
//! an intruder, and all of these are alike. Each follower may have a mass and a contact of its own, too; a
//! wall is a bead that nothing moves. The ringing of a bead in company depends on its neighbours, so it
//! reveals a drift only where a bead is alone.

use fixed::types::{I0F32, I2F30, I8F24};
use serde::Serialize;

use crate::quantity::Length;

/// Beads behind the host in the reduced chain of estimate B.
pub const FOLLOWERS: usize = 6;

/// Where there are other intruders, and coefficients of the beads behind. A bead that is alone among beads
/// like it needs none of the coefficients.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Company {
    /// The followers that hold an intruder: bit 0 stands for the bead right behind the host.
    pub behind: u8,
    /// True if beads near by hold an intruder that no follower represents: those in front, or further behind.
    pub elsewhere: bool,
    /// True if the beads behind, or their contacts, are not like the host.
    pub unlike: bool,
    /// 2^2/12 · k dt²/m of the intruders behind.
    pub stiffness: I0F32,
    /// 1/12 · c dt/m of these intruders.
    pub damping: I0F32,
    /// The beads behind.
    pub followers: [Follower; FOLLOWERS],
}

/// Coefficients of a bead behind the host, and of the contact in front of it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Follower {
    /// As [`ReducedChain::contact`](crate::reduced_chain::ReducedChain::contact), with the same powers of
    /// two.
    pub contact: I0F32,
    /// As [`ReducedChain::relaxation`](crate::reduced_chain::ReducedChain::relaxation).
    pub relaxation: I2F30,
    /// Overlap at rest, by the force that presses the chain together, µm.
    pub overlap: Length,
    /// Acceleration of a host by that force, in twelfths, as bits of [`Step`](crate::quantity::Step).
    pub load: i32,
    /// Mass of the host over that of this bead; 0 for a wall.
    pub lightness: I8F24,
    /// m/(M - m) of its intruder: effect of the springs on the bead. The same powers of two are taken out of
    /// it as of the masses of the host ([`Scale::masses`](crate::scale::Scale::masses)).
    pub ratio: I0F32,
}

impl Company {
    /// True if no other bead near by holds an intruder.
    pub fn is_alone(&self) -> bool {
        self.behind == 0 && !self.elsewhere
    }

    /// True if the beads behind are like the host, without intruders.
    pub(crate) fn is_uniform(&self) -> bool {
        self.behind == 0 && !self.unlike
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
        for behind in 0..64 {
            for elsewhere in [false, true] {
                let company = Company {
                    behind,
                    elsewhere,
                    ..Company::default()
                };
                assert_eq!(company.is_alone(), behind == 0 && !elsewhere);
                let held = [0, 1, 2, 3, 4, 5].map(|follower| company.holds(follower));
                let stated = [1, 2, 4, 8, 16, 32].map(|bit| behind % (2 * bit) >= bit);
                assert_eq!(held, stated, "{behind}");
            }
        }
    }
}
