//! Requests on a bad line: a whole one is understood, a damaged one is refused by its cause, and costs the
//! next one nothing.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use crate::common::{STEP, most, request};
use bead_wire::{
    Cause, Inner, KEY, MAX_REQUEST, ReceivedRequest, Rejected, Request, RequestCounters, RequestDecoder,
    VERSION, encode_request,
};
use proptest::collection::vec;
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

    /// Flips every bit of the request in turn, those of the delimiters too.
    #[test]
    fn a_flipped_bit_never_makes_another_request(number: u16, request in request()) {
        let damaged = bytes(number, &request);
        let after = bytes(9, &Request::Arm);
        for bit in (0..8 * damaged.len()).step_by(STEP) {
            let mut flipped = damaged.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            let mut decoder = RequestDecoder::new();
            let heard = decode(&mut decoder, &[&flipped[..], &after].concat());
            let requests: Vec<_> = heard.iter().flatten().collect();
            // A flip in the delimiter behind the request does not join it to the next one, which begins with
            // its own.
            let (last, others) = requests.split_last().unwrap();
            prop_assert_eq!(*last, &understood(9, Request::Arm), "bit {}", bit);
            // After a run of 254 bytes the last COBS code may carry nothing. Then a flip in it leaves the
            // same request.
            prop_assert!(others.iter().all(|other| **other == understood(number, request.clone())), "bit {}", bit);
            prop_assert_eq!(decoder.counters().requests as usize, requests.len());
        }
    }

    #[test]
    fn garbage_before_a_request_costs_the_request_nothing(
        requests in vec((request(), vec(any::<u8>(), 0..most(3 * MAX_REQUEST))), 1..8),
    ) {
        let mut stream = Vec::new();
        for (number, (request, garbage)) in (0..).zip(&requests) {
            stream.extend(garbage);
            stream.extend(bytes(number, request));
        }
        let mut decoder = RequestDecoder::new();
        let heard = decode(&mut decoder, &stream);
        let heard: Vec<_> = heard.into_iter().flatten().collect();
        let sent: Vec<_> = (0..).zip(requests).map(|(number, (request, _))| understood(number, request)).collect();
        prop_assert_eq!(heard, sent);
        prop_assert_eq!(decoder.counters().bytes, stream.len() as u64);
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
        // A bead's kinds are no requests, as on a line whose two wires touch.
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
    // If the CRC is wrong, no byte can be believed.
    let mut wrong = by_hand(VERSION, 72, &[0x64]);
    let last = wrong.len() - 2;
    wrong[last] ^= 1;
    assert_eq!(only(&wrong), Err(Cause::Crc));
    assert_eq!(only(&[3, 1, 2, 0]), Err(Cause::TooShort));
    assert_eq!(only(&[9, 1, 2, 0]), Err(Cause::Cobs));
    assert_eq!(only(&[&[1; MAX_REQUEST][..], &[0]].concat()), Err(Cause::TooLong));
    let mut decoder = RequestDecoder::new();
    decode(&mut decoder, &[by_hand(VERSION, 99, &[]), wrong].concat());
    let one_each = Rejected {
        kind: 1,
        crc: 1,
        ..Rejected::default()
    };
    assert_eq!(decoder.counters().rejected, one_each);
    assert_eq!(decoder.take_counters().rejected, one_each);
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
