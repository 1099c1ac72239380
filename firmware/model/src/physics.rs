//! The bead, its intruder and its neighbours, in SI units.

use core::f64::consts::PI;

use serde::{Deserialize, Serialize};

use crate::company::FOLLOWERS;

/// Energy of the solitary wave of an elastic chain: `E = 1.0465162 κ^{-2/3} F_m^{5/3}`, for beads of any
/// mass. Found from the pulse at contact 70 of a chain with κ = M = 1, integrated to 1e-12. The number of
/// beads around the pulse that are counted changes it by less than 1e-15.
pub const SOLITARY_WAVE_ENERGY: f64 = 1.046_516_203;

/// Time from contact to contact of a solitary wave of an elastic chain, `t = 1.10444 √M κ^(-1/3) F_m^(-1/6)`.
/// Found as [`SOLITARY_WAVE_ENERGY`] is.
pub(crate) const SOLITARY_WAVE_DELAY: f64 = 1.104_44;

/// w of [`Bead::pulse_width`]. Found from the pulse at contact 70 of an elastic chain; a test finds it again.
const PULSE_WIDTH: f64 = 1.556;
/// Least width of the pulse of a wave of 1 m/s, samples. Estimate A is then off by 0.2 %, and estimate B by
/// 6 % (`cargo test -p bead-model spheres -- --nocapture`).
pub const LEAST_WIDTH: f64 = 2.5;

/// A bead with its intruder and the chain that it stands in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bead {
    /// M, mass of the host with its intruder, and of each bead behind it, kg.
    pub mass: f64,
    /// m, mass of the intruder, kg.
    pub intruder_mass: f64,
    /// Mass in front of the crystal of the force sensor, kg. It is a part of M that the measured force does
    /// not move.
    pub front_mass: f64,
    /// k, stiffness of the intruder's springs, N/m.
    pub stiffness: f64,
    /// c, damping of the intruder, N·s/m.
    pub damping: f64,
    /// κ, stiffness of the contacts between beads, N/m^1.5.
    pub contact_stiffness: f64,
    /// τ, relaxation time of those contacts, s.
    pub relaxation: f64,
}

impl Bead {
    /// The paper's bead: Bakelite, R = 19 mm, Y = 4.5 GPa as fitted; m = 3.7 g, k = 3.95e5 N/m, c = 12 N·s/m.
    pub fn paper() -> Self {
        let (radius, density, young, poisson) = (0.019_f64, 1775.0, 4.5e9, 0.44_f64);
        let theta = 0.75 * (1.0 - poisson * poisson) / young;
        Self {
            mass: 4.0 / 3.0 * PI * (radius * radius * radius) * density,
            intruder_mass: 3.7e-3,
            front_mass: 0.0,
            stiffness: 3.95e5,
            damping: 12.0,
            contact_stiffness: 1.0 / (2.0 * theta) / libm::sqrt(2.0 / radius),
            relaxation: 4.2e-6,
        }
    }

    /// The intruder of this bead.
    pub fn intruder(&self) -> Intruder {
        Intruder {
            mass: self.intruder_mass,
            stiffness: self.stiffness,
            damping: self.damping,
        }
    }

    /// Full width at half its height, s, of the pulse of force of a solitary wave that moves the beads of an
    /// elastic chain with at most `speed`, m/s: `w (M/κ)^{2/5} speed^{-1/5}`.
    pub fn pulse_width(&self, speed: f64) -> f64 {
        PULSE_WIDTH * power(self.mass / self.contact_stiffness, 0.4) * power(speed, -0.2)
    }
}

/// `base^exponent` for a base above 0. `libm`'s own power takes 3 KiB more of the image.
pub(crate) fn power(base: f64, exponent: f64) -> f64 {
    libm::expm1(libm::log(base) * exponent) + 1.0
}

/// A mass on springs inside a bead.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Intruder {
    /// m, its mass, kg.
    pub mass: f64,
    /// k, stiffness of its springs, N/m.
    pub stiffness: f64,
    /// c, its damping, N·s/m.
    pub damping: f64,
}

/// The intruders of the beads near by. All zeros for a bead that is alone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct Neighbours {
    /// The beads behind the host that hold an intruder, by their places: 123456 for all six, 0 for none.
    pub behind: u32,
    /// 1 if beads near by hold an intruder that `behind` does not name: in front, or further behind.
    pub elsewhere: u8,
    /// Mass of the intruder in each bead that `behind` names, kg.
    pub mass: f64,
    /// Stiffness of its springs, N/m.
    pub stiffness: f64,
    /// Its damping, N·s/m.
    pub damping: f64,
}

impl Neighbours {
    /// Neighbours that hold `intruder` where `behind` is true, starting with the bead next to the host.
    pub fn new(behind: [bool; FOLLOWERS], elsewhere: bool, intruder: Intruder) -> Self {
        let places = (1..).zip(behind).filter(|(_, holds)| *holds);
        let Intruder {
            mass,
            stiffness,
            damping,
        } = intruder;
        Self {
            behind: places.fold(0, |digits, (place, _)| 10 * digits + place),
            elsewhere: elsewhere.into(),
            mass,
            stiffness,
            damping,
        }
    }

    /// `behind` as bits, bit 0 for the bead right behind the host. `None` for a digit other than 1 to 6, or
    /// one that occurs twice.
    pub fn places(&self) -> Option<u8> {
        let (mut digits, mut bits) = (self.behind, 0);
        while digits > 0 {
            let place = digits % 10;
            digits /= 10;
            let bit = if (1..=FOLLOWERS as u32).contains(&place) {
                1 << (place - 1)
            } else {
                return None;
            };
            if bits & bit != 0 {
                return None;
            }
            bits |= bit;
        }
        Some(bits)
    }

    /// True if the follower with this number, from 0, holds an intruder.
    pub fn holds(&self, follower: usize) -> bool {
        self.places().is_some_and(|bits| bits >> follower & 1 == 1)
    }

    /// The intruder in each bead that `behind` names.
    pub fn intruder(&self) -> Intruder {
        Intruder {
            mass: self.mass,
            stiffness: self.stiffness,
            damping: self.damping,
        }
    }
}

/// The six beads behind the host, from the one next to it on, where they are not like the host. A wave goes
/// on behind the last of them as if all others were like it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Followers {
    /// Mass of each with its intruder, kg.
    pub mass: [f32; FOLLOWERS],
    /// κ of the contact in front of each, N/m^1.5; 0 where the chain has ended.
    pub stiffness: [f32; FOLLOWERS],
    /// τ of that contact, s.
    pub relaxation: [f32; FOLLOWERS],
    /// Place of a wall, from 1, in place of a bead; 0 for none.
    #[serde(default)]
    pub wall: u8,
    /// Force that presses the chain together at rest, N.
    #[serde(default)]
    pub load: f32,
}

/// The beads around a host.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Surroundings {
    /// The intruders in them.
    pub intruders: Neighbours,
    /// Those behind, if they are not like the host.
    pub followers: Option<Followers>,
}

impl From<Neighbours> for Surroundings {
    fn from(intruders: Neighbours) -> Self {
        Self {
            intruders,
            followers: None,
        }
    }
}

impl Followers {
    /// Followers that are like the host.
    pub fn like(bead: &Bead) -> Self {
        Self {
            mass: [bead.mass as f32; FOLLOWERS],
            stiffness: [bead.contact_stiffness as f32; FOLLOWERS],
            relaxation: [bead.relaxation as f32; FOLLOWERS],
            wall: 0,
            load: 0.0,
        }
    }

    /// True if a wall stands in the place of the follower with this number, from 0.
    pub fn is_wall(&self, follower: usize) -> bool {
        usize::from(self.wall) == follower + 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pulse_shortens_with_the_fifth_root_of_the_speed() {
        let bead = Bead::paper();
        assert!((bead.pulse_width(32.0) / bead.pulse_width(1.0) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn places_are_digits_from_1_to_6_each_at_most_once() {
        let places = |behind| {
            Neighbours {
                behind,
                ..Neighbours::default()
            }
            .places()
        };
        for (behind, bits) in [(0, 0), (4, 8), (13, 0b101), (31, 0b101), (654321, 63)] {
            assert_eq!(places(behind), Some(bits), "{behind}");
        }
        for behind in [7, 9, 10, 11, 17, 105, 1231, 1234567, u32::MAX] {
            assert_eq!(places(behind), None, "{behind}");
        }
        for bits in 0..64_u8 {
            let behind = core::array::from_fn(|follower| bits >> follower & 1 == 1);
            let neighbours = Neighbours::new(behind, bits == 3, Intruder::default());
            assert_eq!(neighbours.places(), Some(bits));
            assert_eq!(
                [0, 1, 2, 3, 4, 5].map(|follower| neighbours.holds(follower)),
                behind
            );
            assert_eq!(neighbours.elsewhere, u8::from(bits == 3));
        }
    }
}
