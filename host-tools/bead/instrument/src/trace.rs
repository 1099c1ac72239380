//! A quantity over time, with a value at any time.
//!
//! # Design
//! Between rows, the value is that of the cubic through the four nearest ones, which suits pulses of six rows
//! and more (see [`Trace::rows_wide`]). A source much faster than the front end's own steps is averaged down
//! to them first, so that its noise does not fold into the band. Before the first row the value is 0; after
//! the last it returns to 0 along half a cosine, too slowly for any trigger.

use std::f64::consts::PI;
use std::sync::Arc;

/// Time in which a waveform returns to rest after its end, s.
pub const FADE: f64 = 0.02;
/// Steps below this are averaged, s: half of the front end's own steps.
const FINEST: f64 = 0.25e-6;

/// Least number of rows for a parabola to average.
const FEW: f64 = 6.0;

/// The times of rows since the first, s.
#[derive(Debug, Clone)]
pub(super) enum Times {
    /// At even steps.
    Even {
        /// Time between two rows, s.
        step: f64,
        /// Number of rows.
        count: usize,
    },
    /// Each time, ascending from 0.
    Each(Arc<[f64]>),
}

impl Times {
    fn count(&self) -> usize {
        match self {
            Self::Even { count, .. } => *count,
            Self::Each(times) => times.len(),
        }
    }

    fn at(&self, row: usize) -> f64 {
        match self {
            Self::Even { step, .. } => row as f64 * step,
            Self::Each(times) => times[row],
        }
    }

    /// The row at or before a time, which must lie within the rows; the search begins at `near`.
    fn before(&self, time: f64, near: usize) -> usize {
        let last = self.count() - 1;
        match self {
            Self::Even { step, .. } => ((time / step) as usize).min(last),
            Self::Each(times) => {
                let next = near..(near + 3).min(times.len());
                let quick = next.clone().rev().find(|row| times[*row] <= time);
                match quick {
                    Some(row) if row + 1 < next.end || row == last => row,
                    _ => times.partition_point(|one| *one <= time).saturating_sub(1),
                }
            }
        }
    }
}

/// A quantity over time, in its SI unit, relative to its value at rest.
#[derive(Debug, Clone)]
pub struct Trace {
    times: Times,
    values: Arc<[f64]>,
    /// Time of row 0, s.
    start: f64,
    /// The row that was read last.
    near: usize,
}

impl Trace {
    pub(super) fn new(times: Times, values: Vec<f64>, start: f64) -> Self {
        Self {
            times,
            values: values.into(),
            start,
            near: 0,
        }
    }

    /// A quantity at even steps of time from 0 on.
    ///
    /// # Panics
    /// There are no values.
    pub fn even(values: Vec<f64>, rate_hz: f64) -> Self {
        assert!(!values.is_empty(), "a trace has values");
        let (step, count) = (1.0 / rate_hz, values.len());
        Self::new(Times::Even { step, count }, values, 0.0)
    }

    /// The time of its first value, s.
    pub fn begin(&self) -> f64 {
        self.start
    }

    /// The time of its last value, s.
    pub fn end(&self) -> f64 {
        self.start + self.times.at(self.values.len() - 1)
    }

    /// Its values, with their times.
    pub fn points(&self) -> impl Iterator<Item = (f64, f64)> {
        let values = self.values.iter().enumerate();
        values.map(|(row, value)| (self.start + self.times.at(row), *value))
    }

    /// Number of its values.
    pub fn rows(&self) -> usize {
        self.values.len()
    }

    /// The last value.
    pub fn last(&self) -> f64 {
        self.values.last().copied().unwrap_or(0.0)
    }

    /// The highest value, with its time.
    pub fn highest(&self) -> (f64, f64) {
        let highest = self.points().max_by(|a, b| a.1.total_cmp(&b.1));
        highest.unwrap_or((0.0, 0.0))
    }

    /// The lowest value.
    pub fn lowest(&self) -> f64 {
        self.values.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// The greatest magnitude.
    pub fn greatest(&self) -> f64 {
        self.values
            .iter()
            .fold(0.0, |greatest, value| f64::max(greatest, value.abs()))
    }

    /// The value at a time in s.
    pub fn at(&mut self, time: f64) -> f64 {
        let time = time - self.start;
        let end = self.times.at(self.values.len() - 1);
        if time < 0.0 || time >= end + FADE {
            return 0.0;
        }
        if time >= end {
            return self.last() * 0.5 * (1.0 + (PI * (time - end) / FADE).cos());
        }
        let row = self.times.before(time, self.near);
        self.near = row;
        let count = self.values.len();
        let first = row.saturating_sub(1).min(count.saturating_sub(4));
        let near = first..(first + 4).min(count);
        lagrange(&self.times, &self.values, near, time)
    }

    /// The value at a time of the parabola that fits the rows within `half` seconds of it best (least
    /// squares). Fewer than six such rows give the value [at](Self::at) the time.
    pub fn around(&mut self, time: f64, half: f64) -> f64 {
        let since = time - self.start;
        let end = self.times.at(self.values.len() - 1);
        if self.step() * FEW > 2.0 * half || !(half..=end - half).contains(&since) {
            return self.at(time);
        }
        let first = self.times.before(since - half, self.near);
        self.near = first;
        let last = self.times.before(since + half, first);
        // Sums of powers of the time, and of the values, in units of `half`.
        let (mut s, mut v) = ([0.0; 5], [0.0; 3]);
        for row in first + 1..=last {
            let (x, value) = ((self.times.at(row) - since) / half, self.values[row]);
            let powers = [1.0, x, x * x, x * x * x, x * x * x * x];
            s.iter_mut().zip(powers).for_each(|(sum, power)| *sum += power);
            v.iter_mut()
                .zip(powers)
                .for_each(|(sum, power)| *sum += power * value);
        }
        // Cramer's rule for the value at x = 0.
        let minors = [
            s[2] * s[4] - s[3] * s[3],
            s[1] * s[4] - s[2] * s[3],
            s[1] * s[3] - s[2] * s[2],
        ];
        let whole = s[0] * minors[0] - s[1] * minors[1] + s[2] * minors[2];
        (v[0] * minors[0] - v[1] * minors[1] + v[2] * minors[2]) / whole
    }

    /// Mean time from row to row, s.
    pub fn step(&self) -> f64 {
        self.times.at(self.values.len() - 1) / (self.values.len() - 1).max(1) as f64
    }

    /// Width of the strongest pulse at half of its height, rows; `None` if it does not fall to that on both
    /// sides.
    pub fn rows_wide(&self) -> Option<f64> {
        let size: Vec<f64> = self.values.iter().map(|value| value.abs()).collect();
        let top = (0..size.len()).max_by(|a, b| size[*a].total_cmp(&size[*b]))?;
        let half = 0.5 * size[top];
        let below = |row: &usize| size[*row] < half;
        let (rise, fall) = ((0..top).rev().find(below)?, (top..size.len()).find(below)?);
        let crossing = |low: usize, high: usize| (half - size[low]) / (size[high] - size[low]);
        Some((fall - rise) as f64 - crossing(rise, rise + 1) - crossing(fall, fall - 1))
    }
}

/// The polynomial through the rows `near`, at a time (Lagrange's form).
fn lagrange(times: &Times, values: &[f64], near: std::ops::Range<usize>, time: f64) -> f64 {
    let weight = |row: usize| -> f64 {
        let others = near.clone().filter(|other| *other != row);
        others
            .map(|other| (time - times.at(other)) / (times.at(row) - times.at(other)))
            .product()
    };
    near.clone().map(|row| values[row] * weight(row)).sum()
}

/// Subtracts the value at rest, and returns it and its number of rows: the mean of the first half of the rows
/// before the first that differs from the first value by a twentieth of the greatest difference.
pub(super) fn zeroed(values: &mut [f64]) -> (f64, usize) {
    let first = values.first().copied().unwrap_or(0.0);
    let most = values
        .iter()
        .fold(0.0, |most, value| f64::max(most, (value - first).abs()));
    let moves = values
        .iter()
        .position(|value| (value - first).abs() > 0.05 * most);
    let quiet = (moves.unwrap_or(values.len()) / 2).max(1);
    let rest = values.iter().take(quiet).sum::<f64>() / quiet as f64;
    values.iter_mut().for_each(|value| *value -= rest);
    (rest, quiet)
}

/// Averages rows that are far closer than the front end's steps. The third value is the delay of the first
/// mean behind the first row, s.
pub(super) fn thinned(times: &Times, values: Vec<f64>) -> (Times, Vec<f64>, f64) {
    let Times::Even { step, count } = *times else {
        return (times.clone(), values, 0.0);
    };
    let group = (2.0 * FINEST / step).floor() as usize;
    if step >= FINEST || count / group < 8 {
        return (times.clone(), values, 0.0);
    }
    let means: Vec<f64> = values
        .chunks_exact(group)
        .map(|rows| rows.iter().sum::<f64>() / group as f64)
        .collect();
    let even = Times::Even {
        step: group as f64 * step,
        count: means.len(),
    };
    // The time of a mean is the middle of its rows.
    (even, means, 0.5 * (group - 1) as f64 * step)
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// A pulse like a solitary wave, `wide` s at half height, with its top at `top`.
    fn pulse(time: f64, top: f64, wide: f64) -> f64 {
        // cos⁶ of Nesterenko's wave: half height where cos⁶ = 1/2, at ±0.4716 rad.
        let phase = (time - top) / wide * 2.0 * 0.471_6;
        if phase.abs() < PI / 2.0 {
            phase.cos().powi(6)
        } else {
            0.0
        }
    }

    #[test]
    fn the_cubic_is_within_what_is_said_of_it_at_any_phase() {
        for wide in [3.0, 4.0, 6.0, 10.0, 20.0] {
            let mut worst: f64 = 0.0;
            for phase in 0..20 {
                let top = 50.0 + f64::from(phase) / 20.0;
                let values = (0..100).map(|row| pulse(f64::from(row), top, wide)).collect();
                let mut trace = Trace::even(values, 1.0);
                let along = (0..4000).map(|step| 30.0 + f64::from(step) * 0.01);
                let off = along.map(|time| (trace.at(time) - pulse(time, top, wide)).abs());
                worst = worst.max(off.fold(0.0, f64::max));
            }
            println!("{wide} rows: {worst:.2e}, said {:.2e}", (1.9 / wide).powi(4));
            assert!(worst < (1.9 / wide).powi(4), "{wide}: {worst}");
            assert!(worst > 0.1 * (1.9 / wide).powi(4), "{wide}: {worst}");
        }
    }

    #[test]
    fn uneven_rows_give_the_same_cubic() {
        let f = |t: f64| 2.0 - t + 3.0 * t * t - 0.5 * t * t * t;
        let times: Vec<f64> = (0..40)
            .map(|n| f64::from(n) + 0.3 * (f64::from(n) * 1.7).sin())
            .collect();
        let times: Vec<f64> = times.iter().map(|time| time - times[0]).collect();
        let values = times.iter().map(|time| f(*time)).collect();
        let end = times[39];
        let mut trace = Trace::new(Times::Each(times.into()), values, 0.0);
        for step in (20..980).chain([500, 21, 979]) {
            let time = end * f64::from(step) / 1000.0;
            assert!(
                (trace.at(time) - f(time)).abs() < 1e-8 * f(time).abs().max(1.0),
                "{time}"
            );
        }
    }

    #[test]
    fn outside_of_its_rows_it_rests_and_it_goes_back_to_rest_slowly() {
        let mut trace = Trace::even(vec![0.0, 1.0, 2.0, 4.0], 1000.0);
        assert_eq!((trace.at(-1e-9), trace.at(3e-3 + FADE)), (0.0, 0.0));
        assert_eq!(trace.at(3e-3), 4.0);
        assert!((trace.at(3e-3 + FADE / 2.0) - 2.0).abs() < 1e-12);
        // In the half millisecond over which a trigger looks back it moves by less than a hundredth.
        let steps = (0..40).map(|n| 3e-3 + f64::from(n) * 0.5e-3);
        let values: Vec<f64> = steps.map(|time| trace.at(time)).collect();
        assert!(
            values
                .windows(2)
                .all(|pair| (0.0..0.16).contains(&(pair[0] - pair[1])))
        );
    }

    #[test]
    fn the_rest_before_the_strike_is_its_zero() {
        let mut values: Vec<f64> = (0..200)
            .map(|row| 0.21 + 0.001 * f64::from(row % 3 - 1) + 5.0 * pulse(f64::from(row), 120.0, 20.0))
            .collect();
        assert!((zeroed(&mut values).0 - 0.21).abs() < 1e-3);
        assert!(values[..60].iter().all(|value| value.abs() < 2e-3));
        // A file that begins within the pulse rests at its first value.
        let mut cut = vec![1.0, 2.0, 3.0, 2.0, 1.0, 0.0];
        assert_eq!(zeroed(&mut cut).0, 1.0);
    }

    #[test]
    fn the_parabola_around_a_time_takes_noise_out_and_keeps_the_pulse() {
        let mut chance = ChaCha8Rng::seed_from_u64(1);
        let mut noise = || chance.random_range(-0.02..0.02);
        let values = (0..4000).map(|row| pulse(f64::from(row), 2000.0, 217.0) + noise());
        let mut trace = Trace::even(values.collect(), 1e6);
        let off = |of: &mut dyn FnMut(f64) -> f64| -> f64 {
            let times = (0..200).map(|n| 1.8e-3 + f64::from(n) * 2e-6);
            let squares = times.map(|time| (of(time) - pulse(time * 1e6, 2000.0, 217.0)).powi(2));
            (squares.sum::<f64>() / 200.0).sqrt()
        };
        let (alone, around) = (
            off(&mut |time| trace.clone().at(time)),
            off(&mut |time| trace.around(time, 1e-5)),
        );
        println!("{alone} {around}");
        // Over twenty rows, the parabola leaves 9/4 / 20 of the noise's variance: a third of the noise.
        assert!(alone > 0.01 && around < 0.42 * alone, "{alone} {around}");
        // A slow source is not averaged.
        let mut slow = Trace::even((0..40).map(|row| pulse(f64::from(row), 20.0, 8.0)).collect(), 1e5);
        assert_eq!(slow.around(203e-6, 1e-5), slow.clone().at(203e-6));
    }

    #[test]
    fn a_fast_source_is_averaged_and_keeps_its_pulse() {
        let rate = 50e6;
        let values: Vec<f64> = (0..50_000)
            .map(|row| pulse(f64::from(row), 25_000.0, 10_000.0))
            .collect();
        let times = Times::Even {
            step: 1.0 / rate,
            count: values.len(),
        };
        let (times, means, later) = thinned(&times, values);
        assert_eq!(means.len(), 2000);
        let mut trace = Trace::new(times, means, later);
        assert!((trace.highest().1 - 1.0).abs() < 1e-4);
        assert!((trace.at(500e-6) - 1.0).abs() < 1e-4);
        assert!((trace.rows_wide().unwrap() - 400.0).abs() < 0.5);
    }
}
