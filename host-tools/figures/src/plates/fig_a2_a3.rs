//! Figures A2 and A3: the intruder of Fig. 4 with other masses, and with other dampers.

use std::ops::Range;
use std::sync::Arc;

use hertz_chain::{Intruder, PulseSearch, Split};

use super::fig4::{HOST, force_panels, greatest, run, share, splits};
use crate::chart::{Axis, Panel};
use crate::check::Check;
use crate::curve::{axis, chart, discs, geometric, line, log_axis, over_time, panel, time_axis};
use crate::error::Error;
use crate::lab::{Lab, Run};
use crate::observe::{least_growth, summit};
use crate::plan::{Figure, Plan};
use crate::setting::{DAMPING, MASS, OPTIMUM, intruder};

const BY_MASS: &str = "46 beads, τ = 0, intruder k 10⁵ N/m, c 12 N·s/m in bead 15, m = 1, 3.7, 7.8 g";
const BY_DAMPING: &str = "46 beads, τ = 0, intruder m 3.7 g, k 10⁵ N/m in bead 15, c = 4, 12, 36 N·s/m";
const MASS_SWEEP: &str = "46 beads, τ = 0, intruder k 10⁵ N/m, c 12 N·s/m in bead 15, m from 0.5 to 12.5 g; energies through contacts 10 and 25";
const DAMPING_SWEEP: &str = "46 beads, τ = 0, intruder m 3.7 g, k 10⁵ N/m in bead 15, c from 0.3 to 300 N·s/m; energies through contacts 10 and 25";

pub(crate) const PLANS: &[Plan] = &[
    Plan {
        name: "A2a",
        title: "force at contacts 10 and 25 for three masses",
        setting: BY_MASS,
        draw: |lab| forces(lab, &MASSES),
    },
    Plan {
        name: "A2b",
        title: "motion of beads 9 and 10, m = 7.8 g",
        setting: BY_MASS,
        draw: |lab| shift(lab, 7.8e-3, [9, 10]),
    },
    Plan {
        name: "A2c",
        title: "motion of beads 24 and 25, m = 7.8 g",
        setting: BY_MASS,
        draw: |lab| shift(lab, 7.8e-3, [24, 25]),
    },
    Plan {
        name: "A2d",
        title: "energy of the reflected waves against mass",
        setting: MASS_SWEEP,
        draw: |lab| reflected(lab, &MASSES),
    },
    Plan {
        name: "A2e",
        title: "energy of the transmitted waves, and absorbed, against mass",
        setting: MASS_SWEEP,
        draw: |lab| transmitted(lab, &MASSES),
    },
    Plan {
        name: "A3a",
        title: "force at contacts 10 and 25 for three dampers",
        setting: BY_DAMPING,
        draw: |lab| forces(lab, &DAMPINGS),
    },
    Plan {
        name: "A3b",
        title: "motion of beads 9 and 10, m = 3.7 g",
        setting: BY_DAMPING,
        draw: |lab| shift(lab, MASS, [9, 10]),
    },
    Plan {
        name: "A3c",
        title: "motion of beads 24 and 25, m = 3.7 g",
        setting: BY_DAMPING,
        draw: |lab| shift(lab, MASS, [24, 25]),
    },
    Plan {
        name: "A3d",
        title: "energy of the reflected waves against damping",
        setting: DAMPING_SWEEP,
        draw: |lab| reflected(lab, &DAMPINGS),
    },
    Plan {
        name: "A3e",
        title: "energy of the transmitted waves, and absorbed, against damping",
        setting: DAMPING_SWEEP,
        draw: |lab| transmitted(lab, &DAMPINGS),
    },
];

/// What is changed on the intruder, and how its energies come out.
struct Family {
    three: [(&'static str, f64); 3],
    intruder: fn(f64) -> Intruder,
    values: fn() -> Vec<f64>,
    axis: fn() -> Axis,
    /// The unit of the axis in that of the values.
    unit: f64,
    reflected: fn(&Shares) -> Vec<Check>,
    transmitted: fn(&Shares) -> Vec<Check>,
}

/// Shares of the incident energy in %, against what was swept.
struct Shares {
    reflected: Vec<(f64, f64)>,
    secondary: Vec<(f64, f64)>,
    main: Vec<(f64, f64)>,
    absorbed: Vec<(f64, f64)>,
}

const MASSES: Family = Family {
    three: [("m = 1 g", 1e-3), ("3.7 g", 3.7e-3), ("7.8 g", 7.8e-3)],
    intruder: |mass| intruder([HOST], mass, OPTIMUM, DAMPING),
    values: || (1..=25).map(|n| 0.5e-3 * f64::from(n)).collect(),
    axis: || axis("intruder's mass m (g)", 0.0..12.5),
    unit: 1e-3,
    reflected: |shares| {
        vec![
            Check::at_least(
                "reflected, least growth from mass to mass",
                "",
                least_growth(&ordinates(&shares.reflected)),
                1.0,
            ),
            Check::at_least("reflected at 12.5 g", "%", last(&shares.reflected), 1.25),
        ]
    },
    transmitted: |shares| {
        vec![
            Check::at_least(
                "secondary waves, least growth from mass to mass",
                "",
                least_growth(&ordinates(&shares.secondary)),
                1.0,
            ),
            Check::at_least(
                "main wave, least fall from mass to mass",
                "",
                least_fall(&shares.main),
                1.0,
            ),
            Check::at_most("main wave at 12.5 g", "%", last(&shares.main), 86.0),
        ]
    },
};

const DAMPINGS: Family = Family {
    three: [("c = 4 N·s/m", 4.0), ("12", 12.0), ("36", 36.0)],
    intruder: |damping| intruder([HOST], MASS, OPTIMUM, damping),
    values: || geometric(0.3, 300.0, 31),
    axis: || log_axis("damping c (N·s/m)", 0.3..300.0),
    unit: 1.0,
    reflected: |shares| {
        vec![Check::at_least(
            "reflected, least fall from damping to damping",
            "",
            least_fall(&shares.reflected),
            1.0,
        )]
    },
    transmitted: |shares| {
        vec![
            Check::at_least(
                "secondary waves, least fall from damping to damping",
                "",
                least_fall(&shares.secondary),
                1.0,
            ),
            Check::near(
                "most is absorbed at c, decades from 2.5 N·s/m",
                "decades",
                (summit(&shares.absorbed) / 2.5).log10(),
                0.0,
                0.3,
            ),
            Check::at_least(
                "absorbed at the most, over that at either end",
                "",
                greatest(&shares.absorbed) / shares.absorbed[0].1.max(last(&shares.absorbed)),
                1.05,
            ),
        ]
    },
};

fn ordinates(points: &[(f64, f64)]) -> Vec<f64> {
    points.iter().map(|point| point.1).collect()
}

fn least_fall(points: &[(f64, f64)]) -> f64 {
    least_growth(&points.iter().rev().map(|point| point.1).collect::<Vec<_>>())
}

fn last(points: &[(f64, f64)]) -> f64 {
    points.last().map_or(f64::NAN, |point| point.1)
}

fn sweep(lab: &Lab, family: &Family) -> Result<Shares, Error> {
    let values = (family.values)();
    let intruders: Vec<Intruder> = values.iter().map(|&value| (family.intruder)(value)).collect();
    let splits = splits(lab, &intruders)?;
    let of = |part: fn(&Split) -> f64| -> Vec<(f64, f64)> {
        let points = share(&values, &splits, part);
        points
            .into_iter()
            .map(|(value, share)| (value / family.unit, share))
            .collect()
    };
    Ok(Shares {
        reflected: of(|split| split.reflected),
        secondary: of(|split| split.secondary),
        main: of(|split| split.main.energy),
        absorbed: of(|split| split.absorbed),
    })
}

fn forces(lab: &Lab, family: &Family) -> Result<Figure, Error> {
    let runs = family
        .three
        .iter()
        .map(|(name, value)| Ok(((*name).to_owned(), run(lab, (family.intruder)(*value))?)))
        .collect::<Result<Vec<(String, Arc<Run>)>, Error>>()?;
    let absorbed: Vec<f64> = runs
        .iter()
        .map(|(_, run)| run.summary.energy.dissipated_intruders)
        .collect();
    let main: Vec<f64> = runs
        .iter()
        .map(|(_, run)| 1.0 / crate::observe::peak(run, 25))
        .collect();
    let mut checks = Vec::new();
    if family.unit < 1.0 {
        checks.push(Check::at_least(
            "absorbed, least growth from mass to mass",
            "",
            least_growth(&absorbed),
            1.2,
        ));
        checks.push(Check::at_least(
            "main wave at contact 25, least fall of its force from mass to mass",
            "",
            least_growth(&main),
            1.01,
        ));
    } else {
        let best = &runs[1].1;
        checks.push(Check::close(
            "main wave at contact 25, c = 12 N·s/m",
            "N",
            crate::observe::peak(best, 25),
            7.691,
            1e-3,
        ));
    }
    Ok(Figure {
        chart: force_panels(&runs),
        checks,
        frames: Vec::new(),
    })
}

/// Motion of two neighbours, and by how far the first wave shifts the first of them.
fn shift(lab: &Lab, mass: f64, beads: [usize; 2]) -> Result<Figure, Error> {
    let run = run(lab, intruder([HOST], mass, OPTIMUM, DAMPING))?;
    let solution = &run.solution;
    let [first, second] = beads.map(|bead| strongest(&run, bead));
    let (Some(first), Some(second)) = (first, second) else {
        return Err(Error::Missing(format!("no pulse passes beads {beads:?}")));
    };
    // Every bead of a wave moves alike, one after another: with a bead's share of the momentum M V and V(t - n / rate), the
    // momentum is M × rate × shift.
    let rate = 1.0 / (second.time - first.time);
    let expected = first.impulse / (solution.model().mass(beads[0]) * rate);
    let between = 0.5 * (second.to + next(&run, beads[0], second.to));
    let before = first.time - 0.7e-3;
    let seen = solution.displacement(beads[0], between) - solution.displacement(beads[0], before);
    let span: Range<f64> = before..13e-3;
    let curves = beads.iter().enumerate().map(|(place, &bead)| {
        line(
            format!("bead {bead}"),
            place,
            over_time(solution, span.clone(), |at| 1e6 * at.displacement(bead)),
        )
    });
    let curves: Vec<_> = curves.collect();
    let before_host = beads[0] < HOST;
    let velocities: Vec<f64> = (0..200)
        .map(|n| between + (span.end - between) * f64::from(n) / 200.0)
        .map(|t| solution.velocity(beads[0], t))
        .collect();
    let backwards = velocities.iter().copied().fold(f64::INFINITY, f64::min);
    let later = solution.displacement(beads[0], span.end) - solution.displacement(beads[0], between);
    let mut checks = vec![Check::close(
        format!(
            "shift of bead {} by the main wave, against P / (M × rate)",
            beads[0]
        ),
        "µm",
        1e6 * seen,
        1e6 * expected,
        // Before the host the wave has not quite shed what the strike left behind it.
        if before_host { 1e-2 } else { 1e-3 },
    )];
    checks.push(if before_host {
        Check::at_most(
            format!("shift of bead {} by the reflected waves", beads[0]),
            "µm",
            1e6 * later,
            -1.5,
        )
    } else {
        Check::at_least(
            format!("shift of bead {} by the secondary waves", beads[0]),
            "µm",
            1e6 * later,
            1.3,
        )
    });
    checks.push(if before_host {
        Check::at_most(
            "least speed after the main wave: backwards",
            "mm/s",
            1e3 * backwards,
            -0.1,
        )
    } else {
        Check::at_least(
            "least speed after the main wave: never backwards",
            "mm/s",
            1e3 * backwards,
            -0.1,
        )
    });
    Ok(Figure {
        chart: chart(time_axis(span), vec![panel("displacement (µm)", curves)]),
        checks,
        frames: Vec::new(),
    })
}

fn strongest(run: &Run, contact: usize) -> Option<hertz_chain::Pulse> {
    let pulses = run.solution.pulses(contact, &PulseSearch::default());
    pulses.into_iter().max_by(|a, b| a.force.total_cmp(&b.force))
}

/// When the pulse after `time` begins at a contact.
fn next(run: &Run, contact: usize, time: f64) -> f64 {
    let pulses = run.solution.pulses(contact, &PulseSearch::default());
    let after = pulses.iter().map(|pulse| pulse.from).find(|&from| from > time);
    after.unwrap_or(run.solution.end())
}

fn reflected(lab: &Lab, family: &Family) -> Result<Figure, Error> {
    let shares = sweep(lab, family)?;
    Ok(Figure {
        checks: (family.reflected)(&shares),
        chart: chart(
            (family.axis)(),
            vec![dotted("reflected (% of incident)", 0, shares.reflected)],
        ),
        frames: Vec::new(),
    })
}

fn transmitted(lab: &Lab, family: &Family) -> Result<Figure, Error> {
    let shares = sweep(lab, family)?;
    Ok(Figure {
        checks: (family.transmitted)(&shares),
        chart: chart(
            (family.axis)(),
            vec![
                dotted("secondary (% of incident)", 0, shares.secondary),
                dotted("main wave (% of incident)", 1, shares.main),
                dotted("absorbed (% of incident)", 2, shares.absorbed),
            ],
        ),
        frames: Vec::new(),
    })
}

fn dotted(label: &str, place: usize, points: Vec<(f64, f64)>) -> Panel {
    Panel {
        height: 170,
        ..panel(
            label,
            vec![line("", place, points.clone()), discs("", place, points)],
        )
    }
}
