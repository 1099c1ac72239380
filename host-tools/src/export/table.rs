//! Tables on their way into a file: Parquet in row groups, or CSV.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::sync::Arc;

use anyhow::Context;
use parquet::basic::Compression;
use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;

use crate::export::columns::{Cell, Column, Kind};

/// Rows held in memory at a time: a group. Cells, and bytes of text, after which a group of fewer rows ends;
/// a reader takes more of them ([`crate::export::read`]).
const ROW_GROUP: usize = 1 << 16;
const CELLS: usize = 1 << 24;
const TEXT: usize = 64 << 20;

/// A table in a file.
pub trait Table {
    /// Appends a row, with a cell for each column.
    ///
    /// # Errors
    /// The file cannot be written.
    fn push(&mut self, row: Vec<Cell>) -> anyhow::Result<()>;
    /// Completes the file.
    ///
    /// # Errors
    /// As [`push`](Self::push).
    fn finish(self: Box<Self>) -> anyhow::Result<()>;
}

/// The cells of a column that wait for their group.
enum Waiting {
    Whole(Vec<i64>),
    Number(Vec<f64>),
    Text(Vec<ByteArray>),
}

/// A Parquet file.
pub struct Parquet<'a> {
    writer: SerializedFileWriter<&'a mut File>,
    waiting: Vec<Waiting>,
    /// 1 for a value, 0 for null, of each column.
    known: Vec<Vec<i16>>,
    rows: usize,
    /// Bytes of text that wait.
    text: usize,
}

impl<'a> Parquet<'a> {
    /// A table called `name`.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn new(file: &'a mut File, name: &str, columns: &[Column]) -> anyhow::Result<Self> {
        Self::signed(file, name, columns, &[])
    }

    /// The same, with more that the file says of itself.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn signed(
        file: &'a mut File,
        name: &str,
        columns: &[Column],
        said: &[(&str, &str)],
    ) -> anyhow::Result<Self> {
        let field = |column: &Column| {
            let (kind, end) = match column.kind {
                Kind::Whole => ("INT64", ""),
                Kind::Number => ("DOUBLE", ""),
                Kind::Text => ("BYTE_ARRAY", " (UTF8)"),
            };
            format!("OPTIONAL {kind} {}{end}; ", column.name)
        };
        let fields: String = columns.iter().map(field).collect();
        let schema = parse_message_type(&format!("message {name} {{ {fields} }}"))?;
        let mut metadata = vec![
            KeyValue::new(
                "made_by".to_owned(),
                concat!("bead ", env!("CARGO_PKG_VERSION")).to_owned(),
            ),
            KeyValue::new("table".to_owned(), name.to_owned()),
            KeyValue::new("schema_version".to_owned(), "1".to_owned()),
        ];
        let said = said
            .iter()
            .map(|(key, value)| ((*key).to_owned(), (*value).to_owned()));
        metadata.extend(said.map(|(key, value)| KeyValue::new(key, value)));
        let properties = WriterProperties::builder()
            .set_compression(Compression::SNAPPY)
            .set_key_value_metadata(Some(metadata))
            .build();
        let waiting = columns.iter().map(|column| match column.kind {
            Kind::Whole => Waiting::Whole(Vec::new()),
            Kind::Number => Waiting::Number(Vec::new()),
            Kind::Text => Waiting::Text(Vec::new()),
        });
        Ok(Self {
            writer: SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties))?,
            waiting: waiting.collect(),
            known: vec![Vec::new(); columns.len()],
            rows: 0,
            text: 0,
        })
    }

    fn flush(&mut self) -> anyhow::Result<()> {
        if self.rows == 0 {
            return Ok(());
        }
        let mut group = self.writer.next_row_group()?;
        for (waiting, known) in self.waiting.iter_mut().zip(&mut self.known) {
            let mut out = group.next_column()?.context("the schema has too few columns")?;
            /// Writes the values, and where there are none.
            fn put<T: DataType>(
                out: &mut parquet::file::writer::SerializedColumnWriter<'_>,
                values: &mut Vec<T::T>,
                known: &[i16],
            ) -> anyhow::Result<()> {
                out.typed::<T>().write_batch(values, Some(known), None)?;
                values.clear();
                Ok(())
            }
            match waiting {
                Waiting::Whole(values) => put::<Int64Type>(&mut out, values, known)?,
                Waiting::Number(values) => put::<DoubleType>(&mut out, values, known)?,
                Waiting::Text(values) => put::<ByteArrayType>(&mut out, values, known)?,
            }
            known.clear();
            out.close()?;
        }
        group.close()?;
        (self.rows, self.text) = (0, 0);
        Ok(())
    }
}

impl Table for Parquet<'_> {
    fn push(&mut self, row: Vec<Cell>) -> anyhow::Result<()> {
        for ((cell, waiting), known) in row.into_iter().zip(&mut self.waiting).zip(&mut self.known) {
            known.push(i16::from(cell != Cell::Null));
            match (waiting, cell) {
                (_, Cell::Null) => {}
                (Waiting::Whole(values), Cell::Whole(value)) => values.push(value),
                (Waiting::Number(values), Cell::Number(value)) => values.push(value),
                (Waiting::Text(values), Cell::Text(value)) => {
                    self.text += value.len();
                    values.push(value.as_bytes().to_vec().into());
                }
                (_, cell) => anyhow::bail!("{cell:?} is not of its column's kind"),
            }
        }
        self.rows += 1;
        let cells = self.rows * self.waiting.len();
        if self.rows == ROW_GROUP || cells >= CELLS || self.text >= TEXT {
            self.flush()
        } else {
            Ok(())
        }
    }

    fn finish(mut self: Box<Self>) -> anyhow::Result<()> {
        self.flush()?;
        self.writer.close()?;
        Ok(())
    }
}

/// A file of comma-separated values, with a line of names. A null is empty; a number has the fewest digits
/// that give the same bits.
pub struct Csv<'a>(BufWriter<&'a mut File>);

impl<'a> Csv<'a> {
    /// A table.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn new(file: &'a mut File, columns: &[Column]) -> anyhow::Result<Self> {
        let mut out = BufWriter::new(file);
        let names: Vec<_> = columns.iter().map(|column| column.name.as_str()).collect();
        writeln!(out, "{}", names.join(","))?;
        Ok(Self(out))
    }
}

impl Table for Csv<'_> {
    fn push(&mut self, row: Vec<Cell>) -> anyhow::Result<()> {
        let mut between = "";
        for cell in row {
            write!(self.0, "{between}")?;
            match cell {
                Cell::Null => {}
                Cell::Whole(value) => write!(self.0, "{value}")?,
                Cell::Number(value) => write!(self.0, "{value:?}")?,
                // RFC 4180, and nothing that ends a line.
                Cell::Text(text) if text.contains([',', '"', '\n', '\r']) => {
                    write!(
                        self.0,
                        "\"{}\"",
                        text.replace('"', "\"\"").replace(['\n', '\r'], " ")
                    )?;
                }
                Cell::Text(text) => write!(self.0, "{text}")?,
            }
            between = ",";
        }
        writeln!(self.0)?;
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> anyhow::Result<()> {
        Ok(self.0.flush()?)
    }
}
