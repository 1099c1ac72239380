//! Frames of a bead: every decoder comes to the verdict of the protocol's page.

use bead_recording::frames::{Frame, Frames, Item, Piece};
use bead_recording::protobuf;
use bead_tables::printable::printable;
use bead_wire::{Cause, Decoder, Header, Kind, MAX_FRAME, Message, RequestDecoder, VERSION, encode};

use crate::line::{covered, mended, runs};

/// Gives the bytes to all decoders, as they are and with right checksums.
///
/// # Panics
/// Two verdicts differ, or what was read cannot be written.
pub fn check(bytes: &[u8]) {
    same_verdicts(bytes);
    same_verdicts(&mended(bytes));
}

/// Judges a run of bytes by docs/protocol.md: its header, or the reason why it is no frame. The body is not
/// judged.
fn verdict(run: &[u8]) -> Result<(Header, u8), Cause> {
    let covered = covered(run, MAX_FRAME, 16)?;
    let version = covered[0];
    if matches!(version, 0 | 2 | 3) {
        return Err(Cause::Version(version));
    }
    let number = |from: usize, length: usize| {
        let digits = covered[from..from + length].iter().rev();
        digits.fold(0, |number, byte| number << 8 | u64::from(*byte))
    };
    let header = Header {
        address: covered[15],
        boot: covered[2],
        sequence: number(3, 4) as u32,
        sample_index: number(7, 8),
    };
    match Kind::from_byte(covered[1]) {
        Some(Kind::Identity | Kind::Reply) => Ok((header, version)),
        _ if version > VERSION => Err(Cause::Version(version)),
        Some(_) => Ok((header, version)),
        None => Err(Cause::Kind(covered[1])),
    }
}

fn same_verdicts(bytes: &[u8]) {
    let mut decoder = Decoder::new();
    let mut found = Vec::new();
    decoder.feed(bytes, |result| found.push(result));
    let counters = *decoder.counters();
    assert_eq!(counters.bytes, bytes.len() as u64);

    // The protocol's page, and the decoder of a bead, whose frames have the same form up to the checksum.
    let mut requests = RequestDecoder::new();
    let mut heard = bytes.iter().filter_map(|byte| requests.push(*byte));
    let mut results = found.iter();
    for run in runs(bytes) {
        let of_bead = heard.next().expect("a run is heard");
        match (
            results.next().expect("a run is a frame or a reject"),
            verdict(run),
        ) {
            (Ok(frame), Ok(said)) => assert_eq!((frame.header, frame.version), said),
            (Err(reject), Err(cause)) => {
                assert_eq!((reject.cause, reject.bytes), (cause, run.len() as u64));
                let same = matches!(cause, Cause::Cobs | Cause::Crc);
                assert!(!same || [Err(cause), Err(Cause::TooLong)].contains(&of_bead.map(drop)));
            }
            (Err(reject), Ok(_)) => {
                assert!(matches!(reject.cause, Cause::Body | Cause::Trailing), "{reject}")
            }
            (Ok(frame), Err(cause)) => panic!("{frame:?}: {cause}"),
        }
    }
    assert!(results.next().is_none() && heard.next().is_none());
    let accepted = found.iter().filter(|result| result.is_ok()).count() as u64;
    let refused = found.len() as u64 - accepted;
    assert_eq!((counters.frames, counters.rejected.total()), (accepted, refused));

    // The host, which is given bytes in pieces of any length.
    let mut lengths = bytes.iter().map(|byte| usize::from(*byte % 61) + 1).cycle();
    let mut rest = bytes;
    let pieces = std::iter::from_fn(|| {
        let (piece, after) = rest.split_at(lengths.next()?.min(rest.len()));
        rest = after;
        (!piece.is_empty()).then(|| Piece {
            bytes: piece.to_vec(),
            ..Piece::default()
        })
    });
    let mut frames = Frames::new(pieces);
    let items: Vec<Item> = frames.by_ref().collect();
    assert_eq!(*frames.counters(), counters);
    assert_eq!(items.len(), found.len());
    for (item, result) in items.iter().zip(&found) {
        match (item, result) {
            (Item::Frame(frame), Ok(same)) => {
                assert_eq!((&frame.message, frame.arrival), (&same.message, same.arrival));
                told(frame);
            }
            (Item::Rejected(reject), Err(same)) => assert_eq!(reject, same),
            _ => panic!("{item:?}, {result:?}"),
        }
    }
}

/// Checks that a frame that was read can be shown, and written again.
fn told(frame: &Frame) {
    let json = frame.json().to_string();
    let line = printable(&json);
    assert!(!line.contains(char::is_control), "{line:?}");
    let again: serde_json::Value = serde_json::from_str(&line).expect("what is printed is JSON");
    assert_eq!(again["kind"], frame.message.kind().name());
    protobuf::message(frame);
    if let Message::Fetched(fetched) = &frame.message {
        // It may carry anything.
        let _ = fetched.message();
    }
    let mut buffer = [0; MAX_FRAME];
    let written = encode(&frame.header, &frame.message, &mut buffer).expect("a frame fits");
    let mut read = None;
    Decoder::new().feed(written, |result| read = result.ok());
    let read = read.expect("what was written is a frame");
    assert_eq!((read.header, &read.message), (frame.header, &frame.message));
}
