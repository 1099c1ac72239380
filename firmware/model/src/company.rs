//! The intruders of the beads around: a bead in company.
//!
//! # Design
//!
//! In a row of absorbers the beads behind the host hold intruders too, and these take energy out of the wave and
//! give some of it back to the host. Estimate B reckons with them: each of its followers may hold an intruder,
//! and all of these are alike. How a bead in company rings depends on its neighbours, so the ringing tells of a
//! drift only where a bead is alone.

use crate::coefficients::Intruder;
use fixed::types::I0F32;
use serde::{Deserialize, Serialize};

/// Beads behind the host in the reduced chain of estimate B.
pub const FOLLOWERS: usize = 4;

/// Where there are other intruders, and coefficients of those behind. All zeros for a bead that is alone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Company {
    /// Which followers hold an intruder: bit 0 stands for the bead right behind the host.
    pub behind: u8,
    /// Whether beads near by hold one that no follower stands for: those in front, or further behind.
    pub elsewhere: bool,
    /// The intruder of each follower that holds one, SI units. Zeros if none does.
    pub intruder: Intruder<f32>,
    /// 2^2/12 · k dt²/m of that intruder.
    pub stiffness: I0F32,
    /// 1/12 · c dt/m of that intruder.
    pub damping: I0F32,
    /// m/(M - m): effect of its springs on the follower. It has as many powers of two more as the masses of the
    /// host ([`Scale::masses`](crate::scale::Scale::masses)).
    pub ratio: I0F32,
}

impl Company {
    /// Whether no other bead near by holds an intruder.
    pub fn is_alone(&self) -> bool {
        self.behind == 0 && !self.elsewhere
    }

    /// Whether the follower with this number, from 0, holds an intruder.
    #[inline(always)]
    pub(crate) fn holds(&self, follower: usize) -> bool {
        self.behind >> follower & 1 == 1
    }

    /// Whether there are so many followers, their intruder is one, and no coefficient is negative.
    pub(crate) fn is_bounded(&self, bead_mass: f32) -> bool {
        let Intruder {
            mass,
            stiffness,
            damping,
        } = self.intruder;
        let exists = [mass, stiffness, damping]
            .into_iter()
            .all(|value| value.is_finite() && value > 0.0);
        let positive = [self.stiffness, self.damping, self.ratio]
            .into_iter()
            .all(|value| value >= I0F32::ZERO);
        let none = *self
            == Self {
                elsewhere: self.elsewhere,
                ..Self::default()
            };
        none || self.behind < 1 << FOLLOWERS && self.behind > 0 && exists && mass < bead_mass && positive
    }
}
