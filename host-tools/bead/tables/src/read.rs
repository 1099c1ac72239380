//! Parquet files of any program, read some rows at a time.
//!
//! # Design
//! Flat columns of whole numbers, floats, decimals in whole numbers, times and text become [`Cell`]s; other
//! columns keep their name and have [`CellKind::Other`]. Sizes that a file declares are compared with its
//! length before memory is reserved, and the library's panics on damaged files become errors.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use parquet::basic::{Compression, ConvertedType, LogicalType, TimeUnit, Type};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::DataType;
use parquet::errors::ParquetError;
use parquet::file::metadata::{ColumnChunkMetaData, ParquetMetaData, RowGroupMetaData};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::schema::types::ColumnDescriptor;

use crate::guarded::guarded;
use crate::printable::{beginning, one_line};
use crate::table::{Cell, CellKind, Column};

/// Greatest number of rows of a [`Batch`], and of its cells where a table has many columns.
const BATCH_ROWS: usize = 1 << 14;
const BATCH_CELLS: usize = 1 << 20;
/// Greatest number of rows for each byte of a file. Evenly spaced times beside a force at rest reach some
/// 100.
const ROWS_PER_BYTE: u64 = 1000;
/// Greatest number of characters of the library's messages, which may quote names of any length.
const MESSAGE_LENGTH: usize = 300;

/// A Parquet file could not be read. The message is the end of a sentence that begins with the file's name.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The system refused.
    #[error("cannot be read: {0}")]
    File(#[from] io::Error),
    /// It is a device, a pipe or a socket.
    #[error("is a device or a pipe; give a file")]
    Device,
    /// It is not Parquet, or damaged.
    #[error("is not a Parquet file, or is damaged: {0}")]
    Damaged(String),
    /// Its columns are compressed in an unsupported way.
    #[error(
        "is compressed with {0}, which is not supported; write it with zstd: \
         df.write_parquet(path, compression=\"zstd\") in polars"
    )]
    Compressed(String),
}

impl ReadError {
    fn damaged(message: &str) -> Self {
        Self::Damaged(beginning(&one_line(message), MESSAGE_LENGTH).into_owned())
    }
}

impl From<ParquetError> for ReadError {
    fn from(error: ParquetError) -> Self {
        match error {
            // The library's word for the kind of error means nothing to a user.
            ParquetError::General(message) | ParquetError::EOF(message) => Self::damaged(&message),
            ParquetError::External(cause) => Self::damaged(&cause.to_string()),
            error => Self::damaged(&error.to_string()),
        }
    }
}

fn call<T>(read: impl FnOnce() -> Result<T, ParquetError>) -> Result<T, ReadError> {
    match guarded(read) {
        Ok(result) => Ok(result?),
        Err(message) => Err(ReadError::damaged(&message)),
    }
}

/// An open Parquet file.
pub struct Reader {
    file: SerializedFileReader<File>,
    columns: Vec<Column>,
    forms: Vec<CellForm>,
}

/// Rows of a table, column by column.
#[derive(Debug)]
pub struct Batch {
    /// The columns that were asked for, all of one length.
    pub columns: Vec<Vec<Cell>>,
}

impl Batch {
    /// The rows, each with a cell for each column.
    pub fn into_rows(self) -> impl Iterator<Item = Vec<Cell>> {
        let mut columns: Vec<_> = self.columns.into_iter().map(Vec::into_iter).collect();
        std::iter::from_fn(move || columns.iter_mut().map(Iterator::next).collect())
    }
}

impl Reader {
    /// Opens a file.
    ///
    /// # Errors
    /// The file cannot be read, is not Parquet, is compressed other than with Snappy or Zstandard, or
    /// declares more rows or bytes than its length can hold.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let kind = path.metadata()?.file_type();
        if !(kind.is_file() || kind.is_dir()) {
            return Err(ReadError::Device);
        }
        let file = File::open(path)?;
        let length = file.metadata()?.len();
        // A directory can be opened, but not read.
        (&file).take(1).read_to_end(&mut Vec::new())?;
        let file = call(|| SerializedFileReader::new(file))?;
        check_sizes(file.metadata(), length)?;
        check_compression(file.metadata())?;
        let schema = file.metadata().file_metadata().schema_descr();
        let (forms, columns) = schema.columns().iter().map(|column| CellForm::of(column)).unzip();
        Ok(Self { file, columns, forms })
    }

    /// The columns, in their order.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// The unit of a column of times, from its type: `ms`, `us` or `ns`.
    pub fn time_unit(&self, column: usize) -> Option<&'static str> {
        self.forms[column].time_unit
    }

    /// Number of rows.
    pub fn rows(&self) -> u64 {
        rows(self.file.metadata())
    }

    /// The value of one of the file's own notes (key-value metadata).
    pub fn note(&self, key: &str) -> Option<&str> {
        let notes = self.file.metadata().file_metadata().key_value_metadata()?;
        notes.iter().find(|note| note.key == key)?.value.as_deref()
    }

    /// Reads all rows in order, of the columns at these places.
    pub fn batches(&self, places: Vec<usize>) -> impl Iterator<Item = Result<Batch, ReadError>> {
        Batches {
            reader: self,
            places,
            group: 0,
            open: Vec::new(),
            left: 0,
        }
    }

    /// Reads all rows in order, of all columns.
    pub fn all_batches(&self) -> impl Iterator<Item = Result<Batch, ReadError>> {
        self.batches((0..self.columns.len()).collect())
    }
}

fn check_sizes(metadata: &ParquetMetaData, length: u64) -> Result<(), ReadError> {
    let groups = metadata.row_groups();
    let rows = rows(metadata);
    let columns = groups.iter().flat_map(RowGroupMetaData::columns);
    let bytes = sum(columns.map(ColumnChunkMetaData::compressed_size));
    let declared = if rows > length.saturating_mul(ROWS_PER_BYTE) {
        format!("{rows} rows")
    } else if bytes > length {
        format!("{bytes} bytes of columns")
    } else {
        return Ok(());
    };
    Err(ReadError::Damaged(format!(
        "{length} bytes cannot hold the {declared} that it declares"
    )))
}

fn check_compression(metadata: &ParquetMetaData) -> Result<(), ReadError> {
    let columns = metadata.row_groups().iter().flat_map(RowGroupMetaData::columns);
    for column in columns {
        match column.compression() {
            Compression::UNCOMPRESSED | Compression::SNAPPY | Compression::ZSTD(_) => {}
            other => return Err(ReadError::Compressed(format!("{other:?}").to_lowercase())),
        }
    }
    Ok(())
}

fn rows(metadata: &ParquetMetaData) -> u64 {
    sum(metadata.row_groups().iter().map(RowGroupMetaData::num_rows))
}

fn sum(numbers: impl Iterator<Item = i64>) -> u64 {
    numbers.map(i64::unsigned_abs).fold(0, u64::saturating_add)
}

/// The conversion of a column's values to cells.
#[derive(Debug, Clone, Copy)]
struct CellForm {
    /// Definition level of a value that is not null.
    known_at: i16,
    /// Power of ten by which the whole numbers of a column of decimals are divided.
    decimal: Option<f64>,
    is_unsigned: bool,
    time_unit: Option<&'static str>,
}

impl CellForm {
    fn of(column: &ColumnDescriptor) -> (Self, Column) {
        use ConvertedType::{DECIMAL, UINT_8, UINT_16, UINT_32, UINT_64};
        let converted = column.converted_type();
        let form = Self {
            known_at: column.max_def_level(),
            decimal: (converted == DECIMAL).then(|| 10_f64.powi(column.type_scale())),
            is_unsigned: matches!(converted, UINT_8 | UINT_16 | UINT_32 | UINT_64),
            time_unit: time_unit(column),
        };
        let is_half = column.logical_type_ref() == Some(&LogicalType::Float16);
        let kind = match column.physical_type() {
            _ if column.max_rep_level() > 0 => CellKind::Other,
            Type::INT32 | Type::INT64 if form.decimal.is_some() => CellKind::Number,
            Type::INT32 | Type::INT64 => CellKind::Whole,
            Type::FLOAT | Type::DOUBLE => CellKind::Number,
            Type::BYTE_ARRAY if form.decimal.is_none() && !is_half => CellKind::Text,
            _ => CellKind::Other,
        };
        (form, Column::new(column.name(), kind))
    }

    /// The cell of a whole number, which the file stores with a sign.
    fn whole(self, signed: impl Into<i128>, unsigned: impl Into<i128>) -> Cell {
        let value = if self.is_unsigned {
            unsigned.into()
        } else {
            signed.into()
        };
        match (self.decimal, i64::try_from(value)) {
            (Some(one), _) => Cell::Number(value as f64 / one),
            (None, Ok(whole)) => Cell::Whole(whole),
            (None, Err(_)) => Cell::Number(value as f64),
        }
    }
}

/// The unit of a column of times. The library translates the older way to declare it into the newer one,
/// where both exist.
fn time_unit(column: &ColumnDescriptor) -> Option<&'static str> {
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

struct Batches<'a> {
    reader: &'a Reader,
    places: Vec<usize>,
    /// The next row group.
    group: usize,
    /// Columns of the current row group, and its remaining rows.
    open: Vec<(ColumnReader, CellForm)>,
    left: usize,
}

impl Iterator for Batches<'_> {
    type Item = Result<Batch, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        while self.left == 0 {
            if self.group == self.reader.file.num_row_groups() {
                return None;
            }
            if let Err(error) = self.open_group() {
                self.group = self.reader.file.num_row_groups();
                return Some(Err(error));
            }
        }
        let rows = BATCH_ROWS.min(BATCH_CELLS / self.places.len().max(1)).max(1);
        let rows = rows.min(self.left);
        self.left -= rows;
        let columns = self.open.iter_mut();
        let columns = columns.map(|(column, form)| call(|| cells(column, *form, rows)));
        let columns = columns.collect::<Result<_, _>>();
        if columns.is_err() {
            (self.left, self.group) = (0, self.reader.file.num_row_groups());
        }
        Some(columns.map(|columns| Batch { columns }))
    }
}

impl Batches<'_> {
    fn open_group(&mut self) -> Result<(), ReadError> {
        let Reader { file, forms, .. } = self.reader;
        let group = call(|| file.get_row_group(self.group))?;
        self.group += 1;
        self.left = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
        let places = self.places.iter();
        let open = places.map(|&place| Ok((call(|| group.get_column_reader(place))?, forms[place])));
        self.open = open.collect::<Result<_, ReadError>>()?;
        Ok(())
    }
}

fn cells(column: &mut ColumnReader, form: CellForm, rows: usize) -> Result<Vec<Cell>, ParquetError> {
    match column {
        ColumnReader::Int32ColumnReader(column) => values(column, form, rows, |value| {
            Ok(form.whole(*value, value.cast_unsigned()))
        }),
        ColumnReader::Int64ColumnReader(column) => values(column, form, rows, |value| {
            Ok(form.whole(*value, value.cast_unsigned()))
        }),
        ColumnReader::FloatColumnReader(column) => {
            values(column, form, rows, |value| Ok(Cell::Number(f64::from(*value))))
        }
        ColumnReader::DoubleColumnReader(column) => {
            values(column, form, rows, |value| Ok(Cell::Number(*value)))
        }
        ColumnReader::ByteArrayColumnReader(column) => values(column, form, rows, |value| {
            let text =
                std::str::from_utf8(value.data()).map_err(|error| ParquetError::External(error.into()))?;
            Ok(Cell::Text(text.into()))
        }),
        _ => Err(ParquetError::General(
            "a column of another kind was read".to_owned(),
        )),
    }
}

fn values<T: DataType>(
    column: &mut ColumnReaderImpl<T>,
    form: CellForm,
    rows: usize,
    mut cell: impl FnMut(&T::T) -> Result<Cell, ParquetError>,
) -> Result<Vec<Cell>, ParquetError> {
    let ended = || ParquetError::General("a column has too few values".to_owned());
    let (mut values, mut levels) = (Vec::new(), Vec::new());
    let (records, ..) = column.read_records(rows, Some(&mut levels), None, &mut values)?;
    if records != rows {
        return Err(ended());
    }
    // A column that cannot have nulls stores no levels.
    if form.known_at == 0 {
        return values.iter().map(cell).collect();
    }
    let mut values = values.iter();
    let levels = levels.into_iter();
    let cells = levels.map(|level| {
        if level == form.known_at {
            cell(values.next().ok_or_else(ended)?)
        } else {
            Ok(Cell::Null)
        }
    });
    cells.collect()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use parquet::data_type::Int64Type;
    use parquet::file::metadata::{ParquetMetaDataBuilder, ParquetMetaDataWriter};
    use parquet::file::properties::WriterProperties;
    use parquet::file::writer::SerializedFileWriter;
    use parquet::schema::parser::parse_message_type;

    use super::*;
    use crate::Writer;

    /// A file with one column of these values, in one page.
    fn file(values: &[i64]) -> tempfile::NamedTempFile {
        let file = tempfile::NamedTempFile::new().unwrap();
        let schema = Arc::new(parse_message_type("message one { REQUIRED INT64 c; }").unwrap());
        let properties = WriterProperties::builder().set_data_page_row_count_limit(usize::MAX);
        let properties = Arc::new(properties.build());
        let mut writer = SerializedFileWriter::new(file.reopen().unwrap(), schema, properties).unwrap();
        let mut group = writer.next_row_group().unwrap();
        let mut out = group.next_column().unwrap().unwrap();
        out.typed::<Int64Type>().write_batch(values, None, None).unwrap();
        out.close().unwrap();
        group.close().unwrap();
        writer.close().unwrap();
        file
    }

    fn refusal(file: &tempfile::NamedTempFile) -> String {
        Reader::open(file.path()).err().unwrap().to_string()
    }

    /// The refusal of a file of a thousand values whose metadata says something else.
    fn forged(change: impl FnOnce(ParquetMetaData) -> ParquetMetaDataBuilder) -> String {
        let sound = file(&Vec::from_iter(0..1000));
        let metadata = Reader::open(sound.path()).unwrap().file.metadata().clone();
        let end = metadata.row_group(0).column(0).byte_range().1 + 4;
        let mut bytes = std::fs::read(sound.path()).unwrap();
        bytes.truncate(end as usize);
        ParquetMetaDataWriter::new(&mut bytes, &change(metadata).build())
            .finish()
            .unwrap();
        std::fs::write(sound.path(), bytes).unwrap();
        refusal(&sound)
    }

    #[test]
    fn a_wide_and_long_table_is_read_as_it_was_written() {
        let columns = [
            ("n", CellKind::Whole),
            ("x_m", CellKind::Number),
            ("t", CellKind::Text),
        ];
        let columns = columns.map(|(name, kind)| Column::new(name, kind));
        let row = |n: i64| {
            let text = (n % 3 > 0).then(|| format!("row \"{n}\",\n"));
            let number = (n % 2 > 0).then_some(n as f64 / 3.0);
            vec![Cell::Whole(n), Cell::number(number), Cell::text(text.as_deref())]
        };
        let file = tempfile::NamedTempFile::new().unwrap();
        let mut out = file.reopen().unwrap();
        let mut writer = Writer::parquet(&mut out, "three", &columns, &[("of", "tests")]).unwrap();
        (0..70_000).for_each(|n| writer.push(row(n)).unwrap());
        writer.finish().unwrap();
        let reader = Reader::open(file.path()).unwrap();
        assert_eq!((reader.columns(), reader.rows()), (&columns[..], 70_000));
        assert_eq!((reader.note("of"), reader.note("else")), (Some("tests"), None));
        let rows = reader.all_batches().flat_map(|batch| batch.unwrap().into_rows());
        assert!(rows.eq((0..70_000).map(row)));
        let some = reader
            .batches(vec![1])
            .map(|batch| batch.unwrap().columns[0].len());
        assert_eq!(some.sum::<usize>(), 70_000);
    }

    /// A file of 3 kB whose rows and columns took minutes to read.
    #[test]
    fn declared_sizes_that_the_file_cannot_hold_are_refused() {
        let error = refusal(&file(&vec![7; 2_000_000]));
        assert!(error.contains("bytes cannot hold the 2000000 rows"), "{error}");
        let error = forged(|metadata| {
            let groups = vec![metadata.row_group(0).clone(); 2];
            metadata.into_builder().set_row_groups(groups)
        });
        assert!(error.contains("bytes of columns that it declares"), "{error}");
    }

    #[test]
    fn another_compression_is_named_with_what_to_do() {
        let error = forged(|metadata| {
            let group = metadata.row_group(0).clone();
            let column = group.column(0).clone().into_builder();
            let column = column.set_compression(Compression::BROTLI(Default::default()));
            let columns = vec![column.build().unwrap()];
            let group = group.into_builder().set_column_metadata(columns);
            metadata
                .into_builder()
                .set_row_groups(vec![group.build().unwrap()])
        });
        assert!(error.starts_with("is compressed with brotli"), "{error}");
        assert!(error.contains("compression=\"zstd\""), "{error}");
    }
}
