//! Parquet files, as pandas, polars and `bead export` write them.

use std::fmt::Display;
use std::fs::File;
use std::path::Path;

use parquet::basic::{LogicalType, TimeUnit, Type};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::DataType;
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, RowGroupReader};
use parquet::schema::types::ColumnDescriptor;

use crate::recording::parquet::{guarded, open};
use crate::waveform::choice::Choice;
use crate::waveform::columns::{Header, pick};
use crate::waveform::error::WaveformError;
use crate::waveform::rows::{MOST, Rows};
use crate::waveform::signals::Waveform;
use crate::waveform::text::{Strikes, finish};

/// Rows that are read at once.
const AT_ONCE: usize = 1 << 14;

/// Reads a Parquet file, some rows at a time.
pub(super) fn read(path: &Path, choice: &Choice) -> Result<Waveform, WaveformError> {
    let unread = |error: ParquetError| {
        let damaged = |words: &dyn Display| format!("is a damaged Parquet file: {words}");
        let what = match &error {
            ParquetError::General(what) | ParquetError::NYI(what) if what.contains("compil") => {
                "its columns are compressed in a way that is not read; write it with snappy, or not compressed".to_owned()
            }
            // The library's word for the kind of an error says nothing to whoever wrote the file.
            ParquetError::General(words) | ParquetError::EOF(words) => damaged(words),
            ParquetError::External(cause) => damaged(cause),
            error => damaged(error),
        };
        WaveformError::unfit(path, what.replace('\n', " "))
    };
    let file = File::open(path).map_err(|source| WaveformError::File {
        path: path.to_owned(),
        source,
    })?;
    let reader = open(file).map_err(unread)?;
    let metadata = reader.metadata().file_metadata();
    let schema = metadata.schema_descr();
    let headers: Vec<_> = (0..schema.num_columns())
        .map(|place| (place, schema.column(place)))
        .filter(|(_, column)| {
            let is_number = matches!(
                column.physical_type(),
                Type::INT32 | Type::INT64 | Type::FLOAT | Type::DOUBLE
            );
            is_number && column.max_rep_level() == 0
        })
        .map(|(place, column)| Header {
            place,
            // A message that names it is one line.
            name: column.name().replace('\n', " "),
            unit: of_a_clock(&column).map(str::to_owned),
        })
        .collect();
    if headers.is_empty() {
        return Err(WaveformError::unfit(
            path,
            "has no columns of numbers; give a table with force over time",
        ));
    }
    let picks = pick(path, &headers, choice)?;
    let mut rows = Rows::new(
        path,
        "row",
        choice.rate_hz,
        [picks.force.is_some(), picks.acceleration.is_some()],
    );
    rows.remarks.extend(picks.remarks);
    let wanted = choice.strike.unwrap_or(0) as f64;
    let mut strikes = Strikes::default();
    let mut number = 0;
    for group in 0..reader.num_row_groups() {
        let group = guarded(|| reader.get_row_group(group)).map_err(unread)?;
        let column = |place: usize| guarded(|| Column::of(group.as_ref(), place)).map_err(unread);
        let picked = [picks.time, picks.force, picks.acceleration].map(|picked| {
            let picked = picked.filter(|picked| choice.rate_hz.is_none() || Some(*picked) != picks.time);
            picked.map(|picked| column(picked.place).map(|column| (column, picked.size)))
        });
        let [time, force, acceleration] = picked;
        let mut columns = [time.transpose()?, force.transpose()?, acceleration.transpose()?];
        let mut strike = picks.strike.map(column).transpose()?;
        let mut left = usize::try_from(group.metadata().num_rows())
            .unwrap_or(0)
            .min(MOST + 1);
        while left > 0 {
            let count = left.min(AT_ONCE);
            left -= count;
            for (column, _) in columns.iter_mut().flatten() {
                guarded(|| column.read(count)).map_err(unread)?;
            }
            if let Some(column) = &mut strike {
                guarded(|| column.read(count)).map_err(unread)?;
            }
            for row in 0..count {
                number += 1;
                let strike = strike.as_ref().and_then(|column| column.number(row));
                if strike.is_some_and(|strike| strikes.passes_over(strike, wanted)) {
                    continue;
                }
                let of = |picked: &Option<(Column, f64)>| {
                    let (column, size) = picked.as_ref()?;
                    Some(column.number(row)? * size)
                };
                rows.push(number, columns.each_ref().map(of))?;
            }
        }
    }
    finish(rows, picks.strike.is_some(), &strikes, choice)
}

/// The unit of a column of times of day.
fn of_a_clock(column: &ColumnDescriptor) -> Option<&'static str> {
    match column.logical_type_ref()? {
        LogicalType::Timestamp(time) | LogicalType::Time(time) => Some(match time.unit {
            TimeUnit::MILLIS => "ms",
            TimeUnit::MICROS => "us",
            TimeUnit::NANOS => "ns",
        }),
        _ => None,
    }
}

/// Gives the next rows of a column; fewer at its end.
type Reader = Box<dyn FnMut(usize) -> Result<Vec<Option<f64>>, ParquetError>>;

/// A column of numbers in a row group, some rows at a time: a few bytes of a file can stand for millions of rows.
struct Column {
    reader: Reader,
    rows: Vec<Option<f64>>,
}

impl Column {
    /// The column at a place.
    fn of(group: &(dyn RowGroupReader + '_), place: usize) -> Result<Self, ParquetError> {
        let known_at = group.metadata().column(place).column_descr().max_def_level();
        let reader = match group.get_column_reader(place)? {
            ColumnReader::Int32ColumnReader(reader) => numbers(reader, known_at, |value| f64::from(*value)),
            ColumnReader::Int64ColumnReader(reader) => numbers(reader, known_at, |value| *value as f64),
            ColumnReader::FloatColumnReader(reader) => numbers(reader, known_at, |value| f64::from(*value)),
            ColumnReader::DoubleColumnReader(reader) => numbers(reader, known_at, |value| *value),
            _ => return Err(ParquetError::General("a column has changed its type".to_owned())),
        };
        let rows = Vec::new();
        Ok(Self { reader, rows })
    }

    /// Takes the next rows; fewer at the column's end.
    fn read(&mut self, count: usize) -> Result<(), ParquetError> {
        self.rows = (self.reader)(count)?;
        Ok(())
    }

    /// The number in one of these rows, where there is one.
    fn number(&self, row: usize) -> Option<f64> {
        *self.rows.get(row)?
    }
}

/// Reads the next rows of a column, whose numbers are known where their definition level is `known_at`.
fn numbers<T: DataType>(
    mut reader: ColumnReaderImpl<T>,
    known_at: i16,
    number: impl Fn(&T::T) -> f64 + 'static,
) -> Reader {
    Box::new(move |count| {
        let (mut values, mut levels) = (Vec::new(), Vec::new());
        reader.read_records(count, Some(&mut levels), None, &mut values)?;
        let mut values = values.iter().map(&number);
        // A column that cannot have nulls does not say where they are.
        if known_at == 0 {
            return Ok(values.map(Some).collect());
        }
        let known = levels.into_iter().map(|level| level == known_at);
        Ok(known
            .map(|known| if known { values.next() } else { None })
            .collect())
    })
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use parquet::data_type::{FloatType, Int64Type};
    use parquet::file::properties::WriterProperties;
    use parquet::file::writer::SerializedFileWriter;
    use parquet::schema::parser::parse_message_type;

    use super::*;

    /// A frame of 40 rows: time as whole microseconds, force as 32-bit floats, one of them missing at will.
    fn frame(path: &Path, missing: Option<usize>) {
        let schema = "message frame { REQUIRED INT64 when (TIMESTAMP(MICROS,false)); OPTIONAL FLOAT force_kn; OPTIONAL BYTE_ARRAY note (UTF8); }";
        let schema = Arc::new(parse_message_type(schema).unwrap());
        let file = File::create(path).unwrap();
        let mut writer =
            SerializedFileWriter::new(file, schema, Arc::new(WriterProperties::builder().build())).unwrap();
        for half in 0..2 {
            let rows = half * 20..half * 20 + 20;
            let mut group = writer.next_row_group().unwrap();
            let mut column = group.next_column().unwrap().unwrap();
            let times: Vec<i64> = rows.clone().map(|row| 50 * row as i64).collect();
            column
                .typed::<Int64Type>()
                .write_batch(&times, None, None)
                .unwrap();
            column.close().unwrap();
            let mut column = group.next_column().unwrap().unwrap();
            let known: Vec<i16> = rows.clone().map(|row| i16::from(Some(row) != missing)).collect();
            let force = rows.clone().filter(|row| Some(*row) != missing);
            let force: Vec<f32> = force.map(|row| if row == 25 { 0.25 } else { 0.0 }).collect();
            column
                .typed::<FloatType>()
                .write_batch(&force, Some(&known), None)
                .unwrap();
            column.close().unwrap();
            let mut column = group.next_column().unwrap().unwrap();
            let none = vec![0; 20];
            let nothing = column.typed::<parquet::data_type::ByteArrayType>();
            nothing.write_batch(&[], Some(&none), None).unwrap();
            column.close().unwrap();
            group.close().unwrap();
        }
        writer.close().unwrap();
    }

    #[test]
    fn numbers_of_every_width_and_row_groups_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frame.parquet");
        frame(&path, None);
        let force = Waveform::read(&path, &Choice::default(), None)
            .unwrap()
            .force
            .unwrap();
        let (time, peak) = force.highest();
        assert_eq!((force.rows(), peak), (40, 250.0));
        assert!((time - 25.0 * 50e-6).abs() < 1e-15);
    }

    #[test]
    fn equal_rows_that_take_no_room_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("still.parquet");
        let schema = Arc::new(parse_message_type("message still { REQUIRED INT64 force_n; }").unwrap());
        let one_page = WriterProperties::builder().set_data_page_row_count_limit(usize::MAX);
        let properties = Arc::new(one_page.build());
        let mut writer = SerializedFileWriter::new(File::create(&path).unwrap(), schema, properties).unwrap();
        let mut group = writer.next_row_group().unwrap();
        let mut column = group.next_column().unwrap().unwrap();
        let still = vec![7; 2_000_000];
        column
            .typed::<Int64Type>()
            .write_batch(&still, None, None)
            .unwrap();
        column.close().unwrap();
        group.close().unwrap();
        writer.close().unwrap();
        let choice = Choice {
            rate_hz: Some(1e5),
            ..Choice::default()
        };
        let why = Waveform::read(&path, &choice, None).unwrap_err().to_string();
        assert!(
            why.contains("bytes cannot have the 2000000 rows that it names"),
            "{why}"
        );
    }

    #[test]
    fn a_missing_value_and_a_cut_file_are_told() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frame.parquet");
        frame(&path, Some(30));
        let says = || {
            Waveform::read(&path, &Choice::default(), None)
                .unwrap_err()
                .to_string()
        };
        assert!(
            says().contains("row 31 has no number for the force"),
            "{}",
            says()
        );
        let whole = std::fs::read(&path).unwrap();
        std::fs::write(&path, &whole[..whole.len() - 20]).unwrap();
        assert!(says().contains("is a damaged Parquet file"), "{}", says());
        assert_eq!(says().lines().count(), 1);
    }
}
