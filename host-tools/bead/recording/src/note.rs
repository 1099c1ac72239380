//! Remarks on standard error.

use std::fmt;
use std::io::{self, Write};

use bead_tables::printable::one_line;

/// Prints a remark in one line on standard error. A closed standard error is no reason to stop the work.
pub fn note(remark: fmt::Arguments<'_>) {
    let _ = writeln!(io::stderr(), "bead: {}", one_line(&remark.to_string()));
}
