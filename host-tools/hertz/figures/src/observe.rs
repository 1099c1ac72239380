//! Quantities that figures read from a run, beyond its summary.

use std::ops::Range;

use hertz_chain::{Pulse, PulseSearch, Solution, Spectrum};

use crate::lab::FigureRun;

/// Greatest force of a contact, N; 0 if it carried no force.
pub(crate) fn peak(run: &FigureRun, contact: usize) -> f64 {
    let mut peaks = run.summary.peak_force.iter();
    let peak = peaks.find(|peak| peak.contact == contact);
    peak.map_or(0.0, |peak| peak.force)
}

/// The pulses at a contact that reach a twentieth of the strongest, in the order of their arrival.
pub(crate) fn train(solution: &Solution, contact: usize) -> Vec<Pulse> {
    let search = PulseSearch {
        height: 0.05,
        ..PulseSearch::default()
    };
    solution.pulses(contact, &search)
}

/// Duration of the striker's first contact, s, until contact 1 opens. Its force may have several humps.
pub(crate) fn contact_time(run: &FigureRun) -> f64 {
    let search = PulseSearch {
        height: 1e-6,
        fall: 0.01,
        ..PulseSearch::default()
    };
    let humps = run.solution.pulses(1, &search);
    let touching = |hump: &Pulse| run.solution.at(hump.to).force(1) > 1e-9 * hump.force;
    let last = humps.iter().find(|hump| !touching(hump)).or(humps.last());
    last.map_or(f64::NAN, |hump| hump.to)
}

/// Sampling interval of a force for its transform, s. The sampling frequency is far above what a pulse
/// contains.
const INTERVAL: f64 = 2e-6;

/// The Fourier transform of a contact's force over `span` (s), which begins and ends at rest.
pub(crate) fn spectrum(solution: &Solution, contact: usize, span: Range<f64>) -> Spectrum {
    let end = span.end.min(solution.end());
    let force = solution.signal(span.start, end, INTERVAL, |at| at.force(contact));
    Spectrum::of(&force)
}

/// The Fourier transform of a contact's force over one pulse.
pub(crate) fn pulse_spectrum(solution: &Solution, pulse: &Pulse) -> Spectrum {
    spectrum(solution, pulse.contact, pulse.from..pulse.to)
}

/// Magnitudes up to a frequency in Hz, as a curve.
pub(crate) fn magnitudes(spectrum: &Spectrum, up_to: f64, scale: f64) -> Vec<(f64, f64)> {
    spectrum
        .magnitudes()
        .take_while(|(frequency, _)| *frequency <= up_to)
        .map(|(frequency, magnitude)| (frequency, scale * magnitude))
        .collect()
}

/// The -3 dB frequency, Hz; not a number if there is none.
pub(crate) fn half_power(spectrum: &Spectrum) -> f64 {
    spectrum.half_power_frequency().unwrap_or(f64::NAN)
}

/// The least and the greatest of some positive values.
pub(crate) fn extremes(values: impl IntoIterator<Item = f64>) -> (f64, f64) {
    let wider = |(low, high): (f64, f64), value| (low.min(value), high.max(value));
    values.into_iter().fold((f64::INFINITY, 0.0), wider)
}

/// Greatest value over least.
pub(crate) fn ratio(values: impl IntoIterator<Item = f64>) -> f64 {
    let (low, high) = extremes(values);
    high / low
}

/// The ordinates of a curve.
pub(crate) fn ordinates(points: &[(f64, f64)]) -> Vec<f64> {
    points.iter().map(|point| point.1).collect()
}

/// The greatest ordinate of a curve.
pub(crate) fn greatest(points: &[(f64, f64)]) -> f64 {
    ordinates(points).into_iter().fold(f64::NEG_INFINITY, f64::max)
}

/// The greatest ordinate of a curve where its abscissa is in a range; 0 if none is greater.
pub(crate) fn greatest_within(points: &[(f64, f64)], range: Range<f64>) -> f64 {
    let inside = points.iter().filter(|point| range.contains(&point.0));
    inside.map(|point| point.1).fold(0.0, f64::max)
}

/// The last ordinate of a curve.
pub(crate) fn last(points: &[(f64, f64)]) -> f64 {
    points.last().map_or(f64::NAN, |point| point.1)
}

/// The least factor from one value to the next. It is above 1 if each value exceeds the one before.
pub(crate) fn least_growth(values: &[f64]) -> f64 {
    values
        .windows(2)
        .map(|pair| pair[1] / pair[0])
        .fold(f64::INFINITY, f64::min)
}

/// Place of the maximum of a curve over a logarithmic axis: the top of the parabola through the greatest
/// point and its neighbours. Not a number if the greatest point is an end.
pub(crate) fn summit(points: &[(f64, f64)]) -> f64 {
    let top = (0..points.len()).max_by(|&a, &b| points[a].1.total_cmp(&points[b].1));
    let Some(top) = top.filter(|&top| top > 0 && top + 1 < points.len()) else {
        return f64::NAN;
    };
    let [a, b, c] = [top - 1, top, top + 1].map(|n| (points[n].0.ln(), points[n].1));
    let step = 0.5 * (c.0 - a.0);
    (b.0 + 0.5 * step * (a.1 - c.1) / (a.1 - 2.0 * b.1 + c.1)).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_summit_of_a_parabola_over_the_logarithm_is_found_between_points() {
        let points: Vec<(f64, f64)> = [1.0_f64, 10.0, 100.0, 1000.0]
            .map(|x| (x, -(x.log10() - 1.3).powi(2)))
            .to_vec();
        assert!((summit(&points).log10() - 1.3).abs() < 1e-12);
        assert!(summit(&points[..2]).is_nan(), "a summit at an end is none");
    }

    #[test]
    fn growth_that_fails_once_is_below_one() {
        assert!(least_growth(&[1.0, 2.0, 3.0]) > 1.0);
        assert!(least_growth(&[1.0, 2.0, 1.9, 3.0]) < 1.0);
    }
}
