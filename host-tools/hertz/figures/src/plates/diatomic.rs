//! Linear waves of a loaded chain of two kinds of beads in turn: its branches, and the modes of 80 beads.

use std::f64::consts::{PI, TAU};

use hertz_chain::{
    Chain, Dispersion, Drive, DriveQuantity, Material, Model, PeriodicState, Scenario, Section, Striker, Wall,
};
use hertz_charts::{Axis, Panel};

use crate::check::checks;
use crate::curve::{discs, guide, line};
use crate::error::Error;
use crate::lab::Lab;
use crate::plan::{Figure, plans};

plans! {
    "diatomic": "frequencies of linear waves in a chain of steel and aluminium against their wave number, and modes of 80 beads";
        "80 beads of steel (193 GPa, 7955 kg/m³) and aluminium (73.5 GPa, 2689 kg/m³) in turn, radius 9.53 mm, 20 N, τ = 0; walls"
        => diatomic,
}

const BEADS: usize = 80;
/// Frequency of a drive that is faster than every mode, Hz, and its amplitude, m: so small that the waves are
/// linear.
const FAST: f64 = 24e3;
const AMPLITUDE: f64 = 1e-13;

/// The chain of arXiv:0911.2817 between a piston and a wall.
fn scenario() -> Scenario {
    let mut chain = Chain::new(BEADS, 9.53e-3, Material::new(7955.0, 193e9, 0.3));
    chain.precompression = 20.0;
    let aluminium = Material::new(2689.0, 73.5e9, 0.33);
    let piston = Striker::new(chain.radius, aluminium, 0.0);
    let mut scenario = Scenario::new(1e-3, chain, piston);
    let mut light = Section::of((2..=BEADS).step_by(2));
    (light.density, light.young, light.poisson) = (Some(2689.0), Some(73.5e9), Some(0.33));
    scenario.sections = vec![light];
    scenario.wall = Some(Wall::flat(aluminium));
    scenario.drive = Some(Drive::sine(DriveQuantity::Displacement, AMPLITUDE, FAST));
    scenario
}

/// Frequencies of the modes, Hz, the lowest first: the angles of the multipliers of a motion whose period is
/// shorter than half of every mode's.
fn modes(state: &PeriodicState) -> Vec<f64> {
    let angles = state.multipliers().iter().map(|multiplier| multiplier.arg());
    let mut modes: Vec<f64> = angles
        .filter(|angle| *angle > 0.0)
        .map(|angle| angle / (TAU * state.period()))
        .collect();
    modes.sort_by(f64::total_cmp);
    modes
}

fn diatomic(_: &Lab) -> Result<Figure, Error> {
    let scenario = scenario();
    let dispersion = Dispersion::of(&scenario)?;
    let bands = dispersion.bands();
    let model = Model::of(&scenario)?;
    let (heavy, light) = (model.mass(1), model.mass(2));
    let top = |mass: f64| (2.0 * model.contact(2).linear_stiffness() / mass).sqrt() / TAU;
    let modes = modes(&PeriodicState::of(&scenario)?);
    let (acoustic, optical): (Vec<f64>, Vec<f64>) = modes.iter().partition(|mode| **mode < bands.pass[1][0]);
    // A chain between walls: n half waves along its beads, and as many modes in each band as cells.
    let cells = BEADS / 2;
    let place = |number: usize| number as f64 / (cells as f64 + 0.5);
    let points = |modes: &[f64]| -> Vec<(f64, f64)> {
        let modes = modes.iter().zip(1..);
        modes.map(|(mode, n)| (place(n), mode / 1e3)).collect()
    };
    let falling: Vec<f64> = optical.iter().rev().copied().collect();
    let branch = |number: usize| -> Vec<(f64, f64)> {
        let parts = (0..=200).map(|n| f64::from(n) / 200.0);
        parts
            .map(|part| (part, dispersion.frequencies(PI * part)[number] / 1e3))
            .collect()
    };
    let near = |modes: &[f64], number: usize| {
        let off =
            |(mode, n): (&f64, usize)| (mode / dispersion.frequencies(PI * place(n))[number] - 1.0).abs();
        // The last modes of a band sit at the ends of the chain.
        let modes = modes.iter().zip(1..).take(cells - 4);
        modes.map(off).fold(0.0, f64::max)
    };
    let inside = modes.iter().filter(|mode| {
        let is_in = |band: &[f64; 2]| (band[0] * 0.999..=band[1] * 1.001).contains(*mode);
        bands.pass.iter().any(is_in)
    });
    let inside = inside.count() as f64;
    let checks = checks![
        "acoustic top f₁ = √(2K/M)/2π", "Hz": bands.pass[0][1] => close(top(heavy), 1e-10);
        "end of the gap f₂ = √(2K/m)/2π", "Hz": bands.pass[1][0] => close(top(light), 1e-10);
        "optical top f₃ = √(2K (1/M + 1/m))/2π", "Hz": bands.pass[1][1] => close(top(heavy * light / (heavy + light)), 1e-10);
        "f₂/f₁": bands.pass[1][0] / bands.pass[0][1] => close((7955.0_f64 / 2689.0).sqrt(), 1e-10);
        "modes of 80 beads in the bands": inside => near(80.0, 0.0);
        "modes in the acoustic band": acoustic.len() as f64 => near(41.0, 0.0);
        "acoustic modes from the branch, farthest": near(&acoustic, 0) => at_most(2e-4);
        "optical modes from the branch, farthest": near(&falling, 1) => at_most(2e-4);
    ];
    let edges = bands.pass.iter().flatten().skip(1).map(|edge| edge / 1e3);
    let mut curves = vec![
        line("acoustic branch", 0, branch(0)),
        line("optical branch", 1, branch(1)),
        discs("modes of 80 beads", 2, points(&acoustic)),
        discs("", 2, points(&falling)),
    ];
    for (number, edge) in edges.enumerate() {
        let name = if number == 0 { "edges" } else { "" };
        curves.push(guide(name, vec![(0.0, edge), (1.0, edge)]));
    }
    let panel = Panel::new("frequency (kHz)", curves).range(0.0, 11.0).height(320);
    let axis = Axis::new("wave number q / π (per cell)", 0.0..1.0);
    Ok(Figure::over(axis, vec![panel], checks))
}
