//! Linear waves of a loaded chain of equal beads, with an equal intruder in each or without any.
//!
//! Small waves see a spring K = (3/2) κ^(2/3) F₀^(1/3) at each contact. A wave of wave number q (radians from
//! bead to bead) in shells of m₁ = M - m, each with a mass m on a spring k, has
//!
//! ```text
//! m₁ m ω⁴ - [k (m₁ + m) + 4 K m sin²(q/2)] ω² + 4 K k sin²(q/2) = 0
//! ```
//!
//! from the equations of motion with V, u ~ exp(i(q n - ω t)). Dampers and viscous contacts are left out:
//! they widen the edges and do not move them at first order. The lesser root is the acoustic branch, in which
//! bead and intruder move together; the greater one is the optical branch. Between them lies a gap.

use std::f64::consts::{PI, TAU};

use serde::Serialize;

use crate::model::Model;
use crate::oscillator::Oscillator;
use crate::scenario::{InputError, Scenario};

/// Dispersion of linear waves in an endless chain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dispersion {
    /// Stiffness of a contact against small changes, N/m.
    stiffness: f64,
    /// Mass of a bead with its intruder, kg.
    mass: f64,
    intruder: Option<Oscillator>,
}

/// Frequencies of one wave number, Hz.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BranchFrequencies {
    /// Acoustic branch.
    pub acoustic: f64,
    /// Optical branch; `None` without intruders.
    pub optical: Option<f64>,
}

/// Bands of linear waves. They pass up to the acoustic top and, with intruders, from the end of the gap to
/// the optical top.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
#[non_exhaustive]
pub struct Bands {
    /// Highest frequency of the acoustic band, where neighbours move against each other.
    #[serde(rename = "acoustic_top_hz")]
    pub acoustic_top: f64,
    /// End of the gap above it, where all shells move against their intruders; none without intruders.
    #[serde(rename = "gap_end_hz")]
    pub gap_end: Option<f64>,
    /// Highest frequency of the optical band; none without intruders.
    #[serde(rename = "optical_top_hz")]
    pub optical_top: Option<f64>,
}

impl Dispersion {
    /// Waves of a scenario's chain, far from its ends.
    ///
    /// # Errors
    /// [`InputError`]: the scenario is out of range, its chain has no static load, or its beads or intruders
    /// are not all alike.
    pub fn of(scenario: &Scenario) -> Result<Self, InputError> {
        let model = Model::of(scenario)?;
        if scenario.chain.precompression == 0.0 {
            let what = "a chain that just touches carries no linear waves".to_owned();
            return Err(InputError::at(
                "chain.precompression",
                what,
                "give it a static load in N",
            ));
        }
        if scenario.chain.gravity != 0.0 {
            let what = "a vertical chain has another load, and other bands, at each contact".to_owned();
            return Err(InputError::at("chain.gravity", what, "leave it out"));
        }
        let beads = scenario.chain.beads;
        let spheres = scenario.spheres();
        if spheres[1..].iter().any(|sphere| *sphere != spheres[0]) || beads < 2 {
            let what = "linear waves are those of two beads or more, all alike".to_owned();
            return Err(InputError::at("section", what, "leave out the sections"));
        }
        let intruder = model.intruders().first().map(|intruder| intruder.oscillator);
        let alike = |oscillator: &Oscillator| {
            let intruders = model.intruders();
            intruders.len() == beads && intruders.iter().all(|one| one.oscillator == *oscillator)
        };
        if intruder.as_ref().is_some_and(|oscillator| !alike(oscillator)) {
            let what = "linear waves are those of beads with equal intruders in all, or none".to_owned();
            return Err(InputError::at(
                "intruder",
                what,
                format!("put one kind into beads 1 to {beads}"),
            ));
        }
        Ok(Self {
            stiffness: model.contact(2).linear_stiffness(),
            mass: model.mass(1),
            intruder,
        })
    }

    /// Frequencies at a wave number in radians from bead to bead.
    pub fn frequencies(&self, wave_number: f64) -> BranchFrequencies {
        let sine = (0.5 * wave_number).sin();
        let contacts = 4.0 * self.stiffness * sine * sine;
        let Some(Oscillator { mass, stiffness, .. }) = self.intruder else {
            return BranchFrequencies {
                acoustic: (contacts / self.mass).sqrt() / TAU,
                optical: None,
            };
        };
        let shell = self.mass - mass;
        let (a, b, c) = (
            shell * mass,
            stiffness * self.mass + contacts * mass,
            contacts * stiffness,
        );
        // b² - 4ac as a sum of squares, and the lesser root without a difference of near numbers.
        let near = stiffness * self.mass - contacts * mass;
        let root = (near * near + 4.0 * stiffness * mass * mass * contacts).sqrt();
        BranchFrequencies {
            acoustic: (2.0 * c / (b + root)).sqrt() / TAU,
            optical: Some((0.5 * (b + root) / a).sqrt() / TAU),
        }
    }

    /// Edges of the bands.
    pub fn bands(&self) -> Bands {
        let short = self.frequencies(PI);
        Bands {
            acoustic_top: short.acoustic,
            gap_end: self.frequencies(0.0).optical,
            optical_top: short.optical,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::{Intruder, Section};

    fn loaded(load: f64) -> Scenario {
        let mut scenario = Scenario::paper();
        (scenario.chain.precompression, scenario.chain.relaxation) = (load, 0.0);
        let oscillator = Oscillator {
            damping: 0.0,
            ..Oscillator::PAPER
        };
        scenario.intruders = vec![Intruder::new(1..=scenario.chain.beads, oscillator)];
        scenario
    }

    /// Roots of the quartic for the paper's bead, by another program with 50 digits.
    const EDGES: &str = "\
1 1185.387193351 1707.549143120 1773.287007350
10 1517.772748060 1707.549143120 2032.821189085
100 1610.652857174 1707.549143120 2811.710799436";

    #[test]
    fn the_edges_of_the_papers_bead_are_the_roots_of_the_quartic() {
        for row in EDGES.lines() {
            let numbers: Vec<f64> = row.split(' ').map(|number| number.parse().unwrap()).collect();
            let bands = Dispersion::of(&loaded(numbers[0])).unwrap().bands();
            let seen = [
                bands.acoustic_top,
                bands.gap_end.unwrap(),
                bands.optical_top.unwrap(),
            ];
            for (seen, expected) in seen.into_iter().zip(&numbers[1..]) {
                assert!((seen / expected - 1.0).abs() < 1e-9, "{row}: {seen}");
            }
        }
    }

    #[test]
    fn without_intruders_it_is_the_lattice_of_one_mass() {
        let mut scenario = loaded(10.0);
        scenario.intruders.clear();
        let dispersion = Dispersion::of(&scenario).unwrap();
        let model = Model::of(&scenario).unwrap();
        let top = (model.contact(5).linear_stiffness() / model.mass(5)).sqrt() / PI;
        for wave_number in [0.01, 1.0, 3.0] {
            let found = dispersion.frequencies(wave_number);
            let expected = top * (0.5 * wave_number).sin();
            assert!((found.acoustic / expected - 1.0).abs() < 1e-14 && found.optical.is_none());
        }
    }

    #[test]
    fn a_chain_without_load_or_of_unlike_beads_has_no_bands() {
        let mut mixed = loaded(1.0);
        mixed.sections = vec![Section::of([3])];
        mixed.sections[0].radius = Some(0.01);
        let mut vertical = loaded(1.0);
        vertical.chain.gravity = 9.81;
        vertical.wall = Some(crate::scenario::Wall::flat(vertical.striker.material()));
        let mut one_host = loaded(1.0);
        one_host.intruders[0].beads.truncate(1);
        for (scenario, words) in [
            (loaded(0.0), "chain.precompression: a chain that just touches"),
            (mixed, "section: linear waves"),
            (vertical, "chain.gravity: a vertical chain"),
            (one_host, "intruder: linear waves"),
        ] {
            let error = Dispersion::of(&scenario).unwrap_err().to_string();
            assert!(error.starts_with(words), "{error}");
        }
    }
}
