//! Requests on a bad line: a whole one is understood, a damaged one is refused by its cause, and costs the
//! next one nothing.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use crate::common::{STEP, block, most, request};
use bead_wire::{
    BufferTooSmall, Cause, Heard, KEY, Key, MAX_BLOCK, MAX_REQUEST, Rejected, Reply, Request,
    RequestCounters, RequestDecoder, Ticket, VERSION, encode_request,
};
use crc::{CRC_32_ISO_HDLC, Crc};
use proptest::collection::vec;
use proptest::prelude::*;

const ADDRESS: u8 = 5;

fn bytes(number: u16, request: &Request) -> Vec<u8> {
    encode_request(ADDRESS, number, request, &mut [0; MAX_REQUEST])
        .unwrap()
        .to_vec()
}

/// A request built by hand from the layout in `docs/protocol.md`.
fn by_hand(version: u8, kind: u8, number: u16, body: &[u8]) -> Vec<u8> {
    let mut payload = vec![version, kind];
    payload.extend(number.to_le_bytes());
    payload.push(ADDRESS);
    payload.extend(body);
    payload.extend(Crc::<u32>::new(&CRC_32_ISO_HDLC).checksum(&payload).to_le_bytes());
    let mut stream = vec![0; cobs::max_encoding_length(payload.len())];
    let length = cobs::encode(&payload, &mut stream);
    [&[0], &stream[..length], &[0]].concat()
}

fn decode(decoder: &mut RequestDecoder, stream: &[u8]) -> Vec<Result<Heard, Cause>> {
    stream.iter().filter_map(|&byte| decoder.push(byte)).collect()
}

/// The one request or reject in `stream`.
fn only(stream: &[u8]) -> Result<Heard, Cause> {
    let mut heard = decode(&mut RequestDecoder::new(), stream);
    assert_eq!(heard.len(), 1, "{heard:?}");
    heard.remove(0)
}

fn understood(number: u16, request: Request) -> Heard {
    Heard {
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

    #[test]
    fn what_stands_between_two_delimiters_ends_in_one_counter(
        stream in vec(prop_oneof![Just(0u8), any::<u8>()], 0..most(5000)),
    ) {
        let mut decoder = RequestDecoder::new();
        let heard = decode(&mut decoder, &stream);
        let counters = decoder.counters();
        prop_assert_eq!(counters.bytes, stream.len() as u64);
        prop_assert_eq!(counters.requests + counters.rejected.total(), heard.len() as u64);
        let ended = stream.iter().rposition(|&byte| byte == 0).unwrap_or(0);
        let runs = stream[..ended].split(|&byte| byte == 0).filter(|run| !run.is_empty()).count();
        prop_assert_eq!(heard.len(), runs);
    }
}

#[test]
fn each_way_of_being_no_request_is_refused_by_its_name() {
    let refused = |cause| {
        Ok(Heard {
            address: ADDRESS,
            number: 7,
            request: Err(cause),
        })
    };
    // If the CRC is right, somebody waits for a reply. Number and address are known, whatever the version.
    assert_eq!(
        only(&by_hand(VERSION + 1, 64, 7, &[])),
        refused(Cause::Version(VERSION + 1))
    );
    assert_eq!(
        only(&by_hand(0xFF, 200, 7, b"of tomorrow")),
        refused(Cause::Version(0xFF))
    );
    assert_eq!(only(&by_hand(VERSION, 63, 7, &[])), refused(Cause::Kind(63)));
    assert_eq!(only(&by_hand(VERSION, 99, 7, &[])), refused(Cause::Kind(99)));
    // A bead's kind is no request.
    assert_eq!(only(&by_hand(VERSION, 1, 7, &[])), refused(Cause::Kind(1)));
    assert_eq!(only(&by_hand(VERSION, 69, 7, &[0])), refused(Cause::Trailing));
    assert_eq!(only(&by_hand(VERSION, 72, 7, &[])), refused(Cause::Body));
    assert_eq!(
        only(&by_hand(VERSION, 72, 7, &[0x64, 0])),
        refused(Cause::Trailing)
    );
    // A block of two bytes, once with one byte missing and once with one too many.
    assert_eq!(only(&by_hand(VERSION, 67, 7, &[2, 1])), refused(Cause::Body));
    assert_eq!(
        only(&by_hand(VERSION, 67, 7, &[2, 1, 2, 3])),
        refused(Cause::Trailing)
    );
    assert_eq!(only(&by_hand(0, 64, 7, &[])), refused(Cause::Version(0)));
    // If the CRC is wrong, no byte can be believed.
    let mut wrong = by_hand(VERSION, 72, 7, &[0x64]);
    let last = wrong.len() - 2;
    wrong[last] ^= 1;
    assert_eq!(only(&wrong), Err(Cause::Crc));
    assert_eq!(only(&[3, 1, 2, 0]), Err(Cause::TooShort));
    assert_eq!(only(&[9, 1, 2, 0]), Err(Cause::Cobs));
    assert_eq!(only(&[&[1; MAX_REQUEST][..], &[0]].concat()), Err(Cause::TooLong));
    let mut decoder = RequestDecoder::new();
    decode(&mut decoder, &[by_hand(VERSION, 99, 7, &[]), wrong].concat());
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
    assert_eq!(MAX_REQUEST, 315, "docs/protocol.md says so");
    let block = Request::WriteSettings {
        block: block(&[0xFF; MAX_BLOCK]),
    };
    let ticket = Ticket {
        counter: u64::MAX,
        boot: u32::MAX,
        until: u64::MAX,
    };
    let key = Key::new([1; KEY]).unwrap();
    let Request::Signed {
        counter,
        boot,
        until,
        kind,
        body,
        ..
    } = block.signed(&key, &[0; 12], ADDRESS, 0xFFFF, ticket)
    else {
        panic!("it is signed");
    };
    let longest = Request::Signed {
        counter,
        boot,
        until,
        kind,
        body,
        code: [0xFF; KEY],
    };
    // Bytes without a zero are the worst case of COBS.
    assert_eq!(bytes(0xFFFF, &longest).len(), MAX_REQUEST);
    for room in (0..MAX_REQUEST).step_by(STEP) {
        assert_eq!(
            encode_request(ADDRESS, 0xFFFF, &longest, &mut [0; MAX_REQUEST][..room]),
            Err(BufferTooSmall(room))
        );
    }
}

#[test]
fn a_frame_of_the_bead_that_comes_back_is_no_request() {
    // This happens on a line whose two wires touch.
    let reply = Reply {
        request: 7,
        outcome: bead_wire::Outcome::Done,
        detail: "".into(),
    };
    let header = bead_wire::Header {
        address: 0,
        boot: 0,
        sequence: 5,
        sample_index: 1,
    };
    let mut buffer = [0; bead_wire::MAX_FRAME];
    let sent = bead_wire::encode(&header, &reply.into(), &mut buffer).unwrap();
    assert_eq!(only(sent).unwrap().request, Err(Cause::Kind(16)));
}
