//! The intruders of the beads around: a bead in company.
//!
//! # Design
//!
//! In a row of absorbers the beads behind the host hold intruders too, and these take energy out of the wave
//! and give some of it back to the host. Estimate B reckons with them: each of its followers may hold an
//! intruder, and all of these are alike. How a bead in company rings depends on its neighbours, so the
//! ringing tells of a drift only where a bead is alone.

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
    /// m/(M - m): effect of its springs on the follower. It has as many powers of two more as the masses of
    /// the host ([`Scale::masses`](crate::scale::Scale::masses)).
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Of a bead of 50 g, with intruders in these followers.
    fn company(behind: u8) -> Company {
        Company {
            behind,
            intruder: Intruder {
                mass: 3.7e-3,
                stiffness: 3.95e5,
                damping: 12.0,
            },
            stiffness: I0F32::from_num(0.1),
            damping: I0F32::from_num(0.1),
            ratio: I0F32::from_num(0.1),
            ..Company::default()
        }
    }

    #[test]
    fn a_bead_is_alone_if_no_other_holds_an_intruder_near_or_far() {
        let elsewhere = Company {
            elsewhere: true,
            ..Company::default()
        };
        assert!(Company::default().is_alone());
        assert!(!elsewhere.is_alone());
        assert!(!company(4).is_alone());
        assert!(
            !Company {
                elsewhere: true,
                ..company(4)
            }
            .is_alone()
        );
    }

    #[test]
    fn each_bit_stands_for_a_follower() {
        for behind in 0..16 {
            let held = [0, 1, 2, 3].map(|follower| company(behind).holds(follower));
            assert_eq!(
                held,
                [1, 2, 4, 8].map(|bit| behind % (2 * bit) >= bit),
                "{behind}"
            );
        }
    }

    #[test]
    fn company_has_no_numbers_or_those_of_an_intruder_in_one_of_four_followers() {
        const BEAD: f32 = 0.05;
        let allowed = |company: Company| company.is_bounded(BEAD);
        let with = |change: fn(&mut Company)| {
            let mut company = company(1);
            change(&mut company);
            allowed(company)
        };
        assert!(allowed(Company::default()));
        for behind in 0..=17 {
            assert_eq!(allowed(company(behind)), (1..16).contains(&behind), "{behind:#b}");
        }
        assert!(with(|company| company.elsewhere = true));
        assert!(with(|company| *company = Company {
            elsewhere: true,
            ..Company::default()
        }));
        // Intruders that stand nowhere have no numbers.
        assert!(!with(|company| *company = Company {
            ratio: company.ratio,
            ..Company::default()
        }));
        type Number = fn(&mut Company) -> &mut f32;
        let numbers: [Number; 3] = [
            |company| &mut company.intruder.mass,
            |company| &mut company.intruder.stiffness,
            |company| &mut company.intruder.damping,
        ];
        for number in numbers {
            for value in [0.0, -1.0, f32::NAN, f32::INFINITY] {
                let mut company = company(1);
                *number(&mut company) = value;
                assert!(!allowed(company), "{company:?}");
            }
        }
        assert!(!with(|company| company.intruder.mass = BEAD));
        assert!(with(|company| company.intruder.mass = 0.999 * BEAD));
        assert!(!with(|company| company.stiffness = -I0F32::DELTA));
        assert!(!with(|company| company.damping = -I0F32::DELTA));
        assert!(!with(|company| company.ratio = -I0F32::DELTA));
        assert!(with(|company| company.ratio = I0F32::ZERO));
    }
}
