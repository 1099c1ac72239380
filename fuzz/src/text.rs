//! Inputs that are text.

use hertz_chain::InputError;

/// Longest text that is looked at, bytes. What is longer finds nothing that is not found in this.
const LONGEST: usize = 4096;

/// The text, if it is one.
pub(crate) fn of(bytes: &[u8]) -> Option<&str> {
    std::str::from_utf8(bytes)
        .ok()
        .filter(|text| text.len() <= LONGEST)
}

/// Checks that an error is told in one line, with a file.
pub(crate) fn one_line(error: &InputError) {
    let line = error.to_string();
    assert!(
        !line.contains('\n') && !error.what.is_empty() && !error.advice.is_empty(),
        "{line:?}"
    );
}
