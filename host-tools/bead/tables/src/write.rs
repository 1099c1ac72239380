//! Tables on their way into a file: Parquet in row groups, or CSV.

use std::fs::File;
use std::sync::Arc;

use anyhow::Context;
use parquet::basic::Compression;
use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::parser::parse_message_type;

use crate::table::{Cell, CellKind, Column};

/// Greatest size of a row group: rows, cells, and bytes of text. A group is held in memory.
const GROUP_ROWS: usize = 1 << 16;
const GROUP_CELLS: usize = 1 << 22;
const GROUP_TEXT: usize = 64 << 20;

/// A table in a file, written row by row.
pub struct Writer<'a>(OpenTable<'a>);

enum OpenTable<'a> {
    Parquet(Box<Parquet<'a>>),
    Csv(Box<csv::Writer<&'a mut File>>),
}

impl<'a> Writer<'a> {
    /// Begins a Parquet file with the table `name`. `notes` are keys and values that the file carries beside
    /// the table.
    ///
    /// # Errors
    /// The file cannot be written, or a column has [`CellKind::Other`] or a name with blanks.
    pub fn parquet(
        file: &'a mut File,
        name: &str,
        columns: &[Column],
        notes: &[(&str, &str)],
    ) -> anyhow::Result<Self> {
        Ok(Self(OpenTable::Parquet(Box::new(Parquet::new(
            file, name, columns, notes,
        )?))))
    }

    /// Begins a file of comma-separated values (RFC 4180) with a line of names. A null is an empty field; a
    /// number has the fewest digits that give the same bits.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn csv(file: &'a mut File, columns: &[Column]) -> anyhow::Result<Self> {
        let mut out = csv::Writer::from_writer(file);
        out.write_record(columns.iter().map(|column| &column.name))?;
        Ok(Self(OpenTable::Csv(Box::new(out))))
    }

    /// Appends a row, with a cell for each column.
    ///
    /// # Errors
    /// The file cannot be written, or a cell is not of its column's kind.
    pub fn push(&mut self, row: Vec<Cell>) -> anyhow::Result<()> {
        match &mut self.0 {
            OpenTable::Parquet(out) => out.push(row),
            OpenTable::Csv(out) => {
                for cell in row {
                    match cell {
                        Cell::Null => out.write_field("")?,
                        Cell::Whole(value) => out.write_field(value.to_string())?,
                        Cell::Number(value) => out.write_field(format!("{value:?}"))?,
                        Cell::Text(text) => out.write_field(&*text)?,
                    }
                }
                Ok(out.write_record(None::<&[u8]>)?)
            }
        }
    }

    /// Completes the file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn finish(self) -> anyhow::Result<()> {
        match self.0 {
            OpenTable::Parquet(out) => out.finish(),
            OpenTable::Csv(mut out) => Ok(out.flush()?),
        }
    }
}

enum WaitingCells {
    Whole(Vec<i64>),
    Number(Vec<f64>),
    Text(Vec<ByteArray>),
}

struct Parquet<'a> {
    writer: SerializedFileWriter<&'a mut File>,
    waiting: Vec<WaitingCells>,
    /// Definition levels by column: 1 for a value, 0 for null.
    known: Vec<Vec<i16>>,
    rows: usize,
    /// Bytes of text that wait.
    text: usize,
}

impl<'a> Parquet<'a> {
    fn new(
        file: &'a mut File,
        name: &str,
        columns: &[Column],
        notes: &[(&str, &str)],
    ) -> anyhow::Result<Self> {
        let (mut fields, mut waiting) = (String::new(), Vec::new());
        for column in columns {
            let (kind, end, empty) = match column.kind {
                CellKind::Whole => ("INT64", "", WaitingCells::Whole(Vec::new())),
                CellKind::Number => ("DOUBLE", "", WaitingCells::Number(Vec::new())),
                CellKind::Text => ("BYTE_ARRAY", " (UTF8)", WaitingCells::Text(Vec::new())),
                CellKind::Other => {
                    anyhow::bail!("column {} is of a kind that cannot be written", column.name)
                }
            };
            fields.push_str(&format!("OPTIONAL {kind} {}{end}; ", column.name));
            waiting.push(empty);
        }
        let schema = parse_message_type(&format!("message {name} {{ {fields} }}"))?;
        let own = [("table", name), ("schema_version", "1")];
        let notes = own.iter().chain(notes);
        let notes = notes.map(|(key, value)| KeyValue::new((*key).to_owned(), (*value).to_owned()));
        let properties = WriterProperties::builder()
            .set_compression(Compression::SNAPPY)
            .set_key_value_metadata(Some(notes.collect()))
            .build();
        Ok(Self {
            writer: SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties))?,
            known: vec![Vec::new(); waiting.len()],
            waiting,
            rows: 0,
            text: 0,
        })
    }

    fn push(&mut self, row: Vec<Cell>) -> anyhow::Result<()> {
        for ((cell, waiting), known) in row.into_iter().zip(&mut self.waiting).zip(&mut self.known) {
            known.push(i16::from(cell != Cell::Null));
            match (waiting, cell) {
                (_, Cell::Null) => {}
                (WaitingCells::Whole(values), Cell::Whole(value)) => values.push(value),
                (WaitingCells::Number(values), Cell::Number(value)) => values.push(value),
                (WaitingCells::Text(values), Cell::Text(value)) => {
                    self.text += value.len();
                    values.push(value.as_bytes().to_vec().into());
                }
                (_, cell) => anyhow::bail!("{cell:?} is not of its column's kind"),
            }
        }
        self.rows += 1;
        let cells = self.rows * self.waiting.len();
        if self.rows == GROUP_ROWS || cells >= GROUP_CELLS || self.text >= GROUP_TEXT {
            self.flush()?;
        }
        Ok(())
    }

    fn flush(&mut self) -> anyhow::Result<()> {
        if self.rows == 0 {
            return Ok(());
        }
        let mut group = self.writer.next_row_group()?;
        for (waiting, known) in self.waiting.iter_mut().zip(&mut self.known) {
            let mut out = group.next_column()?.context("the schema has too few columns")?;
            match waiting {
                WaitingCells::Whole(values) => write_column::<Int64Type>(&mut out, values, known)?,
                WaitingCells::Number(values) => write_column::<DoubleType>(&mut out, values, known)?,
                WaitingCells::Text(values) => write_column::<ByteArrayType>(&mut out, values, known)?,
            }
            known.clear();
            out.close()?;
        }
        group.close()?;
        (self.rows, self.text) = (0, 0);
        Ok(())
    }

    fn finish(mut self) -> anyhow::Result<()> {
        self.flush()?;
        self.writer.close()?;
        Ok(())
    }
}

/// Writes the values of a column chunk, and empties them.
fn write_column<T: DataType>(
    out: &mut SerializedColumnWriter<'_>,
    values: &mut Vec<T::T>,
    known: &[i16],
) -> anyhow::Result<()> {
    out.typed::<T>().write_batch(values, Some(known), None)?;
    values.clear();
    Ok(())
}
