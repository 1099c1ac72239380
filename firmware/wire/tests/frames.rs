//! One frame: what it carries, what it refuses, how long it gets.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use bead_wire::{
    Cause, CodeError, Codes, Decoder, EncodeError, Fault, FaultCause, Header, Identity, MAX_BLOCK,
    MAX_DETAIL, MAX_FIRMWARE, MAX_FRAME, MAX_GIT, MAX_SCANS, Message, Settings, VERSION, Waveform, encode,
};
use common::{decode, draft, filler};
use crc::{CRC_32_ISO_HDLC, Crc};
use proptest::prelude::*;

const HEADER: Header = Header {
    boot: 0,
    sequence: 0,
    sample_index: 0,
};

/// A frame built by hand from the layout in `docs/protocol.md`.
fn by_hand(version: u8, kind: u8, sequence: u32, body: &[u8]) -> Vec<u8> {
    let mut payload = vec![version, kind, 0];
    payload.extend(sequence.to_le_bytes());
    payload.extend([0; 8]);
    payload.extend(body);
    payload.extend(Crc::<u32>::new(&CRC_32_ISO_HDLC).checksum(&payload).to_le_bytes());
    let mut stream = vec![0; cobs::max_encoding_length(payload.len())];
    let length = cobs::encode(&payload, &mut stream);
    stream.truncate(length);
    stream.push(0);
    stream
}

fn cause(stream: &[u8]) -> Option<Cause> {
    let (_, rejects) = decode(&mut Decoder::new(), stream);
    rejects.first().map(|reject| reject.cause)
}

proptest! {
    #[test]
    fn every_message_comes_back_as_it_was_sent(
        draft in draft(),
        (boot, sequence, sample_index) in any::<(u8, u32, u64)>(),
    ) {
        let header = Header { boot, sequence, sample_index };
        let mut buffer = [0; MAX_FRAME];
        let sent = encode(&header, &draft.message(), &mut buffer).unwrap();
        let mut received = 0;
        Decoder::new().feed(sent, |result| {
            let frame = result.unwrap();
            assert_eq!((frame.header, frame.message), (header, draft.message()));
            received += 1;
        });
        prop_assert_eq!(received, 1);
    }

    #[test]
    fn a_frame_has_a_delimiter_at_each_end_and_none_within(draft in draft()) {
        let mut buffer = [0; MAX_FRAME];
        let sent = encode(&HEADER, &draft.message(), &mut buffer).unwrap();
        let delimiters: Vec<_> = (0..sent.len()).filter(|&at| sent[at] == 0).collect();
        prop_assert_eq!(delimiters, [0, sent.len() - 1]);
    }

    #[test]
    fn a_buffer_too_small_by_any_number_of_bytes_is_refused(draft in draft()) {
        let mut buffer = [0; MAX_FRAME];
        let needed = encode(&HEADER, &draft.message(), &mut buffer).unwrap().len();
        for room in 0..needed {
            prop_assert_eq!(
                encode(&HEADER, &draft.message(), &mut buffer[..room]),
                Err(EncodeError::BufferTooSmall(room))
            );
        }
    }

    #[test]
    fn texts_too_long_are_cut_between_characters(firmware: String, git: String, filling in "\\PC{80,200}") {
        let (firmware, git) = (firmware + &filling, git + &filling);
        let identity = Message::Identity(Identity {
            firmware: &firmware, git: &git, uid: [0; 12], boot: 0, reset_cause: 0, sample_rate_hz: 1, channels: 2,
        });
        let fault = Message::Fault(Fault { cause: FaultCause::Panic, boot: 0, pc: 0, detail: &git });
        let mut buffer = [0; MAX_FRAME];
        let heads = |text: &str, head: &str, most: usize| {
            // A character has at most four bytes: no more than three are given up.
            text.starts_with(head) && head.len() <= most && head.len() + 3 >= most.min(text.len())
        };
        for message in [identity, fault] {
            let sent = encode(&HEADER, &message, &mut buffer).unwrap();
            Decoder::new().feed(sent, |result| match result.unwrap().message {
                Message::Identity(cut) => {
                    assert!(heads(&firmware, cut.firmware, MAX_FIRMWARE));
                    assert!(heads(&git, cut.git, MAX_GIT));
                }
                Message::Fault(cut) => assert!(heads(&git, cut.detail, MAX_DETAIL)),
                other => panic!("sent no {other:?}"),
            });
        }
    }

    #[test]
    fn codes_come_back_as_they_were_packed(scans in prop::collection::vec([0..4096u16, 0..4096u16], 0..100)) {
        let mut packed = vec![0; 3 * scans.len()];
        let codes = Codes::pack(scans.iter().copied(), &mut packed).unwrap();
        prop_assert_eq!(codes.len(), scans.len());
        prop_assert!(codes.iter().eq(scans));
    }
}

#[test]
fn no_frame_is_longer_than_max_frame_and_one_is_as_long() {
    assert_eq!(MAX_FRAME, 281, "docs/protocol.md and hosts' buffers say so");
    // No zero byte anywhere is the worst case of COBS.
    let header = Header {
        boot: 0xFF,
        sequence: u32::MAX,
        sample_index: u64::MAX,
    };
    let message = Message::Settings(Settings {
        block: &[0xFF; MAX_BLOCK],
    });
    let mut buffer = [0; 2 * MAX_FRAME];
    assert_eq!(encode(&header, &message, &mut buffer).unwrap().len(), MAX_FRAME);
}

#[test]
fn slices_too_long_are_refused() {
    let mut buffer = [0; 2 * MAX_FRAME];
    let block = [1; MAX_BLOCK + 1];
    assert_eq!(
        encode(
            &HEADER,
            &Message::Settings(Settings { block: &block }),
            &mut buffer
        ),
        Err(EncodeError::TooLong {
            length: MAX_BLOCK + 1,
            most: MAX_BLOCK
        })
    );
    let mut packed = [0; 3 * (MAX_SCANS + 1)];
    let codes = Codes::pack([[1, 2]; MAX_SCANS + 1], &mut packed).unwrap();
    let waveform = Waveform {
        strike: 0,
        first_index: 0,
        codes,
        absorbed_measured: 0,
        absorbed_predicted: 0,
    };
    assert_eq!(
        encode(&HEADER, &Message::Waveform(waveform), &mut buffer),
        Err(EncodeError::TooLong {
            length: 3 * (MAX_SCANS + 1),
            most: 3 * MAX_SCANS
        })
    );
}

#[test]
fn codes_beyond_twelve_bits_and_partial_scans_are_refused() {
    assert_eq!(
        Codes::pack([[0, 4096]], &mut [0; 3]),
        Err(CodeError::TooHigh(4096))
    );
    assert_eq!(
        Codes::pack([[0, 1]; 2], &mut [0; 5]),
        Err(CodeError::BufferTooSmall(5))
    );
    assert_eq!(Codes::from_bytes(&[0; 4]), Err(CodeError::PartialScan(4)));
}

#[test]
fn the_layout_is_the_documented_one() {
    let by_hand = by_hand(VERSION, 6, 77, b"\x02ab");
    let mut buffer = [0; MAX_FRAME];
    let message = Message::Settings(Settings { block: b"ab" });
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
    assert_eq!(cause(&by_hand(VERSION, 10, 0, b"")), Some(Cause::Kind(10)));
    assert_eq!(cause(&by_hand(VERSION, 6, 0, b"\x03ab")), Some(Cause::Body));
    assert_eq!(cause(&by_hand(VERSION, 6, 0, b"\x02abc")), Some(Cause::Trailing));
    // A waveform of four bytes: one scan and a third. Then one whole scan.
    assert_eq!(
        cause(&by_hand(VERSION, 4, 0, b"\x00\x00\x04abcd\x00\x00")),
        Some(Cause::Body)
    );
    assert_eq!(cause(&by_hand(VERSION, 4, 0, b"\x00\x00\x03abc\x00\x00")), None);
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

#[test]
fn a_frame_becomes_one_json_object() {
    let mut packed = [0; 6];
    let codes = Codes::pack([[1, 2], [3, 4095]], &mut packed).unwrap();
    let waveform = Waveform {
        strike: 5,
        first_index: 9,
        codes,
        absorbed_measured: -1,
        absorbed_predicted: 0,
    };
    let mut buffer = [0; MAX_FRAME];
    let sent = encode(&HEADER, &Message::Waveform(waveform), &mut buffer).unwrap();
    let mut json = String::new();
    Decoder::new().feed(sent, |result| {
        json = serde_json::to_string(&result.unwrap()).unwrap()
    });
    assert_eq!(
        json,
        r#"{"header":{"boot":0,"sequence":0,"sample_index":0},"arrival":"first","message":{"kind":"waveform","strike":5,"first_index":9,"codes":[[1,2],[3,4095]],"absorbed_measured":-1,"absorbed_predicted":0}}"#
    );
}
