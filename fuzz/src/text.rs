//! Inputs that are text.

use hertz_chain::InputError;

/// Longest text that is read, bytes. Longer ones would find nothing new.
const LONGEST: usize = 4096;

/// Returns the value that `parse` reads in the bytes, if they are a text that it accepts. A refusal must fit
/// one line.
pub(crate) fn read<T>(bytes: &[u8], parse: impl FnOnce(&str) -> Result<T, InputError>) -> Option<T> {
    let text = std::str::from_utf8(bytes).ok()?;
    (text.len() <= LONGEST).then(|| accepted(parse(text)))?
}

/// Returns the value, if it was accepted. A refusal must fit one line, and give advice.
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
