//! The pictures of a row: what its sensors felt, each at its place in the chain, and the energy along it.

use hertz_chain::Curve;
use hertz_charts::{Axis, Chart, Ink, Mark, Panel, Series, WIDTH};

use crate::row::chain::Chain;
use crate::row::compare::RowComparison;
use crate::row::energy::{After, Sides};
use crate::row::member::Felt;
use crate::row::strikes::Row;
use crate::strike::{SensedPoint, Traces};

/// Beads beyond the first and the last of the row whose force is shown as simulated.
const BEYOND: usize = 2;
/// Height of the highest curve, in beads.
const HIGH: f64 = 1.9;
/// Before the first arrival and after the last, s.
const BEFORE: f64 = 0.35e-3;
const AFTER: f64 = 1.4e-3;
/// Points of a simulated curve.
const POINTS: usize = 400;

/// A strike as it is drawn: for each bead, its curves and how much later than those it came by the time in
/// common.
struct Drawn<'a> {
    felt: Vec<Option<(&'a Traces, f64)>>,
}

/// The force at each place over time, and E(n).
pub fn overview(row: &Row, chain: &Chain, told: &RowComparison) -> Chart {
    let mut panels = vec![force(row, chain)];
    panels.extend(left(told));
    chart(
        row,
        chain,
        "The force that each bead of the row sensed, over time at its place in the chain, and the energy that is left \
         after n intruders",
        panels,
    )
}

/// The acceleration at each place over time, and T of each intruder.
pub fn details(row: &Row, chain: &Chain, told: &RowComparison) -> Chart {
    let mut panels = vec![acceleration(row, chain)];
    panels.extend(transmission(told));
    chart(
        row,
        chain,
        "The acceleration of each intruder over time at its place in the chain, and the part of the energy that each lets \
         pass",
        panels,
    )
}

fn chart(row: &Row, chain: &Chain, description: &str, panels: Vec<Panel>) -> Chart {
    Chart {
        description: description.to_owned(),
        width: WIDTH,
        ..Chart::new(time(span(row, chain)), panels)
    }
}

fn time((from, to): (f64, f64)) -> Axis {
    Axis::new("time since the striker hit (ms)", from * 1e3..to * 1e3)
}

/// From shortly before the wave comes to the first bead until it has passed the last, s.
fn span(row: &Row, chain: &Chain) -> (f64, f64) {
    let fronts = row.members.iter().map(|member| member.chain.front());
    let (first, last) = fronts.fold((f64::INFINITY, 0.0_f64), |(low, high), front| {
        (low.min(front), high.max(front))
    });
    let end = chain.solution.end();
    ((first - BEFORE).clamp(0.0, end), (last + AFTER).min(end))
}

/// The strike that most beads felt, of those whose curves are kept.
fn drawn(row: &Row) -> Drawn<'_> {
    let mut best: Option<(usize, Drawn<'_>)> = None;
    for strike in &row.strikes {
        let zero = row.zero(strike);
        let felt: Vec<_> = row
            .felt(strike)
            .into_iter()
            .map(|felt| curves(felt?, zero))
            .collect();
        let count = felt.iter().flatten().count();
        if best.as_ref().is_none_or(|(most, _)| count > *most) {
            best = Some((count, Drawn { felt }));
        }
    }
    best.map_or(Drawn { felt: Vec::new() }, |(_, drawn)| drawn)
}

/// A strike's curves, and how much later than they say it came.
fn curves(felt: &Felt, zero: Option<f64>) -> Option<(&Traces, f64)> {
    // Without a time in common a curve stands where it fits the simulation best.
    let late = zero.zip(felt.rise.zip(felt.rise_drawn));
    let late = late.map_or(0.0, |(zero, (rise, drawn))| rise - zero - drawn);
    Some((felt.traces.as_ref()?, late))
}

/// Curves at the places of their beads, `scale` beads high for each unit.
fn at_places(
    row: &Row,
    name: &str,
    scale: f64,
    points: impl Fn(&Traces) -> &[SensedPoint],
    (from, to): (f64, f64),
) -> Vec<Series> {
    let mut curves: Vec<Series> = Vec::new();
    for (member, felt) in row.members.iter().zip(drawn(row).felt) {
        let Some((traces, late)) = felt else { continue };
        let place = |point: &SensedPoint| {
            let time = point.time + late;
            (time * 1e3, member.bead as f64 + scale * point.sensed)
        };
        let shown = points(traces).iter().map(place);
        curves.push(Series {
            name: String::new(),
            ink: Ink::Sensed,
            mark: Mark::Line,
            points: shown
                .filter(|(time, _)| (from * 1e3..=to * 1e3).contains(time))
                .collect(),
        });
    }
    // One name for all.
    if let Some(first) = curves.first_mut() {
        first.name = name.to_owned();
    }
    curves
}

/// Simulated curves at the places of `beads`.
fn simulated(
    beads: impl IntoIterator<Item = (usize, Mark)>,
    name: &str,
    scale: f64,
    value: impl Fn(usize) -> Option<Curve>,
    (from, to): (f64, f64),
) -> Vec<Series> {
    let mut curves: Vec<Series> = Vec::new();
    for (bead, mark) in beads {
        let Some(mut curve) = value(bead) else { continue };
        let at = |point: usize| {
            let time = from + (to - from) * point as f64 / POINTS as f64;
            let time = time.min(curve.end());
            (time * 1e3, bead as f64 + scale * curve.at(time))
        };
        curves.push(Series {
            name: String::new(),
            ink: Ink::Chain,
            mark,
            points: (0..=POINTS).map(at).collect(),
        });
    }
    // One name for all, beside the mark that lies under the beads' own.
    let named = curves.iter().position(|curve| curve.mark == Mark::Broad);
    if let Some(curve) = curves.get_mut(named.unwrap_or(0)) {
        curve.name = name.to_owned();
    }
    curves
}

/// Places with the mark that their simulated curve has: broad under what a bead sensed, thin elsewhere.
fn marked(row: &Row, beads: impl IntoIterator<Item = usize>) -> Vec<(usize, Mark)> {
    let mark = |bead: usize| {
        if row.members.iter().any(|member| member.bead == bead) {
            (bead, Mark::Broad)
        } else {
            (bead, Mark::Line)
        }
    };
    beads.into_iter().map(mark).collect()
}

/// The first place of the row and the last.
fn ends(row: &Row) -> (usize, usize) {
    let beads = row.members.iter().map(|member| member.bead);
    beads.fold((usize::MAX, 0), |(low, high), bead| {
        (low.min(bead), high.max(bead))
    })
}

/// The places whose force is drawn.
fn places(row: &Row, chain: &Chain) -> (usize, usize) {
    let ((first, last), end) = (ends(row), chain.scenario.chain.beads);
    (first.saturating_sub(BEYOND).max(1), (last + BEYOND).min(end))
}

fn force(row: &Row, chain: &Chain) -> Panel {
    let span = span(row, chain);
    let (first, last) = places(row, chain);
    let highest = row.members.iter().map(|member| member.chain.truth().peak_force);
    let highest = highest.fold(0.0, f64::max);
    let scale = HIGH / highest;
    let of = |bead: usize| Some(chain.solution.force_beyond_curve(bead));
    let mut series = simulated(marked(row, first..=last), "simulated", scale, of, span);
    series.extend(at_places(
        row,
        "sensed by the beads",
        scale,
        |traces| &traces.force,
        span,
    ));
    Panel::new("place of the bead", series)
        .range(first as f64 - 0.4, last as f64 + HIGH + 0.2)
        .over(time(span))
        .height(height(first, last))
        .note(format!("Force: one bead up is {:.1} N", 1.0 / scale))
}

fn acceleration(row: &Row, chain: &Chain) -> Panel {
    let span = span(row, chain);
    let (first, last) = ends(row);
    let inside = |host: &usize| (first..=last).contains(host);
    let hosts = marked(row, chain.hosts.iter().copied().filter(inside));
    let of = |bead: usize| chain.solution.acceleration_curve(bead);
    // As high, up and down together, as the forces.
    let unscaled = simulated(hosts.clone(), "", 1.0, of, span);
    let reach = |curve: &Series| {
        let base = curve.points.first().map_or(0.0, |first| first.1);
        curve
            .points
            .iter()
            .map(|point| (point.1 - base).abs())
            .fold(0.0, f64::max)
    };
    let greatest = unscaled.iter().map(reach).fold(f64::MIN_POSITIVE, f64::max);
    let scale = 0.5 * HIGH / greatest;
    let mut series = simulated(hosts, "simulated", scale, of, span);
    series.extend(at_places(
        row,
        "sensed by the beads",
        scale,
        |traces| &traces.acceleration,
        span,
    ));
    Panel::new("place of the bead", series)
        .range(first as f64 - 1.1, last as f64 + 1.1)
        .over(time(span))
        .height(height(first, last))
        .note(format!("Acceleration: one bead up is {:.0} m/s²", 1.0 / scale))
}

/// Pixels for the places from one to another.
fn height(first: usize, last: usize) -> u32 {
    (34 * (last - first + 2) as u32).clamp(180, 640)
}

/// E(n) by the beads over the simulation's.
fn left(told: &RowComparison) -> Option<Panel> {
    let after = &told.energy.after;
    let most = after.last()?.n;
    let points = |side: fn(&Sides<f64>) -> f64| -> Vec<(f64, f64)> {
        after
            .iter()
            .map(|one| (one.n as f64, 100.0 * side(&one.left)))
            .collect()
    };
    let own = |of: fn(&Sides<f64>) -> f64| -> Vec<(f64, f64)> {
        let is_own = |one: &&After| one.transmission.is_none_or(|through| through.by_a.is_some());
        let own = after.iter().filter(is_own);
        own.map(|one| (one.n as f64, 100.0 * of(&one.left))).collect()
    };
    let series = |name: &str, ink, mark, points| Series {
        name: name.to_owned(),
        ink,
        mark,
        points,
    };
    let mut all = vec![
        series(
            "simulated, rows of n intruders (Fig. 5)",
            Ink::Chain,
            Mark::Broad,
            points(|side| side.rows_of_n),
        ),
        series(
            "by the beads, A",
            Ink::Measured,
            Mark::Rings,
            own(|side| side.by_a),
        ),
        series(
            "by the beads, B",
            Ink::Predicted,
            Mark::Discs,
            own(|side| side.by_b),
        ),
    ];
    if let Some(fit) = told.energy.fit.by_a {
        let power = |one: &After| {
            let power = fit.initial * fit.transmission.powi(one.n as i32);
            (one.n as f64, 100.0 * power)
        };
        let name = format!("Tⁿ, T = {:.4}", fit.transmission);
        all.push(series(
            &name,
            Ink::Guide,
            Mark::Dashed,
            after.iter().map(power).collect(),
        ));
    }
    Some(
        Panel::new("energy left, E(n) (%)", all)
            .over(Axis::count("intruders n", 0..=most))
            .height(230),
    )
}

/// T of each intruder by its bead beside the simulation's.
fn transmission(told: &RowComparison) -> Option<Panel> {
    let after = &told.energy.after;
    let (first, last) = (after.get(1)?.bead?, after.last()?.bead?);
    let points = |side: usize| -> Vec<(f64, f64)> {
        let point = |one: &After| Some((one.bead? as f64, one.transmission?.each()[side]?));
        after.iter().filter_map(point).collect()
    };
    let series = |name: &str, ink, mark, side| Series {
        name: name.to_owned(),
        ink,
        mark,
        points: points(side),
    };
    let all = vec![
        series("simulated, this row", Ink::Chain, Mark::Broad, 2),
        series("simulated, rows of n", Ink::Guide, Mark::Dashed, 3),
        series("by the bead, A", Ink::Measured, Mark::Rings, 0),
        series("by the bead, B", Ink::Predicted, Mark::Discs, 1),
    ];
    Some(
        Panel::new("T of the intruder", all)
            .over(Axis::count("place of the bead", first..=last))
            .height(230),
    )
}
