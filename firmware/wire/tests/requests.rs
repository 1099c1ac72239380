//! Requests on a bad line: what is whole is done, what is not is refused by its cause, and the next one is understood.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use bead_wire::{
    Cause, EncodeError, MAX_BLOCK, MAX_REQUEST, Message, Numbered, Rejected, RejectedRequest, Reply, Request,
    RequestCounters, RequestDecoder, VERSION, encode_request,
};
use crc::{CRC_32_ISO_HDLC, Crc};
use proptest::collection::vec;
use proptest::prelude::*;

/// A request that owns its block.
#[derive(Clone, Debug, PartialEq)]
enum Draft {
    Bare(Request<'static>),
    Write(Vec<u8>),
}

impl Draft {
    fn request(&self) -> Request<'_> {
        match self {
            Self::Bare(request) => *request,
            Self::Write(block) => Request::WriteSettings { block },
        }
    }

    fn of(request: Request<'_>) -> Self {
        match request {
            Request::WriteSettings { block } => Self::Write(block.to_vec()),
            Request::Identity => Self::Bare(Request::Identity),
            Request::Status => Self::Bare(Request::Status),
            Request::ReadSettings => Self::Bare(Request::ReadSettings),
            Request::EraseSettings => Self::Bare(Request::EraseSettings),
            Request::Arm => Self::Bare(Request::Arm),
            Request::Disarm => Self::Bare(Request::Disarm),
            Request::SelfTest => Self::Bare(Request::SelfTest),
            Request::Raw { duration_ms } => Self::Bare(Request::Raw { duration_ms }),
            Request::ResetCounters => Self::Bare(Request::ResetCounters),
            Request::Reboot => Self::Bare(Request::Reboot),
        }
    }
}

/// One of each kind but the one with a block, in the order of their numbers.
fn bare() -> [Request<'static>; 10] {
    [
        Request::Identity,
        Request::Status,
        Request::ReadSettings,
        Request::EraseSettings,
        Request::Arm,
        Request::Disarm,
        Request::SelfTest,
        Request::Raw { duration_ms: 1000 },
        Request::ResetCounters,
        Request::Reboot,
    ]
}

fn draft() -> impl Strategy<Value = Draft> {
    prop_oneof![
        prop::sample::select(bare().to_vec()).prop_map(Draft::Bare),
        any::<u32>().prop_map(|duration_ms| Draft::Bare(Request::Raw { duration_ms })),
        vec(any::<u8>(), 0..=MAX_BLOCK).prop_map(Draft::Write),
    ]
}

fn bytes(number: u16, request: &Request<'_>) -> Vec<u8> {
    encode_request(number, request, &mut [0; MAX_REQUEST])
        .unwrap()
        .to_vec()
}

/// A request built by hand from the layout in `docs/protocol.md`.
fn by_hand(version: u8, kind: u8, number: u16, body: &[u8]) -> Vec<u8> {
    let mut payload = vec![version, kind];
    payload.extend(number.to_le_bytes());
    payload.extend(body);
    payload.extend(Crc::<u32>::new(&CRC_32_ISO_HDLC).checksum(&payload).to_le_bytes());
    let mut stream = vec![0; corncobs::max_encoded_len(payload.len())];
    let length = corncobs::encode_buf(&payload, &mut stream);
    stream.truncate(length);
    [&[0][..], &stream].concat()
}

type Heard = Vec<Result<(u16, Draft), RejectedRequest>>;

fn decode(decoder: &mut RequestDecoder, stream: &[u8]) -> Heard {
    let mut heard = Vec::new();
    for &byte in stream {
        heard.extend(
            decoder
                .push(byte)
                .map(|result| result.map(|Numbered { number, request }| (number, Draft::of(request)))),
        );
    }
    heard
}

/// The one thing that stands in `stream`.
fn only(stream: &[u8]) -> Result<(u16, Draft), RejectedRequest> {
    let mut heard = decode(&mut RequestDecoder::new(), stream);
    assert_eq!(heard.len(), 1, "{heard:?}");
    heard.remove(0)
}

proptest! {
    #[test]
    fn every_request_comes_as_it_was_sent(number: u16, draft in draft()) {
        prop_assert_eq!(only(&bytes(number, &draft.request())), Ok((number, draft)));
    }

    /// Every bit of the request in turn, delimiters included.
    #[test]
    fn a_flipped_bit_never_makes_another_request(number: u16, draft in draft()) {
        let damaged = bytes(number, &draft.request());
        let after = bytes(9, &Request::Arm);
        for bit in 0..8 * damaged.len() {
            let mut flipped = damaged.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            let mut decoder = RequestDecoder::new();
            let heard = decode(&mut decoder, &[&flipped[..], &after].concat());
            let understood: Vec<_> = heard.iter().flatten().collect();
            // A flip in the delimiter behind it joins nothing: the next request has its own in front.
            let (last, others) = understood.split_last().unwrap();
            prop_assert_eq!(*last, &(9, Draft::Bare(Request::Arm)), "bit {}", bit);
            // The code behind a run of 254 bytes says nothing if it is the last: without it the request is the same.
            prop_assert!(others.iter().all(|other| **other == (number, draft.clone())), "bit {}", bit);
            prop_assert!(heard.iter().filter_map(|heard| heard.as_ref().err()).all(|reject| reject.number.is_none()));
            prop_assert_eq!(decoder.counters().requests as usize, understood.len());
        }
    }

    #[test]
    fn garbage_before_a_request_costs_the_request_nothing(
        drafts in vec((draft(), vec(any::<u8>(), 0..3 * MAX_REQUEST)), 1..8),
    ) {
        let mut stream = Vec::new();
        for (number, (draft, garbage)) in (0..).zip(&drafts) {
            stream.extend(garbage);
            stream.extend(bytes(number, &draft.request()));
        }
        let mut decoder = RequestDecoder::new();
        let heard = decode(&mut decoder, &stream);
        let understood: Vec<_> = heard.into_iter().flatten().collect();
        let sent: Vec<_> = (0..).zip(drafts.into_iter().map(|(draft, _)| draft)).collect();
        prop_assert_eq!(understood, sent);
        prop_assert_eq!(decoder.counters().bytes, stream.len() as u64);
    }

    #[test]
    fn what_stands_between_two_delimiters_ends_in_one_counter(
        stream in vec(prop_oneof![Just(0u8), any::<u8>()], 0..5000),
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
    let raw = [0x64];
    let reject = |stream: &[u8]| only(stream).unwrap_err();
    let refused = |cause, number| RejectedRequest { cause, number };
    // With the CRC right, somebody waits for a reply: the number is known.
    assert_eq!(
        reject(&by_hand(VERSION + 1, 64, 7, &[])),
        refused(Cause::Version(VERSION + 1), Some(7))
    );
    assert_eq!(
        reject(&by_hand(VERSION, 63, 7, &[])),
        refused(Cause::Kind(63), Some(7))
    );
    assert_eq!(
        reject(&by_hand(VERSION, 75, 7, &[])),
        refused(Cause::Kind(75), Some(7))
    );
    // A kind of the bead's own messages is none of a host's.
    assert_eq!(
        reject(&by_hand(VERSION, 1, 7, &[])),
        refused(Cause::Kind(1), Some(7))
    );
    assert_eq!(
        reject(&by_hand(VERSION, 69, 7, &[0])),
        refused(Cause::Trailing, Some(7))
    );
    assert_eq!(
        reject(&by_hand(VERSION, 72, 7, &[])),
        refused(Cause::Body, Some(7))
    );
    assert_eq!(
        reject(&by_hand(VERSION, 72, 7, &[0x64, 0])),
        refused(Cause::Trailing, Some(7))
    );
    // A block of two bytes of which one is missing, and of which one is too many.
    assert_eq!(
        reject(&by_hand(VERSION, 67, 7, &[2, 1])),
        refused(Cause::Body, Some(7))
    );
    assert_eq!(
        reject(&by_hand(VERSION, 67, 7, &[2, 1, 2, 3])),
        refused(Cause::Trailing, Some(7))
    );
    // Without it, nothing can be believed.
    let mut wrong = by_hand(VERSION, 72, 7, &raw);
    let last = wrong.len() - 2;
    wrong[last] ^= 1;
    assert_eq!(reject(&wrong), refused(Cause::Crc, None));
    assert_eq!(reject(&[3, 1, 2, 0]), refused(Cause::TooShort, None));
    assert_eq!(reject(&[9, 1, 2, 0]), refused(Cause::Cobs, None));
    assert_eq!(
        reject(&[&[1; MAX_REQUEST][..], &[0]].concat()),
        refused(Cause::TooLong, None)
    );
    let mut decoder = RequestDecoder::new();
    decode(&mut decoder, &[by_hand(VERSION, 75, 7, &[]), wrong].concat());
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
    assert_eq!(MAX_REQUEST, 270, "docs/protocol.md says so");
    let block = [0xFF; MAX_BLOCK];
    let longest = Request::WriteSettings { block: &block };
    // Numbers without a zero byte are the worst case of COBS.
    assert_eq!(bytes(0xFFFF, &longest).len(), MAX_REQUEST);
    for room in 0..MAX_REQUEST {
        assert_eq!(
            encode_request(0xFFFF, &longest, &mut [0; MAX_REQUEST][..room]),
            Err(EncodeError::BufferTooSmall(room))
        );
    }
    let block = [0; MAX_BLOCK + 1];
    let too_long = EncodeError::TooLong {
        length: MAX_BLOCK + 1,
        most: MAX_BLOCK,
    };
    assert_eq!(
        encode_request(
            0,
            &Request::WriteSettings { block: &block },
            &mut [0; 2 * MAX_REQUEST]
        ),
        Err(too_long)
    );
}

#[test]
fn a_frame_of_the_bead_that_comes_back_is_no_request() {
    // As on a line whose two wires touch.
    let reply = Message::Reply(Reply {
        request: 7,
        outcome: bead_wire::Outcome::Done,
        detail: "",
    });
    let header = bead_wire::Header {
        boot: 0,
        sequence: 5,
        sample_index: 1,
    };
    let mut buffer = [0; bead_wire::MAX_FRAME];
    let sent = bead_wire::encode(&header, &reply, &mut buffer).unwrap();
    assert_eq!(only(sent).unwrap_err().cause, Cause::Kind(16));
}
