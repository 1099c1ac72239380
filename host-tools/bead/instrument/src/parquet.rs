//! Parquet files, as pandas, polars and `bead export` write them.

use std::path::Path;

use crate::choice::Choice;
use crate::columns::{ColumnHeader, Picks, few, pick};
use crate::error::WaveformError;
use crate::rows::{Rows, StrikeFilter};
use crate::signals::Waveform;
use bead_tables::{Batch, Cell, CellKind, ReadError, Reader};

/// Reads a Parquet file, some rows at a time.
pub(super) fn read(path: &Path, choice: &Choice) -> Result<Waveform, WaveformError> {
    let unread = |error: ReadError| match error {
        ReadError::File(source) => WaveformError::unread(path)(source),
        error => WaveformError::unfit(path, error.to_string()),
    };
    let reader = Reader::open(path).map_err(unread)?;
    let picks = columns(path, &reader, choice)?;
    let mut rows = Rows::picked(path, "row", choice.rate_hz, &picks);
    let mut strikes = StrikeFilter::new(&picks, choice);
    let of = [picks.time, picks.force, picks.acceleration];
    let mut places: Vec<usize> = of.iter().flatten().map(|picked| picked.place).collect();
    places.extend(picks.strike);
    let (mut number, mut origin) = (0, None);
    for batch in reader.batches(places) {
        let Batch { columns } = batch.map_err(unread)?;
        let mut columns = columns.into_iter();
        let [time, force, acceleration] =
            of.map(|picked| picked.and_then(|picked| Some((columns.next()?, picked.size))));
        let strike = picks.strike.and_then(|_| columns.next());
        if let Some((cells, size)) = &time
            && origin.is_none()
        {
            // An f64 cannot resolve steps below 1 µs in times since 1970, so integer times count from the
            // first.
            let first = match cells.first() {
                Some(Cell::Whole(first)) => *first,
                _ => 0,
            };
            origin = Some(first);
            rows.since = first as f64 * size;
        }
        let origin = origin.unwrap_or(0);
        let time_at = |row: usize| {
            let (cells, size) = time.as_ref()?;
            match cells[row] {
                Cell::Whole(whole) => Some((i128::from(whole) - i128::from(origin)) as f64 * size),
                ref cell => Some((cell.as_f64()? - origin as f64) * size),
            }
        };
        let value_at = |column: &Option<(Vec<Cell>, f64)>, row: usize| {
            let (cells, size) = column.as_ref()?;
            Some(cells[row].as_f64()? * size)
        };
        let count = [&time, &force, &acceleration]
            .into_iter()
            .flatten()
            .map(|(cells, _)| cells.len())
            .max();
        for row in 0..count.unwrap_or(0) {
            number += 1;
            let strike = strike.as_ref().and_then(|cells| cells[row].as_f64());
            if strikes.is_wanted(strike) {
                rows.push(
                    number,
                    [time_at(row), value_at(&force, row), value_at(&acceleration, row)],
                )?;
            }
        }
    }
    strikes.finish(rows)
}

fn columns(path: &Path, reader: &Reader, choice: &Choice) -> Result<Picks, WaveformError> {
    let (mut headers, mut others) = (Vec::new(), Vec::new());
    for (place, column) in reader.columns().iter().enumerate() {
        let header = ColumnHeader {
            place,
            name: column.name.replace('\n', " "),
            unit: reader.time_unit(place).map(str::to_owned),
        };
        match column.kind {
            CellKind::Whole | CellKind::Number => headers.push(header),
            CellKind::Other => others.push(header),
            CellKind::Text => {}
        }
    }
    let also = (!others.is_empty()).then(|| {
        format!(
            "lists, decimals in bytes, floats of 16 bits and times of 96 bits are not read, such as {}; write them as doubles",
            few(others.iter())
        )
    });
    if headers.is_empty() {
        let none = WaveformError::unfit(
            path,
            "has no columns of numbers; give a table with force over time",
        );
        return Err(none.also(also.as_deref()));
    }
    pick(path, &headers, choice).map_err(|error| error.also(also.as_deref()))
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::sync::Arc;

    use parquet::data_type::{DataType, DoubleType, FloatType, Int32Type, Int64Type};
    use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
    use parquet::schema::parser::parse_message_type;

    use super::*;
    use crate::testing;
    use bead_tables::{Column, Writer};

    fn write<T: DataType>(group: &mut SerializedRowGroupWriter<'_, File>, values: &[T::T]) {
        let mut column = group.next_column().unwrap().unwrap();
        column.typed::<T>().write_batch(values, None, None).unwrap();
        column.close().unwrap();
    }

    /// Reads a file with a column of forty values, by the schema's type, and one of force: half a newton in
    /// row 25.
    fn table<T: DataType>(
        column: &str,
        value: impl Fn(usize) -> T::T,
        choice: &Choice,
    ) -> Result<Waveform, String> {
        let schema = format!("message table {{ {column} REQUIRED DOUBLE force_n; }}");
        let schema = Arc::new(parse_message_type(&schema).unwrap());
        let file = tempfile::NamedTempFile::new().unwrap();
        let mut writer = SerializedFileWriter::new(file.reopen().unwrap(), schema, Arc::default()).unwrap();
        let mut group = writer.next_row_group().unwrap();
        write::<T>(&mut group, &Vec::from_iter((0..40).map(value)));
        let force = (0..40).map(|row| if row == 25 { 0.5 } else { 0.0 });
        write::<DoubleType>(&mut group, &Vec::from_iter(force));
        group.close().unwrap();
        writer.close().unwrap();
        testing::read(std::fs::read(file.path()).unwrap(), choice)
    }

    /// The time of the highest force after the first row, and that of the first row, s.
    fn times<T: DataType>(column: &str, value: impl Fn(usize) -> T::T) -> (f64, f64) {
        let waveform = table::<T>(column, value, &Choice::default()).unwrap();
        (waveform.force.unwrap().highest().0, waveform.start)
    }

    /// The error for such a table.
    fn refused<T: DataType>(column: &str, value: impl Fn(usize) -> T::T) -> String {
        table::<T>(column, value, &Choice::default()).unwrap_err()
    }

    fn is_near(found: f64, expected: f64, within: f64) {
        assert!((found - expected).abs() < within, "{found} for {expected}");
    }

    #[test]
    fn decimals_and_numbers_without_a_sign_are_what_their_types_say() {
        // 0.50 ms from row to row, from 1.25 ms on.
        let column = "REQUIRED INT32 time_ms (DECIMAL(9,2));";
        let (top, start) = times::<Int32Type>(column, |row| 125 + 50 * row as i32);
        is_near(top, 1250e-5, 1e-12);
        is_near(start, 1.25e-3, 1e-12);
        let column = "REQUIRED INT64 time_ms (DECIMAL(18,5));";
        let (top, _) = times::<Int64Type>(column, |row| 50 * row as i64);
        is_near(top, 1250e-8, 1e-15);
        // A counter that passes 2^31.
        let before = i32::MAX - 500;
        let column = "REQUIRED INT32 time_us (INTEGER(32,false));";
        let (top, start) = times::<Int32Type>(column, |row| before.wrapping_add(50 * row as i32));
        is_near(top, 1250e-6, 1e-12);
        is_near(start, f64::from(before) * 1e-6, 1e-6);
        // Nothing is subtracted from a force.
        let column = "REQUIRED INT32 kraft (DECIMAL(9,2));";
        let choice = Choice {
            rate_hz: Some(1e3),
            force: "kraft:N".parse().ok(),
            ..Choice::default()
        };
        let kraft = |row| 7 + i32::from(row == 25) * 150;
        let waveform = table::<Int32Type>(column, kraft, &choice).unwrap();
        is_near(waveform.force.unwrap().highest().1, 1.5, 1e-12);
        let remark = &waveform.remarks[1];
        assert!(remark.contains("begins at 0.0700 N"), "{remark}");
    }

    #[test]
    fn times_of_day_have_their_unit_from_older_types_too_and_keep_their_steps() {
        for (kind, one) in [
            ("TIMESTAMP_MILLIS", 1e-3),
            ("TIMESTAMP_MICROS", 1e-6),
            ("TIME_MICROS", 1e-6),
            ("TIME(NANOS,true)", 1e-9),
        ] {
            let column = format!("REQUIRED INT64 when ({kind});");
            let (top, _) = times::<Int64Type>(&column, |row| 50 * row as i64);
            is_near(top, 1250.0 * one, 1e-9 * one);
        }
        let (top, _) = times::<Int32Type>("REQUIRED INT32 when (TIME_MILLIS);", |row| 50 * row as i32);
        is_near(top, 1.25, 1e-12);
        // 300 ns from row to row, in the year 2026: an f64 has steps of 238 ns there.
        let epoch = 1_772_000_000_000_123_457;
        let column = "REQUIRED INT64 when (TIMESTAMP(NANOS,true));";
        let (top, start) = times::<Int64Type>(column, |row| epoch + 300 * row as i64);
        is_near(top, 25.0 * 300e-9, 1e-15);
        is_near(start, 1_772_000_000.000_123, 1e-6);
        // An error states times as the file does.
        let column = "REQUIRED INT64 when (TIMESTAMP_MILLIS);";
        let error = refused::<Int64Type>(column, |row| 1000 * if row > 30 { 4 } else { row as i64 });
        assert!(error.contains("goes back at row 32, from 30 to 4 s"), "{error}");
        let error = refused::<Int64Type>(column, |row| 1000 * (7 + row as i64 + 9 * i64::from(row > 30)));
        assert!(error.contains("gap from 37 to 47 s"), "{error}");
    }

    #[test]
    fn numbers_in_forms_that_are_not_read_are_named() {
        use parquet::data_type::FixedLenByteArrayType;
        let column = "REQUIRED FIXED_LEN_BYTE_ARRAY(16) time_s (DECIMAL(30,2));";
        let error = refused::<FixedLenByteArrayType>(column, |_| vec![0; 16].into());
        for part in [
            "no column of time among force_n; say which",
            "are not read, such as time_s; write them as doubles",
        ] {
            assert!(error.contains(part), "{error}");
        }
    }

    #[test]
    fn floats_are_read_and_a_null_and_a_cut_file_are_refused() {
        let (top, _) = times::<FloatType>("REQUIRED FLOAT time_ms;", |row| 0.05 * row as f32);
        is_near(top, 25.0 * 50e-6, 1e-9);
        let file = tempfile::NamedTempFile::new().unwrap();
        let columns = [("time_s", CellKind::Number), ("force_n", CellKind::Number)];
        let columns = columns.map(|(name, kind)| Column::new(name, kind));
        let mut out = file.reopen().unwrap();
        let mut writer = Writer::parquet(&mut out, "frame", &columns, &[]).unwrap();
        for row in 0..40 {
            let force = (row != 30).then_some(0.0);
            let cells = vec![Cell::Number(f64::from(row)), Cell::number(force)];
            writer.push(cells).unwrap();
        }
        writer.finish().unwrap();
        let whole = std::fs::read(file.path()).unwrap();
        for (bytes, part) in [
            (&whole[..], "row 31 has no number for the force"),
            (&whole[..whole.len() - 20], "or is damaged"),
        ] {
            let error = testing::read(bytes, &Choice::default()).unwrap_err();
            assert!(error.contains(part) && error.lines().count() == 1, "{error}");
        }
    }
}
