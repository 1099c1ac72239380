//! Frames as bytes, one of each kind: yesterday's recordings must decode today.
//!
//! If a test here fails, the layout of a frame has changed. Was that the purpose? A body never changes: give the new one a new
//! number and a file of its own. A new header is a new [`VERSION`]: keep today's frames in a file beside `v2.txt`, with a test
//! that reads them, and put the new ones into the files of the messages. Was it not the purpose? Then a field was
//! added, lost or moved, or a bound has changed: undo that.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::collections::HashMap;
use std::format;
use std::string::String;
use std::vec::Vec;

use crate::body::Fields;
use crate::decoder::Decoder;
use crate::frame::{Frame, Header, MAX_FRAME, encode};
use crate::message::{Kind, Message, examples};
use crate::payload::VERSION;
use crate::request::{MAX_REQUEST, Request, RequestDecoder, encode_request};
use crate::text::Block;

const HEADER: Header = Header {
    address: 7,
    boot: 2,
    sequence: 0x0102_0304,
    sample_index: 0x0A_0000_0B0C,
};

/// The requests, delimiters included: number 0xA1B2 to address 7.
const REQUESTS: [&str; 11] = [
    "00090240b2a113c5f58c00",
    "00090241b2a124af378d00",
    "00090242b2a17d11718f00",
    "000b0243b2a107424541440106ff0a27797a00",
    "00090244b2a1cf6dfc8b00",
    "00090245b2a1f8073e8a00",
    "00090246b2a1a1b9788800",
    "00090247b2a196d3ba8900",
    "000b0248b2a1c413f2f160d000",
    "00090249b2a19cfe248300",
    "0009024ab2a1c540628100",
];

fn requests() -> [Request; 11] {
    [
        Request::Identity,
        Request::Status,
        Request::ReadSettings,
        Request::WriteSettings {
            block: Block::try_from(&b"BEAD\x01\x00\xff"[..]).unwrap(),
        },
        Request::EraseSettings,
        Request::Arm,
        Request::Disarm,
        Request::SelfTest,
        Request::Raw { duration_ms: 2_500 },
        Request::ResetCounters,
        Request::Reboot,
    ]
}

fn from_hex(hex: &str) -> Vec<u8> {
    (0..hex.len())
        .step_by(2)
        .map(|at| u8::from_str_radix(&hex[at..at + 2], 16).unwrap())
        .collect()
}

fn to_hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The only frame in these bytes.
fn read(hex: &str) -> Frame {
    let mut frames = Vec::new();
    Decoder::new().feed(&from_hex(hex), |result| frames.push(result.unwrap()));
    assert_eq!(frames.len(), 1, "{hex}");
    frames.remove(0)
}

#[test]
fn todays_frames_are_the_same_bytes_and_are_understood() {
    for (message, hex) in examples() {
        let mut buffer = [0; MAX_FRAME];
        let sent = to_hex(encode(&HEADER, &message, &mut buffer).unwrap());
        assert_eq!(sent, hex, "{}", message.kind().name());
        let frame = read(hex);
        assert_eq!((frame.version, frame.header, &frame.message), (VERSION, HEADER, &message));
    }
}

#[test]
fn the_frames_of_version_2_are_read_as_those_of_address_0() {
    let today: HashMap<&str, Message> = examples()
        .into_iter()
        .map(|(message, _)| (message.kind().name(), message))
        .collect();
    let rows = include_str!("golden/v2.txt").lines().filter(|line| !line.starts_with('#'));
    for (row, line) in rows.enumerate() {
        let (name, hex) = line.split_once(' ').unwrap();
        let frame = read(hex);
        let header = Header { address: 0, ..HEADER };
        assert_eq!((frame.version, frame.header, &frame.message), (2, header, &today[name]), "row {row}");
    }
}

#[test]
fn the_longest_body_of_each_kind_is_as_long_as_its_fields_say() {
    for &kind in Kind::ALL {
        let mut longest = 0;
        // All ones give the longest varints; lengths drawn from all ones are taken modulo their bound plus one.
        for draw in 0..2000u64 {
            let mut state = draw;
            let message = Message::draw(kind, &mut || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                if draw % 2 == 0 { u64::MAX << (draw % 40) | state >> 40 } else { state >> 7 }
            });
            let mut buffer = [0; 2 * MAX_FRAME];
            longest = longest.max(message.encode(&mut buffer).unwrap());
        }
        assert!(longest <= kind.longest(), "{}: {longest}", kind.name());
    }
}

#[test]
fn requests_are_the_same_bytes_and_are_understood() {
    for (hex, request) in REQUESTS.into_iter().zip(requests()) {
        let mut buffer = [0; MAX_REQUEST];
        let sent = encode_request(HEADER.address, 0xA1B2, &request, &mut buffer).unwrap();
        assert_eq!(to_hex(sent), hex, "{request:?}");
        let mut decoder = RequestDecoder::new();
        let heard: Vec<_> = from_hex(hex).into_iter().filter_map(|byte| decoder.push(byte)).collect();
        assert_eq!(heard.len(), 1);
        let heard = heard[0].clone().unwrap();
        assert_eq!((heard.address, heard.number, heard.request), (HEADER.address, 0xA1B2, Ok(request)));
    }
    assert_eq!(Request::LIST.len(), REQUESTS.len());
}

#[test]
fn every_kind_has_a_name_and_fields_and_no_number_of_a_request() {
    for &kind in Kind::ALL {
        assert_eq!(Kind::from_byte(kind as u8), Some(kind));
        assert!((kind as u8) < 64);
        let mut names = Vec::new();
        let (message, _) = examples().into_iter().find(|(message, _)| message.kind() == kind).unwrap();
        message.each(&mut |name, _| names.push(name));
        assert!(kind.fields().iter().map(|field| field.name).eq(names));
    }
}
