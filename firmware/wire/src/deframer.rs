//! Finds the bytes between two delimiters, in a stream in which any byte may be missing or wrong.
//!
//! # Design
//! A byte 0x00 is always a delimiter and never anything else. So after any damage the decoder is in step
//! again at the next delimiter. It keeps at most one frame of `N` bytes, allocates nothing and cannot panic.

use crate::cause::Cause;
use crate::payload::DELIMITER;

/// Takes bytes one at a time and returns payloads.
#[derive(Clone, Debug)]
pub(crate) struct Deframer<const N: usize> {
    encoded: [u8; N],
    /// Number of bytes since the last delimiter. Bytes beyond the buffer are counted, not kept.
    pending: u64,
}

/// The bytes between two delimiters.
pub(crate) struct Between<'a> {
    /// Number of bytes, as received.
    pub(crate) bytes: u64,
    /// Their payload, or the reason why they have none.
    pub(crate) payload: Result<&'a [u8], Cause>,
}

impl<const N: usize> Deframer<N> {
    pub(crate) const fn new() -> Self {
        Self {
            encoded: [0; N],
            pending: 0,
        }
    }

    /// Number of bytes received since the last delimiter.
    pub(crate) const fn pending(&self) -> u64 {
        self.pending
    }

    /// Takes one byte. A delimiter returns the bytes before it, if there are any.
    pub(crate) fn push(&mut self, byte: u8) -> Option<Between<'_>> {
        if byte != DELIMITER {
            if let Some(slot) = usize::try_from(self.pending)
                .ok()
                .and_then(|at| self.encoded.get_mut(at))
            {
                *slot = byte;
            }
            self.pending += 1;
            return None;
        }
        let bytes = core::mem::take(&mut self.pending);
        // Each frame has a delimiter on both sides, so two delimiters in a row are normal.
        (bytes > 0).then(|| Between {
            bytes,
            payload: self.decode(bytes),
        })
    }

    fn decode(&mut self, bytes: u64) -> Result<&[u8], Cause> {
        let encoded = usize::try_from(bytes)
            .ok()
            .and_then(|length| self.encoded.get_mut(..length))
            .ok_or(Cause::TooLong)?;
        let length = cobs::decode_in_place(encoded).map_err(|_| Cause::Cobs)?;
        Ok(&encoded[..length])
    }
}
