//! The table of boards, `firmware/boards.txt`.

use crate::files;
use crate::step::{Steps, Stop};

/// Where the rows are.
pub(crate) const TABLE: &str = "firmware/boards.txt";

/// The boards that the image can run on; the first is built if none is named.
pub(crate) fn names(steps: &Steps) -> Result<Vec<String>, Stop> {
    let table = read(steps)?;
    let works = rows(&table).filter(|row| row[1] != "no");
    Ok(works.map(|row| row[0].to_owned()).collect())
}

/// Reads the table.
pub(crate) fn read(steps: &Steps) -> Result<String, Stop> {
    files::read(&steps.root.join(TABLE))
}

/// The cells of each row.
pub(crate) fn rows(table: &str) -> impl Iterator<Item = Vec<&str>> {
    let rows = table
        .lines()
        .filter(|line| line.contains('|') && !line.starts_with('#'));
    rows.map(|line| line.split('|').map(str::trim).collect())
}
