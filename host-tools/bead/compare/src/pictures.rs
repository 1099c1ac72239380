//! The pictures of a strike: what was sensed and estimated, and what is left when the simulation is
//! subtracted.

use hertz_charts::{Axis, Chart, Ink, Mark, Panel, Series, WIDTH};

use crate::report::EnergyUnit;
use crate::strike::{AbsorbedPoint, SensedPoint, Traces};

/// Force, acceleration and absorbed energy of a strike over one time axis.
pub fn strike_chart(traces: &Traces) -> Chart {
    let sensed = |points: &[SensedPoint], y_label: &str, [simulated, sensed]: [&str; 2]| {
        let of = |value: fn(&SensedPoint) -> f64| points.iter().map(move |point| (point.time, value(point)));
        let (chain, bead) = (of(|point| point.simulated), of(|point| point.sensed));
        let curves = vec![
            series(simulated, Ink::Chain, Mark::Broad, chain, 1.0),
            series(sensed, Ink::Sensed, Mark::Dots, bead, 1.0),
        ];
        Panel::new(y_label, curves).height(165)
    };
    let unit = EnergyUnit::of(traces.f64_samples[1].last().map(|last| last.chain));
    let estimate = |name: &str, ink, mark, curve: &[AbsorbedPoint]| {
        let points = curve.iter().map(|point| (point.time, point.estimate));
        series(name, ink, mark, points, unit.scale)
    };
    let chain = traces.f64_samples[1].iter();
    let chain = chain.map(|point| (point.time, point.chain));
    let [measured, predicted] = &traces.device;
    let absorbed = vec![
        series("", Ink::Chain, Mark::Broad, chain, unit.scale),
        estimate(
            "A, measured by the acceleration",
            Ink::Measured,
            Mark::Rings,
            measured,
        ),
        estimate(
            "B, predicted from the force",
            Ink::Predicted,
            Mark::Discs,
            predicted,
        ),
    ];
    over_time(
        traces,
        "Force and acceleration that the bead senses, and the energy that its intruder absorbs, over time",
        vec![
            sensed(&traces.force, "force (N)", ["simulated", "sensed by the bead"]),
            sensed(&traces.acceleration, "acceleration (m/s²)", ["", ""]),
            Panel::new(format!("absorbed energy ({})", unit.symbol), absorbed).height(230),
        ],
    )
}

/// The three curves of [`strike_chart`] less the simulation.
pub fn residual_chart(traces: &Traces) -> Chart {
    let residual = |points: &[SensedPoint], name: &str, y_label: &str, scale: f64| {
        let off = |point: &SensedPoint| (point.time, point.sensed - point.simulated);
        let off = points.iter().map(off);
        Panel::new(y_label, vec![series(name, Ink::Sensed, Mark::Dots, off, scale)]).height(140)
    };
    let last = traces.f64_samples[1].last().map_or(1.0, |last| last.chain);
    let mut absorbed = Vec::new();
    for (which, ink, estimate, device) in [
        (0, Ink::Measured, "A", Mark::Rings),
        (1, Ink::Predicted, "B", Mark::Discs),
    ] {
        for (by, mark, curves) in [
            ("f64", Mark::Dashed, &traces.f64_samples),
            ("replay", Mark::Line, &traces.replay),
            ("bead", device, &traces.device),
        ] {
            let error = |point: &AbsorbedPoint| (point.time, point.estimate - point.chain);
            let points = curves[which].iter().map(error);
            let name = format!("{estimate}, {by}");
            absorbed.push(series(&name, ink, mark, points, 100.0 / last));
        }
    }
    let (force, acceleration) = (&traces.force, &traces.acceleration);
    let name = "sensed − simulated acceleration";
    over_time(
        traces,
        "What remains of force, acceleration and absorbed energy when the simulation is subtracted",
        vec![
            residual(force, "sensed − simulated force", "force (mN)", 1e3),
            residual(acceleration, name, "acceleration (m/s²)", 1.0),
            Panel::new("energy (% of final)", absorbed).height(230),
        ],
    )
}

/// A chart of a page's width over the time of the window.
fn over_time(traces: &Traces, description: &str, panels: Vec<Panel>) -> Chart {
    let range = match (traces.force.first(), traces.force.last()) {
        (Some(first), Some(last)) => first.time * 1e3..last.time * 1e3,
        _ => 0.0..1.0,
    };
    Chart {
        description: description.to_owned(),
        width: WIDTH,
        ..Chart::new(Axis::new("time since the striker hit (ms)", range), panels)
    }
}

/// A curve over milliseconds, its values scaled to the axis.
fn series(name: &str, ink: Ink, mark: Mark, points: impl Iterator<Item = (f64, f64)>, scale: f64) -> Series {
    Series {
        name: name.to_owned(),
        ink,
        mark,
        points: points.map(|(time, value)| (time * 1e3, value * scale)).collect(),
    }
}
