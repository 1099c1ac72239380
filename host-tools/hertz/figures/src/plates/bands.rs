//! Linear waves of a loaded chain with an intruder in each bead: the branches of the dispersion, and a chain
//! of 200 beads on which all of them ring at once.

use std::f64::consts::PI;

use hertz_chain::{Accuracy, Bands, Dispersion, Intruder, Run, Scenario, Signal, Spectrum, Start};
use rayon::prelude::*;

use crate::check::checks;
use crate::curve::{discs, guide, line};
use crate::error::Error;
use crate::lab::Lab;
use crate::plan::{Figure, plans};
use crate::setting::{ELASTIC, MASS, STIFFNESS, intruder, strike};
use hertz_charts::{Axis, Panel};

plans! {
    "bands": "frequencies of linear waves against their wave number, chain loaded with 1, 10 and 100 N";
        "200 beads, τ = 0, intruders m 3.7 g, k 3.95e5 N/m, c 0 in all; bead 71 starts at 1 µm/s, its chain rings for 0.25 s"
        => bands,
}

const BEADS: usize = 200;
/// Edges of the bands.
pub(super) const EDGES: [&str; 3] = ["acoustic top", "end of the gap", "optical top"];
/// Static loads, N, and for each the [`EDGES`], Hz. Roots of the quartic by a program with 50 digits.
pub(super) const LOADS: [(f64, [f64; 3]); 3] = [
    (1.0, [1185.387193, 1707.549143, 1773.287007]),
    (10.0, [1517.772748, 1707.549143, 2032.821189]),
    (100.0, [1610.652857, 1707.549143, 2811.710799]),
];
/// The bead that is kicked. No mode has a node there.
const KICKED: usize = 71;
/// Velocity of the kicked bead, m/s: so small that the waves are linear.
const KICK: f64 = 1e-6;
/// The modes that are looked at: the first and the last, whose branches end at the edges, and some between.
const MODES: [usize; 14] = [1, 10, 20, 35, 50, 65, 80, 100, 120, 140, 160, 180, 190, BEADS - 1];
/// Time of the run and between samples, s.
const DURATION: f64 = 0.25;
const INTERVAL: f64 = 1.5e-4;
/// Below this frequency, Hz, a mode has too few periods in the run.
const SLOW: f64 = 100.0;

/// The paper's intruder without its damper in each bead.
pub(super) fn intruders_in_all() -> Vec<Intruder> {
    vec![intruder(1..=BEADS, MASS, STIFFNESS, 0.0)]
}

fn scenario(load: f64) -> Scenario {
    let mut scenario = strike(BEADS, ELASTIC, DURATION);
    scenario.chain.precompression = load;
    // The striker only stands in front of the chain.
    scenario.striker.velocity = 1e-3 * KICK;
    scenario.starts = vec![Start::moving([KICKED], KICK)];
    scenario.intruders = intruders_in_all();
    scenario
}

/// Wave number of a mode of a chain with free ends, radians from bead to bead.
fn wave_number(mode: usize) -> f64 {
    PI * mode as f64 / BEADS as f64
}

/// A mode that was seen: wave number, and frequencies of the two branches, Hz. The acoustic one is `None`
/// if it is too slow.
struct SeenMode {
    wave_number: f64,
    acoustic: Option<f64>,
    optical: f64,
}

/// Modes of a loaded chain as its motion shows them, and the greatest error of its energy balance.
fn ring(scenario: &Scenario, bands: &Bands) -> Result<(Vec<SeenMode>, f64), Error> {
    let mut run = Run::new(scenario, Accuracy::new(1e-11, 0.5))?;
    let start = run.model().initial_energy();
    let count = (DURATION / INTERVAL) as usize;
    let mut balance = 0.0_f64;
    let mut signals = MODES.map(|_| Vec::with_capacity(count + 1));
    for sample in 0..=count {
        run.to(sample as f64 * INTERVAL)?;
        let now = run.snapshot();
        balance = balance.max((now.energies().total() / start - 1.0).abs());
        let velocities: Vec<f64> = (1..=BEADS).map(|bead| now.velocity(bead)).collect();
        for (signal, mode) in signals.iter_mut().zip(MODES) {
            // The shape of a mode between free ends.
            let shape =
                |(n, velocity): (usize, &f64)| velocity * (wave_number(mode) * (n as f64 + 0.5)).cos();
            signal.push(velocities.iter().enumerate().map(shape).sum());
        }
    }
    // No mode is between the bands, or above half the sampling rate.
    let gap = 0.5 * (bands.acoustic_top + bands.gap_end.unwrap_or(f64::NAN));
    let seen = MODES.iter().zip(signals).map(|(&mode, signal)| {
        let spectrum = tone_spectrum(signal);
        SeenMode {
            wave_number: wave_number(mode),
            acoustic: Some(tone(&spectrum, 0.5 * SLOW, gap)).filter(|frequency| *frequency > SLOW),
            optical: tone(&spectrum, gap, 0.5 / INTERVAL),
        }
    });
    Ok((seen.collect(), balance))
}

/// The spectrum of a sum of tones, through Hann's window.
fn tone_spectrum(mut values: Vec<f64>) -> Spectrum {
    let last = values.len() as f64 - 1.0;
    for (n, value) in values.iter_mut().enumerate() {
        *value *= (PI * n as f64 / last).sin().powi(2);
    }
    Spectrum::of(&Signal {
        start: 0.0,
        interval: INTERVAL,
        values,
    })
}

/// Frequency of the strongest tone between two frequencies, Hz: the top of the parabola through the
/// logarithms of the greatest magnitude and its neighbours.
fn tone(spectrum: &Spectrum, from: f64, to: f64) -> f64 {
    let points: Vec<(f64, f64)> = spectrum.magnitudes().collect();
    let inside = (1..points.len() - 1).filter(|&n| (from..to).contains(&points[n].0));
    let Some(top) = inside.max_by(|&a, &b| points[a].1.total_cmp(&points[b].1)) else {
        return f64::NAN;
    };
    let [a, b, c] = [top - 1, top, top + 1].map(|n| points[n].1.ln());
    points[top].0 + 0.5 * spectrum.step() * (a - c) / (a - 2.0 * b + c)
}

fn bands(_: &Lab) -> Result<Figure, Error> {
    let seen = LOADS
        .into_par_iter()
        .map(|(load, edges)| {
            let scenario = scenario(load);
            let dispersion = Dispersion::of(&scenario)?;
            let (modes, balance) = ring(&scenario, &dispersion.bands())?;
            Ok((load, edges, dispersion, modes, balance))
        })
        .collect::<Result<Vec<_>, Error>>()?;
    let (mut curves, mut marks, mut checks) = (Vec::new(), Vec::new(), Vec::new());
    let (mut farthest, mut worst) = (0.0_f64, 0.0_f64);
    for (place, (load, edges, dispersion, modes, balance)) in seen.into_iter().enumerate() {
        let bands = dispersion.bands();
        let found =
            [Some(bands.acoustic_top), bands.gap_end, bands.optical_top].map(|edge| edge.unwrap_or(f64::NAN));
        let (first, last) = (&modes[0], &modes[MODES.len() - 1]);
        let rung = [last.acoustic.unwrap_or(f64::NAN), first.optical, last.optical];
        for ((name, edge), (found, rung)) in EDGES.iter().zip(edges).zip(found.into_iter().zip(rung)) {
            checks.extend(checks![
                "{name} at {load} N", "Hz": found => close(edge, 1e-6);
                "{name} at {load} N, on 200 beads", "Hz": rung => close(edge, 1e-4);
            ]);
        }
        worst = worst.max(balance);
        let mut points = Vec::new();
        for mode in &modes {
            let expected = dispersion.frequencies(mode.wave_number);
            for (seen, expected) in [mode.acoustic, Some(mode.optical)].into_iter().zip(expected) {
                let Some(seen) = seen else { continue };
                farthest = farthest.max((seen / expected - 1.0).abs());
                points.push((mode.wave_number / PI, seen));
            }
        }
        let branch = |number: usize| -> Vec<(f64, f64)> {
            let part = (0..=200).map(|n| f64::from(n) / 200.0);
            part.map(|part| (part, dispersion.frequencies(PI * part)[number]))
                .collect()
        };
        curves.push(line(format!("{load} N"), place, branch(0)));
        curves.push(line("", place, branch(1)));
        marks.push(discs("", place, points));
    }
    checks.extend(checks![
        "frequency of a mode from the dispersion, farthest part": farthest => at_most(2e-5);
        "energy balance of the ringing chains, of what was given": worst => at_most(1e-10);
    ]);
    curves.extend(marks);
    let end = LOADS[0].1[1];
    curves.push(guide("end of the gap", vec![(0.0, end), (1.0, end)]));
    let panel = Panel::new("frequency (Hz)", curves)
        .range(0.0, 3000.0)
        .height(320);
    let axis = Axis::new("wave number q / π (per bead)", 0.0..1.0);
    Ok(Figure::over(axis, vec![panel], checks))
}
