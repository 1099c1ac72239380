//! Figure 4: what an intruder in bead 15 of 46 elastic beads reflects, transmits and sends on later, by its
//! stiffness.

use std::sync::Arc;

use hertz_chain::{Intruder, PulseSearch, Split};
use rayon::prelude::*;

use crate::check::{FigureCheck, checks};
use crate::curve::{dotted, force_over_time, geometric, time_axis, told_apart};
use crate::error::Error;
use crate::lab::{FigureRun, Lab};
use crate::observe::{greatest, greatest_within, peak, summit};
use crate::plan::{Figure, plans};
use crate::setting::{DAMPING, ELASTIC, MASS, OPTIMUM, intruder, strike, with};
use hertz_charts::{Axis, Chart, Panel, Series};

/// The host of Figs. 4, A2 and A3.
pub(crate) const HOST: usize = 15;
const NEAR: usize = 10;
const FAR: usize = 25;
pub(crate) const DURATION: f64 = 0.014;
/// Long enough for the slow secondary waves to pass both contacts. The main wave reaches the end after 11 ms,
/// and a free end sends nothing back.
const SPLIT_DURATION: f64 = 0.04;
const SWEEP: &str = "46 beads, τ = 0, intruder m 3.7 g, c 12 N·s/m in bead 15, k from 10³ to 10⁷ N/m; energies through contacts 10 and 25";

plans! {
    "4a": "force at contacts 10 and 25 for three stiffnesses";
        "46 beads, τ = 0, intruder m 3.7 g, c 12 N·s/m in bead 15, k = 10³, 10⁵, 10⁷ N/m" => forces,
    "4b": "energy of the reflected waves against stiffness"; SWEEP => reflected,
    "4c": "energy of the transmitted secondary waves and of the main wave against stiffness";
        SWEEP => transmitted,
}

/// The run with this intruder in the host.
pub(crate) fn run(lab: &Lab, intruder: Intruder) -> Result<Arc<FigureRun>, Error> {
    lab.run(&with(strike(46, ELASTIC, DURATION), intruder))
}

/// Forces at contacts 10 and 25, and the small waves that follow the main ones, for runs with names. All
/// panels have one axis of time. In a magnified panel the main wave leaves through the upper edge.
pub(crate) fn force_panels(runs: &[(String, Arc<FigureRun>)]) -> Chart {
    let span = 1.5e-3..13e-3;
    let curves = |contact: usize| -> Vec<Series> {
        let named = |(place, (name, run)): (usize, &(String, Arc<FigureRun>))| {
            let name = if contact == NEAR { name.as_str() } else { "" };
            told_apart(name, place, force_over_time(&run.solution, &span, contact))
        };
        runs.iter().enumerate().map(named).collect()
    };
    let label = |contact: usize| format!("force at {contact} (N)");
    let whole = |contact: usize| Panel::new(label(contact), curves(contact)).height(150);
    // The main wave has passed the contact at `from`, ms.
    let magnified = |contact: usize, from: f64| {
        let mut curves = curves(contact);
        let later = |series: &Series| greatest_within(&series.points, from..f64::INFINITY);
        let highest = curves.iter().map(later).fold(0.0, f64::max);
        curves.iter_mut().for_each(|series| series.name.clear());
        Panel::new(label(contact), curves)
            .height(150)
            .range(0.0, 1.12 * highest)
            .note("the same, magnified")
    };
    let panels = vec![whole(NEAR), magnified(NEAR, 4.0), whole(FAR), magnified(FAR, 7.5)];
    Chart::new(time_axis(span.clone()), panels)
}

fn forces(lab: &Lab) -> Result<Figure, Error> {
    let plain = lab.run(&strike(46, ELASTIC, DURATION))?;
    let mut runs = Vec::new();
    for (name, stiffness) in [("k = 10³ N/m", 1e3), ("10⁵", OPTIMUM), ("10⁷", 1e7)] {
        let run = run(lab, intruder([HOST], MASS, stiffness, DAMPING))?;
        runs.push((name.to_owned(), run));
    }
    let best = peak(&runs[1].1, FAR);
    let checks = checks![
        "main wave at contact 25 without intruder", "N": peak(&plain, FAR) => close(7.936, 1e-3);
        "main wave at contact 25, k = 10⁵", "N": best => close(7.691, 1e-3);
        "main wave at contact 25, k = 10⁷, of that without":
            peak(&runs[2].1, FAR) / peak(&plain, FAR) => at_least(0.999);
    ];
    Ok(Figure::new(force_panels(&runs), checks))
}

/// The split of the incident wave for each of these intruders in the host.
pub(crate) fn splits(lab: &Lab, intruders: &[Intruder]) -> Result<Vec<Split>, Error> {
    intruders
        .par_iter()
        .map(|intruder| {
            let scenario = with(strike(46, ELASTIC, SPLIT_DURATION), intruder.clone());
            let split = |run: FigureRun| run.solution.split(NEAR, FAR, &PulseSearch::default());
            let split = lab.keep("split", &scenario, split)?;
            let missing = || Error::Missing("no pulse passes contacts 10 and 25".to_owned());
            (*split).clone().ok_or_else(missing)
        })
        .collect()
}

/// A part of the incident energy in %, for each value of the sweep.
pub(crate) fn share(values: &[f64], splits: &[Split], of: impl Fn(&Split) -> f64) -> Vec<(f64, f64)> {
    let percent = |split: &Split| 100.0 * of(split) / split.incident.energy;
    values.iter().copied().zip(splits.iter().map(percent)).collect()
}

fn sweep(lab: &Lab) -> Result<(Vec<f64>, Vec<Split>), Error> {
    let stiffnesses = geometric(1e3, 1e7, 41);
    let of = |&stiffness: &f64| intruder([HOST], MASS, stiffness, DAMPING);
    let intruders: Vec<Intruder> = stiffnesses.iter().map(of).collect();
    let splits = splits(lab, &intruders)?;
    Ok((stiffnesses, splits))
}

/// Within a factor 1.3 of 10⁵ N/m.
fn near_optimum(what: &str, stiffness: f64) -> FigureCheck {
    let decades = (stiffness / OPTIMUM).log10();
    FigureCheck::near(what, "decades", decades, 0.0, 1.3_f64.log10())
}

fn closure(splits: &[Split]) -> FigureCheck {
    let rests = splits
        .iter()
        .map(|split| split.rest.abs() / split.incident.energy);
    let rest = rests.fold(0.0, f64::max);
    let what = "energy still between the contacts, of the incident";
    FigureCheck::at_most(what, "", rest, 2e-5)
}

fn reflected(lab: &Lab) -> Result<Figure, Error> {
    let (stiffnesses, splits) = sweep(lab)?;
    let points = share(&stiffnesses, &splits, |split| split.reflected);
    let low = points[0].1 / greatest(&points);
    let checks = vec![
        near_optimum("most is reflected at k, decades from 10⁵ N/m", summit(&points)),
        FigureCheck::at_most("reflected at 10³, of the most", "", low, 0.42)
            .but_paper("a large reflection at low k"),
        closure(&splits),
    ];
    let panel = Panel::new("reflected (% of incident)", dotted("", 0, points).into());
    Ok(Figure::over(by_stiffness(), vec![panel], checks))
}

fn by_stiffness() -> Axis {
    Axis::log("stiffness k (N/m)", 1e3..1e7)
}

fn transmitted(lab: &Lab) -> Result<Figure, Error> {
    let (stiffnesses, splits) = sweep(lab)?;
    let secondary = share(&stiffnesses, &splits, |split| split.secondary);
    let main = share(&stiffnesses, &splits, |split| split.main.energy);
    let lost: Vec<(f64, f64)> = main.iter().map(|(k, main)| (*k, -main)).collect();
    let (most, least) = (summit(&secondary), summit(&lost));
    let checks = vec![
        near_optimum("most goes into secondary waves at k, decades from 10⁵ N/m", most),
        near_optimum("least stays in the main wave at k, decades from 10⁵ N/m", least),
        closure(&splits),
    ];
    let panels = vec![
        Panel::new("secondary (% of incident)", dotted("", 0, secondary).into()),
        Panel::new("main wave (% of incident)", dotted("", 1, main).into()),
    ];
    Ok(Figure::over(by_stiffness(), panels, checks))
}
