//! COBS of a payload.
//!
//! # Design
//! The crate `cobs` decodes here, and encodes in the tests. Its encoder takes each byte through a state
//! machine. The one here copies the payload as a whole; only the search for the next zero is left for each
//! byte.

/// Most bytes of a piece. Its code byte is then 0xFF, and stands for no zero behind it.
const PIECE: usize = 254;

/// Writes the COBS form of `bytes`, without delimiters, to the head of `out`, and returns its length. `None`
/// if there is no room: [`cobs::max_encoding_length`] bytes are always enough.
pub(crate) fn encode(bytes: &[u8], out: &mut [u8]) -> Option<usize> {
    // One byte further on, all bytes are already in place: the code byte of the next piece takes the place of
    // a zero.
    out.get_mut(1..=bytes.len())?.copy_from_slice(bytes);
    let (mut code, mut rest) = (0, bytes);
    loop {
        let head = &rest[..rest.len().min(PIECE)];
        let zero = head.iter().position(|&byte| byte == 0);
        let length = zero.unwrap_or(head.len());
        // At most 254 + 1.
        *out.get_mut(code)? = length as u8 + 1;
        code += 1 + length;
        rest = &rest[length..];
        match zero {
            Some(_) => rest = &rest[1..],
            None if rest.is_empty() => return Some(code),
            // Without a zero, the rest moves to make room for the next code byte.
            None => out.get_mut(code + 1..=code + rest.len())?.copy_from_slice(rest),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec;
    use std::vec::Vec;

    /// Longest payload that is drawn: three pieces; under Miri, which is slow, little more than one.
    const LONGEST: usize = if cfg!(miri) { PIECE + 8 } else { 3 * PIECE };

    /// Payloads with few zeros and with many, around the length of a piece and of two.
    fn payloads() -> impl Strategy<Value = Vec<u8>> {
        let byte = prop_oneof![400 => 1..=255_u8, 1 => Just(0)];
        let long = prop::collection::vec(byte, 0..=LONGEST);
        let full = (0..=2 * PIECE + 2).prop_map(|length| vec![7; length]);
        prop_oneof![prop::collection::vec(0..4_u8, 0..40), long, full]
    }

    proptest! {
        #[test]
        fn it_writes_what_another_encoder_writes_and_never_beyond_its_room(
            payload in payloads(),
            short in 1..400_usize,
        ) {
            let mut expected = vec![0; cobs::max_encoding_length(payload.len()) + 1];
            // This version of the crate writes nothing for an empty payload; the standard asks for one code
            // byte.
            expected[0] = 1;
            let length = cobs::encode(&payload, &mut expected).max(1);
            let mut encoded = vec![0; length];
            prop_assert_eq!(encode(&payload, &mut encoded), Some(length));
            prop_assert_eq!(&encoded, &expected[..length]);
            encoded.truncate(length.saturating_sub(short));
            prop_assert_eq!(encode(&payload, &mut encoded), None);
        }
    }
}
