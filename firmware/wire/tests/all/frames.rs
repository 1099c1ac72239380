//! One frame: what it carries, which bytes are refused, and how long it can be.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use crate::common::{STEP, block, decode, filler, message, most};
use bead_wire::{
    Block, BlockTooLong, BufferTooSmall, Cause, CodeError, Codes, Decoder, FaultCause, Fetched, FieldKind,
    Fields, Frame, Header, Inner, MAX_BLOCK, MAX_DETAIL, MAX_FRAME, Message, Outcome, Settings, StrikeFlags,
    Text, VERSION, Value, encode,
};
use crc::{CRC_32_ISO_HDLC, Crc};
use proptest::prelude::*;

const HEADER: Header = Header {
    address: 0,
    boot: 0,
    sequence: 0,
    sample_index: 0,
};

/// A frame built by hand from the layout in `docs/protocol.md`.
fn by_hand(version: u8, kind: u8, sequence: u32, body: &[u8]) -> Vec<u8> {
    let mut payload = vec![version, kind, 0];
    payload.extend(sequence.to_le_bytes());
    payload.extend([0; 8 + 1]);
    payload.extend(body);
    payload.extend(Crc::<u32>::new(&CRC_32_ISO_HDLC).checksum(&payload).to_le_bytes());
    let mut stream = vec![0; cobs::max_encoding_length(payload.len())];
    let length = cobs::encode(&payload, &mut stream);
    [&stream[..length], &[0]].concat()
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
    fn a_frame_has_a_delimiter_at_each_end_and_none_within(message in message()) {
        let mut buffer = [0; MAX_FRAME];
        let sent = encode(&HEADER, &message, &mut buffer).unwrap();
        let delimiters: Vec<_> = (0..sent.len()).filter(|&at| sent[at] == 0).collect();
        prop_assert_eq!(delimiters, [0, sent.len() - 1]);
    }

    #[test]
    fn a_buffer_too_small_by_any_number_of_bytes_is_refused(message in message()) {
        let mut buffer = [0; MAX_FRAME];
        let needed = encode(&HEADER, &message, &mut buffer).unwrap().len();
        for room in (0..needed).step_by(STEP) {
            prop_assert_eq!(
                encode(&HEADER, &message, &mut buffer[..room]),
                Err(BufferTooSmall(room))
            );
        }
    }

    #[test]
    #[cfg_attr(miri, ignore = "what draws its texts takes minutes there")]
    fn texts_too_long_are_cut_between_characters(text: String, filling in "\\PC{80,200}") {
        let text = text + &filling;
        let cut = Text::<MAX_DETAIL>::from(text.as_str());
        // A character has at most four bytes, so the cut costs at most three more than it has to.
        prop_assert!(text.starts_with(cut.as_str()) && cut.as_str().len() <= MAX_DETAIL);
        prop_assert!(cut.as_str().len() + 3 >= MAX_DETAIL.min(text.len()));
    }

    #[test]
    fn codes_come_back_as_they_were_packed(scans in prop::collection::vec([0..4096u16, 0..4096u16], 0..most(100))) {
        let codes = Codes::<300>::pack(scans.iter().copied()).unwrap();
        prop_assert_eq!(codes.len(), scans.len());
        prop_assert!(codes.iter().eq(scans));
    }
}

#[test]
fn no_frame_is_longer_than_max_frame_and_one_is_as_long() {
    assert_eq!(MAX_FRAME, 297, "docs/protocol.md and hosts' buffers say so");
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
fn blocks_too_long_are_refused() {
    assert_eq!(
        Block::try_from(&[1; MAX_BLOCK + 1][..]),
        Err(BlockTooLong(MAX_BLOCK + 1))
    );
    // The decoder refuses them too: here the length says 257, and 257 bytes follow.
    let body = [&[0x81, 0x02][..], &[1; MAX_BLOCK + 1]].concat();
    assert_eq!(cause(&by_hand(VERSION, 6, 0, &body)), Some(Cause::Body));
    let longer = [&[0x90, 0x02][..], &[1; MAX_BLOCK + 16]].concat();
    assert_eq!(cause(&by_hand(VERSION, 6, 0, &longer)), Some(Cause::TooLong));
    let detail = [&[0x07, 0x00, 97][..], &[b'x'; 97]].concat();
    assert_eq!(cause(&by_hand(VERSION, 16, 0, &detail)), Some(Cause::Body));
}

#[test]
fn codes_beyond_twelve_bits_and_partial_scans_are_refused() {
    assert_eq!(Codes::<3>::pack([[0, 4096]]), Err(CodeError::TooHigh(4096)));
    assert_eq!(Codes::<3>::pack([[0, 1]; 2]), Err(CodeError::TooMany(3)));
    assert_eq!(Codes::<3>::from_bytes(&[0; 6]), Err(CodeError::TooMany(3)));
    assert_eq!(Codes::<6>::from_bytes(&[0; 4]), Err(CodeError::PartialScan(4)));
}

#[test]
fn the_layout_is_the_documented_one() {
    let by_hand = by_hand(VERSION, 6, 77, b"\x02ab");
    let mut buffer = [0; MAX_FRAME];
    let message = Message::Settings(Settings { block: block(b"ab") });
    let sent = encode(
        &Header {
            sequence: 77,
            ..HEADER
        },
        &message,
        &mut buffer,
    )
    .unwrap();
    assert_eq!(sent[1..], by_hand);
}

#[test]
fn each_kind_of_damage_is_refused_by_its_name() {
    let good = by_hand(VERSION, 6, 0, b"\x02ab");
    assert_eq!(cause(&good), None);
    assert_eq!(
        cause(&by_hand(VERSION + 1, 6, 0, b"\x02ab")),
        Some(Cause::Version(VERSION + 1))
    );
    assert_eq!(cause(&by_hand(VERSION, 0, 0, b"")), Some(Cause::Kind(0)));
    assert_eq!(cause(&by_hand(VERSION, 63, 0, b"")), Some(Cause::Kind(63)));
    assert_eq!(cause(&by_hand(VERSION, 6, 0, b"\x03ab")), Some(Cause::Body));
    assert_eq!(cause(&by_hand(VERSION, 6, 0, b"\x02abc")), Some(Cause::Trailing));
    // First a waveform of four bytes, which is one scan and a third. Then one of a whole scan.
    assert_eq!(
        cause(&by_hand(VERSION, 4, 0, b"\x00\x00\x04abcd\x00\x00\x00")),
        Some(Cause::Body)
    );
    assert_eq!(
        cause(&by_hand(VERSION, 4, 0, b"\x00\x00\x03abc\x00\x00\x00")),
        None
    );
    assert_eq!(cause(b"\x09abc\x00"), Some(Cause::Cobs));
    assert_eq!(cause(b"\x04abc\x00"), Some(Cause::TooShort));
    let flipped: Vec<_> = good
        .iter()
        .map(|&byte| if byte == b'a' { b'q' } else { byte })
        .collect();
    assert_eq!(cause(&flipped), Some(Cause::Crc));
    assert_eq!(cause(&[&[1; MAX_FRAME][..], &[0]].concat()), Some(Cause::TooLong));
}

#[test]
fn a_frame_whose_crc_is_right_is_not_lost_though_its_kind_is_unknown() {
    let stream = [
        filler(0, 0),
        by_hand(VERSION, 99, 1, b"from tomorrow"),
        filler(0, 2),
    ]
    .concat();
    let mut decoder = Decoder::new();
    assert_eq!(decode(&mut decoder, &stream).0, [0, 2]);
    assert_eq!(
        (decoder.counters().lost, decoder.counters().rejected.kind),
        (0, 1)
    );
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
    assert_eq!(heard.len(), 2);
    assert!(heard.iter().all(|frame| frame.version == later));
    match &heard[0].message {
        Message::Identity(identity) => {
            assert_eq!(
                (identity.firmware.as_str(), identity.boot, identity.sample_rate_hz),
                ("1", 5, 100_000)
            );
        }
        other => panic!("{other:?}"),
    }
    match &heard[1].message {
        Message::Reply(reply) => assert_eq!((reply.request, reply.outcome), (7, Outcome::Version)),
        other => panic!("{other:?}"),
    }
    let mut decoder = Decoder::new();
    let (_, rejects) = decode(&mut decoder, &stream);
    assert_eq!(rejects[0].cause, Cause::Version(later));
    assert_eq!(
        (decoder.counters().lost, decoder.counters().rejected.version),
        (0, 1)
    );
    // No frame of version 0 exists; those of 2 and 3 were sent before the first release.
    for refused in [0, 2, 3] {
        let stream = by_hand(refused, 1, 0, identity);
        assert_eq!(cause(&stream), Some(Cause::Version(refused)));
    }
    assert_eq!(
        Cause::Version(3).to_string(),
        "version 3 of the protocol is not known here; use `bead` of commit 710832c"
    );
}

#[test]
fn an_unknown_number_keeps_its_frame_and_has_no_name() {
    let heard = frames(&by_hand(VERSION, 5, 0, b"\xc8\x02\x00\x05hello"));
    match &heard[0].message {
        Message::Fault(fault) => {
            assert_eq!(
                (fault.cause, fault.cause.name()),
                (FaultCause::Unknown(200), None)
            );
            assert_eq!((fault.boot, fault.detail.as_str()), (2, "hello"));
            assert_eq!(fault.cause.to_string(), "number 200");
        }
        other => panic!("{other:?}"),
    }
    assert_eq!(cause(&by_hand(VERSION, 16, 0, b"\x07\xfe\x00")), None);
    assert_eq!(cause(&by_hand(VERSION, 19, 0, b"\x63\x01\x00")), None);
}

#[test]
fn names_and_numbers_belong_together() {
    for &(number, name, _) in FaultCause::LIST {
        assert_eq!(FaultCause::from_number(number).name(), Some(name));
        assert_eq!(FaultCause::from_name(name).map(FaultCause::number), Some(number));
    }
    let flags = StrikeFlags::from_bits(1 << 2 | 1 << 4 | 1 << 14);
    assert!(flags.names().eq(["estimates_differ", "sensor_fault"]));
    assert!(flags.has(StrikeFlags::SENSOR_FAULT) && !flags.has(StrikeFlags::GAINS_DIFFER));
    assert_eq!(flags.without(StrikeFlags::OF_THE_BEAD).bits(), 1 << 2 | 1 << 4);
}

#[test]
fn a_body_shows_its_fields_in_order_with_value_and_unit() {
    let gains = bead_wire::GainMatch {
        deviation: bead_wire::Fraction::from_bits(-1 << 15),
        uncertainty: bead_wire::Fraction::from_bits(1),
    };
    let mut seen = Vec::new();
    gains.each(&mut |field, value| match (field.kind, value) {
        (FieldKind::Quantity(unit), Value::Integer(bits)) => {
            seen.push((field.name, bits, unit.si(bits as i64, None)));
        }
        _ => panic!("{} is a quantity", field.name),
    });
    assert_eq!(seen[0], ("deviation", -1 << 15, Some(-0.5)));
    assert_eq!((seen[1].0, seen[1].1), ("uncertainty", 1));
}
