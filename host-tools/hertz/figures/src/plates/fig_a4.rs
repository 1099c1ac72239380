//! Figure A4: a wave through nine neighbouring hosts, for heavier and heavier intruders; also as an animation
//! over the mass.

use std::sync::Arc;

use hertz_chain::{Pulse, Snapshot};
use rayon::prelude::*;

use crate::check::checks;
use crate::curve::{line, over_time, time_axis};
use crate::error::Error;
use crate::lab::{FigureRun, Lab};
use crate::observe::{least_growth, ordinates, train};
use crate::plan::{Figure, plans};
use crate::setting::{DAMPING, ELASTIC, OPTIMUM, intruder, strike, with};
use hertz_charts::{Axis, Chart, Panel};

/// Hosts 15 to 23.
const HOSTS: std::ops::RangeInclusive<usize> = 15..=23;
const DURATION: f64 = 0.013;
const CONTACTS: std::ops::RangeInclusive<usize> = 10..=30;
/// Distance from one curve to the next, N.
const STEP: f64 = 4.0;
const MASSES: [f64; 3] = [0.5e-3, 12e-3, 25e-3];
/// The frame of the animation that stands for it in print: 6 g, with two waves behind the hosts.
const STILL: usize = 11;

const SETTING: &str = "46 beads, τ = 0, intruders k 10⁵ N/m, c 12 N·s/m in beads 15 to 23";

plans! {
    "A4a": "a wave through nine hosts, m = 0.5 g"; SETTING => |lab| still(lab, 0),
    "A4b": "a wave through nine hosts, m = 12 g"; SETTING => |lab| still(lab, 1),
    "A4c": "a wave through nine hosts, m = 25 g"; SETTING => |lab| still(lab, 2),
    "A4m": "a wave through nine hosts, animated over m from 0.5 to 25 g"; SETTING => animation,
}

fn scenario(mass: f64) -> hertz_chain::Scenario {
    let intruder = intruder(HOSTS, mass, OPTIMUM, DAMPING);
    with(strike(46, ELASTIC, DURATION), intruder)
}

/// Force over time at every contact. Each curve stands one step above the one before.
fn waterfall(run: &FigureRun, title: &str) -> Chart {
    let span = 1.5e-3..DURATION;
    let curve = |contact: usize| {
        let name = match contact {
            10 => title,
            15 => "at a host's left",
            _ => "",
        };
        let place = usize::from(HOSTS.contains(&contact));
        let stepped = |at: &Snapshot<'_>| contact as f64 + at.force(contact) / STEP;
        line(name, place, over_time(&run.solution, span.clone(), stepped))
    };
    let label = format!("contact + force / {STEP} N");
    let panel = Panel::new(label, CONTACTS.map(curve).collect()).range(9.5, 33.0);
    Chart::new(time_axis(span.clone()), vec![panel.height(420)])
}

/// Force of the first pulse and of the strongest after it.
fn first_and_second(pulses: &[Pulse]) -> (f64, f64) {
    let second = pulses.iter().skip(1).map(|pulse| pulse.force).fold(0.0, f64::max);
    (pulses.first().map_or(0.0, |pulse| pulse.force), second)
}

fn still(lab: &Lab, which: usize) -> Result<Figure, Error> {
    let run = lab.run(&scenario(MASSES[which]))?;
    let pairs = [16, 18, 20, 22, 24].map(|contact| first_and_second(&train(&run.solution, contact)));
    let behind = train(&run.solution, 26);
    let (main, second) = first_and_second(&behind);
    let checks = match which {
        0 => checks![
            "pulses of at least a twentieth of the strongest at contact 26": behind.len() as f64 => near(1.0, 0.0);
            "main wave at contact 26", "N": main => at_least(7.8);
        ],
        1 => {
            let (mains, seconds) = (pairs.map(|pair| 1.0 / pair.0), pairs.map(|pair| pair.1));
            checks![
                "main wave, least fall every two hosts": least_growth(&mains) => at_least(1.05);
                "secondary wave, least growth every two hosts": least_growth(&seconds) => at_least(1.05);
            ]
        }
        _ => checks![
            "pulses of at least a twentieth of the strongest at contact 26": behind.len() as f64 => at_least(4.0);
            "secondary over main wave at contact 26": second / main => at_least(1.1);
        ],
    };
    let title = format!("m = {} g", 1e3 * MASSES[which]);
    Ok(Figure::new(waterfall(&run, &title), checks))
}

fn animation(lab: &Lab) -> Result<Figure, Error> {
    let masses: Vec<f64> = (1..=50).map(|n| 0.5e-3 * f64::from(n)).collect();
    let frames = masses
        .par_iter()
        .map(|&mass| {
            lab.keep("waterfall", &scenario(mass), |run| {
                let absorbed = run.summary.energy.dissipated_intruders / run.solution.injection().energy;
                let title = format!("m = {:.1} g", 1e3 * mass);
                (waterfall(&run, &title), 100.0 * absorbed)
            })
        })
        .collect::<Result<Vec<Arc<(Chart, f64)>>, Error>>()?;
    let pairs = masses.iter().zip(&frames);
    let absorbed: Vec<(f64, f64)> = pairs.map(|(mass, frame)| (1e3 * mass, frame.1)).collect();
    let checks = checks![
        "absorbed, least growth from mass to mass up to 5 g":
            least_growth(&ordinates(&absorbed[..10])) => at_least(1.0);
    ];
    let mut still = frames[STILL].0.clone();
    still.panels[0].x = Some(still.x.clone());
    let axis = Axis::new("intruder's mass m (g)", 0.0..25.0);
    let panel = Panel::new("absorbed (% of injected)", vec![line("", 0, absorbed)]);
    still.panels.push(panel.height(170).over(axis));
    Ok(Figure {
        frames: frames.iter().map(|frame| frame.0.clone()).collect(),
        ..Figure::new(still, checks)
    })
}
