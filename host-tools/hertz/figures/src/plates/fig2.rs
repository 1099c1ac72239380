//! Figure 2: the experiment's strike on 16 viscous beads, without and with the intruder in bead 8.

use std::f64::consts::TAU;
use std::sync::Arc;

use hertz_chain::ContactForce;

use crate::check::{FigureCheck, checks};
use crate::curve::{dashed, dotted, force_over_time, guide, line, over_time, time_axis};
use crate::error::Error;
use crate::lab::{FigureRun, Lab};
use crate::observe::{greatest, last, peak};
use crate::plan::{Figure, plans};
use crate::setting::{AS_PRINTED, DAMPING, MASS, STIFFNESS, VISCOUS, intruder, strike, with};
use hertz_charts::{Axis, Chart, Panel};

const HOST: usize = 8;
const DURATION: f64 = 0.004;

plans! {
    "2a": "force at contacts 6 to 11, no intruder";
        "16 beads, τ = 4.2 µs, steel striker R 4.5 mm at 0.45 m/s" => forces_without,
    "2b": "force at contacts 6 to 12, intruder in bead 8";
        "as 2a, intruder m 3.7 g, k 3.95e5 N/m, c 12 N·s/m in bead 8" => forces_with,
    "2c": "acceleration of the intruder in bead 8"; "as 2b" => acceleration,
    "2d": "energy of the chain without and with the intruder, and of the intruder";
        "as 2a and 2b; E_T as printed, with M for the host" => energy,
}

fn without(lab: &Lab) -> Result<Arc<FigureRun>, Error> {
    lab.run(&strike(16, VISCOUS, DURATION))
}

fn with_intruder(lab: &Lab) -> Result<Arc<FigureRun>, Error> {
    let intruder = intruder([HOST], MASS, STIFFNESS, DAMPING);
    lab.run(&with(strike(16, VISCOUS, DURATION), intruder))
}

fn forces(run: &FigureRun, contacts: std::ops::RangeInclusive<usize>) -> Chart {
    let span = 1.0e-3..3.5e-3;
    let curves = contacts
        .enumerate()
        .map(|(place, contact)| {
            let word = if place == 0 { "contact " } else { "" };
            let name = format!("{word}{contact}");
            line(name, place, force_over_time(&run.solution, &span, contact))
        })
        .collect();
    Chart::new(time_axis(span), vec![Panel::new("contact force (N)", curves)])
}

/// The highest forces of these contacts against their numbers, for both runs: what the intruder takes beyond
/// what viscosity takes.
fn decrease(plain: &FigureRun, run: &FigureRun, contacts: std::ops::RangeInclusive<usize>) -> Panel {
    let of = |run: &FigureRun| {
        contacts
            .clone()
            .map(|contact| (contact as f64, peak(run, contact)))
            .collect()
    };
    let curves = [
        dotted("without intruder", 0, of(plain)),
        dotted("with intruder", 1, of(run)),
    ];
    Panel::new("highest force (N)", curves.concat())
        .height(170)
        .over(Axis::count("contact", contacts))
}

fn forces_without(lab: &Lab) -> Result<Figure, Error> {
    let run = without(lab)?;
    let mut scenario = strike(16, VISCOUS, DURATION);
    scenario.chain.contact_force = ContactForce::Clipped;
    let clipped = lab.run(&scenario)?;
    let expected = [6.6016, 6.4822, 6.3834, 6.2967, 6.2173, 6.1425];
    let row = |(contact, force)| -> Vec<FigureCheck> {
        checks!["highest force at contact {contact}", "N": peak(&run, contact) => close(force, 1e-3);]
    };
    let mut checks: Vec<FigureCheck> = (6..=11).zip(expected).flat_map(row).collect();
    let more = 100.0 * (peak(&clipped, 11) / peak(&run, 11) - 1.0);
    checks.extend(checks![
        "force at contact 11 where parting beads may not pull: more by", "%": more => close(0.129_781, 0.02);
    ]);
    Ok(Figure::new(forces(&run, 6..=11), checks))
}

fn forces_with(lab: &Lab) -> Result<Figure, Error> {
    let (plain, run) = (without(lab)?, with_intruder(lab)?);
    let loss = |contact: usize| 100.0 * (1.0 - peak(&run, contact) / peak(&plain, contact));
    let checks = checks![
        "loss of force by the intruder at contact 7", "%": loss(7) => at_most(0.01);
        "loss of force at contact 8, the host's left", "%": loss(8) => close(0.84155, 1e-3);
        "loss of force at contact 9, the host's right", "%": loss(9) => close(3.03985, 1e-3);
        "loss of force at contact 12", "%": loss(12) => close(1.37682, 1e-3);
    ];
    let mut chart = forces(&run, 6..=12);
    chart.panels[0].x = Some(chart.x.clone());
    chart.panels.push(decrease(&plain, &run, 6..=12));
    Ok(Figure::new(chart, checks))
}

/// Times at which `value` rises through zero within the points.
fn upward_crossings(points: &[(f64, f64)]) -> Vec<f64> {
    points
        .windows(2)
        .filter(|pair| pair[0].1 < 0.0 && pair[1].1 >= 0.0)
        .map(|pair| pair[0].0 - pair[0].1 * (pair[1].0 - pair[0].0) / (pair[1].1 - pair[0].1))
        .collect()
}

fn acceleration(lab: &Lab) -> Result<Figure, Error> {
    let run = with_intruder(lab)?;
    let points = over_time(&run.solution, 0.0..DURATION, |at| {
        at.intruder_acceleration(HOST).unwrap_or(f64::NAN)
    });
    let host = run.solution.model().mass(HOST);
    // Once the pulse has passed, the host is free: it and the intruder ring about their common centre.
    let reduced = MASS * (host - MASS) / host;
    let decay = 0.5 * DAMPING / reduced;
    let ringing = (STIFFNESS / reduced - decay * decay).sqrt() / TAU;
    let late: Vec<(f64, f64)> = points.iter().copied().filter(|(time, _)| *time > 2.6).collect();
    let crossings = upward_crossings(&late);
    let periods = crossings.len().saturating_sub(1) as f64;
    let seen = periods / (crossings.last().unwrap_or(&0.0) - crossings.first().unwrap_or(&0.0)) * 1e3;
    let summary = run.summary.intruders[0];
    let checks = checks![
        "highest acceleration", "m/s²": summary.acceleration_max => close(133.23, 1e-3);
        "lowest acceleration", "m/s²": summary.acceleration_min => close(-194.33, 1e-3);
        "ringing after the pulse, against the free host's", "Hz": seen => close(ringing, 0.02);
    ];
    let curves = vec![line("", 0, points), guide("", vec![(1.4, 0.0), (4.0, 0.0)])];
    let panel = Panel::new("intruder acceleration (m/s²)", curves);
    Ok(Figure::over(time_axis(1.4e-3..DURATION), vec![panel], checks))
}

fn energy(lab: &Lab) -> Result<Figure, Error> {
    let (plain, run) = (without(lab)?, with_intruder(lab)?);
    let micro = |run: &FigureRun, of: fn(hertz_chain::Energies) -> f64| {
        over_time(&run.solution, 0.0..DURATION, |at| 1e6 * of(at.energies()))
    };
    let before = micro(&plain, |e| e.chain_as_printed);
    let after = micro(&run, |e| e.chain_as_printed);
    let pairs = before.iter().zip(&after);
    let lost: Vec<(f64, f64)> = pairs
        .filter(|((time, _), _)| *time > 0.5)
        .map(|((time, without), (_, with))| (*time, 100.0 * (1.0 - with / without)))
        .collect();
    let (dip, lasting) = (greatest(&lost), last(&lost));
    let dissipated = 1e9 * run.summary.energy.dissipated_intruders;
    let checks = checks![
        "deepest dip of the chain's energy", "%":
            dip => close(3.58, 2e-3), paper "nearly 4 %, read as what is lost";
        "lasting loss of the chain's energy", "%": lasting => near(1.30949, 1e-4), paper "nearly 4 %";
        "energy lost in the intruder's damper", "nJ": dissipated => close(828.976, 1e-4);
    ];
    let chain = vec![
        line("without", 0, before),
        line("with intruder", 1, after),
        dashed("with, and intruder's", 2, micro(&run, |e| e.chain + e.intruders)),
    ];
    let intruder = vec![line("", 3, micro(&run, |e| e.intruders))];
    let panels = vec![
        Panel::new("energy of the chain (µJ)", chain).note(AS_PRINTED),
        Panel::new("intruder (µJ)", intruder),
    ];
    Ok(Figure::over(time_axis(0.5e-3..DURATION), panels, checks))
}
