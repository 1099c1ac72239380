//! The pictures of a row: what its sensors felt, each at its place in the chain, and the energy along it.

use hertz_chain::Curve;
use hertz_charts::{Axis, Chart, Ink, Mark, Panel, Series};

use crate::pictures::{time_axis, wide};
use crate::row::chain::RowChain;
use crate::row::compare::RowComparison;
use crate::row::energy::{After, EnergyAlong};
use crate::row::member::FeltStrike;
use crate::row::strikes::BeadRow;
use crate::traces::{SensedPoint, Traces};

/// Beads beyond the first and the last of the row whose force is shown as simulated.
const BEYOND: usize = 2;
/// Height of the highest curve, in beads.
const HIGH: f64 = 1.9;
/// Before the first arrival and after the last, s.
const BEFORE: f64 = 0.35e-3;
const AFTER: f64 = 1.4e-3;
const POINTS: usize = 400;

/// The force at each place over time with E(n), and the acceleration at each place over time with T of each
/// intruder.
pub fn charts(row: &BeadRow, chain: &RowChain, compared: &RowComparison) -> [Chart; 2] {
    let time = || time_axis(span(row, chain));
    let mut overview = vec![force(row, chain)];
    overview.extend(left(&compared.energy));
    let mut details = vec![acceleration(row, chain)];
    details.extend(transmission(&compared.energy));
    let of_forces = "The force that each bead of the row sensed, over time at its place in the chain, and the energy that is left \
                     after n intruders";
    let of_accelerations = "The acceleration of each intruder over time at its place in the chain, and the part of the energy \
                            that each lets pass";
    let overview = wide(of_forces, time(), overview);
    [overview, wide(of_accelerations, time(), details)]
}

/// The span from shortly before the wave comes to the first bead until it has passed the last, s.
fn span(row: &BeadRow, chain: &RowChain) -> [f64; 2] {
    let fronts = row.members.iter().map(|member| member.chain.front());
    let (first, last) = fronts.fold((f64::INFINITY, 0.0_f64), |(low, high), front| {
        (low.min(front), high.max(front))
    });
    let end = chain.solution.end();
    [(first - BEFORE).clamp(0.0, end), (last + AFTER).min(end)]
}

/// For each bead its curves of one strike, and how much later its arrival is in the common time than in the
/// curves, s. The strike is the one that most beads felt, of those whose curves are kept.
fn drawn(row: &BeadRow) -> Vec<Option<(&Traces, f64)>> {
    let of = |strike: &Vec<Option<usize>>| {
        let zero = row.zero(strike);
        let felt = row.felt(strike).into_iter();
        felt.map(|felt| curves(felt?, zero)).collect::<Vec<_>>()
    };
    // The first of equals.
    let strikes = row.strikes.iter().rev().map(of);
    strikes
        .max_by_key(|felt| felt.iter().flatten().count())
        .unwrap_or_default()
}

fn curves(felt: &FeltStrike, zero: Option<f64>) -> Option<(&Traces, f64)> {
    // Without a common time, a curve is drawn where it fits the simulation best.
    let late = zero.zip(felt.rise.zip(felt.rise_drawn));
    let late = late.map_or(0.0, |(zero, (rise, drawn))| rise - zero - drawn);
    Some((felt.traces.as_ref()?, late))
}

/// A quantity as it is drawn at each place.
struct DrawnQuantity {
    /// The simulated curve of each bead: times, s, and values.
    simulated: Vec<(usize, Vec<(f64, f64)>)>,
    sensed: fn(&Traces) -> &[SensedPoint],
    /// Height of a unit, in beads.
    scale: f64,
    /// The lowest and the highest place on the axis.
    range: [f64; 2],
    /// Pixels.
    height: u32,
    note: String,
}

impl DrawnQuantity {
    fn panel(self, row: &BeadRow, chain: &RowChain) -> Panel {
        let [from, to] = span(row, chain);
        let is_member = |bead: usize| row.members.iter().any(|member| member.bead == bead);
        // One name for all simulated curves, beside the mark that is drawn under the beads' own.
        let named = self.simulated.iter().position(|(bead, _)| is_member(*bead));
        let mut series = Vec::new();
        for (number, (bead, points)) in self.simulated.iter().enumerate() {
            let is_named = number == named.unwrap_or(0);
            let name = if is_named { "simulated" } else { "" };
            let mark = if is_member(*bead) { Mark::Broad } else { Mark::Line };
            let at = |(time, value): &(f64, f64)| (time * 1e3, *bead as f64 + self.scale * value);
            let points = points.iter().map(at);
            series.push(Series::new(name, Ink::Chain, mark, points));
        }
        let mut name = "sensed by the beads";
        for (member, felt) in row.members.iter().zip(drawn(row)) {
            let Some((traces, late)) = felt else { continue };
            let points = (self.sensed)(traces).iter().map(|point| {
                let height = self.scale * point.sensed;
                ((point.time + late) * 1e3, member.bead as f64 + height)
            });
            let points = points.filter(|(time, _)| (from * 1e3..=to * 1e3).contains(time));
            let name = std::mem::take(&mut name);
            series.push(Series::new(name, Ink::Sensed, Mark::Line, points));
        }
        let [low, high] = self.range;
        Panel::new("place of the bead", series)
            .range(low, high)
            .over(time_axis([from, to]))
            .height(self.height)
            .note(self.note)
    }
}

fn simulated(
    row: &BeadRow,
    chain: &RowChain,
    beads: impl Iterator<Item = usize>,
    value: impl Fn(usize) -> Option<Curve>,
) -> Vec<(usize, Vec<(f64, f64)>)> {
    let [from, to] = span(row, chain);
    let of = |bead: usize| {
        let mut curve = value(bead)?;
        let at = |point: usize| {
            let time = (from + (to - from) * point as f64 / POINTS as f64).min(curve.end());
            (time, curve.at(time))
        };
        Some((bead, (0..=POINTS).map(at).collect()))
    };
    beads.filter_map(of).collect()
}

fn ends(row: &BeadRow) -> [usize; 2] {
    let beads = || row.members.iter().map(|member| member.bead);
    [beads().min().unwrap_or(1), beads().max().unwrap_or(1)]
}

fn force(row: &BeadRow, chain: &RowChain) -> Panel {
    let [first, last] = ends(row);
    let first = first.saturating_sub(BEYOND).max(1);
    let last = (last + BEYOND).min(chain.scenario.chain.beads);
    let peaks = row.members.iter().map(|member| member.chain.truth.peak_force);
    let scale = HIGH / peaks.fold(0.0, f64::max);
    let of = |bead: usize| Some(chain.solution.force_beyond_curve(bead));
    let drawn = DrawnQuantity {
        simulated: simulated(row, chain, first..=last, of),
        sensed: |traces| &traces.force,
        scale,
        height: height(first, last),
        range: [first as f64 - 0.4, last as f64 + HIGH + 0.2],
        note: format!("Force: one bead up is {:.1} N", 1.0 / scale),
    };
    drawn.panel(row, chain)
}

fn acceleration(row: &BeadRow, chain: &RowChain) -> Panel {
    let [first, last] = ends(row);
    let hosts = chain.hosts.iter().copied();
    let hosts = hosts.filter(|host| (first..=last).contains(host));
    let simulated = simulated(row, chain, hosts, |bead| chain.solution.acceleration_curve(bead));
    // The accelerations reach as high, up and down together, as the forces.
    let reach = |(_, points): &(usize, Vec<(f64, f64)>)| {
        let off = points.iter().map(|point| (point.1 - points[0].1).abs());
        off.fold(0.0, f64::max)
    };
    let scale = 0.5 * HIGH / simulated.iter().map(reach).fold(f64::MIN_POSITIVE, f64::max);
    let drawn = DrawnQuantity {
        simulated,
        sensed: |traces| &traces.acceleration,
        scale,
        height: height(first, last),
        range: [first as f64 - 1.1, last as f64 + 1.1],
        note: format!("Acceleration: one bead up is {:.0} m/s²", 1.0 / scale),
    };
    drawn.panel(row, chain)
}

/// Pixels for the places from one to another.
fn height(first: usize, last: usize) -> u32 {
    (34 * (last - first + 2) as u32).clamp(180, 640)
}

/// E(n) by the beads over the simulation's.
fn left(energy: &EnergyAlong) -> Option<Panel> {
    let after = &energy.after;
    let most = after.last()?.n;
    let points = |value: &dyn Fn(&After) -> Option<f64>| -> Vec<(f64, f64)> {
        let point = |one: &After| Some((one.n as f64, 100.0 * value(one)?));
        after.iter().filter_map(point).collect()
    };
    let is_own = |one: &After| one.transmission.is_none_or(|through| through.by_a.is_some());
    let in_rows = points(&|one| Some(one.left.rows_of_n));
    let by_a = points(&|one| is_own(one).then_some(one.left.by_a));
    let by_b = points(&|one| is_own(one).then_some(one.left.by_b));
    let name = "simulated, rows of n intruders (Fig. 5)";
    let mut all = vec![
        Series::new(name, Ink::Chain, Mark::Broad, in_rows),
        Series::new("by the beads, A", Ink::Measured, Mark::Rings, by_a),
        Series::new("by the beads, B", Ink::Predicted, Mark::Discs, by_b),
    ];
    if let Some(fit) = energy.fit.by_a {
        let power = points(&|one| Some(fit.initial * fit.transmission.powi(one.n as i32)));
        let name = format!("Tⁿ, T = {:.4}", fit.transmission);
        all.push(Series::new(name, Ink::Guide, Mark::Dashed, power));
    }
    let panel = Panel::new("energy left, E(n) (%)", all);
    Some(panel.over(Axis::count("intruders n", 0..=most)).height(230))
}

/// T of each intruder by its bead beside the simulation's.
fn transmission(energy: &EnergyAlong) -> Option<Panel> {
    let after = &energy.after;
    let (first, last) = (after.get(1)?.bead?, after.last()?.bead?);
    let series = |name: &str, ink, mark, side: usize| {
        let point = |one: &After| Some((one.bead? as f64, one.transmission?.each()[side]?));
        Series::new(name, ink, mark, after.iter().filter_map(point))
    };
    let all = vec![
        series("simulated, this row", Ink::Chain, Mark::Broad, 2),
        series("simulated, rows of n", Ink::Guide, Mark::Dashed, 3),
        series("by the bead, A", Ink::Measured, Mark::Rings, 0),
        series("by the bead, B", Ink::Predicted, Mark::Discs, 1),
    ];
    let places = Axis::count("place of the bead", first..=last);
    Some(Panel::new("T of the intruder", all).over(places).height(230))
}
