//! Motions of a driven chain that repeat: two of them meet and vanish as the drive grows.

use std::ops::ControlFlow;

use hertz_chain::{
    Accuracy, Bifurcation, Branch, BranchOptions, BranchPoint, Chain, Dispersion, Drive, DriveParameter,
    DriveQuantity, Material, PeriodExtremes, PeriodicState, Run, Scenario, Section, SimulateError, Striker,
    Wall,
};
use hertz_charts::{Axis, Panel};
use rayon::prelude::*;

use crate::check::checks;
use crate::curve::{dashed, discs, line, told_apart};
use crate::error::Error;
use crate::lab::Lab;
use crate::plan::{Figure, plans};

plans! {
    "periodic": "motions of a shaken chain that repeat, against the amplitude of its end, and three at one amplitude";
        "21 beads in cells of steel, tungsten carbide, steel, radius 9.525 mm, τ 0.25 µs, 10 N; the end moves at 6.2 kHz, in a gap"
        => periodic,
}

const BEADS: usize = 21;
const FREQUENCY: f64 = 6200.0;
/// Amplitude at which the branch begins, m, and at which it ends.
const AMPLITUDES: (f64, f64) = (1e-9, 4e-8);
/// Amplitude of the motions that are shown, m: three repeat.
const SHOWN: f64 = 2.5e-8;
/// Change of a displacement, m, in the runs whose differences are compared with the multipliers.
const OFF: f64 = 1e-11;

/// The trimer chain of arXiv:1411.0614, with its loss in the contacts.
fn scenario(amplitude: f64) -> Scenario {
    let steel = Material::new(7780.0, 200e9, 0.3);
    let mut chain = Chain::new(BEADS, 9.525e-3, steel);
    (chain.relaxation, chain.precompression) = (2.5e-7, 10.0);
    let piston = Striker::new(chain.radius, steel, 0.0);
    let mut scenario = Scenario::new(1e-3, chain, piston);
    let mut carbide = Section::of((2..=BEADS).step_by(3));
    (carbide.density, carbide.young, carbide.poisson) = (Some(14980.0), Some(628e9), Some(0.28));
    scenario.sections = vec![carbide];
    scenario.wall = Some(Wall::flat(steel));
    scenario.drive = Some(Drive::sine(DriveQuantity::Displacement, amplitude, FREQUENCY));
    scenario
}

/// The state of the chain after a period, with one value of its start moved: displacement of each bead, m,
/// and its velocity times a 2π-th of the period, m.
fn moved(state: &PeriodicState, value: usize, off: f64) -> Result<Vec<f64>, SimulateError> {
    let unit = state.period() / std::f64::consts::TAU;
    let mut scenario = state.scenario().clone();
    scenario.starts = state.starts();
    let start = &mut scenario.starts[value % BEADS];
    if value < BEADS {
        start.displacement += off;
    } else {
        start.velocity += off / unit;
    }
    let mut run = Run::new(&scenario, Accuracy::REFERENCE)?;
    run.to(state.period())?;
    let end = run.snapshot();
    let places = scenario.starts.iter().zip(1..);
    let places = places.map(|(start, bead)| start.displacement + end.displacement(bead));
    let velocities = (1..=BEADS).map(|bead| end.velocity(bead) * unit);
    Ok(places.chain(velocities).collect())
}

/// Greatest difference between the sums of the multipliers and of their squares, and the traces of the
/// derivative of a period, and of its square, by differences of runs.
fn off_from_runs(state: &PeriodicState) -> Result<f64, SimulateError> {
    let columns = (0..2 * BEADS)
        .into_par_iter()
        .map(|value| {
            let (more, less) = (moved(state, value, OFF)?, moved(state, value, -OFF)?);
            Ok(more
                .iter()
                .zip(&less)
                .map(|(more, less)| (more - less) / (2.0 * OFF))
                .collect())
        })
        .collect::<Result<Vec<Vec<f64>>, SimulateError>>()?;
    let all = 0..columns.len();
    let trace: f64 = all.clone().map(|n| columns[n][n]).sum();
    let pairs = all
        .clone()
        .flat_map(|row| all.clone().map(move |column| (row, column)));
    let square: f64 = pairs
        .map(|(row, column)| columns[column][row] * columns[row][column])
        .sum();
    let multipliers = state.multipliers().iter();
    let sum: f64 = multipliers.clone().map(|one| one.re).sum();
    let squares: f64 = multipliers.map(|one| (one * one).re).sum();
    Ok((sum - trace).abs().max((squares - square).abs()))
}

/// Consecutive points that are stable, or that are not, as curves: amplitude in nm, velocity in mm/s.
fn pieces(points: &[(f64, f64, bool)]) -> Vec<(bool, Vec<(f64, f64)>)> {
    let mut pieces: Vec<(bool, Vec<(f64, f64)>)> = Vec::new();
    for &(amplitude, velocity, is_stable) in points {
        if pieces.last().is_none_or(|piece| piece.0 != is_stable) {
            // A piece begins where the one before ends.
            let end = pieces.last().and_then(|piece| piece.1.last().copied());
            pieces.push((is_stable, end.into_iter().collect()));
        }
        let last = pieces.len() - 1;
        pieces[last].1.push((amplitude, velocity));
    }
    pieces
}

fn periodic(_: &Lab) -> Result<Figure, Error> {
    let bands = Dispersion::of(&scenario(AMPLITUDES.0))?.bands();
    let gap = (bands.pass[1][1], bands.pass[2][0]);
    let start = PeriodicState::of(&scenario(AMPLITUDES.0))?;
    let options = BranchOptions::default();
    let branch = Branch::follow(start, DriveParameter::Amplitude, AMPLITUDES.1, &options, |_| {
        ControlFlow::Continue(())
    })?;
    let periods = branch.points.par_iter().map(|point| point.state.extremes());
    let periods = periods.collect::<Result<Vec<_>, _>>()?;
    let points: Vec<_> = branch.points.iter().zip(&periods).collect();
    let place = |(point, period): &(&BranchPoint, &PeriodExtremes)| {
        (point.value * 1e9, period.speeds[0] * 1e3, point.state.is_stable())
    };
    let all: Vec<_> = points.iter().map(place).collect();
    let is_fold =
        |(point, _): &&(&BranchPoint, &PeriodExtremes)| point.bifurcation == Some(Bifurcation::Fold);
    let folds = points.iter().filter(is_fold).map(place);
    let folds: Vec<(f64, f64)> = folds
        .map(|(amplitude, velocity, _)| (amplitude, velocity))
        .collect();

    // The motions at one amplitude, each near a point of the branch on either side of it.
    let mut motions = Vec::new();
    for pair in branch.points.windows(2) {
        if (pair[0].value - SHOWN) * (pair[1].value - SHOWN) < 0.0 {
            motions.push(pair[0].state.near(&scenario(SHOWN))?);
        }
    }
    let names = ["driven state", "between them", "surface mode"];
    let mut profiles = Vec::new();
    for (place, (state, name)) in motions.iter().zip(names).enumerate() {
        let forces = state.extremes()?.forces;
        let contacts = (1..).map(f64::from).zip(forces.into_iter().map(|force| force[1]));
        profiles.push(told_apart(name, place, contacts.collect()));
    }

    let nearest_one = |point: &BranchPoint| {
        let distances = point.state.multipliers().iter().map(|one| (one - 1.0).norm());
        distances.fold(f64::INFINITY, f64::min)
    };
    let at_folds = branch.folds().map(nearest_one).fold(0.0, f64::max);
    let missed = branch.points.iter().map(|point| point.state.residual());
    let missed = missed.fold(0.0, f64::max);
    let off = motions.iter().map(off_from_runs).collect::<Result<Vec<_>, _>>()?;
    let off = off.into_iter().fold(0.0, f64::max);
    let unstable = motions.iter().filter(|state| !state.is_stable()).count();
    let fold = |n: usize| folds.get(n).map_or(f64::NAN, |fold| fold.0);
    let checks = checks![
        "end of the band below the drive", "Hz": gap.0 => close(6042.16321, 1e-8);
        "start of the band above the drive", "Hz": gap.1 => close(6714.97432, 1e-8);
        "amplitude at which driven state and surface mode meet", "nm": fold(0) => close(28.487540733, 1e-8);
        "amplitude below which there is no surface mode", "nm": fold(1) => close(22.6369, 1e-5);
        "distance of a multiplier from 1 at the folds, greatest": at_folds => at_most(1e-6);
        "motions that repeat at 25 nm": motions.len() as f64 => near(3.0, 0.0);
        "of these unstable": unstable as f64 => near(1.0, 0.0);
        "sums of multipliers and of their squares from differences of runs, farthest": off => at_most(1e-8);
        "distance between start and end of a period, as a part of the motion": missed => at_most(1e-10);
    ];
    let mut curves = Vec::new();
    let mut names = ["unstable", "stable"];
    for (is_stable, piece) in pieces(&all) {
        // The first of each kind is named.
        let name = std::mem::take(&mut names[usize::from(is_stable)]);
        curves.push(if is_stable {
            line(name, 0, piece)
        } else {
            dashed(name, 1, piece)
        });
    }
    curves.push(discs("fold", 2, folds));
    let axis = Axis::new("amplitude of the end (nm)", 0.0..40.0);
    let branch_panel = Panel::new("greatest velocity of bead 1 (mm/s)", curves)
        .over(axis.clone())
        .range(0.0, 20.0)
        .height(260);
    let contacts = Axis::new("contact, at 25 nm", 0.0..BEADS as f64 + 2.0);
    let profile_panel = Panel::new("greatest force (N)", profiles)
        .over(contacts)
        .height(200);
    Ok(Figure::over(axis, vec![branch_panel, profile_panel], checks))
}
