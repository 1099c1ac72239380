//! A second reader of a line's bytes, made from docs/protocol.md. It uses nothing of `bead_wire` but its
//! names of causes.

use bead_wire::Cause;
use crc::{CRC_32_ISO_HDLC, Crc};

const CRC32: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// CRC-32/ISO-HDLC.
pub fn crc(bytes: &[u8]) -> [u8; 4] {
    CRC32.checksum(bytes).to_le_bytes()
}

/// The runs of bytes that a delimiter ends, without the empty ones.
pub fn runs(bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    let ended = bytes
        .iter()
        .rposition(|byte| *byte == 0)
        .map_or(0, |last| last + 1);
    bytes[..ended]
        .split(|byte| *byte == 0)
        .filter(|run| !run.is_empty())
}

/// Decodes COBS bytes; `None` if they end within a group.
pub fn from_cobs(run: &[u8]) -> Option<Vec<u8>> {
    let (mut payload, mut rest) = (Vec::new(), run);
    while let Some((&code, after)) = rest.split_first() {
        let (group, after) = after.split_at_checked(usize::from(code).checked_sub(1)?)?;
        payload.extend(group);
        if code < 0xFF && !after.is_empty() {
            payload.push(0);
        }
        rest = after;
    }
    Some(payload)
}

/// The bytes of a run that its checksum covers: a header of this many bytes, and a body.
///
/// # Errors
/// The run has more bytes than `most` with its two delimiters, or is not COBS of a header and a right
/// checksum.
pub fn covered(run: &[u8], most: usize, header: usize) -> Result<Vec<u8>, Cause> {
    if run.len() > most - 2 {
        return Err(Cause::TooLong);
    }
    let mut payload = from_cobs(run).ok_or(Cause::Cobs)?;
    let length = payload.len().checked_sub(4).filter(|length| *length >= header);
    let said = payload.split_off(length.ok_or(Cause::TooShort)?);
    if said != crc(&payload) {
        return Err(Cause::Crc);
    }
    Ok(payload)
}

/// Bytes as COBS, without a delimiter.
pub fn to_cobs(payload: &[u8]) -> Vec<u8> {
    let mut run = Vec::new();
    for group in payload.split(|byte| *byte == 0) {
        for piece in group.chunks(0xFE) {
            run.push(piece.len() as u8 + 1);
            run.extend(piece);
        }
        // A full piece stands for no zero. One that a zero follows needs an empty piece behind it.
        if group.len().is_multiple_of(0xFE) {
            run.push(1);
        }
    }
    run
}

/// The stream with a right checksum behind every run that has room for one. A run that is not COBS is taken
/// for a payload as it is.
pub fn mended(bytes: &[u8]) -> Vec<u8> {
    let mut stream = vec![0];
    for run in bytes.split(|byte| *byte == 0).filter(|run| !run.is_empty()) {
        let mut payload = from_cobs(run).unwrap_or_else(|| run.to_vec());
        payload.truncate(payload.len().saturating_sub(4));
        payload.extend(crc(&payload));
        stream.extend(to_cobs(&payload));
        stream.push(0);
    }
    stream
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sound_frame_is_mended_to_itself() {
        let payload = b"\x03\x01 a frame of some kind";
        let sound = [&payload[..], &crc(payload)].concat();
        let stream = [&[0][..], &to_cobs(&sound), &[0]].concat();
        assert_eq!(mended(&stream), stream);
        let mut damaged = stream.clone();
        damaged[stream.len() - 2] ^= 0x40;
        assert_eq!(mended(&damaged), stream);
    }
}
