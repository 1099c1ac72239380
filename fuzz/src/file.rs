//! A file with the bytes of an input, for readers that open files by name. It is in memory where the system
//! has a place for that: on a disk, a target waits five times as long as it computes.

use std::fs::OpenOptions;
use std::io::Write;
use std::path::Path;

use tempfile::NamedTempFile;

thread_local! {
    static FILE: NamedTempFile = NamedTempFile::new_in("/dev/shm")
        .or_else(|_| NamedTempFile::new())
        .expect("the temporary folder takes a file");
}

/// Calls `read` with the name of a file that has these bytes.
pub(crate) fn with(bytes: &[u8], read: impl FnOnce(&Path)) {
    FILE.with(|file| {
        let written = OpenOptions::new().write(true).truncate(true).open(file.path());
        written
            .and_then(|mut file| file.write_all(bytes))
            .expect("the temporary folder takes some bytes");
        read(file.path());
    });
}
