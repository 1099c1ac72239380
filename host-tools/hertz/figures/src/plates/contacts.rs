//! Contacts with a force κ δⁿ: two bodies that meet, and the solitary wave in a chain.

use std::f64::consts::{FRAC_PI_2, PI};

use hertz_chain::{ContactLaw, Model, PowerLaw, Scenario, Striker, simulate};
use hertz_charts::{Axis, Panel};
use rayon::prelude::*;

use crate::check::checks;
use crate::curve::{guide, line};
use crate::error::Error;
use crate::lab::{FigureRun, Lab};
use crate::plan::{Figure, plans};
use crate::setting::{ELASTIC, strike};

plans! {
    "contacts": "overlap of the solitary wave against the distance from its peak, contacts F = κ δⁿ";
        "60 equal beads of 51 g struck by a bead at 0.45 m/s, n 3/2, 2 and 3, κ as stiff as the paper's at 2 µm; two bodies with n 1, 3/2 and 3"
        => contacts,
}

/// Overlap at which all laws have the force of the paper's contact, m, and that contact's κ, N/m^(3/2).
const DEPTH: f64 = 2e-6;
const HERTZ: f64 = 3.62604e8;
/// Speeds of the two bodies, m/s.
const SPEEDS: [f64; 4] = [0.1, 0.45, 2.0, 10.0];
/// Contacts between which the wave's speed is taken.
const CONTACTS: [usize; 2] = [30, 45];

fn law(exponent: f64) -> PowerLaw {
    PowerLaw::new(exponent, HERTZ * DEPTH.powf(1.5 - exponent))
}

/// A row of equal beads, struck by the first.
fn scenario(beads: usize, exponent: f64, speed: f64, duration: f64) -> Scenario {
    let mut scenario = strike(beads, ELASTIC, duration);
    scenario.striker = Striker::new(scenario.chain.radius, scenario.chain.material(), speed);
    scenario.contact = Some(ContactLaw::power(exponent, law(exponent).stiffness));
    scenario
}

/// Two bodies that met.
struct Meeting {
    /// Time of contact over that of the closed form.
    time: f64,
    /// Greatest force over V^(2n/(n+1)), N.
    force: f64,
}

fn meet(exponent: f64, speed: f64) -> Result<Meeting, Error> {
    let mut scenario = scenario(1, exponent, speed, 1.0);
    let model = Model::of(&scenario)?;
    let expected = law(exponent).contact_time(0.5 * model.mass(1), speed);
    scenario.duration = 1.5 * expected;
    let solution = simulate(&scenario)?;
    let mut sampler = solution.sampler();
    let (mut closed, mut open) = (0.5 * expected, 1.5 * expected);
    while open - closed > 4.0 * f64::EPSILON * open {
        let middle = 0.5 * (closed + open);
        if sampler.at(middle).overlap(1) > 0.0 {
            closed = middle;
        } else {
            open = middle;
        }
    }
    let force = solution.summary().peak_force[0].force;
    Ok(Meeting {
        time: open / expected,
        force: force / speed.powf(2.0 * exponent / (exponent + 1.0)),
    })
}

/// Part of the peak at which the wave's width is taken.
const HEIGHT: f64 = 0.1;

/// Overlap of a long wave over its peak, by the distance in beads: a cosine to the power 2/(n-1), with its
/// zeros at the wave's width.
fn long_wave(exponent: f64, distance: f64) -> f64 {
    let phase = PI * distance / law(exponent).wave_width();
    if phase.abs() >= FRAC_PI_2 {
        return 0.0;
    }
    phase.cos().powf(2.0 / (exponent - 1.0))
}

/// The wave's width between its zeros, beads, computed from its width at a tenth of the peak overlap, and
/// its shape.
fn wave(run: &FigureRun, exponent: f64) -> Result<(f64, Vec<(f64, f64)>), Error> {
    let peak = |contact: usize| {
        let found = run.summary.peak_force.iter().find(|peak| peak.contact == contact);
        found.ok_or_else(|| Error::Missing(format!("no wave reaches contact {contact}")))
    };
    let [near, far] = CONTACTS;
    let (first, last) = (peak(near)?, peak(far)?);
    let pace = (far - near) as f64 / (last.time - first.time);
    let mut sampler = run.solution.sampler();
    let greatest = sampler.at(first.time).overlap(near);
    let mut shape = |distance: f64| sampler.at(first.time + distance / pace).overlap(near) / greatest;
    let mut side = |sign: f64| {
        let (mut inside, mut outside) = (0.0, 3.0);
        while outside - inside > 1e-9 {
            let middle = 0.5 * (inside + outside);
            if shape(sign * middle) > HEIGHT {
                inside = middle;
            } else {
                outside = middle;
            }
        }
        outside
    };
    let width = side(-1.0) + side(1.0);
    let of_long = 2.0 / PI * HEIGHT.powf(0.5 * (exponent - 1.0)).acos();
    let points = distances().map(|distance| (distance, shape(distance).max(0.0)));
    Ok((width / of_long, points.collect()))
}

/// Distances from the peak, beads.
fn distances() -> impl Iterator<Item = f64> {
    (-150..=150).map(|n| f64::from(n) / 50.0)
}

fn contacts(lab: &Lab) -> Result<Figure, Error> {
    let mut checks = Vec::new();
    let met = [1.0, 1.5, 3.0]
        .into_par_iter()
        .map(|exponent| {
            let all = SPEEDS.into_iter().map(|speed| meet(exponent, speed));
            Ok((exponent, all.collect::<Result<Vec<_>, Error>>()?))
        })
        .collect::<Result<Vec<_>, Error>>()?;
    for (exponent, met) in met {
        let time = met.iter().map(|met| (met.time - 1.0).abs()).fold(0.0, f64::max);
        let force = met.iter().map(|one| (one.force / met[0].force - 1.0).abs());
        let force = force.fold(0.0, f64::max);
        checks.extend(checks![
            "time of contact of two bodies from the closed form, n = {exponent}": time => at_most(1e-10);
            "force of two bodies from the power of their speed, n = {exponent}": force => at_most(1e-11);
        ]);
    }
    let mut curves = Vec::new();
    for (place, exponent) in [1.5, 2.0, 3.0].into_iter().enumerate() {
        let run = lab.run(&scenario(60, exponent, 0.45, 0.02))?;
        let (width, shape) = wave(&run, exponent)?;
        let long = law(exponent).wave_width();
        checks.extend(if exponent < 3.0 {
            checks!["width of the solitary wave from the closed form, n = {exponent}", "beads": width => close(long, 0.05);]
        } else {
            // The wave is no longer long: an independent program has 1.0727 times the closed form.
            checks![
                "width of the solitary wave by an independent program, n = {exponent}", "beads":
                    width => close(1.0727 * long, 1e-3);
            ]
        });
        curves.push(line(format!("n = {exponent}"), place, shape));
        let points = distances().map(|distance| (distance, long_wave(exponent, distance)));
        let name = if place == 0 { "long waves" } else { "" };
        curves.push(guide(name, points.collect()));
    }
    let panel = Panel::new("overlap over its peak", curves).range(0.0, 1.05);
    let axis = Axis::new("distance from the peak (beads)", -3.0..3.0);
    Ok(Figure::over(axis, vec![panel.height(300)], checks))
}
