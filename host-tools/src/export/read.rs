//! Tables on their way out of a Parquet file that this program wrote: a row group at a time.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use anyhow::Context;
use parquet::basic::Type;
use parquet::column::reader::{ColumnReader, get_typed_column_reader};
use parquet::data_type::{ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::file::reader::{FileReader, SerializedFileReader};

use crate::export::columns::{Cell, Column, Kind};
use crate::recording::parquet::{Bounded, guarded, open};

/// Rows of a group at most, which is in memory as a whole. PyArrow writes as many together, this program
/// fewer.
const GROUP_MOST: usize = 1 << 20;
/// Cells of a group at most: they take 800 MB.
const CELLS_MOST: usize = 1 << 25;
/// Bytes of text in a column of a group at most. A file has a text that many rows share once.
const TEXT_MOST: usize = 256 << 20;

/// A table that is read.
pub struct Reading {
    reader: SerializedFileReader<Bounded>,
    columns: Vec<Column>,
}

/// Some rows of a table, column by column.
#[derive(Debug)]
pub struct Group {
    columns: Vec<Vec<Cell>>,
}

impl Reading {
    /// Opens a table.
    ///
    /// # Errors
    /// It cannot be read, or is no Parquet file with columns of this program's kinds.
    pub fn open(path: &Path) -> anyhow::Result<Self> {
        let kind = path.metadata().context("it cannot be read")?.file_type();
        anyhow::ensure!(
            kind.is_file() || kind.is_dir(),
            "it is a device or a pipe; give a file"
        );
        let file = File::open(path).context("it cannot be read")?;
        let reader = open(file).context("it is no Parquet file")?;
        let schema = reader.metadata().file_metadata().schema_descr();
        let column = |n: usize| {
            let column = schema.column(n);
            let kind = match column.physical_type() {
                Type::INT64 => Kind::Whole,
                Type::DOUBLE => Kind::Number,
                Type::BYTE_ARRAY => Kind::Text,
                other => anyhow::bail!(
                    "column {} is of type {other}, which this program does not write",
                    column.name()
                ),
            };
            Ok(Column::new(column.name(), kind))
        };
        let columns: Vec<_> = (0..schema.num_columns())
            .map(column)
            .collect::<anyhow::Result<_>>()?;
        anyhow::ensure!(!columns.is_empty(), "it has no column");
        for group in reader.metadata().row_groups() {
            let rows = group.num_rows();
            let fits = usize::try_from(rows).is_ok_and(|rows| rows <= GROUP_MOST);
            anyhow::ensure!(
                fits,
                "a group of its rows has {rows}, and {GROUP_MOST} are read at once"
            );
        }
        Ok(Self { reader, columns })
    }

    /// The columns, in their order.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// Rows in all.
    pub fn rows(&self) -> u64 {
        let groups = self.reader.metadata().row_groups().iter();
        groups.map(|group| group.num_rows().unsigned_abs()).sum()
    }

    /// What the file says of itself under a key.
    pub fn said(&self, key: &str) -> Option<&str> {
        let pairs = self.reader.metadata().file_metadata().key_value_metadata()?;
        pairs.iter().find(|pair| pair.key == key)?.value.as_deref()
    }

    /// The rows, in order.
    pub fn groups(&self) -> impl Iterator<Item = anyhow::Result<Group>> + '_ {
        self.groups_at((0..self.columns.len()).collect())
    }

    /// The rows, in order, of columns that hold numbers.
    ///
    /// # Errors
    /// There is no such column, or it holds text.
    pub fn groups_of(
        &self,
        names: &[&str],
    ) -> anyhow::Result<impl Iterator<Item = anyhow::Result<Group>> + '_> {
        let place = |name: &&str| {
            let place = self.columns.iter().position(|column| column.name == *name);
            let place = place.with_context(|| format!("it has no column {name}"))?;
            let is_text = self.columns[place].kind == Kind::Text;
            anyhow::ensure!(!is_text, "its column {name} has text in place of numbers");
            Ok(place)
        };
        let places = names.iter().map(place).collect::<anyhow::Result<_>>()?;
        Ok(self.groups_at(places))
    }

    fn groups_at(&self, places: Vec<usize>) -> impl Iterator<Item = anyhow::Result<Group>> + '_ {
        (0..self.reader.num_row_groups()).map(move |group| self.group(group, &places))
    }

    fn group(&self, group: usize, places: &[usize]) -> anyhow::Result<Group> {
        let group = guarded(|| self.reader.get_row_group(group))?;
        let rows = usize::try_from(group.metadata().num_rows())?;
        let values = rows.saturating_mul(places.len());
        anyhow::ensure!(
            values <= CELLS_MOST,
            "a group of its rows has {values} values, and {CELLS_MOST} are read at once"
        );
        let column = |&place: &usize| {
            let kind = self.columns[place].kind;
            guarded(|| cells(group.get_column_reader(place)?, kind, rows))
        };
        let columns = places.iter().map(column);
        Ok(Group {
            columns: columns.collect::<anyhow::Result<_>>()?,
        })
    }
}

fn cells(reader: ColumnReader, kind: Kind, rows: usize) -> anyhow::Result<Vec<Cell>> {
    /// The values that are there, and 0 for each that is not.
    fn read<T: DataType>(
        reader: ColumnReader,
        rows: usize,
        mut cell: impl FnMut(&T::T) -> anyhow::Result<Cell>,
    ) -> anyhow::Result<Vec<Cell>> {
        let (mut values, mut known) = (Vec::new(), Vec::new());
        let mut reader = get_typed_column_reader::<T>(reader);
        let depth = reader.read_records(rows, Some(&mut known), None, &mut values)?.0;
        anyhow::ensure!(depth == rows && known.len() == rows, "the file is damaged");
        let mut values = values.iter();
        let next = |known: i16| match known {
            0 => Ok(Cell::Null),
            _ => cell(values.next().context("the file is damaged")?),
        };
        known.into_iter().map(next).collect()
    }
    match kind {
        Kind::Whole => read::<Int64Type>(reader, rows, |value| Ok(Cell::Whole(*value))),
        Kind::Number => read::<DoubleType>(reader, rows, |value| Ok(Cell::Number(*value))),
        Kind::Text => {
            let mut left = TEXT_MOST;
            read::<ByteArrayType>(reader, rows, |value| {
                let text = std::str::from_utf8(value.data())?;
                let too_long =
                    || format!("a column has more than {TEXT_MOST} bytes of text in a group of rows");
                left = left.checked_sub(text.len()).with_context(too_long)?;
                Ok(Cell::Text(Arc::from(text)))
            })
        }
    }
}

impl Group {
    /// The rows.
    pub fn into_rows(self) -> impl Iterator<Item = Vec<Cell>> {
        let mut columns: Vec<_> = self.columns.into_iter().map(Vec::into_iter).collect();
        std::iter::from_fn(move || columns.iter_mut().map(Iterator::next).collect())
    }
}

#[cfg(test)]
mod tests {
    use parquet::data_type::ByteArray;
    use parquet::file::writer::SerializedFileWriter;
    use parquet::schema::parser::parse_message_type;

    use super::*;
    use crate::export::table::{Parquet, Table};

    /// Why a file is not read that has some columns of these texts, or of as many rows without one.
    fn refused(columns: usize, rows: usize, texts: &[ByteArray]) -> String {
        let file = tempfile::NamedTempFile::new().unwrap();
        let fields: String = (0..columns)
            .map(|n| format!("OPTIONAL BYTE_ARRAY c{n} (UTF8); "))
            .collect();
        let schema = parse_message_type(&format!("message texts {{ {fields} }}")).unwrap();
        let mut writer = SerializedFileWriter::new(file.as_file(), Arc::new(schema), Arc::default()).unwrap();
        let mut group = writer.next_row_group().unwrap();
        let known = vec![i16::from(!texts.is_empty()); rows];
        while let Some(mut column) = group.next_column().unwrap() {
            let out = column.typed::<ByteArrayType>();
            assert_eq!(out.write_batch(texts, Some(&known), None).unwrap(), texts.len());
            column.close().unwrap();
        }
        group.close().unwrap();
        writer.close().unwrap();
        let table = Reading::open(file.path()).unwrap();
        let group = table.groups().next().unwrap();
        group
            .map(|group| group.into_rows().count())
            .unwrap_err()
            .to_string()
    }

    /// A sweep of 300 columns and 70,000 points wrote a part that could not be read again.
    #[test]
    fn what_this_program_writes_is_read_again_however_wide_and_long_it_is() {
        let of = |columns: usize, rows: usize, cell: &Cell| {
            let file = tempfile::NamedTempFile::new().unwrap();
            let kind = if matches!(cell, Cell::Text(_)) {
                Kind::Text
            } else {
                Kind::Number
            };
            let names: Vec<_> = (0..columns).map(|n| Column::new(format!("c{n}"), kind)).collect();
            let mut out = file.reopen().unwrap();
            let mut table = Parquet::new(&mut out, "wide", &names).unwrap();
            for _ in 0..rows {
                table.push(vec![cell.clone(); columns]).unwrap();
            }
            Box::new(table).finish().unwrap();
            let table = Reading::open(file.path()).unwrap();
            let groups: Vec<usize> = table
                .groups()
                .map(|group| group.unwrap().into_rows().count())
                .collect();
            assert_eq!(groups.iter().sum::<usize>(), rows);
            groups[0]
        };
        assert_eq!(of(1000, 17_000, &Cell::Null), 16_778);
        assert_eq!(of(1, 270, &Cell::Text("a".repeat(1 << 20).into())), 64);
        assert_eq!(of(1, 66_000, &Cell::Number(1.0)), 65_536);
    }

    /// A text of a megabyte that a million rows share took memory without end.
    #[test]
    fn more_text_or_more_values_than_fit_are_refused() {
        let text = ByteArray::from(vec![b'a'; 512 << 10]);
        let why = refused(1, 520, &vec![text; 520]);
        assert!(why.contains("more than 268435456 bytes of text"), "{why}");
        let why = refused(33, GROUP_MOST, &[]);
        assert!(
            why.contains("has 34603008 values, and 33554432 are read at once"),
            "{why}"
        );
    }
}
