//! Figures A2 and A3: the intruder of Fig. 4 with other masses, and with other dampers.

use std::ops::Range;
use std::sync::Arc;

use hertz_chain::{Intruder, PulseSearch, Split};

use super::fig4::{HOST, force_panels, run, share, splits};
use crate::check::{FigureCheck, checks};
use crate::curve::{dotted, geometric, line, over_time, time_axis};
use crate::error::Error;
use crate::lab::{FigureRun, Lab};
use crate::observe::{greatest, last, least_growth, ordinates, peak, summit};
use crate::plan::{Figure, plans};
use crate::setting::{DAMPING, MASS, OPTIMUM, intruder};
use hertz_charts::{Axis, Panel};

const BY_MASS: &str = "46 beads, τ = 0, intruder k 10⁵ N/m, c 12 N·s/m in bead 15, m = 1, 3.7, 7.8 g";
const BY_DAMPING: &str = "46 beads, τ = 0, intruder m 3.7 g, k 10⁵ N/m in bead 15, c = 4, 12, 36 N·s/m";
const MASS_SWEEP: &str = "46 beads, τ = 0, intruder k 10⁵ N/m, c 12 N·s/m in bead 15, m from 0.5 to 12.5 g; energies through contacts 10 and 25";
const DAMPING_SWEEP: &str = "46 beads, τ = 0, intruder m 3.7 g, k 10⁵ N/m in bead 15, c from 0.3 to 300 N·s/m; energies through contacts 10 and 25";
const LATE_WAVE: &str = "as A3e; the step at 0.5 N·s/m is a wave of 0.07 N that passes contact 10 after 20 ms, when the host that still rings meets its neighbour again";

plans! {
    "A2a": "force at contacts 10 and 25 for three masses"; BY_MASS => |lab| forces(lab, &MASSES),
    "A2b": "motion of beads 9 and 10, m = 7.8 g"; BY_MASS => |lab| shift(lab, 7.8e-3, [9, 10]),
    "A2c": "motion of beads 24 and 25, m = 7.8 g"; BY_MASS => |lab| shift(lab, 7.8e-3, [24, 25]),
    "A2d": "energy of the reflected waves against mass";
        MASS_SWEEP => |lab| reflected(lab, &MASSES),
    "A2e": "energy of the transmitted waves, and absorbed, against mass";
        MASS_SWEEP => |lab| transmitted(lab, &MASSES),
    "A3a": "force at contacts 10 and 25 for three dampers";
        BY_DAMPING => |lab| forces(lab, &DAMPINGS),
    "A3b": "motion of beads 9 and 10, m = 3.7 g"; BY_DAMPING => |lab| shift(lab, MASS, [9, 10]),
    "A3c": "motion of beads 24 and 25, m = 3.7 g"; BY_DAMPING => |lab| shift(lab, MASS, [24, 25]),
    "A3d": "energy of the reflected waves against damping";
        LATE_WAVE => |lab| reflected(lab, &DAMPINGS),
    "A3e": "energy of the transmitted waves, and absorbed, against damping";
        DAMPING_SWEEP => |lab| transmitted(lab, &DAMPINGS),
}

/// A change of the intruder, and the conditions on its energies.
struct IntruderFamily {
    three: [(&'static str, f64); 3],
    intruder: fn(f64) -> Intruder,
    values: fn() -> Vec<f64>,
    axis: fn() -> Axis,
    /// The unit of the axis, in units of the values.
    unit: f64,
    reflected: fn(&Shares) -> Vec<FigureCheck>,
    transmitted: fn(&Shares) -> Vec<FigureCheck>,
}

/// Shares of the incident energy in %, against the swept quantity.
struct Shares {
    reflected: Vec<(f64, f64)>,
    secondary: Vec<(f64, f64)>,
    main: Vec<(f64, f64)>,
    absorbed: Vec<(f64, f64)>,
}

const MASSES: IntruderFamily = IntruderFamily {
    three: [("m = 1 g", 1e-3), ("3.7 g", 3.7e-3), ("7.8 g", 7.8e-3)],
    intruder: |mass| intruder([HOST], mass, OPTIMUM, DAMPING),
    values: || (1..=25).map(|n| 0.5e-3 * f64::from(n)).collect(),
    axis: || Axis::new("intruder's mass m (g)", 0.0..12.5),
    unit: 1e-3,
    reflected: |shares| {
        checks![
            "reflected, least growth from mass to mass":
                least_growth(&ordinates(&shares.reflected)) => at_least(1.0);
            "reflected at 12.5 g", "%": last(&shares.reflected) => at_least(1.25);
        ]
    },
    transmitted: |shares| {
        checks![
            "secondary waves, least growth from mass to mass":
                least_growth(&ordinates(&shares.secondary)) => at_least(1.0);
            "main wave, least fall from mass to mass": least_fall(&shares.main) => at_least(1.0);
            "main wave at 12.5 g", "%": last(&shares.main) => at_most(86.0);
        ]
    },
};

const DAMPINGS: IntruderFamily = IntruderFamily {
    three: [("c = 4 N·s/m", 4.0), ("12", 12.0), ("36", 36.0)],
    intruder: |damping| intruder([HOST], MASS, OPTIMUM, damping),
    values: || geometric(0.3, 300.0, 31),
    axis: || Axis::log("damping c (N·s/m)", 0.3..300.0),
    unit: 1.0,
    reflected: |shares| {
        checks![
            "reflected, least fall from damping to damping": least_fall(&shares.reflected) => at_least(1.0);
        ]
    },
    transmitted: |shares| {
        checks![
            "secondary waves, least fall from damping to damping":
                least_fall(&shares.secondary) => at_least(1.0);
            "most is absorbed at c, decades from 2.5 N·s/m", "decades":
                (summit(&shares.absorbed) / 2.5).log10() => near(0.0, 0.3);
            "absorbed at the most, over that at either end":
                greatest(&shares.absorbed) / shares.absorbed[0].1.max(last(&shares.absorbed))
                => at_least(1.05);
        ]
    },
};

fn least_fall(points: &[(f64, f64)]) -> f64 {
    let mut values = ordinates(points);
    values.reverse();
    least_growth(&values)
}

fn sweep(lab: &Lab, family: &IntruderFamily) -> Result<Shares, Error> {
    let values = (family.values)();
    let intruders: Vec<Intruder> = values.iter().map(|&value| (family.intruder)(value)).collect();
    let splits = splits(lab, &intruders)?;
    let values: Vec<f64> = values.iter().map(|value| value / family.unit).collect();
    let of = |part: fn(&Split) -> f64| share(&values, &splits, part);
    Ok(Shares {
        reflected: of(|split| split.reflected),
        secondary: of(|split| split.secondary),
        main: of(|split| split.main.energy),
        absorbed: of(|split| split.absorbed),
    })
}

fn forces(lab: &Lab, family: &IntruderFamily) -> Result<Figure, Error> {
    let runs = family
        .three
        .iter()
        .map(|(name, value)| Ok(((*name).to_owned(), run(lab, (family.intruder)(*value))?)))
        .collect::<Result<Vec<(String, Arc<FigureRun>)>, Error>>()?;
    let absorbed = runs
        .iter()
        .map(|(_, run)| run.summary.energy.dissipated_intruders);
    let absorbed: Vec<f64> = absorbed.collect();
    let main: Vec<f64> = runs.iter().map(|(_, run)| 1.0 / peak(run, 25)).collect();
    let checks = if family.unit < 1.0 {
        checks![
            "absorbed, least growth from mass to mass": least_growth(&absorbed) => at_least(1.2);
            "main wave at contact 25, least fall of its force from mass to mass":
                least_growth(&main) => at_least(1.01);
        ]
    } else {
        checks!["main wave at contact 25, c = 12 N·s/m", "N": peak(&runs[1].1, 25) => close(7.691, 1e-3);]
    };
    Ok(Figure::new(force_panels(&runs), checks))
}

/// Motion of two neighbours, and by how far the first wave shifts the first of them.
fn shift(lab: &Lab, mass: f64, beads: [usize; 2]) -> Result<Figure, Error> {
    let run = run(lab, intruder([HOST], mass, OPTIMUM, DAMPING))?;
    let solution = &run.solution;
    let [first, second] = beads.map(|bead| strongest(&run, bead));
    let (Some(first), Some(second)) = (first, second) else {
        return Err(Error::Missing(format!("no pulse passes beads {beads:?}")));
    };
    // The beads of a wave move alike, one after another: bead n moves with V(t - n / rate). Its momentum is M
    // V, so that the wave's momentum is M × rate × shift.
    let rate = 1.0 / (second.time - first.time);
    let expected = first.impulse / (solution.model().mass(beads[0]) * rate);
    let between = 0.5 * (second.to + next(&run, beads[0], second.to));
    let before = first.time - 0.7e-3;
    let seen = solution.at(between).displacement(beads[0]) - solution.at(before).displacement(beads[0]);
    let span: Range<f64> = before..13e-3;
    let curves = beads.iter().enumerate().map(|(place, &bead)| {
        let motion = over_time(solution, span.clone(), |at| 1e6 * at.displacement(bead));
        line(format!("bead {bead}"), place, motion)
    });
    let curves: Vec<_> = curves.collect();
    let before_host = beads[0] < HOST;
    let backwards = (0..200)
        .map(|n| between + (span.end - between) * f64::from(n) / 200.0)
        .map(|time| solution.at(time).velocity(beads[0]))
        .fold(f64::INFINITY, f64::min);
    let later = solution.at(span.end).displacement(beads[0]) - solution.at(between).displacement(beads[0]);
    let (bead, [seen, expected, later]) = (beads[0], [seen, expected, later].map(|metres| 1e6 * metres));
    // Before the host, the wave still carries a little of what the strike left behind it.
    let part = if before_host { 1e-2 } else { 1e-3 };
    let mut checks = checks![
        "shift of bead {bead} by the main wave, against P / (M × rate)", "µm": seen => close(expected, part);
    ];
    checks.extend(if before_host {
        checks![
            "shift of bead {bead} by the reflected waves", "µm": later => at_most(-1.5);
            "least speed after the main wave: backwards", "mm/s": 1e3 * backwards => at_most(-0.1);
        ]
    } else {
        checks![
            "shift of bead {bead} by the secondary waves", "µm": later => at_least(1.3);
            "least speed after the main wave: never backwards", "mm/s": 1e3 * backwards => at_least(-0.1);
        ]
    });
    let panel = Panel::new("displacement (µm)", curves);
    Ok(Figure::over(time_axis(span), vec![panel], checks))
}

fn strongest(run: &FigureRun, contact: usize) -> Option<hertz_chain::Pulse> {
    let pulses = run.solution.pulses(contact, &PulseSearch::default());
    pulses.into_iter().max_by(|a, b| a.force.total_cmp(&b.force))
}

/// Start of the next pulse at a contact after `time`; the end of the run without one.
fn next(run: &FigureRun, contact: usize, time: f64) -> f64 {
    let pulses = run.solution.pulses(contact, &PulseSearch::default());
    let after = pulses.iter().map(|pulse| pulse.from).find(|&from| from > time);
    after.unwrap_or(run.solution.end())
}

fn reflected(lab: &Lab, family: &IntruderFamily) -> Result<Figure, Error> {
    let shares = sweep(lab, family)?;
    let checks = (family.reflected)(&shares);
    let panels = vec![small("reflected (% of incident)", 0, shares.reflected)];
    Ok(Figure::over((family.axis)(), panels, checks))
}

fn transmitted(lab: &Lab, family: &IntruderFamily) -> Result<Figure, Error> {
    let shares = sweep(lab, family)?;
    let checks = (family.transmitted)(&shares);
    let panels = vec![
        small("secondary (% of incident)", 0, shares.secondary),
        small("main wave (% of incident)", 1, shares.main),
        small("absorbed (% of incident)", 2, shares.absorbed),
    ];
    Ok(Figure::over((family.axis)(), panels, checks))
}

fn small(label: &str, place: usize, points: Vec<(f64, f64)>) -> Panel {
    Panel::new(label, dotted("", place, points).into()).height(210)
}
