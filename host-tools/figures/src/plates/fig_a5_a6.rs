//! Figures A5 and A6: the experiment's strikers, on four hosts and on a chain without.

use std::sync::Arc;

use hertz_chain::Scenario;

use crate::chart::{Panel, Scale};
use crate::check::Check;
use crate::curve::{axis, chart, dashed, line, over_time, panel, time_axis};
use crate::error::Error;
use crate::lab::{Lab, Run};
use crate::observe::{half_power, least_growth, magnitudes, peak, pulse_spectrum, ratio, train};
use crate::plan::{Figure, Plan};
use crate::setting::{DAMPING, ELASTIC, MASS, STIFFNESS, VISCOUS, intruder, strike, with};

pub(crate) const PLANS: &[Plan] = &[
    Plan {
        name: "A5",
        title: "force at contact 12 behind four intruders, three strikers",
        setting: "16 beads, τ = 4.2 µs, intruders m 3.7 g, k 3.95e5 N/m, c 12 N·s/m in beads 4 to 7; steel strikers at 0.45 m/s",
        draw: four_hosts,
    },
    Plan {
        name: "A6a",
        title: "force at contacts 6 and 40, three stiff strikers and a soft one",
        setting: STRIKERS,
        draw: forces,
    },
    Plan {
        name: "A6b",
        title: "spectra of the first pulses at contacts 6 and 40, three stiff strikers and a soft one",
        setting: STRIKERS,
        draw: spectra,
    },
];

/// Steel balls of the experiment's size and up, m.
const RADII: [f64; 3] = [0.0045, 0.0065, 0.0095];

const DURATION: f64 = 0.004;

fn four_hosts(lab: &Lab) -> Result<Figure, Error> {
    const CONTACT: usize = 12;
    let mut panels = Vec::new();
    let mut losses = Vec::new();
    for (place, radius) in RADII.into_iter().enumerate() {
        let mut plain = strike(16, VISCOUS, DURATION);
        plain.striker.radius = radius;
        let hosts = intruder(4..=7, MASS, STIFFNESS, DAMPING);
        let (before, after) = (lab.run(&plain)?, lab.run(&with(plain, hosts))?);
        losses.push(100.0 * (1.0 - peak(&after, CONTACT) / peak(&before, CONTACT)));
        let span = 1.4e-3..3.4e-3;
        let force = |run: &Run| over_time(&run.solution, span.clone(), |at| at.force(CONTACT));
        panels.push(Panel {
            height: 150,
            x: Some(time_axis(span.clone())),
            ..panel(
                "force (N)",
                vec![
                    dashed(
                        format!("R = {} mm, no intruders", 1e3 * radius),
                        place,
                        force(&before),
                    ),
                    line("four intruders", place, force(&after)),
                ],
            )
        });
    }
    let checks = vec![
        Check::at_least(
            "loss of force, least growth from size to size",
            "",
            least_growth(&losses),
            1.3,
        ),
        Check::at_least("loss of force, R = 4.5 mm", "%", losses[0], 4.0),
    ];
    Ok(Figure {
        chart: chart(time_axis(0.0..DURATION), panels),
        checks,
        frames: Vec::new(),
    })
}

const STRIKERS: &str = "45 beads, τ = 0, 0.45 m/s: steel balls of R 4.5, 6.5, 9.5 mm, and a polymer ball of R 19 mm, \
                        1100 kg/m³, 20 MPa, ν 0.45";
const NEAR: usize = 6;
const FAR: usize = 40;

fn strikers() -> Vec<(String, Scenario)> {
    let chain = strike(45, ELASTIC, 0.013);
    let steel = RADII.into_iter().map(|radius| {
        let mut scenario = chain.clone();
        scenario.striker.radius = radius;
        (format!("steel, R = {} mm", 1e3 * radius), scenario)
    });
    let mut soft = chain.clone();
    soft.striker.radius = 0.019;
    soft.striker.density = 1100.0;
    soft.striker.young = 20e6;
    soft.striker.poisson = 0.45;
    steel.chain([("polymer, R = 19 mm".to_owned(), soft)]).collect()
}

fn runs(lab: &Lab) -> Result<Vec<(String, Arc<Run>)>, Error> {
    strikers()
        .into_iter()
        .map(|(name, scenario)| Ok((name, lab.run(&scenario)?)))
        .collect()
}

fn forces(lab: &Lab) -> Result<Figure, Error> {
    let runs = runs(lab)?;
    let span = 0.5e-3..12e-3;
    let panels = runs.iter().enumerate().map(|(place, (name, run))| {
        let force = |contact| over_time(&run.solution, span.clone(), |at| at.force(contact));
        Panel {
            height: 130,
            ..panel(
                "force (N)",
                vec![
                    line(format!("{name}: contact {NEAR}"), place, force(NEAR)),
                    dashed(format!("contact {FAR}"), place, force(FAR)),
                ],
            )
        }
    });
    let pulses: Vec<f64> = runs
        .iter()
        .map(|(_, run)| train(&run.solution, FAR).len() as f64)
        .collect();
    let checks = vec![
        Check::near("pulses from steel, R = 4.5 mm", "", pulses[0], 1.0, 0.0),
        Check::at_least("pulses from the polymer ball", "", pulses[3], 3.0),
    ];
    Ok(Figure {
        chart: chart(time_axis(span.clone()), panels.collect()),
        checks,
        frames: Vec::new(),
    })
}

fn spectra(lab: &Lab) -> Result<Figure, Error> {
    let runs = runs(lab)?;
    let mut panels = Vec::new();
    let mut frequencies = Vec::new();
    for contact in [NEAR, FAR] {
        let mut curves = Vec::new();
        for (place, (name, run)) in runs.iter().enumerate() {
            let Some(first) = train(&run.solution, contact).into_iter().next() else {
                return Err(Error::Missing(format!("no pulse passes contact {contact}")));
            };
            let spectrum = pulse_spectrum(&run.solution, &first);
            frequencies.push(half_power(&spectrum));
            let whole = spectrum.values()[0].norm();
            let name = if contact == NEAR { name.as_str() } else { "" };
            curves.push(line(name, place, magnitudes(&spectrum, 3000.0, 1.0 / whole)));
        }
        panels.push(Panel {
            y_scale: Scale::Log,
            y_range: Some((1e-3, 1.5)),
            height: 200,
            x: Some(axis("frequency (Hz)", 0.0..3000.0)),
            ..panel(format!("contact {contact}: |S| / impulse"), curves)
        });
    }
    let (near, far) = frequencies.split_at(runs.len());
    // A wave's clock runs with F^(1/6). At contact 6 the polymer's pulses have not parted yet.
    let scaled =
        |frequencies: &[f64], contact: usize| {
            ratio(frequencies.iter().zip(&runs).map(|(frequency, (_, run))| {
                frequency / train(&run.solution, contact)[0].force.powf(1.0 / 6.0)
            }))
        };
    let checks = vec![
        Check::at_most(
            "-3 dB frequency at contact 6, stiff: greatest over least",
            "",
            ratio(near[..3].to_vec()),
            1.5,
        )
        .but_paper("does not vary significantly with radius"),
        Check::at_most("the same over F^(1/6)", "", scaled(&near[..3], NEAR), 1.03),
        Check::at_most(
            "-3 dB frequency at contact 40, all: greatest over least",
            "",
            ratio(far.to_vec()),
            1.5,
        )
        .but_paper("nearly insensitive to modulus and mass"),
        Check::at_most("the same over F^(1/6)", "", scaled(far, FAR), 1.001),
    ];
    Ok(Figure {
        chart: chart(axis("frequency (Hz)", 0.0..3000.0), panels),
        checks,
        frames: Vec::new(),
    })
}
