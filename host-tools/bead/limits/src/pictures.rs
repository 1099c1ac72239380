//! Pictures of a result: values over the strikes between their limits, and spectra under their masks.

use hertz_charts::{Axis, Chart, Ink, Mark, Panel, Series, WIDTH};

use crate::judged::{EnvelopePoint, JudgedLimit, JudgedRecording};
use crate::rule::Outcome;
use crate::words::{Shown, subject};

/// Greatest number of strikes in a picture; of more, it shows every second, third and so on.
const SHOWN: usize = 1000;
/// Greatest number of panels of a recording on a page.
const PANELS_MOST: usize = 24;

/// The pictures of a recording: its values over the strikes, and each spectrum under its mask.
pub(crate) fn charts(recording: &JudgedRecording) -> Vec<Chart> {
    let over_strikes = recording
        .limits
        .iter()
        .filter(|limit| limit.points.len() > 1 && limit.envelope.is_empty());
    let panels: Vec<Panel> = over_strikes.take(PANELS_MOST).map(values_panel).collect();
    let most = recording
        .limits
        .iter()
        .map(|limit| limit.points.len())
        .max()
        .unwrap_or(1);
    let axis = Axis::count(
        "strike, in the order of the recording",
        0..=most.saturating_sub(1),
    );
    let values = (!panels.is_empty()).then(|| Chart {
        description: "Values of the strikes between their limits".to_owned(),
        width: WIDTH,
        ..Chart::new(axis, panels)
    });
    let spectra = recording.limits.iter().filter(|limit| !limit.envelope.is_empty());
    values
        .into_iter()
        .chain(spectra.take(PANELS_MOST).map(spectrum))
        .collect()
}

fn values_panel(limit: &JudgedLimit) -> Panel {
    let shown = Shown::of(limit);
    let every = limit.points.len().div_ceil(SHOWN).max(1);
    let points = || limit.points.iter().enumerate().step_by(every);
    let values = |bad: bool| -> Vec<(f64, f64)> {
        let wanted = points().filter(|(_, point)| (point.outcome == Outcome::Fail) == bad);
        wanted
            .filter_map(|(at, point)| Some((at as f64, point.value? * shown.scale)))
            .collect()
    };
    let bars = points().filter_map(|(at, point)| {
        let (at, value, within) = (
            at as f64,
            point.value? * shown.scale,
            point.expanded? * shown.scale,
        );
        Some([(at, value - within), (at, value + within), (at, f64::NAN)])
    });
    let end = limit.points.len() as f64;
    let level = |value: Option<f64>| {
        let value = value? * shown.scale;
        Some([(-1.0, value), (end, value), (end, f64::NAN)])
    };
    let levels = [level(limit.interval.min), level(limit.interval.max)];
    let mut curves = vec![
        Series::new("± U", Ink::Chain, Mark::Line, bars.flatten()),
        Series::new(
            "limit",
            Ink::Guide,
            Mark::Dashed,
            levels.into_iter().flatten().flatten(),
        ),
        Series::new("kept", Ink::Sensed, Mark::Discs, values(false)),
        Series::new("broken", Ink::Predicted, Mark::Discs, values(true)),
    ];
    curves.retain(|curve| !curve.points.is_empty());
    let name = limit.quantity.replace('_', " ") + &shown.suffix();
    Panel::new(name, curves).height(150).note(subject(limit))
}

fn spectrum(limit: &JudgedLimit) -> Chart {
    let of = |value: fn(&EnvelopePoint) -> Option<f64>| -> Vec<(f64, f64)> {
        let points = limit.envelope.iter();
        points
            .filter_map(|point| Some((point.frequency, value(point)?)))
            .collect()
    };
    let mut curves = vec![
        Series::new(
            "greatest of the strikes",
            Ink::Measured,
            Mark::Line,
            of(|point| Some(point.greatest)),
        ),
        Series::new(
            "upper limit",
            Ink::Predicted,
            Mark::Dashed,
            of(|point| point.limits.max),
        ),
        Series::new(
            "lower limit",
            Ink::Sensed,
            Mark::Dashed,
            of(|point| point.limits.min),
        ),
    ];
    curves.retain(|curve| !curve.points.is_empty());
    let ends = limit.envelope.first().zip(limit.envelope.last());
    let (low, high) = ends.map_or((1.0, 10.0), |(first, last)| (first.frequency, last.frequency));
    let panel = Panel::new(format!("shock response ({})", limit.unit), curves)
        .log()
        .height(300)
        .note(subject(limit));
    Chart {
        description: "Shock response spectra under their mask".to_owned(),
        width: WIDTH,
        ..Chart::new(Axis::log("natural frequency (Hz)", low..high), vec![panel])
    }
}
