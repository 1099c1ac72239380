//! Check that docs/checks.md equals the output of `bead figures --table`.

use std::path::Path;

use crate::files::read;
use crate::step::Stop;

/// A value below this is an error or a rounding, which differs from computer to computer.
const ROUNDING: f64 = 1e-8;
/// Relative difference that is allowed: the table has six digits.
const DIFFERENCE: f64 = 1e-4;

/// Compares two tables of checks, the one in the book and the one just written.
///
/// # Errors
/// A file cannot be read, a row is in only one table, or a value differs.
pub(crate) fn compare(book: &Path, fresh: &Path) -> Result<usize, Stop> {
    let (book_text, fresh_text) = (read(book)?, read(fresh)?);
    let rows = fresh_text.lines().count();
    let differs = |line: &str| {
        Stop::failed(format!(
            "{} differs from the results of the figures at `{line}`; copy {} over it",
            book.display(),
            fresh.display()
        ))
    };
    if book_text.lines().count() != rows {
        return Err(differs("the number of rows"));
    }
    let mut pairs = book_text.lines().zip(fresh_text.lines());
    match pairs.find(|(one, other)| !same(one, other)) {
        Some((_, line)) => Err(differs(line)),
        None => Ok(rows),
    }
}

/// Compares two rows word for word, but for the value.
fn same(one: &str, other: &str) -> bool {
    const VALUE: usize = 3;
    let [one, other] = [one, other].map(|row| row.split(" | ").collect::<Vec<_>>());
    let mut pairs = (1..).zip(one.iter().zip(&other));
    one.len() == other.len()
        && pairs.all(|(cell, (one, other))| one == other || cell == VALUE && near(one, other))
}

fn near(one: &str, other: &str) -> bool {
    let number = |cell: &str| cell.split(' ').next()?.parse::<f64>().ok();
    let (Some(a), Some(b)) = (number(one), number(other)) else {
        return false;
    };
    (a - b).abs() <= DIFFERENCE * b.abs() || a.abs().max(b.abs()) < ROUNDING
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_differ_by_more_than_rounding_or_not_at_all() {
        let row = |value: &str| format!("| 2a | force | {value} | 6.6 ± 6.6e-3 N | ok |");
        assert!(same(&row("6.60162 N"), &row("6.60163 N")));
        assert!(!same(&row("6.60162 N"), &row("6.61 N")));
        assert!(same(&row("2.46e-15"), &row("-7.1e-13")));
        assert!(!same(&row("6.6 N"), &row("6.6 N").replace("ok", "FAILED")));
        assert!(!same(&row("6.6 N"), &row("6.6 N").replace("force", "speed")));
    }
}
