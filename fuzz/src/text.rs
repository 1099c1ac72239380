//! Inputs that are text.

use hertz_chain::InputError;

/// Longest text that is looked at, bytes. What is longer finds nothing that is not found in this.
const LONGEST: usize = 4096;

/// The value that `parse` reads in the bytes, if they are a text that it accepts. A refusal must be told in
/// one line.
pub(crate) fn read<T>(bytes: &[u8], parse: impl FnOnce(&str) -> Result<T, InputError>) -> Option<T> {
    let text = std::str::from_utf8(bytes).ok()?;
    (text.len() <= LONGEST).then(|| accepted(parse(text)))?
}

/// The value, if it was accepted. A refusal must be told in one line, with an advice.
pub(crate) fn accepted<T>(read: Result<T, InputError>) -> Option<T> {
    let refused = |error: &InputError| {
        let line = error.to_string();
        assert!(
            !line.contains('\n') && !error.what.is_empty() && !error.advice.is_empty(),
            "{line:?}"
        );
    };
    read.inspect_err(refused).ok()
}
