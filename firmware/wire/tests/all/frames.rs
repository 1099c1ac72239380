//! One frame: what it carries, which bytes are refused, and how long it can be.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use crate::common::{STEP, decode, message};
use bead_wire::{
    BufferTooSmall, Cause, Decoder, FaultCause, Fetched, Frame, Header, Inner, MAX_BLOCK, MAX_FRAME, Message,
    Outcome, StrikeFlags, VERSION, encode,
};
use proptest::prelude::*;

fn by_hand(version: u8, kind: u8, sequence: u8, body: &[u8]) -> Vec<u8> {
    // Boot, sequence, sample index and address stand behind the kind.
    let mut header = [0; 16];
    [header[0], header[1], header[3]] = [version, kind, sequence];
    crate::common::by_hand(&header, body)
}

fn cause(stream: &[u8]) -> Option<Cause> {
    let (_, rejects) = decode(&mut Decoder::new(), stream);
    rejects.first().map(|reject| reject.cause)
}

proptest! {
    #[test]
    fn every_message_comes_back_as_it_was_sent(
        message in message(),
        (address, boot, sequence, sample_index) in any::<(u8, u8, u32, u64)>(),
    ) {
        let header = Header { address, boot, sequence, sample_index };
        let mut buffer = [0; MAX_FRAME];
        let sent = encode(&header, &message, &mut buffer).unwrap();
        let mut received = 0;
        Decoder::new().feed(sent, |result| {
            let frame = result.unwrap();
            assert_eq!((frame.header, frame.message), (header, message.clone()));
            received += 1;
        });
        prop_assert_eq!(received, 1);
    }

    #[test]
    fn a_buffer_too_small_by_any_number_of_bytes_is_refused(message in message()) {
        let header = Header { address: 0, boot: 0, sequence: 0, sample_index: 0 };
        let mut buffer = [0; MAX_FRAME];
        let needed = encode(&header, &message, &mut buffer).unwrap().len();
        for room in (0..needed).step_by(STEP) {
            let refused = encode(&header, &message, &mut buffer[..room]);
            prop_assert_eq!(refused, Err(BufferTooSmall(room)));
        }
    }
}

#[test]
fn no_frame_is_longer_than_max_frame_and_one_is_as_long() {
    assert_eq!(MAX_FRAME, 489, "docs/protocol.md and hosts' buffers say so");
    // Bytes without a zero are the worst case of COBS.
    let header = Header {
        address: 0xFF,
        boot: 0xFF,
        sequence: u32::MAX,
        sample_index: u64::MAX,
    };
    let message = Message::Fetched(Fetched {
        boot: u32::MAX,
        strike: u32::MAX,
        part: 0xFF,
        parts: 0xFF,
        frame_kind: 0xFF,
        body: Inner::filled_by(|room| {
            room.fill(0xFF);
            room.len()
        }),
    });
    let mut buffer = [0; 2 * MAX_FRAME];
    assert_eq!(encode(&header, &message, &mut buffer).unwrap().len(), MAX_FRAME);
}

#[test]
fn each_kind_of_damage_is_refused_by_its_name() {
    let block = |length: usize| {
        let [low, high] = [length as u8 | 0x80, (length >> 7) as u8];
        [&[low, high][..], &vec![1; length]].concat()
    };
    let detail = [&[0x07, 0x00, 97][..], &[b'x'; 97]].concat();
    for (version, kind, body, expected) in [
        (VERSION, 6, &b"\x02ab"[..], None),
        (VERSION + 3, 6, b"\x02ab", Some(Cause::Version(VERSION + 3))),
        (VERSION, 0, b"", Some(Cause::Kind(0))),
        (VERSION, 63, b"", Some(Cause::Kind(63))),
        (VERSION, 6, b"\x03ab", Some(Cause::Body)),
        (VERSION, 6, b"\x02abc", Some(Cause::Trailing)),
        (VERSION, 6, &block(MAX_BLOCK), None),
        (VERSION, 6, &block(MAX_BLOCK + 1), Some(Cause::Body)),
        (VERSION, 6, &block(MAX_BLOCK + 16), Some(Cause::TooLong)),
        (VERSION, 16, &detail, Some(Cause::Body)),
        // A number without a name is of a later version.
        (VERSION, 16, b"\x07\xfe\x00", None),
        (VERSION, 19, b"\x63\x01\x00", None),
        // A waveform of four bytes, which is one scan and a third, and one of a whole scan.
        (VERSION, 4, b"\x00\x00\x04abcd\x00\x00\x00", Some(Cause::Body)),
        (VERSION, 4, b"\x00\x00\x03abc\x00\x00\x00", None),
    ] {
        let found = cause(&by_hand(version, kind, 0, body));
        assert_eq!(found, expected, "{kind} {body:?}");
    }
    assert_eq!(cause(b"\x09abc\x00"), Some(Cause::Cobs));
    assert_eq!(cause(b"\x04abc\x00"), Some(Cause::TooShort));
    let mut flipped = by_hand(VERSION, 6, 0, b"\x02ab");
    let last = flipped.len() - 2;
    flipped[last] ^= 1;
    assert_eq!(cause(&flipped), Some(Cause::Crc));
    assert_eq!(cause(&[&[1; MAX_FRAME][..], &[0]].concat()), Some(Cause::TooLong));
}

fn frames(stream: &[u8]) -> Vec<Frame> {
    let mut frames = Vec::new();
    Decoder::new().feed(stream, |result| frames.extend(result.ok()));
    frames
}

#[test]
fn identity_and_reply_of_a_later_version_are_read_with_their_header_and_others_refused_but_not_lost() {
    let later = VERSION + 7;
    let identity = b"\x011\x00123456789012\x05\x04\xa0\x8d\x06\x04and more";
    let reply = b"\x07\x01\x02no\xff\xff";
    let stream = [
        by_hand(later, 1, 0, identity),
        by_hand(later, 2, 1, b"of another layout"),
        by_hand(later, 16, 2, reply),
    ]
    .concat();
    let heard = frames(&stream);
    assert!(heard.iter().all(|frame| frame.version == later));
    let [Message::Identity(who), Message::Reply(answer)] = [&heard[0].message, &heard[1].message] else {
        panic!("{heard:?}")
    };
    assert_eq!((who.firmware.as_str(), who.boot), ("1", 5));
    assert_eq!(who.sample_rate_hz, 100_000);
    assert_eq!((answer.request, answer.outcome), (7, Outcome::Version));
    let mut decoder = Decoder::new();
    let (_, rejects) = decode(&mut decoder, &stream);
    assert_eq!(rejects[0].cause, Cause::Version(later));
    let counters = decoder.counters();
    assert_eq!((counters.lost, counters.rejected.version), (0, 1));
    // No frame of version 0 exists; those of 2 and 3 were sent before the first release.
    for refused in [0, 2, 3] {
        let found = cause(&by_hand(refused, 1, 0, identity));
        assert_eq!(found, Some(Cause::Version(refused)));
    }
    assert_eq!(
        Cause::Version(3).to_string(),
        "version 3 of the protocol is unknown here; use `bead` of commit 710832c"
    );
}

#[test]
fn an_unknown_number_keeps_its_frame_and_has_no_name() {
    let heard = frames(&by_hand(VERSION, 5, 0, b"\xc8\x02\x00\x05hello"));
    let Message::Fault(fault) = &heard[0].message else {
        panic!("{heard:?}")
    };
    assert_eq!(fault.cause, FaultCause::Unknown(200));
    assert_eq!(fault.cause.name(), None);
    assert_eq!((fault.boot, fault.detail.as_str()), (2, "hello"));
    assert_eq!(fault.cause.to_string(), "number 200");
}

#[test]
fn names_and_numbers_belong_together() {
    for &(number, name, _) in FaultCause::LIST {
        assert_eq!(FaultCause::from_number(number).name(), Some(name));
        assert_eq!(FaultCause::from_number(number).number(), number);
    }
    let flags = StrikeFlags::from_bits(1 << 31 | 1 << 4 | 1 << 14);
    assert!(flags.names().eq(["estimates_differ", "sensor_fault"]));
    assert!(flags.has(StrikeFlags::SENSOR_FAULT) && !flags.has(StrikeFlags::GAINS_DIFFER));
    assert_eq!(flags.without(StrikeFlags::OF_THE_BEAD).bits(), 1 << 31 | 1 << 4);
}
