//! Figure A4: a wave through nine neighbouring hosts, for heavier and heavier intruders; also as an animation
//! over the mass.

use std::sync::Arc;

use hertz_chain::Pulse;
use rayon::prelude::*;

use crate::chart::{Axis, Chart, Panel, Series};
use crate::check::checks;
use crate::curve::{line, over_time, time_axis};
use crate::error::Error;
use crate::lab::{Lab, Run};
use crate::observe::{least_growth, train};
use crate::plan::{Figure, plans};
use crate::setting::{DAMPING, ELASTIC, OPTIMUM, intruder, strike, with};

/// Hosts 15 to 23.
const HOSTS: std::ops::RangeInclusive<usize> = 15..=23;
const DURATION: f64 = 0.013;
const CONTACTS: std::ops::RangeInclusive<usize> = 10..=30;
/// Newton from one curve to the next.
const STEP: f64 = 4.0;
const MASSES: [f64; 3] = [0.5e-3, 12e-3, 25e-3];

const SETTING: &str = "46 beads, τ = 0, intruders k 10⁵ N/m, c 12 N·s/m in beads 15 to 23";

plans! {
    "A4a": "a wave through nine hosts, m = 0.5 g"; SETTING => |lab| still(lab, 0),
    "A4b": "a wave through nine hosts, m = 12 g"; SETTING => |lab| still(lab, 1),
    "A4c": "a wave through nine hosts, m = 25 g"; SETTING => |lab| still(lab, 2),
    "A4m": "a wave through nine hosts, animated over m from 0.5 to 25 g"; SETTING => animation,
}

fn scenario(mass: f64) -> hertz_chain::Scenario {
    with(
        strike(46, ELASTIC, DURATION),
        intruder(HOSTS, mass, OPTIMUM, DAMPING),
    )
}

/// Force over time at every contact. Each curve stands one step above the one before.
fn waterfall(run: &Run, title: &str) -> Chart {
    let span = 1.5e-3..DURATION;
    let curves: Vec<Series> = CONTACTS
        .map(|contact| {
            let host = HOSTS.contains(&contact);
            let place = usize::from(host);
            let name = match contact {
                10 => title.to_owned(),
                15 => "at a host's left".to_owned(),
                _ => String::new(),
            };
            line(
                name,
                place,
                over_time(&run.solution, span.clone(), |at| {
                    contact as f64 + at.force(contact) / STEP
                }),
            )
        })
        .collect();
    Chart::new(
        time_axis(span),
        vec![
            Panel::new(format!("contact + force / {STEP} N"), curves)
                .range(9.5, 33.0)
                .height(420),
        ],
    )
}

/// Force of the first pulse and of the strongest after it.
fn first_and_second(pulses: &[Pulse]) -> (f64, f64) {
    let second = pulses.iter().skip(1).map(|pulse| pulse.force).fold(0.0, f64::max);
    (pulses.first().map_or(0.0, |pulse| pulse.force), second)
}

fn still(lab: &Lab, which: usize) -> Result<Figure, Error> {
    let run = lab.run(&scenario(MASSES[which]))?;
    let trains: Vec<Vec<Pulse>> = [16, 18, 20, 22, 24]
        .iter()
        .map(|&contact| train(&run.solution, contact))
        .collect();
    let pairs: Vec<(f64, f64)> = trains.iter().map(|pulses| first_and_second(pulses)).collect();
    let behind = train(&run.solution, 26);
    let (main, second) = first_and_second(&behind);
    let checks = match which {
        0 => checks![
            "pulses of over a twentieth at contact 26": behind.len() as f64 => near(1.0, 0.0);
            "main wave at contact 26", "N": main => at_least(7.8);
        ],
        1 => {
            let mains: Vec<f64> = pairs.iter().map(|pair| 1.0 / pair.0).collect();
            let seconds: Vec<f64> = pairs.iter().map(|pair| pair.1).collect();
            checks![
                "main wave, least fall every two hosts": least_growth(&mains) => at_least(1.05);
                "secondary wave, least growth every two hosts": least_growth(&seconds) => at_least(1.05);
            ]
        }
        _ => checks![
            "pulses of over a twentieth at contact 26": behind.len() as f64 => at_least(4.0);
            "secondary over main wave at contact 26": second / main => at_least(1.1);
        ],
    };
    Ok(Figure::new(
        waterfall(&run, &format!("m = {} g", 1e3 * MASSES[which])),
        checks,
    ))
}

fn animation(lab: &Lab) -> Result<Figure, Error> {
    let masses: Vec<f64> = (1..=50).map(|n| 0.5e-3 * f64::from(n)).collect();
    let frames = masses
        .par_iter()
        .map(|&mass| {
            let kept = lab.keep("waterfall", &scenario(mass), |run| {
                let after = run.summary.energy.dissipated_intruders / run.solution.injection().energy;
                (
                    waterfall(&run, &format!("m = {:.1} g", 1e3 * mass)),
                    100.0 * after,
                )
            })?;
            Ok(kept)
        })
        .collect::<Result<Vec<Arc<(Chart, f64)>>, Error>>()?;
    let absorbed: Vec<(f64, f64)> = masses
        .iter()
        .zip(&frames)
        .map(|(mass, frame)| (1e3 * mass, frame.1))
        .collect();
    let light: Vec<f64> = absorbed.iter().take(10).map(|point| point.1).collect();
    let checks = checks![
        "absorbed, least growth from mass to mass up to 5 g": least_growth(&light) => at_least(1.0);
    ];
    Ok(Figure {
        chart: Chart::new(
            Axis::new("intruder's mass m (g)", 0.0..25.0),
            vec![Panel::new(
                "absorbed (% of injected)",
                vec![line("", 0, absorbed)],
            )],
        ),
        checks,
        frames: frames.iter().map(|frame| frame.0.clone()).collect(),
    })
}
