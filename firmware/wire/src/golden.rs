//! Frames as bytes, one of each kind: what was recorded yesterday must be read today.
//!
//! If a test here fails, the layout of a frame has changed.
//! - Was that the purpose? A body never changes: give the new one a new number and a file of its own. If the
//!   header has changed, raise [`VERSION`], keep today's frames in a file beside `v2.txt`, with a test that
//!   reads them, and put the new frames into the files of the messages.
//! - Was it not? Then a field was added, lost or moved, or a bound has changed: undo that.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::collections::HashMap;
use std::format;
use std::string::String;
use std::vec::Vec;

use crate::body::{Field, Fields};
use crate::codes::Codes;
use crate::decoder::Decoder;
use crate::frame::{Frame, Header, MAX_FRAME, encode};
use crate::message::fault::FaultCause;
use crate::message::shape::GainMatch;
use crate::message::strike::StrikeFlags;
use crate::message::{Kind, Message, examples};
use crate::payload::VERSION;
use crate::quantity::{Energy, Force, Fraction, Impulse, Samples};
use crate::request::{MAX_REQUEST, Request, RequestDecoder, encode_request};
use crate::signed::{KEY, Key, Ticket};
use crate::text::{Block, MAX_BLOCK, Text};

const HEADER: Header = Header {
    address: 7,
    boot: 2,
    sequence: 0x0102_0304,
    sample_index: 0x0A_0000_0B0C,
};

/// The requests with their delimiters: number 0xA1B2, for address 7.
const REQUESTS: [&str; 16] = [
    "000a0340b2a10785e734f500",
    "000a0341b2a107e080884d00",
    "000a0342b2a1070e2f3d5f00",
    "000c0343b2a10707424541440106ff9749be0b00",
    "000a0344b2a107d270567a00",
    "000a0345b2a107b717eac200",
    "000a0346b2a10759b85fd000",
    "000a0347b2a1073cdfe36800",
    "000c0348b2a107c413e72d38fe00",
    "000a0349b2a1070fa83c8800",
    "000a034ab2a107e107899a00",
    "001a034bb2a1077369787465656e206279746573206f6b5801b73400",
    "000e034cb2a107ac0202c096b10245159cc3f928d965e99ba80b5dbf392b9c49093f727600",
    "000a034db2a107583f5e0700",
    "000d034eb2a10702ac02e8ac339700",
    "000e034fb2a107c096b102696cb06400",
];

const KEY_BYTES: [u8; KEY] = *b"sixteen bytes ok";

fn requests() -> [Request; 16] {
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
        Request::SetKey { key: KEY_BYTES },
        Request::Arm.signed(
            &Key::new(KEY_BYTES).unwrap(),
            b"\x30\x00\x2a\x00\x0e\x51\x33\x35\x39\x30\x37\x31",
            HEADER.address,
            0xA1B2,
            Ticket {
                counter: 300,
                boot: 2,
                until: 5_000_000,
            },
        ),
        Request::ListKept,
        Request::Fetch { boot: 2, strike: 300 },
        Request::Keep { index: 5_000_000 },
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
        assert_eq!(
            (frame.version, frame.header, &frame.message),
            (VERSION, HEADER, &message)
        );
    }
}

#[test]
fn the_frames_of_version_2_are_read_as_those_of_address_0() {
    let today: HashMap<&str, Message> = examples()
        .into_iter()
        .map(|(message, _)| (message.kind().name(), message))
        .collect();
    let rows = include_str!("golden/v2.txt")
        .lines()
        .filter(|line| !line.starts_with('#'));
    for (row, line) in rows.enumerate() {
        let (name, hex) = line.split_once(' ').unwrap();
        let frame = read(hex);
        let header = Header { address: 0, ..HEADER };
        assert_eq!(
            (frame.version, frame.header, &frame.message),
            (2, header, &today[name]),
            "row {row}"
        );
    }
}

/// The longest body is the sum over its fields, so each form of a field is tried with its longest values.
#[test]
fn the_longest_form_of_each_field_is_as_long_as_stated() {
    fn longest<F: Field>(values: &[F]) {
        let mut buffer = [0; 300];
        let lengths = values
            .iter()
            .map(|value| postcard::to_slice(value, &mut buffer).unwrap().len());
        assert_eq!(lengths.max(), Some(F::LONGEST), "{}", F::FORM);
    }
    // In zigzag order the lowest number is the longest.
    longest(&[u8::MAX]);
    longest(&[u16::MAX]);
    longest(&[u32::MAX]);
    longest(&[u64::MAX]);
    longest(&[true]);
    longest(&[[0xFF_u8; 12]]);
    longest(&[Force::from_bits(i32::MIN)]);
    longest(&[Energy::from_bits(i64::MIN)]);
    longest(&[Impulse::from_bits(i64::MIN)]);
    longest(&[Samples::from_bits(u32::MAX)]);
    longest(&[FaultCause::Unknown(u8::MAX)]);
    longest(&[Text::<24>::new(format_args!("{:x>99}", ""))]);
    longest(&[Text::<96>::new(format_args!("{:x>99}", ""))]);
    longest(&[Block::try_from(&[1; MAX_BLOCK][..]).unwrap()]);
    longest(&[Codes::<96>::pack([[1, 2]; 32]).unwrap()]);
    longest(&[Codes::<102>::pack([[1, 2]; 34]).unwrap()]);
    longest(&[StrikeFlags::from_bits(u16::MAX)]);
    longest(&[Some(GainMatch {
        deviation: Fraction::from_bits(i32::MIN),
        uncertainty: Fraction::from_bits(i32::MIN),
    })]);
    for &kind in Kind::ALL {
        assert_eq!(
            kind.longest(),
            kind.fields().iter().map(|field| field.longest).sum()
        );
    }
}

#[test]
fn requests_are_the_same_bytes_and_are_understood() {
    for (hex, request) in REQUESTS.into_iter().zip(requests()) {
        let mut buffer = [0; MAX_REQUEST];
        let sent = encode_request(HEADER.address, 0xA1B2, &request, &mut buffer).unwrap();
        assert_eq!(to_hex(sent), hex, "{request:?}");
        let mut decoder = RequestDecoder::new();
        let heard: Vec<_> = from_hex(hex)
            .into_iter()
            .filter_map(|byte| decoder.push(byte))
            .collect();
        assert_eq!(heard.len(), 1);
        let heard = heard[0].clone().unwrap();
        assert_eq!(
            (heard.address, heard.number, heard.request),
            (HEADER.address, 0xA1B2, Ok(request))
        );
    }
    assert_eq!(Request::LIST.len(), REQUESTS.len());
}

#[test]
fn every_kind_has_a_name_and_fields_and_no_number_of_a_request() {
    for &kind in Kind::ALL {
        assert_eq!(Kind::from_byte(kind as u8), Some(kind));
        assert!((kind as u8) < 64);
        let mut names = Vec::new();
        let (message, _) = examples()
            .into_iter()
            .find(|(message, _)| message.kind() == kind)
            .unwrap();
        message.each(&mut |field, _| names.push(field.name));
        assert!(kind.fields().iter().map(|field| field.name).eq(names));
    }
}
