//! Trends as a picture: a panel for each quantity of each bead over days.

use bead_tables::printable::one_line;
use bead_tables::unit::Unit;
use hertz_charts::{Axis, Chart, Ink, Mark, Panel, Series, WIDTH};

use crate::date::{DAY_NS, day, text};
use crate::quantity::Quantity;
use crate::trend::{BeadTrend, QuantityTrend, TrendPoint};

/// The trends of beads, one below the other, over days from the first.
pub fn chart(beads: &[BeadTrend]) -> Chart {
    let points = || {
        beads
            .iter()
            .flat_map(|bead| &bead.quantities)
            .flat_map(|trend| &trend.points)
    };
    let first = points().map(|point| point.time_unix_ns).min().unwrap_or(0);
    let origin = day(first);
    let days = |point: &TrendPoint| (point.time_unix_ns - origin) as f64 / DAY_NS as f64;
    let (low, high) = points()
        .map(days)
        .fold((f64::INFINITY, 0.0), |(low, high): (f64, f64), at| {
            (low.min(at), high.max(at))
        });
    // The first and the last point are inside the axes.
    let margin = (0.03 * (high - low)).max(0.02);
    let axis = if low.is_finite() {
        low - margin..high + margin
    } else {
        0.0..1.0
    };
    let several = beads.len() > 1;
    let panels = beads.iter().flat_map(|bead| {
        let of = bead.quantities.iter().map(move |trend| {
            let panel = panel(trend, &days, low - margin, high + margin);
            let bead = match (several, &bead.name) {
                (true, Some(name)) => format!("bead {}, {}", bead.bead, one_line(name)),
                (true, None) => format!("bead {}", bead.bead),
                (false, _) => String::new(),
            };
            let notes = [bead, panel.note.clone()];
            let notes: Vec<String> = notes.into_iter().filter(|note| !note.is_empty()).collect();
            panel.note(notes.join("; "))
        });
        of.collect::<Vec<_>>()
    });
    let label = format!(
        "days from {}, UTC",
        text(origin).split('T').next().unwrap_or_default()
    );
    Chart {
        description: "Quantities of beads over days, with control limits".to_owned(),
        width: WIDTH,
        ..Chart::new(Axis::new(label, axis), panels.collect())
    }
}

fn panel(trend: &QuantityTrend, days: &impl Fn(&TrendPoint) -> f64, from: f64, to: f64) -> Panel {
    let quantity = trend.quantity();
    let greatest = trend
        .points
        .iter()
        .map(|point| point.value.abs())
        .fold(0.0, f64::max);
    let (unit, scale) = unit(quantity, greatest);
    let name = match quantity {
        Quantity::ForceGains => "force gains",
        Quantity::AccelerationGains => "acceleration gains",
        other => other.title(),
    };
    let label = if unit.is_empty() {
        name.to_owned()
    } else {
        format!("{name} ({unit})")
    };
    let place = |point: &TrendPoint| (days(point), point.value * scale);
    let within = trend
        .points
        .iter()
        .filter_map(|point| Some(2.0 * point.u?))
        .fold(0.0, f64::max);
    let are_bars = within <= BARS_MOST * extent(trend);
    let bars = trend.points.iter().filter(|_| are_bars).filter_map(|point| {
        let (at, value) = place(point);
        let within = 2.0 * point.u? * scale;
        Some([(at, value - within), (at, value + within), (at, f64::NAN)])
    });
    let mut curves = vec![Series::new("± 2 u", Ink::Chain, Mark::Line, bars.flatten())];
    if let Some(limits) = trend.limits {
        let level = |value: f64| vec![(from, value * scale), (to, value * scale)];
        let both = [level(limits.lower), vec![(from, f64::NAN)], level(limits.upper)].concat();
        curves.push(Series::new("mean", Ink::Guide, Mark::Line, level(limits.centre)));
        curves.push(Series::new("mean ± 3 s", Ink::Guide, Mark::Dashed, both));
    }
    let ink = match quantity {
        Quantity::Measured => Ink::Measured,
        Quantity::Predicted => Ink::Predicted,
        _ => Ink::Sensed,
    };
    let beyond = trend
        .points
        .iter()
        .filter(|point| point.out_of_control == Some(true));
    curves.push(Series::new("", ink, Mark::Discs, trend.points.iter().map(place)));
    let beyond = beyond.map(place);
    curves.push(Series::new("out of control", Ink::Text, Mark::Rings, beyond));
    curves.retain(|curve| !curve.points.is_empty());
    let panel = Panel::new(label, curves).height(150);
    if are_bars {
        return panel;
    }
    // Bars of that length would squeeze points and limits into one line.
    panel.note(format!("2 u is up to {} {unit}", three_digits(within * scale)).trim_end())
}

/// Bars of the uncertainty are drawn if they are at most this many times as long as the extent of points and
/// limits.
const BARS_MOST: f64 = 3.0;

/// Difference between the greatest and the least of points and limits.
fn extent(trend: &QuantityTrend) -> f64 {
    let values = trend.points.iter().map(|point| point.value);
    let limits = trend
        .limits
        .iter()
        .flat_map(|limits| [limits.lower, limits.upper]);
    let ends = values
        .chain(limits)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(value), high.max(value))
        });
    ends.1 - ends.0
}

/// A number above 0 with three significant digits.
fn three_digits(value: f64) -> String {
    let digits = (2.0 - value.log10().floor()).clamp(0.0, 9.0) as usize;
    format!("{value:.digits$}")
}

/// The unit of a quantity with values up to `greatest`, with the prefix that energies need, and the factor
/// to it.
fn unit(quantity: Quantity, greatest: f64) -> (String, f64) {
    match (quantity, Unit::of_symbol(quantity.unit())) {
        (Quantity::ForceGains | Quantity::AccelerationGains, _) => ("%".to_owned(), 100.0),
        (Quantity::Measured | Quantity::Predicted, Some(unit)) => {
            let (symbol, size) = unit.prefixed(greatest.min(1.0));
            (symbol, 1.0 / size)
        }
        _ => (quantity.unit().to_owned(), 1.0),
    }
}
