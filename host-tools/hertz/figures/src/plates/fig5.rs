//! Figure 5: many intruders in a row, from bead 7 on.

use hertz_chain::TransmissionFit;
use rayon::prelude::*;

use crate::check::{FigureCheck, checks};
use crate::curve::{discs, dotted, guide, line, over_time, time_axis};
use crate::error::Error;
use crate::lab::Lab;
use crate::observe::{extremes, last, least_growth};
use crate::plan::{Figure, plans};
use crate::setting::{AS_PRINTED, DAMPING, ELASTIC, MASS, OPTIMUM, intruder, strike, with};
use hertz_charts::{Axis, Panel};

/// The caption counts the striker as sphere 1: seven spheres without intruders are six beads.
const FIRST: usize = 7;
const BEADS: usize = 60;
/// At 0.45 m/s.
const DURATION: f64 = 0.011;
const SPEED: f64 = 0.45;
const MOST: usize = 20;
const MASSES: [f64; 5] = [2.7e-3, 4.7e-3, 7.7e-3, 12e-3, 20e-3];
const SPEEDS: [f64; 5] = [0.1, 0.3, 1.0, 3.0, 10.0];

plans! {
    "5a": "energy of the chain over time for 0 to 20 intruders";
        "60 beads, τ = 0, intruders m 3.7 g, k 10⁵ N/m, c 12 N·s/m in beads 7 on; E_T as printed, with M for the hosts"
        => over_the_run,
    "5b": "energy left against the number of intruders, five masses";
        "as 5a, m = 2.7, 4.7, 7.7, 12, 20 g; energy 11 ms after the strike" => by_mass,
    "5c": "energy left against the number of intruders, striker at 0.1 to 10 m/s";
        "as 5a, m = 4.7 g; energy 11 ms (0.45 m/s / V)^(1/5) after the strike" => by_speed,
}

fn scenario(intruders: usize, mass: f64, speed: f64) -> hertz_chain::Scenario {
    // At τ = 0 a chain without intruders is the same at any speed but for its clock: t ~ V^(-1/5).
    let mut scenario = strike(BEADS, ELASTIC, DURATION * (SPEED / speed).powf(0.2));
    scenario.striker.velocity = speed;
    let intruders = intruder(FIRST..FIRST + intruders, mass, OPTIMUM, DAMPING);
    with(scenario, intruders)
}

/// (n, energy of the chain as printed over that without intruders) at the end of the run.
fn left(lab: &Lab, counts: &[usize], mass: f64, speed: f64) -> Result<Vec<(usize, f64)>, Error> {
    let energy = |intruders: usize| {
        lab.keep("left", &scenario(intruders, mass, speed), |run| {
            run.solution.energy_left()
        })
    };
    let whole = energy(0)?;
    counts
        .par_iter()
        .map(|&intruders| Ok((intruders, *energy(intruders)? / *whole)))
        .collect()
}

fn percent(points: &[(usize, f64)]) -> Vec<(f64, f64)> {
    points.iter().map(|(n, part)| (*n as f64, 100.0 * part)).collect()
}

fn over_the_run(lab: &Lab) -> Result<Figure, Error> {
    let counts = [0, 1, 2, 5, 10, 15, 20];
    let curves = counts
        .par_iter()
        .map(|&intruders| {
            let kept = lab.keep("over time", &scenario(intruders, MASS, SPEED), |run| {
                over_time(&run.solution, 1e-3..DURATION, |at| {
                    1e6 * at.energies().chain_as_printed
                })
            })?;
            Ok((*kept).clone())
        })
        .collect::<Result<Vec<_>, Error>>()?;
    let whole = last(&curves[0]);
    let lasts: Vec<f64> = curves.iter().map(|curve| last(curve) / whole).collect();
    let falls: Vec<f64> = lasts.iter().map(|part| 1.0 / part).collect();
    let checks = checks![
        "energy of the chain without intruders", "µJ": whole => close(65.38903, 1e-4);
        "more intruders leave less energy: least factor": least_growth(&falls) => at_least(1.04);
        "left by ten intruders", "%":
            100.0 * lasts[4] => near(62.46, 0.01), paper "ten intruders are enough to absorb the energy";
    ];
    let named = curves.into_iter().zip(counts).enumerate();
    let series = named.map(|(place, (points, n))| line(format!("n = {n}"), place, points));
    let panel = Panel::new("energy of the chain (µJ)", series.collect()).note(AS_PRINTED);
    let panel = panel.named_at_end();
    Ok(Figure::over(time_axis(1e-3..DURATION), vec![panel], checks))
}

fn by_mass(lab: &Lab) -> Result<Figure, Error> {
    let counts: Vec<usize> = (0..=MOST).collect();
    let mut series = Vec::new();
    let mut fits = Vec::new();
    let mut first = f64::NAN;
    for (place, mass) in MASSES.into_iter().enumerate() {
        let points = left(lab, &counts, mass, SPEED)?;
        fits.push(fit(&points)?);
        if place == 0 {
            first = 100.0 * points[1].1;
        }
        series.push(discs(format!("{} g", mass * 1e3), place, percent(&points)));
    }
    let light = fits[0];
    let name = format!("Tⁿ, T = {:.4}", light.transmission);
    let power = |n: usize| 100.0 * light.initial * light.transmission.powi(n as i32);
    let ends = [0, MOST].map(|n| (n as f64, power(n)));
    series.push(guide(name, ends.to_vec()));
    let heaviest = fits[MASSES.len() - 1];
    let checks = checks![
        "left by the first intruder of 2.7 g", "%": first => close(96.752_912, 1e-6);
        "transmission of one intruder of 2.7 g": light.transmission => close(0.9693, 1e-3);
        "scatter of ln E about Tⁿ, 2.7 g": light.residual => at_most(0.003);
        "scatter at 20 g over that at 2.7 g": heaviest.residual / light.residual => at_least(10.0);
    ];
    Ok(by_count(Panel::new("energy left (%)", series).log(), checks))
}

fn by_count(panel: Panel, checks: Vec<FigureCheck>) -> Figure {
    Figure::over(Axis::new("intruders n", 0.0..MOST as f64), vec![panel], checks)
}

fn fit(points: &[(usize, f64)]) -> Result<TransmissionFit, Error> {
    TransmissionFit::of(points)
        .ok_or_else(|| Error::Missing("too few energies to fit a transmission to".to_owned()))
}

fn by_speed(lab: &Lab) -> Result<Figure, Error> {
    let counts: Vec<usize> = (0..=MOST).step_by(2).collect();
    let mut series = Vec::new();
    let mut at_ten = Vec::new();
    for (place, speed) in SPEEDS.into_iter().enumerate() {
        let points = left(lab, &counts, 4.7e-3, speed)?;
        at_ten.push(100.0 * points[5].1);
        series.extend(dotted(format!("{speed} m/s"), place, percent(&points)));
    }
    let (low, high) = extremes(at_ten);
    let checks = checks![
        "spread of what ten intruders leave, over two decades of speed", "points":
            high - low => at_most(10.0);
        "least that ten intruders leave", "%":
            low => at_least(55.8), paper "ten intruders are enough to absorb the energy";
    ];
    Ok(by_count(Panel::new("energy left (%)", series), checks))
}
