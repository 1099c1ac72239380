//! Messages and requests drawn at random, and frames of them, for the tests of this folder.

use std::{env, fs};

use bead_wire::{Block, Decoder, Header, Kind, MAX_FRAME, Message, Reject, Request, Settings, encode};
use crc::{CRC_32_ISO_HDLC, Crc};
use proptest::prelude::*;

/// Every bit, every length; under Miri, which is slow, each 211th.
pub(crate) const STEP: usize = if cfg!(miri) { 211 } else { 1 };

/// Most frames or bytes that a test draws: under Miri a part of them.
pub(crate) const fn most(number: usize) -> usize {
    if cfg!(miri) { number / 20 + 2 } else { number }
}

/// Random bits from a seed (SplitMix64, Steele et al. 2014).
pub(crate) fn bits(seed: u64) -> impl FnMut() -> u64 {
    let mut state = seed;
    move || {
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mixed = (state ^ state >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ mixed >> 31
    }
}

pub(crate) fn message() -> impl Strategy<Value = Message> {
    (prop::sample::select(Kind::ALL), any::<u64>())
        .prop_map(|(kind, seed)| Message::draw(kind, &mut bits(seed)))
}

/// A message that is not an identity: one that cannot open a boot.
pub(crate) fn unopening() -> impl Strategy<Value = Message> {
    message().prop_filter("an identity", |message| message.kind() != Kind::Identity)
}

pub(crate) fn request() -> impl Strategy<Value = Request> {
    (prop::sample::select(Request::LIST), any::<u64>())
        .prop_map(|(row, seed)| Request::draw(row.0, &mut bits(seed)).expect("the table has that row"))
}

pub(crate) fn block(bytes: &[u8]) -> Block {
    Block::try_from(bytes).expect("the blocks of these tests fit a frame")
}

pub(crate) fn bytes(boot: u8, sequence: u32, message: &Message) -> Vec<u8> {
    bytes_of(0, boot, sequence, message)
}

pub(crate) fn bytes_of(address: u8, boot: u8, sequence: u32, message: &Message) -> Vec<u8> {
    let header = Header {
        address,
        boot,
        sequence,
        sample_index: u64::from(sequence) * 32,
    };
    encode(&header, message, &mut [0; MAX_FRAME])
        .expect("the buffer takes any frame")
        .to_vec()
}

/// A frame or request with this header and body, built by hand from the layout in `docs/protocol.md`.
pub(crate) fn by_hand(header: &[u8], body: &[u8]) -> Vec<u8> {
    let mut payload = [header, body].concat();
    payload.extend(Crc::<u32>::new(&CRC_32_ISO_HDLC).checksum(&payload).to_le_bytes());
    let mut stream = vec![0; cobs::max_encoding_length(payload.len())];
    let length = cobs::encode(&payload, &mut stream);
    [&[0], &stream[..length], &[0]].concat()
}

pub(crate) fn hex(bytes: &[u8], between: &str) -> String {
    let bytes: Vec<_> = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
    bytes.join(between)
}

/// Checks that a file, by its path from this crate, has the text of today. With `overwrite` in this variable
/// the file is written.
pub(crate) fn held(file: &str, today: &str, variable: &str) {
    let path = format!("{}/{file}", env!("CARGO_MANIFEST_DIR"));
    if env::var_os(variable).is_some_and(|value| value == "overwrite") {
        return fs::write(path, today).expect("the file is this crate's own");
    }
    let then = fs::read_to_string(path).expect("the file is there");
    let line = then
        .lines()
        .zip(today.lines())
        .take_while(|(then, now)| then == now)
        .count();
    let [old, new] = [&then, today].map(|text| text.lines().nth(line));
    assert!(
        then == today,
        "{file} line {}: {old:?} is {new:?} today; if that is meant: {variable}=overwrite cargo test --release -p \
         bead-wire",
        line + 1
    );
}

/// Frame of a message that says nothing, for tests of what is around it.
pub(crate) fn filler(boot: u8, sequence: u32) -> Vec<u8> {
    let settings = Settings {
        block: block(b"\x01\x02"),
    };
    bytes(boot, sequence, &settings.into())
}

/// Feeds a stream in pieces; returns the sequence numbers of the frames, and the rejects.
pub(crate) fn decode(decoder: &mut Decoder, stream: &[u8]) -> (Vec<u32>, Vec<Reject>) {
    let (mut sequences, mut rejects) = (Vec::new(), Vec::new());
    for piece in stream.chunks(7) {
        decoder.feed(piece, |result| match result {
            Ok(frame) => sequences.push(frame.header.sequence),
            Err(reject) => rejects.push(reject),
        });
    }
    (sequences, rejects)
}
