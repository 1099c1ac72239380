//! The pictures of a strike: what was sensed and estimated, and what is left when the simulation is
//! subtracted.

use hertz_charts::{Axis, Chart, Ink, Mark, Panel, Series, WIDTH};

use crate::report::EnergyUnit;
use crate::traces::{AbsorbedPoint, SensedPoint, Traces};

/// Force, acceleration and absorbed energy of a strike over one time axis.
pub(crate) fn strike_chart(traces: &Traces) -> Chart {
    let sensed = |points: &[SensedPoint], y_label: &str, [simulated, sensed]: [&str; 2]| {
        let of = |value: fn(&SensedPoint) -> f64| points.iter().map(move |point| (point.time, value(point)));
        let chain = over_ms(of(|point| point.simulated), 1.0);
        let bead = over_ms(of(|point| point.sensed), 1.0);
        let curves = vec![
            Series::new(simulated, Ink::Chain, Mark::Broad, chain),
            Series::new(sensed, Ink::Sensed, Mark::Dots, bead),
        ];
        Panel::new(y_label, curves).height(165)
    };
    let chain = &traces.f64_samples[1];
    let unit = EnergyUnit::of(chain.last().map(|last| last.chain));
    let energy = |name: &str, ink, mark, points: &[AbsorbedPoint], value: fn(&AbsorbedPoint) -> f64| {
        let points = points.iter().map(|point| (point.time, value(point)));
        Series::new(name, ink, mark, over_ms(points, unit.scale))
    };
    let [a, b] = ["A, measured by the acceleration", "B, predicted from the force"];
    let [measured, predicted] = &traces.device;
    let absorbed = vec![
        energy("", Ink::Chain, Mark::Broad, chain, |point| point.chain),
        energy(a, Ink::Measured, Mark::Rings, measured, |point| point.estimate),
        energy(b, Ink::Predicted, Mark::Discs, predicted, |point| point.estimate),
    ];
    let panels = vec![
        sensed(&traces.force, "force (N)", ["simulated", "sensed by the bead"]),
        sensed(&traces.acceleration, "acceleration (m/s²)", ["", ""]),
        Panel::new(format!("absorbed energy ({})", unit.symbol), absorbed).height(230),
    ];
    let description =
        "Force and acceleration that the bead senses, and the energy that its intruder absorbs, over time";
    let x = time_axis(ends(&traces.force, |point| point.time));
    wide(description, x, panels)
}

/// The three curves of [`strike_chart`] less the simulation.
pub(crate) fn residual_chart(traces: &Traces) -> Chart {
    let residual = |points: &[SensedPoint], name: &str, y_label: &str, scale: f64| {
        let off = points
            .iter()
            .map(|point| (point.time, point.sensed - point.simulated));
        let off = Series::new(name, Ink::Sensed, Mark::Dots, over_ms(off, scale));
        Panel::new(y_label, vec![off]).height(140)
    };
    let last = traces.f64_samples[1].last().map_or(1.0, |last| last.chain);
    let mut absorbed = Vec::new();
    let estimates = [
        (Ink::Measured, "A", Mark::Rings),
        (Ink::Predicted, "B", Mark::Discs),
    ];
    for (which, (ink, estimate, device)) in estimates.into_iter().enumerate() {
        for (by, mark, curves) in [
            ("f64", Mark::Dashed, &traces.f64_samples),
            ("replay", Mark::Line, &traces.replay),
            ("bead", device, &traces.device),
        ] {
            let error = |point: &AbsorbedPoint| (point.time, point.estimate - point.chain);
            let points = over_ms(curves[which].iter().map(error), 100.0 / last);
            absorbed.push(Series::new(format!("{estimate}, {by}"), ink, mark, points));
        }
    }
    let (force, acceleration) = (&traces.force, &traces.acceleration);
    let name = "sensed − simulated acceleration";
    let panels = vec![
        residual(force, "sensed − simulated force", "force (mN)", 1e3),
        residual(acceleration, name, "acceleration (m/s²)", 1.0),
        Panel::new("energy (% of final)", absorbed).height(230),
    ];
    let description =
        "What remains of force, acceleration and absorbed energy when the simulation is subtracted";
    wide(description, time_axis(ends(force, |point| point.time)), panels)
}

pub(crate) fn wide(description: &str, x: Axis, panels: Vec<Panel>) -> Chart {
    Chart {
        description: description.to_owned(),
        width: WIDTH,
        ..Chart::new(x, panels)
    }
}

/// The axis of the time since the striker hit, with its ends in s.
pub(crate) fn time_axis([from, to]: [f64; 2]) -> Axis {
    Axis::new("time since the striker hit (ms)", from * 1e3..to * 1e3)
}

/// The times of the first and the last of some points, s.
pub(crate) fn ends<P>(points: &[P], time: fn(&P) -> f64) -> [f64; 2] {
    let ends = points.first().zip(points.last());
    ends.map_or([0.0, 1e-3], |(first, last)| [time(first), time(last)])
}

/// Points over milliseconds, their values times `scale`, from points over seconds.
fn over_ms(points: impl Iterator<Item = (f64, f64)>, scale: f64) -> impl Iterator<Item = (f64, f64)> {
    points.map(move |(time, value)| (time * 1e3, value * scale))
}
