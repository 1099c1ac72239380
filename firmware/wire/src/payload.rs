//! The common form of frames and requests: a payload ends with its CRC, and travels as COBS between two
//! delimiters.

use bead_crc::checksum;
use serde::Deserialize;

use crate::cause::Cause;
use crate::stuffing;

pub(crate) const CRC_LENGTH: usize = 4;
pub(crate) const DELIMITER: u8 = 0;

/// The buffer of this number of bytes is too small. [`MAX_FRAME`](crate::MAX_FRAME) bytes are enough for
/// every frame, [`MAX_REQUEST`](crate::MAX_REQUEST) bytes for every request.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the frame does not fit the buffer of {0} bytes")]
pub struct BufferTooSmall(pub usize);

/// Puts the CRC behind the first `end` bytes of `payload`, and writes all of it as COBS between two
/// delimiters into `buffer`.
pub(crate) fn seal<'b>(
    payload: &mut [u8],
    end: usize,
    buffer: &'b mut [u8],
) -> Result<&'b [u8], BufferTooSmall> {
    let too_small = BufferTooSmall(buffer.len());
    let crc = checksum(&payload[..end]);
    payload[end..end + CRC_LENGTH].copy_from_slice(&crc.to_le_bytes());
    let (first, rest) = buffer.split_first_mut().ok_or(too_small)?;
    *first = DELIMITER;
    let length = stuffing::encode(&payload[..end + CRC_LENGTH], rest).ok_or(too_small)?;
    *rest.get_mut(length).ok_or(too_small)? = DELIMITER;
    Ok(&buffer[..1 + length + 1])
}

/// Splits a payload whose CRC is right into its first `HEADER` bytes and the rest, without the CRC.
pub(crate) fn open<const HEADER: usize>(payload: &[u8]) -> Result<(&[u8; HEADER], &[u8]), Cause> {
    let (covered, crc) = payload.split_last_chunk().ok_or(Cause::TooShort)?;
    let parts = covered.split_first_chunk().ok_or(Cause::TooShort)?;
    if checksum(covered) == u32::from_le_bytes(*crc) {
        Ok(parts)
    } else {
        Err(Cause::Crc)
    }
}

/// The one value that `body` consists of.
pub(crate) fn whole<'a, T: Deserialize<'a>>(body: &'a [u8]) -> Result<T, Cause> {
    match postcard::take_from_bytes(body) {
        Ok((thing, [])) => Ok(thing),
        Ok(_) => Err(Cause::Trailing),
        Err(_) => Err(Cause::Body),
    }
}
