//! Faults of a record: values that were cut off, and noise that hides its zero.

/// Least number of consecutive equal rows that suggests a record was cut off.
const FLAT: usize = 4;
/// Greatest fall, in steps, of a smooth top that stays within one step over some rows, over as many more
/// rows: nine for a parabola, and rounding.
const SMOOTH: f64 = 15.0;
/// Least number of rows for an estimate of noise.
const FEW: usize = 16;

/// The longest run of rows at the highest or the lowest value, if the record seems to be cut off there:
/// number of rows, and the value. Coarse steps of the converter or repeated values may also make a top flat;
/// such tops do not count.
pub(super) fn cut_off(values: &[f64]) -> Option<(usize, f64)> {
    let first = *values.first()?;
    let most = values
        .iter()
        .map(|value| (value - first).abs())
        .fold(0.0, f64::max);
    let changes = values.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    let step = changes
        .filter(|change| *change > 0.0)
        .fold(f64::INFINITY, f64::min);
    let extremes = [f64::max, f64::min].map(|of: fn(f64, f64) -> f64| values.iter().copied().fold(first, of));
    let is_extreme = |value: f64| extremes.contains(&value) && (value - first).abs() > 0.3 * most;
    let (mut longest, mut held, mut at) = ((0, 0), 1, 0);
    for run in values.chunk_by(|one, other| one == other) {
        if is_extreme(run[0]) {
            longest = longest.max((run.len(), at));
        } else if (run[0] - first).abs() > 0.3 * most {
            held = held.max(run.len());
        }
        at += run.len();
    }
    let (rows, from) = longest;
    let flat = *values.get(from)?;
    let falls = |row: Option<usize>| {
        let beside = row.and_then(|row| values.get(row));
        beside.is_none_or(|beside| (flat - beside).abs() > SMOOTH * step)
    };
    let is_steep = falls(from.checked_sub(rows)) && falls(Some(from + 2 * rows - 1));
    (rows >= FLAT && rows > 2 * held && is_steep).then_some((rows, flat))
}

/// Noise before the strike, rms: the greater of two estimates, from the `quiet` rows of the zero, and from
/// the changes from row to row in the first quarter of the rows before the top. An estimate from too few rows
/// counts as 0.
pub(super) fn noise(values: &[f64], quiet: usize) -> f64 {
    let size = |row: &usize| values[*row].abs();
    let top = (0..values.len())
        .max_by(|a, b| size(a).total_cmp(&size(b)))
        .unwrap_or(0);
    let mut changes: Vec<f64> = values[..top / 4]
        .windows(2)
        .map(|pair| (pair[1] - pair[0]).abs())
        .collect();
    let by_changes = (changes.len() >= FEW).then(|| {
        let middle = changes.len() / 2;
        // The median of a normal deviate is 0.6745 of its standard deviation, and two rows have noise.
        *changes.select_nth_unstable_by(middle, f64::total_cmp).1 / (0.6745 * 2.0_f64.sqrt())
    });
    let of_zero = (quiet >= FEW).then(|| {
        let squares: f64 = values[..quiet].iter().map(|value| value * value).sum();
        (squares / quiet as f64).sqrt()
    });
    f64::max(by_changes.unwrap_or(0.0), of_zero.unwrap_or(0.0))
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// A wave of 6.3 N in the middle of 2000 rows, 300 rows wide, with noise, in steps.
    fn wave(noise: f64, step: f64) -> Vec<f64> {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let value = |row: i32| {
            let phase = f64::from(row - 1000) / 300.0 * 2.0 * 0.4716;
            let wave = if phase.abs() < 1.57 {
                6.3 * phase.cos().powi(6)
            } else {
                0.0
            };
            // Twelve even deviates have the variance 1.
            let deviate: f64 = (0..12).map(|_| random.random_range(-0.5..0.5)).sum();
            ((wave + noise * deviate) / step).round() * step
        };
        (0..2000).map(value).collect()
    }

    #[test]
    fn a_record_that_is_cut_off_is_told_from_coarse_steps_and_from_values_that_stand_several_times() {
        let cut = |values: Vec<f64>| values.into_iter().map(|value| value.min(4.0)).collect::<Vec<_>>();
        let held = |values: Vec<f64>| {
            values
                .iter()
                .step_by(8)
                .flat_map(|value| [*value; 8])
                .collect::<Vec<_>>()
        };
        let turned = |values: Vec<f64>| values.into_iter().map(|value| -value).collect::<Vec<_>>();
        for (values, is_cut) in [
            (wave(0.0, 1e-9), false),
            (wave(0.0, 0.05), false),
            (wave(0.05, 0.05), false),
            (held(wave(0.0, 1e-9)), false),
            (cut(wave(0.0, 1e-9)), true),
            (cut(wave(0.0, 0.05)), true),
            (cut(held(wave(0.0, 1e-9))), true),
            (turned(cut(wave(0.0, 0.01))), true),
            // A signal that repeatedly returns to rest is not cut off at rest.
            (
                [cut(wave(0.0, 0.05)).split_off(1400), wave(0.0, 0.05)].concat(),
                false,
            ),
            (vec![0.0; 100], false),
        ] {
            let found = cut_off(&values);
            assert_eq!(found.is_some(), is_cut, "{found:?}");
            assert!(found.is_none_or(|(rows, value)| rows > 100 && (value.abs() - 4.0).abs() < 1e-9));
        }
    }

    #[test]
    fn noise_is_found_however_many_rows_the_zero_has() {
        for (noise_rms, quiet) in [(0.02, 400), (0.2, 3), (0.2, 400), (0.0, 400)] {
            let found = noise(&wave(noise_rms, 1e-6), quiet);
            assert!(
                (found - noise_rms).abs() <= 0.15 * noise_rms + 1e-9,
                "{noise_rms}: {found}"
            );
        }
        // A record that begins with the wave has no noise before it.
        assert_eq!(noise(&wave(0.0, 1e-6)[980..], 1), 0.0);
    }
}
