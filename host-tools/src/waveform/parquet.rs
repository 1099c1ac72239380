//! Parquet files, as pandas, polars and `bead export` write them.

use std::cell::OnceCell;
use std::fmt::Display;
use std::fs::File;
use std::path::Path;
use std::rc::Rc;

use parquet::basic::{ConvertedType, LogicalType, TimeUnit, Type};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::DataType;
use parquet::errors::ParquetError;
use parquet::file::metadata::RowGroupMetaData;
use parquet::file::reader::{FileReader, RowGroupReader};
use parquet::schema::types::{ColumnDescPtr, ColumnDescriptor};

use crate::recording::parquet::{guarded, open};
use crate::recording::printable::beginning;
use crate::waveform::choice::Choice;
use crate::waveform::columns::{Header, Picked, few, pick};
use crate::waveform::error::WaveformError;
use crate::waveform::rows::Rows;
use crate::waveform::signals::Waveform;
use crate::waveform::text::{Strikes, finish};

/// Rows that are read at once.
const AT_ONCE: usize = 1 << 14;
/// Rows of a file at most, with those of strikes that are passed over.
const MOST: i64 = 100_000_000;
/// Characters at most of what the library says, which may hold a name of any length.
const WORDS: usize = 300;

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
        WaveformError::unfit(path, beginning(&what.replace('\n', " "), WORDS))
    };
    let file = File::open(path).map_err(|source| WaveformError::File {
        path: path.to_owned(),
        source,
    })?;
    let reader = open(file).map_err(unread)?;
    let metadata = reader.metadata().file_metadata();
    let schema = metadata.schema_descr();
    let groups = reader.metadata().row_groups();
    let rows = groups.iter().map(RowGroupMetaData::num_rows);
    if rows.fold(0, i64::saturating_add) > MOST {
        let what = format!(
            "has more than {} million rows; cut the strike out of it",
            MOST / 1_000_000
        );
        return Err(WaveformError::unfit(path, what));
    }
    let header = |(place, column): (usize, ColumnDescPtr)| Header {
        place,
        // A message that names it is one line.
        name: column.name().replace('\n', " "),
        unit: of_a_clock(&column).map(str::to_owned),
    };
    let of_kind = |is_of: fn(&ColumnDescriptor) -> bool| {
        let columns = (0..schema.num_columns()).map(|place| (place, schema.column(place)));
        let flat = columns.filter(move |(_, column)| column.max_rep_level() == 0 && is_of(column));
        flat.map(header).collect::<Vec<_>>()
    };
    let headers = of_kind(is_number);
    let others = of_kind(is_other_number);
    let others = (!others.is_empty()).then(|| {
        format!(
            "decimals in bytes, floats of 16 bits and times of 96 bits are not read, as in {}; write them as doubles",
            few(others.iter())
        )
    });
    if headers.is_empty() {
        let none = WaveformError::unfit(
            path,
            "has no columns of numbers; give a table with force over time",
        );
        return Err(none.also(others.as_deref()));
    }
    let picks = pick(path, &headers, choice).map_err(|error| error.also(others.as_deref()))?;
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
    // Time counts from its first row, everything else from 0.
    let (first, zero) = (Origin::default(), Origin::from(OnceCell::from(0)));
    for group in 0..reader.num_row_groups() {
        let group = guarded(|| reader.get_row_group(group)).map_err(unread)?;
        let column = |place: usize, from: &Origin| {
            guarded(|| Column::of(group.as_ref(), place, from.clone())).map_err(unread)
        };
        let picked = |picked: Option<Picked>, from: &Origin| {
            let column =
                picked.map(|picked| Ok::<_, WaveformError>((column(picked.place, from)?, picked.size)));
            column.transpose()
        };
        let mut columns = [
            picked(picks.time, &first)?,
            picked(picks.force, &zero)?,
            picked(picks.acceleration, &zero)?,
        ];
        let mut strike = picks.strike.map(|place| column(place, &zero)).transpose()?;
        let mut left = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
        while left > 0 {
            let count = left.min(AT_ONCE);
            left -= count;
            for (column, _) in columns.iter_mut().flatten() {
                guarded(|| column.read(count)).map_err(unread)?;
            }
            if let Some(column) = &mut strike {
                guarded(|| column.read(count)).map_err(unread)?;
            }
            if let Some((time, size)) = &columns[0] {
                rows.since = time.begins() * size;
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

fn is_number(column: &ColumnDescriptor) -> bool {
    matches!(
        column.physical_type(),
        Type::INT32 | Type::INT64 | Type::FLOAT | Type::DOUBLE
    )
}

/// Whether it has numbers in a form that is not read.
fn is_other_number(column: &ColumnDescriptor) -> bool {
    let is_decimal = column.converted_type() == ConvertedType::DECIMAL;
    let is_half = column.logical_type_ref() == Some(&LogicalType::Float16);
    match column.physical_type() {
        Type::INT96 => true,
        Type::BYTE_ARRAY | Type::FIXED_LEN_BYTE_ARRAY => is_decimal || is_half,
        _ => false,
    }
}

/// The unit of a column of times of day. The library knows the older of the two ways to say it from the newer
/// one, where that says the same.
fn of_a_clock(column: &ColumnDescriptor) -> Option<&'static str> {
    use ConvertedType::{TIME_MICROS, TIME_MILLIS, TIMESTAMP_MICROS, TIMESTAMP_MILLIS};
    match (column.logical_type_ref(), column.converted_type()) {
        (Some(LogicalType::Timestamp(time) | LogicalType::Time(time)), _) if time.unit == TimeUnit::NANOS => {
            Some("ns")
        }
        (_, TIME_MICROS | TIMESTAMP_MICROS) => Some("us"),
        (_, TIME_MILLIS | TIMESTAMP_MILLIS) => Some("ms"),
        _ => None,
    }
}

/// The whole number from which those of a column count; the first of them, where it is not given. Times since
/// 1970 leave an f64 no room for steps below 1 µs.
type Origin = Rc<OnceCell<i128>>;

/// Gives the next rows of a column; fewer at its end.
type Reader = Box<dyn FnMut(usize) -> Result<Vec<Option<f64>>, ParquetError>>;

/// A column of numbers in a row group, some rows at a time: a few bytes of a file can stand for millions of
/// rows.
struct Column {
    reader: Reader,
    rows: Vec<Option<f64>>,
    from: Origin,
    /// The whole number that stands for 1: a power of ten, of decimals.
    one: f64,
}

impl Column {
    /// The column at a place.
    fn of(group: &(dyn RowGroupReader + '_), place: usize, from: Origin) -> Result<Self, ParquetError> {
        use ConvertedType::{DECIMAL, UINT_8, UINT_16, UINT_32, UINT_64};
        let metadata = group.metadata().column(place);
        let known_at = metadata.column_descr().max_def_level();
        let (one, is_unsigned) = match metadata.column_descr().converted_type() {
            DECIMAL => (10_f64.powi(metadata.column_descr().type_scale()), false),
            UINT_8 | UINT_16 | UINT_32 | UINT_64 => (1.0, true),
            _ => (1.0, false),
        };
        let origin = from.clone();
        let number = move |whole: i128| (whole - origin.get_or_init(|| whole)) as f64 / one;
        let reader = match group.get_column_reader(place)? {
            ColumnReader::Int32ColumnReader(reader) => {
                numbers(reader, known_at, move |value| match is_unsigned {
                    true => number(value.cast_unsigned().into()),
                    false => number((*value).into()),
                })
            }
            ColumnReader::Int64ColumnReader(reader) => {
                numbers(reader, known_at, move |value| match is_unsigned {
                    true => number(value.cast_unsigned().into()),
                    false => number((*value).into()),
                })
            }
            ColumnReader::FloatColumnReader(reader) => numbers(reader, known_at, |value| f64::from(*value)),
            ColumnReader::DoubleColumnReader(reader) => numbers(reader, known_at, |value| *value),
            _ => return Err(ParquetError::General("a column has changed its type".to_owned())),
        };
        Ok(Self {
            reader,
            rows: Vec::new(),
            from,
            one,
        })
    }

    /// What its numbers count from.
    fn begins(&self) -> f64 {
        self.from.get().map_or(0.0, |from| *from as f64 / self.one)
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

    use parquet::data_type::{DoubleType, FloatType, Int32Type, Int64Type};
    use parquet::file::metadata::ParquetMetaDataWriter;
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

    /// Columns of forty whole numbers, by the schema's types, and then the force: half a newton in row 25.
    fn table<T: DataType>(path: &Path, columns: &str, value: impl Fn(usize) -> T::T) {
        let schema = format!("message table {{ {columns} REQUIRED DOUBLE force_n; }}");
        let schema = Arc::new(parse_message_type(&schema).unwrap());
        let mut writer =
            SerializedFileWriter::new(File::create(path).unwrap(), schema, Arc::default()).unwrap();
        let mut group = writer.next_row_group().unwrap();
        let mut column = group.next_column().unwrap().unwrap();
        let values: Vec<T::T> = (0..40).map(value).collect();
        column.typed::<T>().write_batch(&values, None, None).unwrap();
        column.close().unwrap();
        let mut column = group.next_column().unwrap().unwrap();
        let force: Vec<f64> = (0..40).map(|row| if row == 25 { 0.5 } else { 0.0 }).collect();
        column
            .typed::<DoubleType>()
            .write_batch(&force, None, None)
            .unwrap();
        column.close().unwrap();
        group.close().unwrap();
        writer.close().unwrap();
    }

    /// When the force has its top after the first row, and when the first row is, s.
    fn times(path: &Path) -> (f64, f64) {
        let waveform = Waveform::read(path, &Choice::default(), None).unwrap();
        (waveform.force.unwrap().highest().0, waveform.start)
    }

    #[test]
    fn decimals_and_numbers_without_a_sign_are_what_their_types_say() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("table.parquet");
        let at = |place: usize| 50.0 * place as f64;
        // 0.50 ms from row to row, from 1.25 ms on.
        table::<Int32Type>(&path, "REQUIRED INT32 time_ms (DECIMAL(9,2));", |row| {
            125 + 50 * row as i32
        });
        let (top, start) = times(&path);
        assert!((top - at(25) * 1e-5).abs() < 1e-12, "{top}");
        assert!((start - 1.25e-3).abs() < 1e-12, "{start}");
        table::<Int64Type>(&path, "REQUIRED INT64 time_ms (DECIMAL(18,5));", |row| {
            50 * row as i64
        });
        assert!((times(&path).0 - at(25) * 1e-8).abs() < 1e-15);
        // Counters that pass 2^31 and 2^63.
        let before = i32::MAX - 500;
        table::<Int32Type>(&path, "REQUIRED INT32 time_us (INTEGER(32,false));", |row| {
            before.wrapping_add(50 * row as i32)
        });
        let (top, start) = times(&path);
        assert!((top - at(25) * 1e-6).abs() < 1e-12, "{top}");
        assert!((start - f64::from(before) * 1e-6).abs() < 1e-6, "{start}");
        table::<Int64Type>(&path, "REQUIRED INT64 time_us (INTEGER(64,false));", |row| {
            (i64::MAX - 500).wrapping_add(50 * row as i64)
        });
        assert!((times(&path).0 - at(25) * 1e-6).abs() < 1e-12);
        // Of a force, nothing is taken off.
        table::<Int32Type>(&path, "REQUIRED INT32 kraft (DECIMAL(9,2));", |row| {
            7 + i32::from(row == 25) * 150
        });
        let choice = Choice {
            rate_hz: Some(1e3),
            force: "kraft:N".parse().ok(),
            ..Choice::default()
        };
        let waveform = Waveform::read(&path, &choice, None).unwrap();
        let (_, peak) = waveform.force.unwrap().highest();
        assert!((peak - 1.5).abs() < 1e-12, "{peak}");
        assert!(
            waveform.remarks[0].contains("begins at 0.0700 N"),
            "{:?}",
            waveform.remarks
        );
    }

    #[test]
    fn times_of_day_have_their_unit_from_older_types_too_and_keep_their_steps() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("table.parquet");
        for (kind, one) in [
            ("TIMESTAMP_MILLIS", 1e-3),
            ("TIMESTAMP_MICROS", 1e-6),
            ("TIME_MICROS", 1e-6),
            ("TIME(NANOS,true)", 1e-9),
        ] {
            table::<Int64Type>(&path, &format!("REQUIRED INT64 when ({kind});"), |row| {
                50 * row as i64
            });
            let (top, _) = times(&path);
            assert!((top - 1250.0 * one).abs() < 1e-9 * one, "{kind}: {top}");
        }
        table::<Int32Type>(&path, "REQUIRED INT32 when (TIME_MILLIS);", |row| 50 * row as i32);
        assert!((times(&path).0 - 1.25).abs() < 1e-12);
        // 300 ns from row to row, in the year 2026: an f64 has steps of 238 ns there.
        let epoch = 1_772_000_000_000_123_457;
        let schema = "REQUIRED INT64 when (TIMESTAMP(NANOS,true));";
        table::<Int64Type>(&path, schema, |row| epoch + 300 * row as i64);
        let (top, start) = times(&path);
        assert!((top - 25.0 * 300e-9).abs() < 1e-15, "{top}");
        assert!((start - 1_772_000_000.000_123).abs() < 1e-6, "{start}");
        // What is refused is told in the file's own time.
        let schema = "REQUIRED INT64 when (TIMESTAMP_MILLIS);";
        table::<Int64Type>(&path, schema, |row| 1000 * if row > 30 { 4 } else { row as i64 });
        let says = || {
            Waveform::read(&path, &Choice::default(), None)
                .unwrap_err()
                .to_string()
        };
        assert!(
            says().contains("goes back at row 32, from 30 to 4 s"),
            "{}",
            says()
        );
        table::<Int64Type>(&path, schema, |row| {
            1000 * (7 + row as i64 + 9 * i64::from(row > 30))
        });
        assert!(says().contains("gap from 37 to 47 s"), "{}", says());
    }

    #[test]
    fn numbers_in_forms_that_are_not_read_are_named() {
        use parquet::data_type::{FixedLenByteArrayType, Int96Type};
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("table.parquet");
        let says = || {
            Waveform::read(&path, &Choice::default(), None)
                .unwrap_err()
                .to_string()
        };
        for (kind, length) in [("DECIMAL(30,2)", 16), ("FLOAT16", 2)] {
            let column = format!("REQUIRED FIXED_LEN_BYTE_ARRAY({length}) time_s ({kind});");
            table::<FixedLenByteArrayType>(&path, &column, |_| vec![0; length].into());
            assert!(
                says().contains("no column of time among force_n; say which"),
                "{}",
                says()
            );
            assert!(
                says().ends_with("are not read, as in time_s; write them as doubles"),
                "{}",
                says()
            );
        }
        table::<Int96Type>(&path, "REQUIRED INT96 when;", |_| vec![0, 0, 0].into());
        assert!(
            says().ends_with("are not read, as in when; write them as doubles"),
            "{}",
            says()
        );
    }

    #[test]
    fn a_file_of_more_rows_than_can_be_passed_over_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("table.parquet");
        table::<Int32Type>(&path, "REQUIRED INT32 time_us;", |row| row as i32);
        let metadata = open(File::open(&path).unwrap()).unwrap().metadata().clone();
        let sound = std::fs::read(&path).unwrap();
        let says = |rows: i64| {
            let group = metadata
                .row_group(0)
                .clone()
                .into_builder()
                .set_num_rows(rows / 2);
            let groups = vec![group.build().unwrap(); 2];
            // So long that its rows may have room in it.
            let mut bytes = sound.clone();
            bytes.resize(110_000, 0);
            let metadata = metadata.clone().into_builder().set_row_groups(groups).build();
            let footer = ParquetMetaDataWriter::new(&mut bytes, &metadata);
            footer.finish().unwrap();
            std::fs::write(&path, bytes).unwrap();
            Waveform::read(&path, &Choice::default(), None)
                .unwrap_err()
                .to_string()
        };
        assert!(says(MOST).contains("row 41 has no number"), "{}", says(MOST));
        assert!(says(MOST + 2).contains("has more than 100 million rows; cut the strike out of it"),);
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
