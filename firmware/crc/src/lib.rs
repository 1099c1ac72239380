//! CRC-32/ISO-HDLC, the one checksum of the project: of frames, settings blocks and the record of a fault.
//!
//! # Design
//! The `crc` crate computes it, byte by byte from a table of 1 KiB. This crate holds the table, so that it is
//! in the image once.
#![cfg_attr(doctest, doc = include_str!("../README.md"))]
#![no_std]
#![forbid(unsafe_code)]

use crc::{CRC_32_ISO_HDLC, Crc, Digest, Table};

static CRC: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);

/// The CRC of `bytes`.
pub fn checksum(bytes: &[u8]) -> u32 {
    checksum_of(&[bytes])
}

/// The CRC of `parts`, one after the other.
// Never inlined, so that it is in the image once.
#[inline(never)]
pub fn checksum_of(parts: &[&[u8]]) -> u32 {
    let mut digest = CRC.digest();
    for part in parts {
        digest.update(part);
    }
    digest.finalize()
}

/// The CRC of bytes that are taken piece by piece.
#[derive(Clone)]
pub struct RunningChecksum(Digest<'static, u32, Table<1>>);

impl Default for RunningChecksum {
    fn default() -> Self {
        Self::new()
    }
}

impl RunningChecksum {
    /// The CRC of no bytes.
    pub fn new() -> Self {
        Self(CRC.digest())
    }

    /// Takes the next bytes.
    #[inline(never)]
    pub fn update(&mut self, bytes: &[u8]) {
        self.0.update(bytes);
    }

    /// The CRC of all bytes so far.
    pub fn finish(self) -> u32 {
        self.0.finalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_of_the_catalogues_text_is_the_catalogues() {
        assert_eq!(checksum(b"123456789"), 0xCBF4_3926);
        assert_eq!(checksum_of(&[b"1234", b"", b"56789"]), 0xCBF4_3926);
        let mut running = RunningChecksum::new();
        [&b"12345"[..], b"6789"]
            .into_iter()
            .for_each(|piece| running.update(piece));
        assert_eq!(running.finish(), 0xCBF4_3926);
    }
}
