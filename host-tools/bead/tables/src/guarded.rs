//! Panics of a library, turned into errors.

use std::any::Any;
use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;

thread_local! {
    /// True while [`guarded`] catches the panics of this thread.
    static GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// Calls `read`, and returns the message of its panic as an error of one line. The panic hook stays silent
/// meanwhile; other panics go to the hook that was there before.
///
/// # Errors
/// The message of a panic.
pub(super) fn guarded<T>(read: impl FnOnce() -> T) -> Result<T, String> {
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
    result.map_err(|panicked| message(panicked.as_ref()).replace('\n', " "))
}

fn message(panicked: &dyn Any) -> &str {
    let text = panicked.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panicked.downcast_ref::<&str>().copied())
        .unwrap_or("the library panicked without a message")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_an_error_of_one_line() {
        let number = |text: &str| guarded(|| text.parse::<u8>().expect("no\nnumber"));
        assert_eq!(number("7"), Ok(7));
        let error = number("x").unwrap_err();
        assert!(error.contains("no number: ") && !error.contains('\n'), "{error}");
        assert_eq!(number("8"), Ok(8));
        assert!(!GUARDED.get());
    }
}
