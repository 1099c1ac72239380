//! The bytes of a file at any place, without all of them in memory.
//!
//! # Design
//! A search for records in a damaged file reads some bytes several times. A file can be made in which every
//! few bytes look like the head of a record of megabytes, and a search reads all of these. So the bytes that
//! are asked for have a limit. It is far above what accidental damage takes.

use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;

use crc32fast::Hasher;
use rustix::fs::SeekFrom;

/// Bytes that are read at once.
const BLOCK: usize = 256 * 1024;

/// Bytes that are asked for at most: for each of the file, and besides.
const ASKED_FOR_EACH: u64 = 128;
const ASKED_BESIDES: u64 = 256 << 20;

/// A file, and a window of it.
pub(super) struct Source {
    file: File,
    /// Length of the file when it was opened.
    pub(super) length: u64,
    window: Vec<u8>,
    /// Where the window begins.
    start: u64,
    /// Bytes that may still be asked for.
    left: u64,
}

impl Source {
    pub(super) fn new(file: File) -> io::Result<Self> {
        let length = file.metadata()?.len();
        Ok(Self {
            length,
            file,
            window: Vec::new(),
            start: 0,
            left: length
                .saturating_mul(ASKED_FOR_EACH)
                .saturating_add(ASKED_BESIDES),
        })
    }

    /// Takes note of work as for so many bytes.
    ///
    /// # Errors
    /// It was too much in all.
    pub(super) fn ask(&mut self, bytes: u64) -> io::Result<()> {
        let too_much = || io::Error::other("it seems to hold far more than it has bytes, and is not read on");
        self.left = self.left.checked_sub(bytes).ok_or_else(too_much)?;
        Ok(())
    }

    /// The bytes from `at` on: at least `wanted`, unless the file ends before.
    pub(super) fn at(&mut self, at: u64, wanted: usize) -> io::Result<&[u8]> {
        let left = usize::try_from(self.length.saturating_sub(at)).unwrap_or(usize::MAX);
        let wanted = wanted.min(left);
        self.ask(wanted as u64)?;
        let inside = at
            .checked_sub(self.start)
            .and_then(|skip| usize::try_from(skip).ok());
        let inside = inside.filter(|skip| {
            skip.checked_add(wanted)
                .is_some_and(|end| end <= self.window.len())
        });
        let skip = match inside {
            Some(skip) => skip,
            None => {
                self.fill(at, wanted.max(BLOCK.min(left)))?;
                0
            }
        };
        Ok(self.window.get(skip..).unwrap_or_default())
    }

    fn fill(&mut self, at: u64, length: usize) -> io::Result<()> {
        self.start = at;
        self.window.resize(length, 0);
        self.window.shrink_to(BLOCK);
        let mut filled = 0;
        while filled < length {
            match self.file.read_at(&mut self.window[filled..], at + filled as u64) {
                // Another program made it shorter.
                Ok(0) => break,
                Ok(read) => filled += read,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => {
                    self.window.clear();
                    return Err(error);
                }
            }
        }
        self.window.truncate(filled);
        Ok(())
    }

    /// The first place from `at` on that is not in a hole of a sparse file: holes read as zeros.
    pub(super) fn behind_hole(&self, at: u64) -> u64 {
        match rustix::fs::seek(&self.file, SeekFrom::Data(at)) {
            Ok(data) => data.max(at),
            // Nothing but a hole follows, or the file system does not tell.
            Err(rustix::io::Errno::NXIO) => self.length,
            Err(_) => at,
        }
    }

    /// CRC-32 of the bytes in a range.
    pub(super) fn crc(&mut self, from: u64, to: u64) -> io::Result<u32> {
        let mut hasher = Hasher::new();
        let mut at = from;
        while at < to {
            let bytes = self.at(at, 1)?;
            let length = bytes.len().min(usize::try_from(to - at).unwrap_or(usize::MAX));
            if length == 0 {
                break;
            }
            hasher.update(&bytes[..length]);
            at += length as u64;
            self.ask(length as u64)?;
        }
        Ok(hasher.finalize())
    }
}
