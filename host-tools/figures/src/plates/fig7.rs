//! Figure 7: how much of its energy a striker lighter than, as heavy as, and heavier than a bead leaves in the chain.

use std::sync::Arc;

use crate::check::Check;
use crate::curve::{chart, guide, line, over_time, panel, time_axis};
use crate::error::Error;
use crate::lab::{Lab, Run};
use crate::observe::train;
use crate::plan::{Figure, Plan};
use crate::setting::{ELASTIC, strike};

const FAR: usize = 30;
const DURATION: f64 = 0.012;
/// Steel balls of M_s/M = 0.0597, 1 and 4.50.
const RADII: [f64; 3] = [0.0045, 0.011_512_034_690_350_61, 0.019];

const LIGHT: &str = "45 beads, τ = 0, steel striker R 4.5 mm, M_s/M = 0.0597";
const EQUAL: &str = "45 beads, τ = 0, steel striker R 11.512 mm, M_s/M = 1";
const HEAVY: &str = "45 beads, τ = 0, steel striker R 19 mm, M_s/M = 4.50";

pub(crate) const PLANS: &[Plan] = &[
    Plan {
        name: "7a",
        title: "energy of the chain over time, light striker",
        setting: LIGHT,
        draw: |lab| energy(lab, 0),
    },
    Plan {
        name: "7b",
        title: "force at contact 30, light striker",
        setting: LIGHT,
        draw: |lab| force(lab, 0),
    },
    Plan {
        name: "7c",
        title: "energy of the chain over time, striker as heavy as a bead",
        setting: EQUAL,
        draw: |lab| energy(lab, 1),
    },
    Plan {
        name: "7d",
        title: "force at contact 30, striker as heavy as a bead",
        setting: EQUAL,
        draw: |lab| force(lab, 1),
    },
    Plan {
        name: "7e",
        title: "energy of the chain over time, heavy striker",
        setting: HEAVY,
        draw: |lab| energy(lab, 2),
    },
    Plan {
        name: "7f",
        title: "force at contact 30, heavy striker: a train of pulses",
        setting: HEAVY,
        draw: |lab| force(lab, 2),
    },
];

fn run(lab: &Lab, which: usize) -> Result<Arc<Run>, Error> {
    let mut scenario = strike(45, ELASTIC, DURATION);
    scenario.striker.radius = RADII[which];
    lab.run(&scenario)
}

fn energy(lab: &Lab, which: usize) -> Result<Figure, Error> {
    let run = run(lab, which)?;
    let until = [0.3e-3, 0.8e-3, 6e-3][which];
    let energy = &run.summary.energy;
    let share = |joule: f64| 100.0 * joule / energy.striker_initial;
    let injection = run.solution.injection();
    let binary = 100.0 * injection.binary_share;
    let last = share(energy.chain_final);
    let checks = match which {
        0 => vec![
            Check::close(
                "of the striker's energy in the chain in the end",
                "%",
                last,
                21.2,
                1e-3,
            ),
            Check::close("the same, by the collision of two", "%", last, binary, 0.01),
            Check::close(
                "highest on the way: the striker at rest",
                "%",
                share(energy.chain_max),
                100.0,
                1e-6,
            ),
        ],
        1 => vec![
            Check::close(
                "of the striker's energy in the chain in the end",
                "%",
                last,
                99.761,
                1e-3,
            ),
            Check::close("by the collision of two", "%", binary, 100.0, 1e-6),
        ],
        _ => vec![
            Check::at_least(
                "of the striker's energy in the chain after 12 ms",
                "%",
                last,
                99.99,
            ),
            Check::at_least(
                "that, over what the collision of two gives",
                "",
                last / binary,
                1.67,
            ),
        ],
    };
    let curve = |of: fn(hertz_chain::Energies) -> f64| {
        over_time(&run.solution, 0.0..until, |at| share(of(at.energies())))
    };
    Ok(Figure {
        chart: chart(
            time_axis(0.0..until),
            vec![panel(
                "of the striker's energy (%)",
                vec![
                    line("chain", 0, curve(|e| e.chain)),
                    line("striker", 1, curve(|e| e.striker)),
                    guide("two bodies", vec![(0.0, binary), (until * 1e3, binary)]),
                ],
            )],
        ),
        checks,
        frames: Vec::new(),
    })
}

fn force(lab: &Lab, which: usize) -> Result<Figure, Error> {
    let run = run(lab, which)?;
    let span = [6.4e-3..8.4e-3, 4e-3..7e-3, 3e-3..8e-3][which].clone();
    let pulses = train(&run.solution, FAR);
    let count = pulses.len() as f64;
    let checks = match which {
        0 => vec![
            Check::near("pulses", "", count, 1.0, 0.0),
            Check::close("force of the pulse", "N", pulses[0].force, 7.936_292, 1e-5),
        ],
        1 => vec![
            Check::near("pulses", "", count, 1.0, 0.0),
            Check::close("force of the pulse", "N", pulses[0].force, 109.263_354, 1e-5),
        ],
        _ => {
            let growth: Vec<f64> = pulses.iter().map(|pulse| 1.0 / pulse.force).collect();
            vec![
                Check::at_least("pulses", "", count, 4.0),
                Check::at_least(
                    "each pulse above the next by a factor of",
                    "",
                    crate::observe::least_growth(&growth),
                    2.0,
                ),
            ]
        }
    };
    let points = over_time(&run.solution, span.clone(), |at| at.force(FAR));
    Ok(Figure {
        chart: chart(
            time_axis(span),
            vec![panel("force at contact 30 (N)", vec![line("", 0, points)])],
        ),
        checks,
        frames: Vec::new(),
    })
}
