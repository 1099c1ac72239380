//! Bytes of a line, read once more by what docs/protocol.md says and by nothing of `bead_wire`.

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

/// Bytes as COBS, without a delimiter.
pub fn to_cobs(payload: &[u8]) -> Vec<u8> {
    let mut run = Vec::new();
    for (number, group) in payload.split(|byte| *byte == 0).enumerate() {
        // A full group stands for no zero. So one that a zero follows needs an empty group behind it.
        if number > 0 && run.is_empty() {
            run.push(1);
        }
        let mut pieces = group.chunks(0xFE).peekable();
        if pieces.peek().is_none() {
            run.push(1);
        }
        while let Some(piece) = pieces.next() {
            run.push(piece.len() as u8 + 1);
            run.extend(piece);
            if piece.len() == 0xFE && pieces.peek().is_none() {
                run.push(1);
            }
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
    fn bytes_come_back_from_cobs_and_without_a_zero_between() {
        for length in [0, 1, 2, 253, 254, 255, 508, 509, 600] {
            for zeros in [usize::MAX, 1, 2, 100, 254, 255] {
                let payload: Vec<u8> = (1..=length).map(|n| if n % zeros == 0 { 0 } else { 7 }).collect();
                let run = to_cobs(&payload);
                assert!(!run.contains(&0));
                assert_eq!(
                    from_cobs(&run),
                    Some(payload),
                    "{length} bytes, zeros each {zeros}"
                );
            }
        }
        assert_eq!(from_cobs(&[3, 1]), None);
    }

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
