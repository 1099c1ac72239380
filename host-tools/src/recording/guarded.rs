//! Readers of other people's files that panic where a file is damaged.
//!
//! # Design
//! The library for Parquet asserts some of what a sound file has, and returns an error for the rest. So its panics are caught
//! where it is called, and become errors of one line. Nothing of its state is used after that. The panic hook says nothing of
//! them; it is set once, and hands all other panics on to the hook that was there.

use std::any::Any;
use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;

thread_local! {
    /// Whether a panic of this thread is caught here.
    static GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// What a library returns of a file's bytes.
///
/// # Errors
/// It panicked: its words, without line breaks.
pub(crate) fn guarded<T>(read: impl FnOnce() -> T) -> Result<T, String> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let before = panic::take_hook();
        panic::set_hook(Box::new(move |panicked| {
            if !GUARDED.get() {
                before(panicked);
            }
        }));
    });
    let outside = GUARDED.replace(true);
    let result = panic::catch_unwind(AssertUnwindSafe(read));
    GUARDED.set(outside);
    result.map_err(|panicked| words(panicked.as_ref()).replace('\n', " "))
}

fn words(panicked: &dyn Any) -> &str {
    let text = panicked.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panicked.downcast_ref::<&str>().copied())
        .unwrap_or("the library says no more")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_an_error_of_one_line_and_the_next_call_is_as_before() {
        let number = |text: &str| guarded(|| text.parse::<u8>().expect("no\nnumber"));
        assert_eq!(number("7"), Ok(7));
        assert!(number("x").unwrap_err().starts_with("no number: "));
        assert_eq!(number("8"), Ok(8));
        assert!(!GUARDED.get());
    }
}
