//! Curves, and the axis of time that all figures share.

use std::ops::Range;

use hertz_chain::{Snapshot, Solution};

use hertz_charts::{Axis, Ink, Mark, Series};

/// Points of a curve over time.
const POINTS: usize = 900;

/// A curve of a family.
pub(crate) fn line(name: impl Into<String>, place: usize, points: Vec<(f64, f64)>) -> Series {
    Series::new(name, Ink::Curve(place), Mark::Line, points)
}

/// A curve of a family whose dashes tell it apart from the others.
pub(crate) fn told_apart(name: impl Into<String>, place: usize, points: Vec<(f64, f64)>) -> Series {
    Series::new(name, Ink::Curve(place), Mark::Family(place), points)
}

/// A dashed curve of a family.
pub(crate) fn dashed(name: impl Into<String>, place: usize, points: Vec<(f64, f64)>) -> Series {
    Series::new(name, Ink::Curve(place), Mark::Dashed, points)
}

/// Points of a family, one for each run.
pub(crate) fn discs(name: impl Into<String>, place: usize, points: Vec<(f64, f64)>) -> Series {
    Series::new(name, Ink::Curve(place), Mark::Discs, points)
}

/// A curve of a family with a disc at each point.
pub(crate) fn dotted(name: impl Into<String>, place: usize, points: Vec<(f64, f64)>) -> [Series; 2] {
    [line(name, place, points.clone()), discs("", place, points)]
}

/// A level or a place for comparison.
pub(crate) fn guide(name: impl Into<String>, points: Vec<(f64, f64)>) -> Series {
    Series::new(name, Ink::Guide, Mark::Dashed, points)
}

/// `value` of a run over `span` (s), against time in ms.
pub(crate) fn over_time(
    solution: &Solution,
    span: Range<f64>,
    value: impl Fn(&Snapshot<'_>) -> f64,
) -> Vec<(f64, f64)> {
    let mut sampler = solution.sampler();
    let end = span.end.min(solution.end());
    (0..=POINTS)
        .map(|point| span.start + (end - span.start) * point as f64 / POINTS as f64)
        .map(|time| (time * 1e3, value(&sampler.at(time.min(solution.end())))))
        .collect()
}

/// The force of a contact over `span` (s), N, against time in ms.
pub(crate) fn force_over_time(solution: &Solution, span: &Range<f64>, contact: usize) -> Vec<(f64, f64)> {
    over_time(solution, span.clone(), |at| at.force(contact))
}

/// Time in ms from a span in s.
pub(crate) fn time_axis(span: Range<f64>) -> Axis {
    Axis::new("time since the strike (ms)", span.start * 1e3..span.end * 1e3)
}

/// `count` values from `low` to `high` in geometric progression. The ends are exact, since an axis that ends
/// there would leave out a point beyond them.
pub(crate) fn geometric(low: f64, high: f64, count: usize) -> Vec<f64> {
    let step = (high / low).ln() / (count - 1) as f64;
    let inner = (1..count - 1).map(|n| low * (step * n as f64).exp());
    std::iter::once(low).chain(inner).chain([high]).collect()
}
