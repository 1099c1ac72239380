//! Requests as bytes and as messages.

use bead_wire::Request;
use crc::{CRC_32_ISO_HDLC, Crc};

/// The request to write this block.
///
/// # Panics
/// It fits no frame.
pub fn write(block: &[u8]) -> Request {
    Request::WriteSettings {
        block: block.try_into().expect("it fits a frame"),
    }
}

/// A payload with its CRC, COBS and delimiters, for frames that none of our programs would send.
pub fn framed(payload: &[u8]) -> Vec<u8> {
    let crc = Crc::<u32>::new(&CRC_32_ISO_HDLC).checksum(payload);
    let payload = [payload, &crc.to_le_bytes()].concat();
    let mut encoded = vec![0; cobs::max_encoding_length(payload.len())];
    let length = cobs::encode(&payload, &mut encoded);
    [&[0], &encoded[..length], &[0]].concat()
}
