//! Bytes of every message and every request, compared with `golden.txt`. Fields, units and lists are in
//! `docs/protocol.md`, which another test checks.
//!
//! If a test here fails, a body has changed: the order or the type of a field.
//! - A new kind or request may come: `GOLDEN=overwrite cargo test --release -p bead-wire golden` writes the
//!   file anew, with lines added and none removed.
//! - Anything else breaks recordings and old beads. A changed body gets a new number and a file of its own; a
//!   changed header is a new version of the protocol.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use crate::common::{bits, held, hex};
use bead_wire::{
    Block, Codes, Energy, FaultCause, Field, Fields, Force, Fraction, GainMatch, Header, Impulse, Key, Kind,
    MAX_BLOCK, MAX_FRAME, MAX_REQUEST, Message, Request, Samples, StrikeFlags, Text, Ticket, encode,
    encode_request,
};

const HEADER: Header = Header {
    address: 7,
    boot: 2,
    sequence: 0x0102_0304,
    sample_index: 0x0A_0000_0B0C,
};
/// Number of each request.
const NUMBER: u16 = 0xA1B2;

/// Draws with bits of zeros, of ones, and of two seeds.
fn each<T>(draw: impl Fn(&mut dyn FnMut() -> u64) -> T) -> [T; 4] {
    [
        draw(&mut || 0),
        draw(&mut || u64::MAX),
        draw(&mut bits(1)),
        draw(&mut bits(2)),
    ]
}

/// The frame of a message, as a line.
fn frame(message: &Message) -> String {
    let mut buffer = [0; MAX_FRAME];
    format!("  {}\n", hex(encode(&HEADER, message, &mut buffer).unwrap(), ""))
}

/// The frame of a request, as a line.
fn request(request: &Request) -> String {
    let mut buffer = [0; MAX_REQUEST];
    let sent = encode_request(HEADER.address, NUMBER, request, &mut buffer).unwrap();
    format!("  {}\n", hex(sent, ""))
}

/// Requests signed with a known key for a known bead.
fn signed() -> String {
    let key = Key::new(*b"sixteen bytes ok").unwrap();
    let uid = b"\x30\x00\x2a\x00\x0e\x51\x33\x35\x39\x30\x37\x31";
    let ticket = Ticket {
        counter: 300,
        boot: 2,
        until: 5_000_000,
    };
    let requests = [Request::Arm, Request::SetKey { key: [0x5A; 16] }];
    let lines = requests.map(|inner| request(&inner.signed(&key, uid, HEADER.address, NUMBER, ticket)));
    format!("signed arm and set key\n{}", lines.concat())
}

fn today() -> String {
    let mut text = String::new();
    for &kind in Kind::ALL {
        text += &format!("{} {}\n", kind as u8, kind.name());
        let drawn = each(|random| Message::draw(kind, random));
        text += &drawn.each_ref().map(frame).concat();
    }
    for &(number, name, _, fields) in Request::LIST {
        text += &format!("{number} {name}\n");
        let drawn = each(|random| Request::draw(number, random).unwrap());
        // Requests without a body are always the same.
        let lines = drawn.each_ref().map(request);
        text += &if fields.is_empty() {
            lines[0].clone()
        } else {
            lines.concat()
        };
    }
    text + &signed()
}

#[test]
fn bytes_of_messages_and_requests_are_those_of_the_golden_file() {
    held("tests/golden.txt", &today(), "GOLDEN");
}

/// The longest body is the sum over its fields, so each form of a field is tried with its longest values.
#[test]
fn the_longest_form_of_each_field_is_as_long_as_stated() {
    fn longest<F: Field>(values: &[F]) {
        let mut buffer = [0; 500];
        let lengths = values
            .iter()
            .map(|value| postcard::to_slice(value, &mut buffer).unwrap().len());
        assert_eq!(lengths.max(), Some(F::LONGEST), "{}", F::FORM);
    }
    // In zigzag order the lowest number is the longest.
    longest(&[Force::from_bits(i32::MIN)]);
    longest(&[Energy::from_bits(i64::MIN)]);
    longest(&[Impulse::from_bits(i64::MIN)]);
    longest(&[Samples::from_bits(u32::MAX)]);
    longest(&[FaultCause::Unknown(u8::MAX)]);
    longest(&[Text::<24>::new(format_args!("{:x>99}", ""))]);
    longest(&[Text::<127>::new(format_args!("{:x>199}", ""))]);
    longest(&[Text::<128>::new(format_args!("{:x>199}", ""))]);
    longest(&[Block::try_from(&[1; MAX_BLOCK][..]).unwrap()]);
    longest(&[Codes::<102>::pack([[1, 2]; 34]).unwrap()]);
    longest(&[StrikeFlags::from_bits(u32::MAX)]);
    longest(&[Some(GainMatch {
        deviation: Fraction::from_bits(i32::MIN),
        uncertainty: Fraction::from_bits(i32::MIN),
    })]);
}

#[test]
fn every_kind_has_a_name_and_fields_and_no_number_of_a_request() {
    for &kind in Kind::ALL {
        assert_eq!(Kind::from_byte(kind as u8), Some(kind));
        assert!((kind as u8) < 64);
        let longest = kind.fields().iter().map(|field| field.longest);
        assert_eq!(kind.longest(), longest.sum::<usize>());
        let mut names = Vec::new();
        Message::draw(kind, &mut || 0).each(&mut |field, _| names.push(field.name));
        assert!(kind.fields().iter().map(|field| field.name).eq(names));
    }
}
