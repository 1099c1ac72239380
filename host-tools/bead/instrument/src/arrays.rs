//! Columns of numbers, stored as whole arrays in a file, as a waveform.

use std::path::Path;

use crate::choice::Choice;
use crate::columns::{ColumnHeader, Picked, pick};
use crate::error::WaveformError;
use crate::rows::{MOST, Rows};
use crate::signals::Waveform;

/// Greatest number of values in a file: three columns of the greatest length.
pub(super) const MOST_NUMBERS: usize = 3 * MOST;

/// Greatest number of columns in a file.
pub(super) const MOST_COLUMNS: usize = 1000;

/// A column, with its numbers.
pub(super) struct Array {
    pub(super) header: ColumnHeader,
    /// Values in the file's unit. All arrays of a file have the same length.
    pub(super) values: Vec<f64>,
}

/// The columns of a matrix that is stored row by row, if `by_rows`, or column by column.
pub(super) fn columns(values: &[f64], columns: usize, by_rows: bool) -> impl Iterator<Item = Vec<f64>> {
    let rows = values.len() / columns.max(1);
    let (to_column, to_row) = if by_rows { (1, columns) } else { (rows, 1) };
    (0..columns).map(move |column| {
        let row = |row| values[column * to_column + row * to_row];
        (0..rows).map(row).collect()
    })
}

/// Makes a waveform of the columns of a file without strikes. `rate_hz` is the file's own number of rows a
/// second, which a column of time or a rate on the command line replaces.
///
/// # Errors
/// A column is missing or ambiguous, or its values are no waveform.
pub(super) fn waveform(
    path: &Path,
    choice: &Choice,
    arrays: &[Array],
    rate_hz: Option<f64>,
) -> Result<Waveform, WaveformError> {
    if choice.strike.is_some() {
        return Err(WaveformError::unfit(
            path,
            "has arrays, whose strikes are not numbered; leave --read strike out",
        ));
    }
    let own = rate_hz.filter(|_| choice.time.is_none());
    let choice = Choice {
        rate_hz: choice.rate_hz.or(own),
        ..choice.clone()
    };
    let headers: Vec<_> = arrays.iter().map(|array| array.header.clone()).collect();
    let picks = pick(path, &headers, &choice)?;
    let mut rows = Rows::picked(path, "row", choice.rate_hz, &picks);
    let column = |picked: Option<Picked>| {
        let picked = picked?;
        let array = arrays.iter().find(|array| array.header.place == picked.place)?;
        Some((&array.values, picked.size))
    };
    let columns = [picks.time, picks.force, picks.acceleration].map(column);
    let count = columns.iter().flatten().map(|(values, _)| values.len()).max();
    for row in 0..count.unwrap_or(0) {
        let value = |column: Option<(&Vec<f64>, f64)>| {
            let (values, size) = column?;
            Some(values.get(row)? * size)
        };
        rows.push(row as u64 + 1, columns.map(value))?;
    }
    rows.end()
}
