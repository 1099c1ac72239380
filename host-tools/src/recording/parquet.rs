//! Parquet files in which anything may be wrong.
//!
//! # Design
//! The library asserts some of what a sound file has, and returns an error for the rest. So its panics are caught where it is
//! called, and become errors of one line. Nothing of its state is used after that. The panic hook says nothing of them; it is
//! set once, and hands all other panics on to the hook that was there.
//!
//! Behind the end of a file the library skips a list of any length, entry by entry, for a minute. So the end of the file is an
//! error to what reads on.

use std::any::Any;
use std::cell::Cell;
use std::fs::File;
use std::io::{self, BufReader, ErrorKind, Read};
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;

use parquet::errors::ParquetError;
use parquet::file::reader::{ChunkReader, Length, SerializedFileReader};
use prost::bytes::Bytes;

/// A file whose end is an error.
#[derive(Debug)]
pub(crate) struct Bounded(File);

/// Its bytes from a place on.
#[derive(Debug)]
pub(crate) struct Rest(BufReader<File>);

impl Length for Bounded {
    fn len(&self) -> u64 {
        self.0.len()
    }
}

impl ChunkReader for Bounded {
    type T = Rest;

    fn get_read(&self, start: u64) -> Result<Rest, ParquetError> {
        self.0.get_read(start).map(Rest)
    }

    fn get_bytes(&self, start: u64, length: usize) -> Result<Bytes, ParquetError> {
        self.0.get_bytes(start, length)
    }
}

impl Read for Rest {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        match self.0.read(bytes)? {
            0 if !bytes.is_empty() => Err(ErrorKind::UnexpectedEof.into()),
            read => Ok(read),
        }
    }
}

/// Opens a Parquet file.
///
/// # Errors
/// It is none, or damaged.
pub(crate) fn open(file: File) -> Result<SerializedFileReader<Bounded>, ParquetError> {
    guarded(|| SerializedFileReader::new(Bounded(file)))
}

thread_local! {
    /// Whether a panic of this thread is caught here.
    static GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// What the library returns of a file's bytes.
///
/// # Errors
/// Its own; and its words where it panicked, without line breaks.
pub(crate) fn guarded<T, E: From<ParquetError>>(read: impl FnOnce() -> Result<T, E>) -> Result<T, E> {
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
    result.unwrap_or_else(|panicked| {
        let words = words(panicked.as_ref()).replace('\n', " ");
        Err(ParquetError::General(words).into())
    })
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
        let number = |text: &str| {
            guarded(|| Ok::<u8, ParquetError>(text.parse().expect("no\nnumber")))
                .map_err(|error| error.to_string())
        };
        assert_eq!(number("7"), Ok(7));
        let why = number("x").unwrap_err();
        assert!(why.contains("no number: ") && !why.contains('\n'), "{why}");
        assert_eq!(number("8"), Ok(8));
        assert!(!GUARDED.get());
    }
}
