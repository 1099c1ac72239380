//! The tables of a scenario: chain, striker, wall, intruders, sections and starts, in SI units.

use std::fmt;

use serde::de::{self, Deserializer, SeqAccess, Unexpected, Visitor};
use serde::{Deserialize, Serialize};

use super::contact::ContactLaw;
use super::drive::{Drive, is_zero};
use crate::oscillator::Oscillator;

/// One strike on one chain, in SI units. Beads are counted from 1; the striker is body 0.
///
/// Read it from TOML with [`Scenario::from_toml`] or [`Scenario::load`], or build it in code and check it
/// with [`Scenario::check`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Scenario {
    /// A title, for people.
    #[serde(default)]
    pub title: String,
    /// Time simulated, s. At t = 0 the striker touches bead 1, unless a [`Start`] puts a gap between them.
    pub duration: f64,
    /// The beads.
    pub chain: Chain,
    /// The sphere that hits bead 1.
    pub striker: Striker,
    /// The wall behind the last bead; without it the far end is free.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wall: Option<Wall>,
    /// Masses on springs inside beads.
    #[serde(default, rename = "intruder", skip_serializing_if = "Vec::is_empty")]
    pub intruders: Vec<Intruder>,
    /// Beads unlike the rest.
    #[serde(default, rename = "section", skip_serializing_if = "Vec::is_empty")]
    pub sections: Vec<Section>,
    /// Beads that move, or stand apart, when the run begins.
    #[serde(default, rename = "start", skip_serializing_if = "Vec::is_empty")]
    pub starts: Vec<Start>,
    /// A drive of the first end, in place of a strike.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drive: Option<Drive>,
    /// Law of the contacts; without it Hertz', with the damping of the materials.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contact: Option<ContactLaw>,
}

/// The beads of the chain, alike but for what [`Section`]s say.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Chain {
    /// Number of beads.
    pub beads: usize,
    /// Radius, m.
    pub radius: f64,
    /// Density, kg/m³.
    pub density: f64,
    /// Young's modulus, Pa.
    pub young: f64,
    /// Poisson's ratio.
    pub poisson: f64,
    /// Viscoelastic relaxation time τ of the material, s; 0 is elastic.
    pub relaxation: f64,
    /// Treatment of a total contact force below zero.
    #[serde(default)]
    pub contact_force: ContactForce,
    /// Static load F₀ that presses the chain together from before the strike, N. It pushes bead 1 forwards at
    /// all times, and the last bead back unless a wall does so. The striker touches bead 1 without force.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub precompression: f64,
    /// Gravity along a vertical chain, from the striker down to the wall, m/s². Each contact then carries the
    /// weight of all beads above it, and the run begins from that state at rest.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub gravity: f64,
    /// Time τ in which the ground would slow a bead to 1/e of its speed, s, by a force of M V/τ. Without
    /// it, there is no drag. The drag does not act on the striker or a driven body, nor on intruders.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drag_time: Option<f64>,
}

/// Treatment of a total contact force below zero, which the viscous term can cause while beads part.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ContactForce {
    /// Kept, as in the paper's equation: parting beads may pull a little.
    #[default]
    Printed,
    /// Cut off at zero (LAMMPS calls this `limit_damping`).
    Clipped,
}

/// The sphere that hits bead 1 at t = 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Striker {
    /// Radius, m.
    pub radius: f64,
    /// Density, kg/m³.
    pub density: f64,
    /// Young's modulus, Pa.
    pub young: f64,
    /// Poisson's ratio.
    pub poisson: f64,
    /// Speed at t = 0, m/s. It is zero for a striker that rests on a vertical chain, or whose place a drive
    /// moves.
    pub velocity: f64,
    /// Mass, kg; without it, that of a full sphere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mass: Option<f64>,
    /// Relaxation time of its material, s; without it, that of bead 1. The time of a contact follows from
    /// both bodies' ([`Contact::relaxation`](crate::Contact)).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub relaxation: Option<f64>,
}

/// A body behind the last bead. It does not move.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Wall {
    /// Young's modulus, Pa.
    pub young: f64,
    /// Poisson's ratio.
    pub poisson: f64,
    /// Radius, m; without it the wall is flat.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius: Option<f64>,
    /// Relaxation time of its material, s; without it, that of the last bead.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub relaxation: Option<f64>,
    /// Free space between the last bead and the wall at t = 0, m.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub gap: f64,
}

/// A mass on a spring and damper inside each of some beads, or inside another intruder there. Its mass is
/// part of the bead's, not added to it; it is not part of the other intruder's.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Intruder {
    /// The host beads.
    #[serde(deserialize_with = "read_beads")]
    pub beads: Vec<usize>,
    /// Mass m, kg.
    pub mass: f64,
    /// Stiffness k, N/m.
    pub stiffness: f64,
    /// Damping c, N·s/m.
    pub damping: f64,
    /// Cubic stiffness k₃, N/m³: the spring's force is k x + k₃ x³. Below zero it softens.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub cubic_stiffness: f64,
    /// Number of the earlier `[[intruder]]` table, counted from 1, whose intruders carry these ones: spring
    /// and damper join the two, and not this one and the bead. Without it, the beads carry them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inside: Option<usize>,
}

/// Beads unlike the rest. Each value given here replaces that of [`Chain`].
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Section {
    /// The beads. A file may give a single number in place of a list.
    #[serde(deserialize_with = "read_beads")]
    pub beads: Vec<usize>,
    /// Radius, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius: Option<f64>,
    /// Density, kg/m³.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub density: Option<f64>,
    /// Young's modulus, Pa.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub young: Option<f64>,
    /// Poisson's ratio.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub poisson: Option<f64>,
    /// Relaxation time, s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub relaxation: Option<f64>,
}

/// Beads that do not begin at rest and in touch. Without this table all beads begin so, and only the striker
/// moves.
///
/// Beads can act as strikers: the first beads, at the striker's velocity, hit the rest together with it, and
/// a last bead with a velocity below zero hits the chain from behind. An intruder begins at rest in its host
/// and moves with it, unless this table says otherwise.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Start {
    /// The beads. A file may give a single number in place of a list.
    #[serde(deserialize_with = "read_beads")]
    pub beads: Vec<usize>,
    /// Velocity of each at t = 0, m/s; positive away from the striker.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub velocity: f64,
    /// Free space at t = 0 between each of these beads and the body before it, m.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub gap: f64,
    /// Displacement of each at t = 0 from where it rests or touches, m; positive away from the striker. It
    /// presses the bead into one neighbour and takes it from the other.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub displacement: f64,
    /// Displacement of the intruders in each at t = 0, of each relative to its host or carrier, m.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub intruder_displacement: f64,
    /// Velocity of the intruders in each at t = 0, of each relative to its host or carrier, m/s.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub intruder_velocity: f64,
}

/// Reads the number of a bead, or a list of such numbers.
fn read_beads<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<usize>, D::Error> {
    struct BeadsVisitor;

    impl<'de> Visitor<'de> for BeadsVisitor {
        type Value = Vec<usize>;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("the number of a bead, or a list of such numbers")
        }

        fn visit_i64<E: de::Error>(self, number: i64) -> Result<Vec<usize>, E> {
            let bead = u64::try_from(number);
            bead.map_err(|_| E::invalid_value(Unexpected::Signed(number), &self))
                .and_then(|bead| self.visit_u64(bead))
        }

        fn visit_u64<E: de::Error>(self, number: u64) -> Result<Vec<usize>, E> {
            Ok(vec![usize::try_from(number).unwrap_or(usize::MAX)])
        }

        fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Vec<usize>, A::Error> {
            let mut beads = Vec::new();
            while let Some(bead) = list.next_element()? {
                beads.push(bead);
            }
            Ok(beads)
        }
    }

    deserializer.deserialize_any(BeadsVisitor)
}

impl Start {
    /// Beads that move at `velocity`, m/s, from where they touch.
    pub fn moving(beads: impl IntoIterator<Item = usize>, velocity: f64) -> Self {
        Self {
            beads: beads.into_iter().collect(),
            velocity,
            ..Self::default()
        }
    }

    /// Beads that stand still at a `displacement`, m, from where they rest or touch.
    pub fn displaced(beads: impl IntoIterator<Item = usize>, displacement: f64) -> Self {
        Self {
            beads: beads.into_iter().collect(),
            displacement,
            ..Self::default()
        }
    }

    /// Beads that stand `gap`, m, behind the body before each.
    pub fn apart(beads: impl IntoIterator<Item = usize>, gap: f64) -> Self {
        Self {
            beads: beads.into_iter().collect(),
            gap,
            ..Self::default()
        }
    }
}

/// The material of a body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// Density, kg/m³.
    pub density: f64,
    /// Young's modulus, Pa.
    pub young: f64,
    /// Poisson's ratio.
    pub poisson: f64,
}

impl Material {
    /// A material of a density in kg/m³, a Young's modulus in Pa and a Poisson's ratio.
    pub const fn new(density: f64, young: f64, poisson: f64) -> Self {
        Self {
            density,
            young,
            poisson,
        }
    }
}

impl Chain {
    /// Elastic beads in touch, without a static load. `radius` is in m.
    pub const fn new(beads: usize, radius: f64, material: Material) -> Self {
        Self {
            beads,
            radius,
            density: material.density,
            young: material.young,
            poisson: material.poisson,
            relaxation: 0.0,
            contact_force: ContactForce::Printed,
            precompression: 0.0,
            gravity: 0.0,
            drag_time: None,
        }
    }

    /// The material of the beads; sections may give another.
    pub fn material(&self) -> Material {
        Material::new(self.density, self.young, self.poisson)
    }
}

impl Striker {
    /// A full sphere of `radius`, m, at `velocity`, m/s, with the relaxation time of bead 1.
    pub const fn new(radius: f64, material: Material, velocity: f64) -> Self {
        Self {
            radius,
            density: material.density,
            young: material.young,
            poisson: material.poisson,
            velocity,
            mass: None,
            relaxation: None,
        }
    }

    /// The material of the striker.
    pub fn material(&self) -> Material {
        Material::new(self.density, self.young, self.poisson)
    }
}

impl Wall {
    /// A flat wall with the relaxation time of the last bead.
    pub const fn flat(material: Material) -> Self {
        Self {
            young: material.young,
            poisson: material.poisson,
            radius: None,
            relaxation: None,
            gap: 0.0,
        }
    }
}

impl Section {
    /// Beads that are like the rest until a value is set.
    pub fn of(beads: impl IntoIterator<Item = usize>) -> Self {
        Self {
            beads: beads.into_iter().collect(),
            ..Self::default()
        }
    }
}

impl Intruder {
    /// One oscillator in each of some beads.
    pub fn new(beads: impl IntoIterator<Item = usize>, oscillator: Oscillator) -> Self {
        Self {
            beads: beads.into_iter().collect(),
            mass: oscillator.mass,
            stiffness: oscillator.stiffness,
            damping: oscillator.damping,
            cubic_stiffness: 0.0,
            inside: None,
        }
    }

    /// The mass on its spring and damper, without its hosts, as it moves at small strokes.
    pub fn oscillator(&self) -> Oscillator {
        Oscillator::new(self.mass, self.stiffness, self.damping)
    }
}

/// A body after the sections have been applied.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Sphere {
    pub(crate) radius: f64,
    pub(crate) material: Material,
    pub(crate) relaxation: f64,
}

impl Sphere {
    pub(crate) fn mass(&self) -> f64 {
        4.0 / 3.0 * std::f64::consts::PI * self.radius.powi(3) * self.material.density
    }
}

impl Scenario {
    /// A strike of `striker` on `chain`, simulated for `duration`, s: no wall, no intruders, all beads alike.
    pub const fn new(duration: f64, chain: Chain, striker: Striker) -> Self {
        Self {
            title: String::new(),
            duration,
            chain,
            striker,
            wall: None,
            intruders: Vec::new(),
            sections: Vec::new(),
            starts: Vec::new(),
            drive: None,
            contact: None,
        }
    }

    /// The scenario as TOML. [`Scenario::from_toml`] reads an equal one from it.
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("tables, numbers and strings are TOML")
    }

    /// Beads 1 to N of the chain, at index 0 to N - 1.
    pub(crate) fn spheres(&self) -> Vec<Sphere> {
        let chain = &self.chain;
        let like = |of: &Section| Sphere {
            radius: of.radius.unwrap_or(chain.radius),
            material: Material::new(
                of.density.unwrap_or(chain.density),
                of.young.unwrap_or(chain.young),
                of.poisson.unwrap_or(chain.poisson),
            ),
            relaxation: of.relaxation.unwrap_or(chain.relaxation),
        };
        let mut spheres = vec![like(&Section::default()); chain.beads];
        for section in &self.sections {
            for bead in &section.beads {
                spheres[bead - 1] = like(section);
            }
        }
        spheres
    }
}
