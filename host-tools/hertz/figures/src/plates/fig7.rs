//! Figure 7: the part of its energy that a striker lighter than, as heavy as, or heavier than a bead leaves
//! in the chain.

use std::sync::Arc;

use crate::check::checks;
use crate::curve::{force_over_time, guide, line, over_time, time_axis};
use crate::error::Error;
use crate::lab::{FigureRun, Lab};
use crate::observe::{least_growth, train};
use crate::plan::{Figure, plans};
use crate::setting::{ELASTIC, strike};
use hertz_charts::Panel;

const FAR: usize = 30;
const DURATION: f64 = 0.012;
/// Steel balls of M_s/M = 0.0597, 1 and 4.50.
const RADII: [f64; 3] = [0.0045, 0.011_512_034_690_350_61, 0.019];

const LIGHT: &str = "45 beads, τ = 0, steel striker R 4.5 mm, M_s/M = 0.0597";
const EQUAL: &str = "45 beads, τ = 0, steel striker R 11.512 mm, M_s/M = 1";
const HEAVY: &str = "45 beads, τ = 0, steel striker R 19 mm, M_s/M = 4.50";

plans! {
    "7a": "energy of the chain over time, light striker"; LIGHT => |lab| energy(lab, 0),
    "7b": "force at contact 30, light striker"; LIGHT => |lab| force(lab, 0),
    "7c": "energy of the chain over time, striker as heavy as a bead";
        EQUAL => |lab| energy(lab, 1),
    "7d": "force at contact 30, striker as heavy as a bead"; EQUAL => |lab| force(lab, 1),
    "7e": "energy of the chain over time, heavy striker"; HEAVY => |lab| energy(lab, 2),
    "7f": "force at contact 30, heavy striker: a train of pulses"; HEAVY => |lab| force(lab, 2),
}

fn run(lab: &Lab, which: usize) -> Result<Arc<FigureRun>, Error> {
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
        0 => checks![
            "of the striker's energy in the chain in the end", "%": last => close(21.2, 1e-3);
            "the same, by the collision of two", "%": last => close(binary, 0.01);
            "highest on the way: the striker at rest", "%": share(energy.chain_max) => close(100.0, 1e-6);
        ],
        1 => checks![
            "of the striker's energy in the chain in the end", "%": last => close(99.761, 1e-3);
            "by the collision of two", "%": binary => close(100.0, 1e-6);
        ],
        _ => checks![
            "of the striker's energy in the chain after 12 ms", "%": last => at_least(99.99);
            "that, over what the collision of two gives": last / binary => at_least(1.67);
        ],
    };
    let curve = |of: fn(hertz_chain::Energies) -> f64| {
        over_time(&run.solution, 0.0..until, |at| share(of(at.energies())))
    };
    let curves = vec![
        line("chain", 0, curve(|e| e.chain)),
        line("striker", 1, curve(|e| e.striker)),
        guide("two bodies", vec![(0.0, binary), (until * 1e3, binary)]),
    ];
    let panel = Panel::new("of the striker's energy (%)", curves);
    Ok(Figure::over(time_axis(0.0..until), vec![panel], checks))
}

fn force(lab: &Lab, which: usize) -> Result<Figure, Error> {
    let run = run(lab, which)?;
    let span = [6.4e-3..8.4e-3, 4e-3..7e-3, 3e-3..8e-3][which].clone();
    let pulses = train(&run.solution, FAR);
    let count = pulses.len() as f64;
    let checks = match which {
        0 => checks![
            "pulses": count => near(1.0, 0.0);
            "force of the pulse", "N": pulses[0].force => close(7.936_292, 1e-5);
        ],
        1 => checks![
            "pulses": count => near(1.0, 0.0);
            "force of the pulse", "N": pulses[0].force => close(109.263_354, 1e-5);
        ],
        _ => {
            let growth: Vec<f64> = pulses.iter().map(|pulse| 1.0 / pulse.force).collect();
            checks![
                "pulses": count => at_least(4.0);
                "each pulse above the next by a factor of": least_growth(&growth) => at_least(2.0);
            ]
        }
    };
    let points = force_over_time(&run.solution, &span, FAR);
    let panel = Panel::new("force at contact 30 (N)", vec![line("", 0, points)]);
    Ok(Figure::over(time_axis(span), vec![panel], checks))
}
