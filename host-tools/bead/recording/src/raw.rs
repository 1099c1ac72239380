//! Raw bytes of a bead in a file.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use crate::file::RecordingError;
use crate::frames::decode;

/// Number of bytes that show the kind of a file.
const HEAD: u64 = 256 * 1024;
/// Number of bytes that are read at once.
const BLOCK: usize = 64 * 1024;

/// Number of frames in the first 256 KiB of a file, 0 if it cannot be read.
pub fn frames_in(path: &Path) -> u64 {
    let mut head = Vec::new();
    if !path.is_file() {
        return 0;
    }
    // A file that cannot be read has no frames.
    let _ = File::open(path).and_then(|file| file.take(HEAD).read_to_end(&mut head));
    decode(&head).1.frames
}

/// Reads a file of raw bytes, piece by piece.
///
/// # Errors
/// The file cannot be read, or what `take` reports.
pub fn read(
    path: &Path,
    mut take: impl FnMut(&[u8]) -> Result<(), RecordingError>,
) -> Result<(), RecordingError> {
    let unread = RecordingError::refused("read", path);
    let mut file = File::open(path).map_err(&unread)?;
    let mut buffer = vec![0; BLOCK];
    loop {
        match file.read(&mut buffer) {
            Ok(0) => return Ok(()),
            Ok(length) => take(&buffer[..length])?,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(unread(error)),
        }
    }
}
