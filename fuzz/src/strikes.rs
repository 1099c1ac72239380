//! A forged stream through all that is made of frames: strikes, replay, clocks, tables.

use std::sync::Arc;

use bead::comparison::replay::replay;
use bead::export::{samples, strikes as table};
use bead::recording::arrival::rise;
use bead::recording::clock::{Live, Segments, Tracker};
use bead::recording::frames::{Frame, Frames, Item, Piece};
use bead::recording::received::LastSaid;
use bead::recording::signal::Signal;
use bead::recording::strikes::{Known, RecordedStrike, Strikes, sent_again};

use crate::line::{mended, runs};

/// Strikes of one input that are replayed.
const REPLAYED: usize = 3;

/// Reads the bytes with right checksums. Each run is received at a time that its last byte gives.
///
/// # Panics
/// Something of what frames are made to does not hold.
pub fn check(bytes: &[u8]) {
    let stream = mended(bytes);
    let mut clock = 1_700_000_000_000_000_000_u64;
    let pieces: Vec<Piece> = runs(&stream)
        .map(|run| {
            clock = clock.wrapping_add(u64::from(run[run.len() - 1]) * 100_000);
            let received_ns = match run[run.len() - 1] {
                0xFF => None,
                0xFE => Some(u64::MAX),
                0xFD => Some(0),
                0xFC => Some(1 << 63),
                _ => Some(clock),
            };
            Piece {
                bytes: [run, &[0]].concat(),
                received_ns,
                ..Piece::default()
            }
        })
        .collect();
    let frames = || Frames::new(pieces.clone());
    let all: Vec<Frame> = frames().filter_map(Item::frame).collect();
    clocks(&all);

    let again = sent_again(all.iter().cloned());
    let recorded = Strikes::new(LastSaid::new(frames()), Known::default()).knowing(again);
    let mut rows = table::Strikes::default();
    let width = rows.columns().len();
    for (id, strike) in (0..).zip(recorded) {
        assert_eq!(rows.row(id, "forged", &strike).len(), width);
        if id < REPLAYED as u64 {
            replayed(&strike);
        }
    }
}

fn replayed(strike: &RecordedStrike) {
    let name = Arc::from("forged");
    let rows = samples::rows(0, &name, strike).count();
    assert_eq!(rows, strike.scans.len());
    let replay = replay(strike);
    assert!(replay.said.is_some() || !replay.identical());
    if let Some(signal) = strike
        .settings
        .and_then(|settings| Signal::of(&strike.scans, &settings))
    {
        assert_eq!(signal.force.len(), strike.scans.len());
        if let Some(at) = rise(&signal) {
            assert!((0.0..signal.force.len() as f64).contains(&at), "{at}");
        }
    }
}

fn clocks(frames: &[Frame]) {
    let (mut tracker, mut live, mut segments) = (Tracker::default(), Live::default(), Segments::default());
    for frame in frames {
        tracker.push(frame);
        live.push(frame);
        segments.place(frame);
    }
    for segment in tracker.segments.iter().chain(live.segments()) {
        if let Some(fit) = segment.fit() {
            for bead in [0.0, 1.0, -1e9, 1e30, f64::NAN] {
                fit.host_ns(bead);
            }
        }
    }
}
