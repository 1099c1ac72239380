//! What stands between two delimiters, in a stream of bytes in which anything may happen.
//!
//! # Design
//! A byte 0x00 is always a delimiter and never anything else, so after any damage this is in step again at the
//! next one. It keeps no more than one frame of `N` bytes, allocates nothing and cannot panic.

use crate::cause::Cause;
use crate::payload::DELIMITER;

/// Takes bytes as they come, gives payloads.
#[derive(Clone, Debug)]
pub(crate) struct Deframer<const N: usize> {
    encoded: [u8; N],
    /// Bytes since the last delimiter; beyond the buffer they are counted, not kept.
    pending: u64,
}

/// What stood between two delimiters.
pub(crate) struct Between<'a> {
    /// How many bytes there were, as received.
    pub(crate) bytes: u64,
    /// What they carried, or why it is nothing.
    pub(crate) payload: Result<&'a [u8], Cause>,
}

impl<const N: usize> Deframer<N> {
    pub(crate) const fn new() -> Self {
        Self {
            encoded: [0; N],
            pending: 0,
        }
    }

    /// Bytes received since the last delimiter.
    pub(crate) const fn pending(&self) -> u64 {
        self.pending
    }

    /// Takes one byte; a delimiter may give what stood before it.
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
        // Frames are delimited on both sides: nothing between two delimiters is no loss.
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
        let length = corncobs::decode_in_place(encoded).map_err(|_| Cause::Cobs)?;
        Ok(&encoded[..length])
    }
}
