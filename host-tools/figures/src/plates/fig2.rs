//! Figure 2: the experiment's strike on 16 viscous beads, without and with the intruder in bead 8.

use std::f64::consts::TAU;
use std::sync::Arc;

use hertz_chain::ContactForce;

use crate::check::Check;
use crate::curve::{chart, dashed, guide, line, over_time, panel, time_axis};
use crate::error::Error;
use crate::lab::{Lab, Run};
use crate::observe::peak;
use crate::plan::{Figure, Plan};
use crate::setting::{DAMPING, MASS, STIFFNESS, VISCOUS, intruder, strike, with};

const HOST: usize = 8;
const DURATION: f64 = 0.004;

pub(crate) const PLANS: &[Plan] = &[
    Plan {
        name: "2a",
        title: "force at contacts 6 to 11, no intruder",
        setting: "16 beads, τ = 4.2 µs, steel striker R 4.5 mm at 0.45 m/s",
        draw: forces_without,
    },
    Plan {
        name: "2b",
        title: "force at contacts 6 to 12, intruder in bead 8",
        setting: "as 2a, intruder m 3.7 g, k 3.95e5 N/m, c 12 N·s/m in bead 8",
        draw: forces_with,
    },
    Plan {
        name: "2c",
        title: "acceleration of the intruder in bead 8",
        setting: "as 2b",
        draw: acceleration,
    },
    Plan {
        name: "2d",
        title: "energy of the chain without and with the intruder, and of the intruder",
        setting: "as 2a and 2b; E_T as printed, with M for the host",
        draw: energy,
    },
];

fn without(lab: &Lab) -> Result<Arc<Run>, Error> {
    lab.run(&strike(16, VISCOUS, DURATION))
}

fn with_intruder(lab: &Lab) -> Result<Arc<Run>, Error> {
    let intruder = intruder([HOST], MASS, STIFFNESS, DAMPING);
    lab.run(&with(strike(16, VISCOUS, DURATION), intruder))
}

fn forces(run: &Run, contacts: std::ops::RangeInclusive<usize>) -> crate::chart::Chart {
    let span = 1.0e-3..3.5e-3;
    let curves = contacts
        .enumerate()
        .map(|(place, contact)| {
            line(
                if place == 0 {
                    format!("contact {contact}")
                } else {
                    contact.to_string()
                },
                place,
                over_time(&run.solution, span.clone(), |at| at.force(contact)),
            )
        })
        .collect();
    chart(time_axis(span), vec![panel("contact force (N)", curves)])
}

fn forces_without(lab: &Lab) -> Result<Figure, Error> {
    let run = without(lab)?;
    let mut scenario = strike(16, VISCOUS, DURATION);
    scenario.chain.contact_force = ContactForce::Clipped;
    let clipped = lab.run(&scenario)?;
    let expected = [6.6016, 6.4822, 6.3834, 6.2967, 6.2173, 6.1425];
    let checks = (6..=11)
        .zip(expected)
        .map(|(contact, force)| {
            let what = format!("highest force at contact {contact}");
            Check::close(what, "N", peak(&run, contact), force, 1e-3)
        })
        .chain([Check::close(
            "force at contact 11 where parting beads may not pull: more by",
            "%",
            100.0 * (peak(&clipped, 11) / peak(&run, 11) - 1.0),
            0.129_781,
            0.02,
        )])
        .collect();
    Ok(Figure {
        chart: forces(&run, 6..=11),
        checks,
        frames: Vec::new(),
    })
}

fn forces_with(lab: &Lab) -> Result<Figure, Error> {
    let (plain, run) = (without(lab)?, with_intruder(lab)?);
    let loss = |contact: usize| 100.0 * (1.0 - peak(&run, contact) / peak(&plain, contact));
    Ok(Figure {
        chart: forces(&run, 6..=12),
        checks: vec![
            Check::at_most("loss of force by the intruder at contact 7", "%", loss(7), 0.01),
            Check::close(
                "loss of force at contact 8, the host's left",
                "%",
                loss(8),
                0.84155,
                1e-3,
            ),
            Check::close(
                "loss of force at contact 9, the host's right",
                "%",
                loss(9),
                3.03985,
                1e-3,
            ),
            Check::close("loss of force at contact 12", "%", loss(12), 1.37682, 1e-3),
        ],
        frames: Vec::new(),
    })
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
    Ok(Figure {
        chart: chart(
            time_axis(1.4e-3..DURATION),
            vec![panel(
                "intruder acceleration (m/s²)",
                vec![line("", 0, points), guide("", vec![(1.4, 0.0), (4.0, 0.0)])],
            )],
        ),
        checks: vec![
            Check::close(
                "highest acceleration",
                "m/s²",
                summary.acceleration_max,
                133.23,
                1e-3,
            ),
            Check::close(
                "lowest acceleration",
                "m/s²",
                summary.acceleration_min,
                -194.33,
                1e-3,
            ),
            Check::close(
                "ringing after the pulse, against the free host's",
                "Hz",
                seen,
                ringing,
                0.02,
            ),
        ],
        frames: Vec::new(),
    })
}

fn energy(lab: &Lab) -> Result<Figure, Error> {
    let (plain, run) = (without(lab)?, with_intruder(lab)?);
    let micro = |run: &Run, of: fn(hertz_chain::Energies) -> f64| {
        over_time(&run.solution, 0.0..DURATION, |at| 1e6 * of(at.energies()))
    };
    let before = micro(&plain, |e| e.chain_as_printed);
    let after = micro(&run, |e| e.chain_as_printed);
    let consistent = micro(&run, |e| e.chain + e.intruders);
    let loss = |with: &[(f64, f64)]| -> Vec<(f64, f64)> {
        let pairs = before.iter().zip(with);
        pairs
            .filter(|((time, _), _)| *time > 0.5)
            .map(|((time, without), (_, with))| (*time, 100.0 * (1.0 - with / without)))
            .collect()
    };
    let dip = loss(&after).iter().map(|(_, loss)| *loss).fold(0.0, f64::max);
    let dissipated = 1e9 * run.summary.energy.dissipated_intruders;
    let lasting = loss(&after).last().map_or(f64::NAN, |(_, loss)| *loss);
    let chart = chart(
        time_axis(0.5e-3..DURATION),
        vec![
            panel(
                "energy of the chain (µJ)",
                vec![
                    line("without", 0, before.clone()),
                    line("with intruder", 1, after),
                    dashed("with, and intruder's", 2, consistent.clone()),
                ],
            ),
            panel("intruder (µJ)", vec![line("", 3, micro(&run, |e| e.intruders))]),
        ],
    );
    Ok(Figure {
        chart,
        checks: vec![
            Check::close("deepest dip of the chain's energy", "%", dip, 3.58, 2e-3)
                .but_paper("nearly 4 %, read as what is lost"),
            Check::near("lasting loss of the chain's energy", "%", lasting, 1.30949, 1e-4)
                .but_paper("nearly 4 %"),
            Check::close(
                "energy lost in the intruder's damper",
                "nJ",
                dissipated,
                828.976,
                1e-4,
            ),
        ],
        frames: Vec::new(),
    })
}
