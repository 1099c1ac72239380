//! Framing, exhaustively where it is small: short streams, and payloads of every length around the groups of
//! COBS.

use bead_fuzz::line::{crc, from_cobs, to_cobs};
use bead_fuzz::{frames, requests};

/// Bytes that mean something to COBS or to the header.
const BYTES: [u8; 6] = [0, 1, 2, 3, 5, 0xFF];
/// Greatest length of which all streams are tried.
const LENGTH: u32 = 5;

#[test]
fn every_short_stream_of_these_bytes_has_one_verdict() {
    for length in 0..=LENGTH {
        for number in 0..BYTES.len().pow(length) {
            let stream: Vec<u8> = (0..length)
                .map(|place| BYTES[number / BYTES.len().pow(place) % BYTES.len()])
                .collect();
            frames::check(&stream);
            requests::check(&stream);
        }
    }
}

#[test]
fn payloads_of_every_length_have_the_verdict_of_the_page_wherever_their_zeros_are() {
    for length in (0..320_usize).chain([504, 505, 596]) {
        for zeros in [usize::MAX, 1, 2, 16, 17, 253, 254, 255] {
            for version in [1, 2, 3, 4] {
                let mut payload: Vec<u8> = (0..length)
                    .map(|at| if (at + 1) % zeros == 0 { 0 } else { 7 })
                    .collect();
                if let Some(first) = payload.first_mut() {
                    *first = version;
                }
                payload.extend(crc(&payload));
                let run = to_cobs(&payload);
                assert_eq!(from_cobs(&run).as_ref(), Some(&payload));
                let stream = [&[0], &run[..], &[0]].concat();
                frames::check(&stream);
                requests::check(&stream);
            }
        }
    }
}
