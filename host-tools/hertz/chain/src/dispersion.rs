//! Linear waves of a loaded chain of identical beads, or of identical cells of several beads.
//!
//! Small waves see a spring K = (3/2) κ^(2/3) F₀^(1/3) at each contact. In a chain of equal beads, a wave of
//! wave number q (radians from bead to bead) in shells of m₁ = M - m, each with a mass m on a spring k, has
//!
//! ```text
//! m₁ m ω⁴ - [k (m₁ + m) + 4 K m sin²(q/2)] ω² + 4 K k sin²(q/2) = 0
//! ```
//!
//! from the equations of motion with V, u ~ exp(i(q n - ω t)). The lesser root is the acoustic branch, in
//! which bead and intruder move together; the greater one is the optical branch. Between them lies a gap. A
//! cell of several beads has a branch for each bead and each intruder: ω² are the eigenvalues of a
//! Hermitian matrix, in which the contact from cell to cell has the factor exp(iq). A bead with several
//! intruders is such a cell too, with one more band for each intruder. Dampers and viscous contacts are left
//! out: they widen the edges and do not move them at first order.

use std::f64::consts::{PI, TAU};

use nalgebra::DMatrix;
use realfft::num_complex::Complex64;
use serde::Serialize;

use crate::model::Model;
use crate::oscillator::Oscillator;
use crate::scenario::{InputError, Scenario};

/// Dispersion of linear waves in an endless chain.
#[derive(Debug, Clone, PartialEq)]
pub struct Dispersion {
    /// The beads that repeat.
    cell: Vec<CellBead>,
}

/// A bead of a cell.
#[derive(Debug, Clone, PartialEq)]
struct CellBead {
    /// Mass with the intruders, kg.
    mass: f64,
    intruders: Vec<CellIntruder>,
    /// Stiffness of the contact behind it against small changes, N/m.
    stiffness: f64,
}

/// An intruder of a cell's bead.
#[derive(Debug, Clone, Copy, PartialEq)]
struct CellIntruder {
    oscillator: Oscillator,
    /// The intruder of this bead that carries this one; `None` if the bead does.
    carrier: Option<usize>,
}

/// Bands of linear waves. They pass up to the acoustic top, and in a further band for each further bead of a
/// cell and each intruder.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
#[non_exhaustive]
pub struct Bands {
    /// Highest frequency of the acoustic band, where neighbours move against each other.
    #[serde(rename = "acoustic_top_hz")]
    pub acoustic_top: f64,
    /// End of the gap above it; none if there is no other band. With an intruder in each bead all shells move
    /// against their intruders there.
    #[serde(rename = "gap_end_hz")]
    pub gap_end: Option<f64>,
    /// Highest frequency that passes above the gap; none if there is no other band.
    #[serde(rename = "optical_top_hz")]
    pub optical_top: Option<f64>,
    /// Lowest and highest frequency of each band, Hz.
    #[serde(rename = "pass_hz")]
    pub pass: Vec<[f64; 2]>,
}

impl Dispersion {
    /// Waves of a scenario's chain, far from its ends.
    ///
    /// # Errors
    /// [`InputError`]: the scenario is out of range, its chain has no static load or is vertical, or no
    /// pattern of beads and intruders occurs at least twice.
    pub fn of(scenario: &Scenario) -> Result<Self, InputError> {
        let model = Model::of(scenario)?;
        if scenario.chain.precompression == 0.0 {
            let what = "a chain whose beads just touch carries no linear waves";
            let advice = "give it a static load in N";
            return Err(InputError::at("chain.precompression", what, advice));
        }
        if scenario.chain.gravity != 0.0 {
            let what = "a vertical chain has a different load, and different bands, at each contact";
            return Err(InputError::at("chain.gravity", what, "leave it out"));
        }
        let beads = scenario.chain.beads;
        let spheres = scenario.spheres();
        let held = |bead: usize| {
            let numbers = model.intruders_of(bead);
            let first = numbers.start;
            model.intruders()[numbers]
                .iter()
                .map(move |intruder| CellIntruder {
                    oscillator: intruder.oscillator,
                    carrier: intruder.carrier.map(|carrier| carrier - first),
                })
        };
        let repeats = |cell: usize| {
            (cell..beads).all(|n| spheres[n] == spheres[n - cell] && held(n + 1).eq(held(n + 1 - cell)))
        };
        let Some(cell) = (1..=beads / 2).find(|&cell| repeats(cell)) else {
            let uneven = spheres[1..].iter().any(|sphere| *sphere != spheres[0]);
            let key = if uneven || beads < 2 {
                "section"
            } else {
                "intruder"
            };
            let what =
                "linear waves need a pattern of beads, with their intruders, that occurs at least twice";
            let advice = "make the beads alike, or arrange them in cells of two or three";
            return Err(InputError::at(key, what, advice));
        };
        let of = |bead: usize| CellBead {
            mass: model.mass(bead),
            intruders: held(bead).collect(),
            stiffness: model.contact(bead + 1).linear_stiffness(),
        };
        Ok(Self {
            cell: (1..=cell).map(of).collect(),
        })
    }

    /// Number of beads in a cell.
    pub fn beads_of_cell(&self) -> usize {
        self.cell.len()
    }

    /// Frequencies at a wave number in radians from cell to cell, Hz, in ascending order: one for each bead
    /// and each intruder of a cell.
    pub fn frequencies(&self, wave_number: f64) -> Vec<f64> {
        match &self.cell[..] {
            [bead] if bead.intruders.len() <= 1 => bead.frequencies(wave_number),
            cell => frequencies_of_cell(cell, wave_number),
        }
    }

    /// Edges of the bands.
    pub fn bands(&self) -> Bands {
        // The frequencies of a branch rise or fall from long waves to the shortest ones.
        let (long, short) = (self.frequencies(0.0), self.frequencies(PI));
        let ends = long.into_iter().zip(short);
        let pass: Vec<[f64; 2]> = ends
            .map(|(long, short)| [long.min(short), long.max(short)])
            .collect();
        Bands {
            acoustic_top: pass[0][1],
            gap_end: pass.get(1).map(|band| band[0]),
            optical_top: pass.last().filter(|_| pass.len() > 1).map(|band| band[1]),
            pass,
        }
    }
}

impl CellBead {
    /// Frequencies of a chain of such beads with at most one intruder each, Hz: the roots of the quartic.
    fn frequencies(&self, wave_number: f64) -> Vec<f64> {
        let sine = (0.5 * wave_number).sin();
        let contacts = 4.0 * self.stiffness * sine * sine;
        let [CellIntruder { oscillator, .. }] = self.intruders[..] else {
            return vec![(contacts / self.mass).sqrt() / TAU];
        };
        let Oscillator { mass, stiffness, .. } = oscillator;
        let shell = self.mass - mass;
        let (a, b, c) = (
            shell * mass,
            stiffness * self.mass + contacts * mass,
            contacts * stiffness,
        );
        // b² - 4ac as a sum of squares, and the lesser root without cancellation.
        let near = stiffness * self.mass - contacts * mass;
        let root = (near * near + 4.0 * stiffness * mass * mass * contacts).sqrt();
        let squares = [2.0 * c / (b + root), 0.5 * (b + root) / a];
        squares.map(|square| square.sqrt() / TAU).to_vec()
    }
}

/// Frequencies of a chain of such cells, Hz, the lowest first.
fn frequencies_of_cell(cell: &[CellBead], wave_number: f64) -> Vec<f64> {
    let beads = cell.len();
    // The body that carries each intruder, and the intruder's spring. Beads are numbered before intruders.
    let mut intruders: Vec<(usize, Oscillator)> = Vec::new();
    for (bead, of) in cell.iter().enumerate() {
        let first = beads + intruders.len();
        let carrier = |one: &CellIntruder| one.carrier.map_or(bead, |carrier| first + carrier);
        intruders.extend(of.intruders.iter().map(|one| (carrier(one), one.oscillator)));
    }
    let inner = |bead: &CellBead| -> f64 { bead.intruders.iter().map(|one| one.oscillator.mass).sum() };
    let mut masses: Vec<f64> = cell.iter().map(|bead| bead.mass - inner(bead)).collect();
    masses.extend(intruders.iter().map(|(_, intruder)| intruder.mass));
    let count = masses.len();
    let mut springs = DMatrix::<Complex64>::zeros(count, count);
    let mut join = |near: usize, far: usize, stiffness: f64, turn: Complex64| {
        springs[(near, near)] += stiffness;
        springs[(far, far)] += stiffness;
        springs[(near, far)] -= turn * stiffness;
        springs[(far, near)] -= turn.conj() * stiffness;
    };
    let none = Complex64::new(1.0, 0.0);
    for (near, bead) in cell.iter().enumerate() {
        // The last contact leads to the next cell.
        let (far, turn) = match near + 1 {
            far if far < beads => (far, none),
            _ => (0, Complex64::from_polar(1.0, wave_number)),
        };
        join(near, far, bead.stiffness, turn);
    }
    for (number, (carrier, intruder)) in intruders.iter().enumerate() {
        join(*carrier, beads + number, intruder.stiffness, none);
    }
    let by_mass = DMatrix::from_fn(count, count, |row, column| {
        springs[(row, column)] / (masses[row] * masses[column]).sqrt()
    });
    let mut squares: Vec<f64> = by_mass.symmetric_eigenvalues().iter().copied().collect();
    squares.sort_by(f64::total_cmp);
    // Rounding may leave less than zero for an infinitely long wave.
    squares
        .iter()
        .map(|square| square.max(0.0).sqrt() / TAU)
        .collect()
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

    /// Steel and aluminium in turn, beads of 9.53 mm radius loaded with 20 N (arXiv:0911.2817).
    fn diatomic() -> Scenario {
        let mut scenario = loaded(20.0);
        scenario.intruders.clear();
        let chain = &mut scenario.chain;
        (chain.beads, chain.radius, chain.density) = (20, 9.53e-3, 7955.0);
        (chain.young, chain.poisson) = (193e9, 0.3);
        let mut light = Section::of((2..=20).step_by(2));
        (light.density, light.young, light.poisson) = (Some(2689.0), Some(73.5e9), Some(0.33));
        scenario.sections = vec![light];
        scenario
    }

    #[test]
    fn two_beads_in_turn_have_the_three_cut_offs_of_a_diatomic_lattice() {
        let scenario = diatomic();
        let model = Model::of(&scenario).unwrap();
        let stiffness = model.contact(2).linear_stiffness();
        let (heavy, light) = (model.mass(1), model.mass(2));
        let of = |mass: f64| (2.0 * stiffness / mass).sqrt() / TAU;
        let expected = [of(heavy), of(light), of(heavy * light / (heavy + light))];
        let dispersion = Dispersion::of(&scenario).unwrap();
        let bands = dispersion.bands();
        let seen = [
            bands.acoustic_top,
            bands.gap_end.unwrap(),
            bands.optical_top.unwrap(),
        ];
        for (seen, expected) in seen.into_iter().zip(expected) {
            assert!((seen / expected - 1.0).abs() < 1e-12, "{seen} {expected}");
        }
        assert_eq!(dispersion.beads_of_cell(), 2);
        // In between, ω² of both branches by the formula of two masses.
        let (sum, sine) = (1.0 / heavy + 1.0 / light, 0.35_f64.sin());
        let root = (sum * sum - 4.0 * sine * sine / (heavy * light)).sqrt();
        for (seen, sign) in dispersion.frequencies(0.7).into_iter().zip([-1.0, 1.0]) {
            let expected = (stiffness * (sum + sign * root)).sqrt() / TAU;
            assert!((seen / expected - 1.0).abs() < 1e-12, "{seen} {expected}");
        }
    }

    /// 4 K sin²(q/2) = ω² (m₁ + Σ m k / (k - m ω²)), the effective mass of a bead with several
    /// intruders. The m of an intruder that carries another includes the effective mass of the other.
    #[test]
    fn a_bead_with_several_intruders_has_a_band_more_for_each_and_an_effective_mass() {
        for inside in [None, Some(1)] {
            let mut scenario = loaded(10.0);
            let light = Oscillator::new(1.5e-3, 5e5, 0.0);
            let mut second = Intruder::new(1..=scenario.chain.beads, light);
            second.inside = inside;
            scenario.intruders.push(second);
            let dispersion = Dispersion::of(&scenario).unwrap();
            let bead = &dispersion.cell[0];
            let [one, two] = [0, 1].map(|place| bead.intruders[place].oscillator);
            for wave_number in [0.3, 1.7, PI] {
                let sine = (0.5 * wave_number).sin();
                for hz in dispersion.frequencies(wave_number) {
                    let square = (TAU * hz).powi(2);
                    let seen = |mass: f64, stiffness: f64| mass * stiffness / (stiffness - mass * square);
                    let second = seen(two.mass, two.stiffness);
                    let both = match inside {
                        None => seen(one.mass, one.stiffness) + second,
                        Some(_) => seen(one.mass + second, one.stiffness),
                    };
                    let mass = bead.mass - one.mass - two.mass + both;
                    let off = square * mass / (4.0 * bead.stiffness * sine * sine) - 1.0;
                    assert!(
                        off.abs() < if inside.is_none() { 1e-9 } else { 1e-8 },
                        "{hz}: {off}"
                    );
                }
            }
            assert_eq!(dispersion.bands().pass.len(), 3);
        }
    }

    #[test]
    fn a_cell_of_like_beads_has_the_folded_branches_of_one() {
        // Three equal beads with intruders, whose wave has thrice the phase from cell to cell.
        let one = Dispersion::of(&loaded(10.0)).unwrap();
        let three = vec![one.cell[0].clone(); 3];
        let folded = [0.2, 0.2 + TAU / 3.0, 0.2 - TAU / 3.0];
        let mut expected: Vec<f64> = folded.into_iter().flat_map(|q| one.frequencies(q)).collect();
        expected.sort_by(f64::total_cmp);
        let seen = frequencies_of_cell(&three, 0.6);
        for (seen, expected) in seen.into_iter().zip(expected) {
            assert!((seen / expected - 1.0).abs() < 1e-10, "{seen} {expected}");
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
            assert!((found[0] / expected - 1.0).abs() < 1e-14 && found.len() == 1);
        }
    }

    #[test]
    fn a_chain_without_load_or_of_unlike_beads_has_no_bands() {
        let mut mixed = loaded(1.0);
        mixed.sections = vec![Section::of([3])];
        mixed.sections[0].radius = Some(0.01);
        let mut uneven = diatomic();
        uneven.sections[0].beads.pop();
        let mut vertical = loaded(1.0);
        vertical.chain.gravity = 9.81;
        vertical.wall = Some(crate::scenario::Wall::flat(vertical.striker.material()));
        let mut one_host = loaded(1.0);
        one_host.intruders[0].beads.truncate(1);
        for (scenario, words) in [
            (
                loaded(0.0),
                "chain.precompression: a chain whose beads just touch",
            ),
            (mixed, "section: linear waves"),
            (uneven, "section: linear waves"),
            (vertical, "chain.gravity: a vertical chain"),
            (one_host, "intruder: linear waves"),
        ] {
            let error = Dispersion::of(&scenario).unwrap_err().to_string();
            assert!(error.starts_with(words), "{error}");
        }
    }
}
