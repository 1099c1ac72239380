//! What frames and requests share: a payload ends with its CRC and travels as COBS between two delimiters.

use crc::{CRC_32_ISO_HDLC, Crc, Table};
use serde::Deserialize;

use crate::cause::Cause;

pub(crate) const CRC_LENGTH: usize = 4;
pub(crate) const DELIMITER: u8 = 0;

/// Version of the header: the first byte of every frame and request. See the [`frame`](crate::frame) module.
pub const VERSION: u8 = 3;

/// Sixteen bytes at a time, from 16 KiB of tables: half of what a frame cost was its checksum.
static CRC: Crc<u32, Table<16>> = Crc::<u32, Table<16>>::new(&CRC_32_ISO_HDLC);

/// The buffer cannot take the frame. It has this many bytes; [`MAX_FRAME`](crate::MAX_FRAME) bytes always suffice for a
/// frame, and [`MAX_REQUEST`](crate::MAX_REQUEST) bytes for a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the frame does not fit the buffer of {0} bytes")]
pub struct BufferTooSmall(pub usize);

/// Puts the CRC behind the first `end` bytes of `payload`, COBS and delimiters around all, into `buffer`.
pub(crate) fn seal<'b>(
    payload: &mut [u8],
    end: usize,
    buffer: &'b mut [u8],
) -> Result<&'b [u8], BufferTooSmall> {
    let too_small = BufferTooSmall(buffer.len());
    let crc = CRC.checksum(&payload[..end]);
    payload[end..end + CRC_LENGTH].copy_from_slice(&crc.to_le_bytes());
    let (first, rest) = buffer.split_first_mut().ok_or(too_small)?;
    *first = DELIMITER;
    let payload = &payload[..end + CRC_LENGTH];
    if rest.len() < corncobs::max_encoded_len(payload.len()) {
        return Err(too_small);
    }
    // With the delimiter at its end.
    let length = corncobs::encode_buf(payload, rest);
    Ok(&buffer[..1 + length])
}

/// The first `HEADER` bytes of a payload and the rest of it, if its CRC is right.
pub(crate) fn open<const HEADER: usize>(payload: &[u8]) -> Result<(&[u8; HEADER], &[u8]), Cause> {
    let (covered, crc) = payload.split_last_chunk().ok_or(Cause::TooShort)?;
    let parts = covered.split_first_chunk().ok_or(Cause::TooShort)?;
    match CRC.checksum(covered) == u32::from_le_bytes(*crc) {
        true => Ok(parts),
        false => Err(Cause::Crc),
    }
}

/// The only thing in `body`.
pub(crate) fn whole<'a, T: Deserialize<'a>>(body: &'a [u8]) -> Result<T, Cause> {
    match postcard::take_from_bytes(body) {
        Ok((thing, [])) => Ok(thing),
        Ok(_) => Err(Cause::Trailing),
        Err(_) => Err(Cause::Body),
    }
}
