//! Records the executed half-words of flash in a file while the image runs.
//!
//! # Design
//! Bit n of byte b of the file is the half-word at FLASH + 2 (8 b + n), which is the start or the second half
//! of an instruction. A block of instructions counts as a whole when it begins: only a fault leaves one in
//! its middle. The file is written whenever something new is executed, so that a killed run keeps its record.

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::Path;
use std::sync::atomic::{AtomicU8, Ordering::Relaxed};

use super::recorder::written;
use crate::memory::FLASH;

/// Bytes of flash for a byte of the file.
const BYTES: u32 = 16;

pub(super) struct Coverage {
    bits: Vec<AtomicU8>,
    file: File,
}

impl Coverage {
    /// Creates a file beside those of other runs of this image.
    ///
    /// # Errors
    /// One line: which file cannot be created.
    pub(super) fn new(stem: &Path) -> Result<Self, String> {
        // The system may reuse a process's number.
        for number in 0.. {
            let path = stem.with_extension(format!("{}-{number}.bits", std::process::id()));
            match File::create_new(&path) {
                Ok(file) => {
                    let bits = (0..FLASH.len() / BYTES as usize).map(|_| AtomicU8::new(0));
                    return Ok(Self {
                        bits: bits.collect(),
                        file,
                    });
                }
                Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(format!("{}: {error}", path.display())),
            }
        }
        Err("no number is left for a file of executed addresses".into())
    }

    /// Records the execution of a block of instructions.
    pub(super) fn executed(&self, address: u32, bytes: u32) {
        let from = address.wrapping_sub(FLASH.start);
        let (mut at, end) = (from / 2, from.saturating_add(bytes).div_ceil(2));
        while at < end {
            let byte = at / 8;
            let last = end.min(8 * (byte + 1));
            let mask = (at..last).fold(0, |mask, bit| mask | 1 << (bit % 8));
            // There are no bits for addresses outside flash.
            let Some(bits) = self.bits.get(byte as usize) else {
                return;
            };
            let before = bits.fetch_or(mask, Relaxed);
            if before | mask != before {
                written(self.file.write_all_at(&[before | mask], byte.into()));
            }
            at = last;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_half_word_of_a_block_in_flash_has_its_bit_in_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let coverage = Coverage::new(&folder.path().join("image")).unwrap();
        let other = Coverage::new(&folder.path().join("image")).unwrap();
        for (address, bytes) in [
            (0x0800_000e, 4),
            (0x0800_0024, 2),
            (0x0800_0024, 2),
            (0x2000_0000, 8),
            (0x080f_fffe, 4),
        ] {
            coverage.executed(address, bytes);
        }
        other.executed(0x0800_0000, 2);
        let mut files: Vec<_> = std::fs::read_dir(folder.path())
            .unwrap()
            .map(|file| file.unwrap().path())
            .collect();
        files.sort();
        let [first, second] = [0, 1].map(|n| std::fs::read(&files[n]).unwrap());
        assert_eq!(first[..3], [0b1000_0000, 0b0000_0001, 0b0000_0100]);
        assert_eq!(
            (
                first.len(),
                first[3..first.len() - 1].iter().all(|byte| *byte == 0)
            ),
            (1 << 16, true)
        );
        assert_eq!(first.last(), Some(&0b1000_0000));
        assert_eq!(second, [1]);
    }
}
