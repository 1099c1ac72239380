//! Requests: a valid one is understood, and any other is refused with its cause. Damage on the line is tested
//! with frames, which come through the same code.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use crate::common::request;
use bead_wire::{
    Cause, Inner, KEY, MAX_REQUEST, ReceivedRequest, Rejected, Request, RequestCounters, RequestDecoder,
    VERSION, encode_request,
};
use proptest::prelude::*;

const ADDRESS: u8 = 5;

fn bytes(number: u16, request: &Request) -> Vec<u8> {
    encode_request(ADDRESS, number, request, &mut [0; MAX_REQUEST])
        .unwrap()
        .to_vec()
}

fn by_hand(version: u8, kind: u8, body: &[u8]) -> Vec<u8> {
    crate::common::by_hand(&[version, kind, 7, 0, ADDRESS], body)
}

fn decode(decoder: &mut RequestDecoder, stream: &[u8]) -> Vec<Result<ReceivedRequest, Cause>> {
    stream.iter().filter_map(|&byte| decoder.push(byte)).collect()
}

/// The one request or reject in `stream`.
fn only(stream: &[u8]) -> Result<ReceivedRequest, Cause> {
    let mut heard = decode(&mut RequestDecoder::new(), stream);
    assert_eq!(heard.len(), 1, "{heard:?}");
    heard.remove(0)
}

fn understood(number: u16, request: Request) -> ReceivedRequest {
    ReceivedRequest {
        address: ADDRESS,
        number,
        request: Ok(request),
    }
}

proptest! {
    #[test]
    fn every_request_comes_as_it_was_sent(number: u16, request in request()) {
        prop_assert_eq!(only(&bytes(number, &request)), Ok(understood(number, request)));
    }
}

#[test]
fn each_way_of_being_no_request_is_refused_by_its_name() {
    // If the CRC is right, somebody waits for a reply. Number and address are known, whatever the version.
    for (version, kind, body, cause) in [
        (VERSION + 1, 64, &b""[..], Cause::Version(VERSION + 1)),
        (0xFF, 200, b"of tomorrow", Cause::Version(0xFF)),
        (0, 64, b"", Cause::Version(0)),
        (VERSION, 63, b"", Cause::Kind(63)),
        (VERSION, 99, b"", Cause::Kind(99)),
        // A bead's kinds are no requests: they come back on a line whose two wires touch.
        (VERSION, 1, b"", Cause::Kind(1)),
        (VERSION, 16, b"", Cause::Kind(16)),
        (VERSION, 69, b"\0", Cause::Trailing),
        (VERSION, 72, b"", Cause::Body),
        (VERSION, 72, b"\x64\0", Cause::Trailing),
        // A block of two bytes, once with one byte missing and once with one too many.
        (VERSION, 67, b"\x02\x01", Cause::Body),
        (VERSION, 67, b"\x02\x01\x02\x03", Cause::Trailing),
    ] {
        let refused = ReceivedRequest {
            address: ADDRESS,
            number: 7,
            request: Err(cause),
        };
        assert_eq!(only(&by_hand(version, kind, body)), Ok(refused));
    }
    // If the CRC is wrong, no byte can be trusted.
    let mut wrong = by_hand(VERSION, 72, &[0x64]);
    let last = wrong.len() - 2;
    wrong[last] ^= 1;
    assert_eq!(only(&wrong), Err(Cause::Crc));
    assert_eq!(only(&[3, 1, 2, 0]), Err(Cause::TooShort));
    assert_eq!(only(&[&[1; MAX_REQUEST][..], &[0]].concat()), Err(Cause::TooLong));
    let mut decoder = RequestDecoder::new();
    let stream = [by_hand(VERSION, 99, &[]), wrong, bytes(9, &Request::Arm)].concat();
    decode(&mut decoder, &stream);
    let one_each = RequestCounters {
        bytes: stream.len() as u64,
        requests: 1,
        rejected: Rejected {
            kind: 1,
            crc: 1,
            ..Rejected::default()
        },
    };
    assert_eq!(*decoder.counters(), one_each);
    assert_eq!(decoder.take_counters(), one_each);
    assert_eq!(*decoder.counters(), RequestCounters::default());
}

#[test]
fn no_request_is_longer_than_max_request_and_one_is_as_long() {
    assert_eq!(MAX_REQUEST, 507, "docs/protocol.md says so");
    // Bytes without a zero are the worst case of COBS.
    let longest = Request::Signed {
        counter: u64::MAX,
        boot: u32::MAX,
        until: u64::MAX,
        kind: 67,
        body: Inner::filled_by(|room| {
            room.fill(0xFF);
            room.len()
        }),
        code: [0xFF; KEY],
    };
    assert_eq!(bytes(0xFFFF, &longest).len(), MAX_REQUEST);
}
