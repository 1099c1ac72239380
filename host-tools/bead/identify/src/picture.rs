//! A strike before and after the fit.

use hertz_charts::{Axis, Chart, Error, Ink, Mark, Panel, Series, WIDTH};

use crate::identified::{Identified, Wanted};
use crate::model::{SignalSample, StrikeModel};

/// Times after the trigger that are shown, ms.
const SHOWN: [f64; 2] = [-0.4, 5.2];

/// Least time without samples that breaks the line, s.
const GAP: f64 = 1e-4;

fn curve(name: &str, ink: Ink, mark: Mark, points: &[SignalSample], of: fn(&SignalSample) -> f64) -> Series {
    let is_shown = |point: &&SignalSample| (SHOWN[0]..SHOWN[1]).contains(&(1e3 * point.time));
    let shown = points.iter().filter(is_shown);
    Series::new(name, ink, mark, shown.map(|point| (1e3 * point.time, of(point))))
}

fn panels(label: &str, points: &[SignalSample]) -> [Panel; 2] {
    let signal = vec![
        curve("computed", Ink::Chain, Mark::Broad, points, |point| {
            point.computed
        }),
        curve("measured", Ink::Measured, Mark::Line, points, |point| {
            point.measured
        }),
    ];
    let residual = vec![curve("", Ink::Measured, Mark::Dots, points, |point| {
        (point.measured - point.computed) / point.deviation
    })];
    [
        Panel::new("acceleration (m/s²)", signal).height(240).note(label),
        Panel::new("residual over noise", residual)
            .height(140)
            .note(label),
    ]
}

/// The samples of the acceleration after the last gap, ascending in time.
fn acceleration(mut samples: Vec<SignalSample>) -> Vec<SignalSample> {
    samples.retain(|sample| !sample.channel.is_force());
    samples.sort_by(|a, b| a.time.total_cmp(&b.time));
    // Before a ringing there is only the quiet; no line is drawn from it.
    let gap = samples
        .windows(2)
        .rposition(|pair| pair[1].time - pair[0].time > GAP);
    samples.drain(..gap.map_or(0, |at| at + 1));
    samples
}

/// The loudest used strike of a bead, with the values at the start and with the best ones.
///
/// # Errors
/// The strike cannot be computed with the values at the start.
pub fn chart(found: &Identified<'_>, wanted: &Wanted) -> Result<Chart, String> {
    let best = &found.best;
    let loudest = best.strikes.iter().max_by(|a, b| {
        let stroke = |one: &crate::fit::FittedStrike<'_>| one.model.stroke(&best.values, &one.own);
        stroke(a).total_cmp(&stroke(b))
    });
    let loudest = loudest.ok_or("there is no strike")?;
    let model: &dyn StrikeModel = loudest.model;
    let own =
        crate::fit::fit(&[(model, model.own())], &wanted.start, &[]).map_err(|error| error.to_string())?;
    let own = &own.strikes[0].own;
    let before = acceleration(model.samples(&wanted.start, own)?);
    let after = acceleration(model.samples(&best.values, &loudest.own)?);
    let [signal, residual] = panels("before the fit", &before);
    let [fitted, left] = panels("after the fit", &after);
    Ok(Chart {
        description: "Acceleration of a strike, measured and computed, before and after the fit".to_owned(),
        width: WIDTH,
        ..Chart::new(
            Axis::new("time from the trigger (ms)", SHOWN[0]..SHOWN[1]),
            vec![signal, residual, fitted, left],
        )
    })
}

/// The picture as SVG.
///
/// # Errors
/// The strike cannot be computed, or no chart can be drawn of it.
pub fn svg(found: &Identified<'_>, wanted: &Wanted) -> Result<String, String> {
    let drawn: Result<String, Error> = chart(found, wanted)?.standalone_svg();
    drawn.map_err(|error| error.to_string())
}
