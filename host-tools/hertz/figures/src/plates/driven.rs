//! A driven chain: how much of the motion of its shaken end passes along 200 loaded beads, by frequency.

use std::f64::consts::TAU;

use hertz_chain::{Accuracy, Complex64, Dispersion, Drive, DriveQuantity, Run, Scenario};
use hertz_charts::{Axis, Panel};
use rayon::prelude::*;

use super::bands::{EDGES, LOADS, intruders_in_all};
use crate::check::checks;
use crate::curve::{guide, line};
use crate::error::Error;
use crate::lab::Lab;
use crate::plan::{Figure, plans};
use crate::setting::{ELASTIC, strike};

plans! {
    "driven": "velocity of bead 20 over that of the shaken end, chain loaded with 1, 10 and 100 N";
        "200 beads, τ = 0, intruders m 3.7 g, k 3.95e5 N/m, c 0 in all; the end moves by 0.1 nm, from 400 to 3400 Hz in 0.15 s"
        => driven,
}

const BEADS: usize = 200;
/// Bead that is looked at.
const SEEN: usize = 20;
/// Amplitude of the drive, m: so small that the waves are linear.
const AMPLITUDE: f64 = 1e-10;
/// Time of the run, between samples and of the sweep, s.
const DURATION: f64 = 0.7;
const INTERVAL: f64 = 1e-4;
const SWEEP: f64 = 0.15;
/// Rate at which the weight of later samples decays, 1/s. It acts as a loss, which lets the ringing die.
const FADING: f64 = 6.0;
/// Frequencies looked at, Hz: from, to and step.
const FREQUENCIES: (f64, f64, f64) = (500.0, 3200.0, 0.5);
/// Part of the end's motion that counts as passing.
const PASSES: f64 = 0.1;

fn scenario(load: f64) -> Scenario {
    let mut scenario = strike(BEADS, ELASTIC, DURATION);
    let chain = &mut scenario.chain;
    chain.precompression = load;
    // A piston whose contact is one between beads.
    scenario.striker.radius = chain.radius;
    (scenario.striker.young, scenario.striker.poisson) = (chain.young, chain.poisson);
    scenario.striker.velocity = 0.0;
    let mut drive = Drive::sine(DriveQuantity::Displacement, AMPLITUDE, 400.0);
    (drive.frequency_end, drive.sweep, drive.ramp) = (Some(3400.0), Some(SWEEP), 5e-3);
    scenario.drive = Some(drive);
    scenario.intruders = intruders_in_all();
    scenario
}

/// Transmission at each frequency (Hz), and the greatest error of the energy balance over the greatest
/// energy.
fn shake(scenario: &Scenario) -> Result<(Vec<(f64, f64)>, f64), Error> {
    let mut run = Run::new(scenario, Accuracy::new(1e-11, 0.5))?;
    let start = run.snapshot().energies().total();
    let (mut greatest, mut worst) = (0.0_f64, 0.0_f64);
    let mut velocities = Vec::new();
    for sample in 0..=(DURATION / INTERVAL) as usize {
        run.to(sample as f64 * INTERVAL)?;
        let now = run.snapshot();
        let energies = now.energies();
        greatest = greatest.max(energies.chain + energies.intruders);
        worst = worst.max((energies.total() - start).abs());
        velocities.push((now.velocity(0), now.velocity(SEEN)));
    }
    let (from, to, step) = FREQUENCIES;
    let count = ((to - from) / step) as usize;
    let transmission = (0..=count).into_par_iter().map(|n| {
        let frequency = from + step * n as f64;
        let turn = (Complex64::new(-FADING, -TAU * frequency) * INTERVAL).exp();
        // Horner's rule, from the last sample to the first.
        let zero = Complex64::new(0.0, 0.0);
        let (end, seen) = velocities
            .iter()
            .rev()
            .fold((zero, zero), |(end, seen), velocity| {
                (end * turn + velocity.0, seen * turn + velocity.1)
            });
        (frequency, (seen / end).norm())
    });
    Ok((transmission.collect(), worst / greatest))
}

/// Edges of the pass bands, Hz: the highest frequency that passes below a frequency in the gap, the lowest
/// above it, and the highest of all.
fn edges(transmission: &[(f64, f64)], gap: f64) -> [f64; 3] {
    let passes = || {
        transmission
            .iter()
            .filter(|(_, part)| *part >= PASSES)
            .map(|point| point.0)
    };
    let or_none = |edge: Option<f64>| edge.unwrap_or(f64::NAN);
    [
        or_none(passes().rfind(|frequency| *frequency < gap)),
        or_none(passes().find(|frequency| *frequency > gap)),
        or_none(passes().next_back()),
    ]
}

fn driven(_: &Lab) -> Result<Figure, Error> {
    let seen = LOADS
        .into_par_iter()
        .map(|(load, expected)| {
            let scenario = scenario(load);
            let bands = Dispersion::of(&scenario)?.bands();
            let (transmission, balance) = shake(&scenario)?;
            let gap = 0.5 * (bands.acoustic_top + bands.gap_end.unwrap_or(f64::NAN));
            let found = edges(&transmission, gap);
            Ok((load, expected, transmission, found, balance))
        })
        .collect::<Result<Vec<_>, Error>>()?;
    let (from, to, _) = FREQUENCIES;
    let (mut panels, mut checks, mut worst) = (Vec::new(), Vec::new(), 0.0_f64);
    for (place, (load, expected, transmission, found, balance)) in seen.into_iter().enumerate() {
        for ((name, expected), found) in EDGES.iter().zip(expected).zip(found) {
            checks.extend(checks![
                "{name} at {load} N, where transmission ends", "Hz": found => close(expected, 5e-3);
            ]);
        }
        worst = worst.max(balance);
        let name = if place == 0 { "counts as passing" } else { "" };
        let curves = vec![
            line(format!("{load} N"), place, transmission),
            guide(name, vec![(from, PASSES), (to, PASSES)]),
        ];
        let title = if place == 1 {
            "velocity of bead 20 over the end's"
        } else {
            ""
        };
        panels.push(Panel::new(title, curves).log().range(1e-4, 10.0).height(140));
    }
    checks.extend(checks![
        "energy with the drive's work, of the greatest energy": worst => at_most(1e-10);
    ]);
    let axis = Axis::new("frequency (Hz)", from..to);
    Ok(Figure::over(axis, panels, checks))
}
