//! Tables that commands write for other programs: Parquet or, to a name with .csv, CSV.

use std::fs::File;
use std::path::Path;

use bead_console::failure::Failure;
use bead_console::place::{FileKind, Overwrite};
use bead_tables::whole::{Target, WriteError};
use bead_tables::{Column, Writer};

/// Begins the table `name` in a file.
pub(crate) fn begin<'a>(
    file: &'a mut File,
    is_csv: bool,
    name: &str,
    columns: &[Column],
) -> anyhow::Result<Writer<'a>> {
    if is_csv {
        return Writer::csv(file, columns);
    }
    let made_by = ("made_by", concat!("bead ", env!("CARGO_PKG_VERSION")));
    Writer::parquet(file, name, columns, &[made_by])
}

/// A table to be written, whole or not at all.
pub(crate) struct TableFile {
    target: Target,
    is_csv: bool,
}

impl TableFile {
    /// The place of a table that may not have been asked for.
    pub(crate) fn optional(
        overwrite: Overwrite,
        path: Option<&Path>,
        inputs: &[&Path],
    ) -> Result<Option<Self>, Failure> {
        let is_csv = path.and_then(Path::extension).is_some_and(|end| end == "csv");
        let kind = if is_csv {
            FileKind::Table
        } else {
            FileKind::Parquet
        };
        let target = overwrite.optional(path, kind, inputs)?;
        Ok(target.map(|target| Self { target, is_csv }))
    }

    /// Writes the table `name` with the rows that `fill` gives it.
    pub(crate) fn write(
        &self,
        name: &str,
        columns: &[Column],
        fill: impl FnOnce(&mut Writer<'_>) -> anyhow::Result<()>,
    ) -> Result<(), WriteError> {
        self.target.write(|file| {
            let mut table = begin(file, self.is_csv, name, columns)?;
            fill(&mut table)?;
            table.finish()
        })
    }
}
