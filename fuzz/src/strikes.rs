//! A forged stream through all that is made of frames: strikes, replay, clocks, tables.

use std::sync::{Arc, LazyLock};

use bead_compare::replay::replay;
use bead_model::Settings;
use bead_model::design::Capture;
use bead_recording::arrival::rise;
use bead_recording::clock::{Live, Segments, Tracker};
use bead_recording::export::{samples, strikes as table};
use bead_recording::frames::{Frame, Frames, Item, Piece};
use bead_recording::received::LastSaid;
use bead_recording::signal::Signal;
use bead_recording::strikes::{FetchedNames, GivenSettings, RecordedStrike, Strikes};
use bead_testing::paper_settings;
use bead_wire::Message;

use crate::line::{mended, runs};

/// Strikes of one input that are replayed.
const REPLAYED: usize = 3;

/// Indices of samples at which something ends, or may.
const ENDS: [u64; 12] = [
    0,
    1,
    127,
    5000,
    (1 << 32) - 200,
    1 << 32,
    (1 << 63) - 2000,
    (1 << 63) - 1,
    1 << 63,
    u64::MAX - 2000,
    u64::MAX - 100,
    u64::MAX,
];

/// Reads the bytes with right checksums. The last byte of each run sets its receive time. The strikes are
/// read once more with sound settings, and with indices at one of the ends.
///
/// # Panics
/// An invariant of the results does not hold.
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

    let mut fetched = FetchedNames::default();
    all.iter().for_each(|frame| fetched.push(frame));
    let recorded =
        Strikes::new(LastSaid::new(frames()), GivenSettings::default()).with_fetched(fetched.finish());
    let width = table::columns().len();
    for (id, strike) in (0..).zip(recorded) {
        assert_eq!(table::row(id, "forged", &strike).len(), width);
        if id < REPLAYED as u64 {
            replayed(&strike);
        }
    }
    let settings = SETTINGS[bytes.len() % 2];
    let moved = moved(all, ENDS[bytes.len() / 2 % ENDS.len()]);
    for mut strike in Strikes::new(moved, GivenSettings::from([(None, settings)])).take(REPLAYED) {
        // With a sample missing, nothing is replayed.
        strike.after_gaps.clear();
        strike.said.samples = u16::try_from(strike.scans.len()).unwrap_or(u16::MAX);
        replayed(&strike);
    }
}

/// Settings of the paper's bead: with a window of 288 samples, which fits an input, and with its own.
static SETTINGS: LazyLock<[Settings; 2]> = LazyLock::new(|| {
    let capture = Capture {
        history: 1.28e-3,
        length: 1.6e-3,
        lookback: 0.3e-3,
        ..Capture::default()
    };
    let short = paper_settings().with(|paper| paper.capture = capture);
    [short.expect("the paper's bead has settings"), paper_settings()]
});

/// Returns the frames without settings, and with sample indices moved so that the first strike begins at
/// `first`.
fn moved(mut frames: Vec<Frame>, first: u64) -> Vec<Frame> {
    frames.retain(|frame| !matches!(frame.message, Message::Settings(_)));
    let strike = frames.iter().find_map(|frame| match &frame.message {
        Message::Strike(strike) => Some(strike.first_index),
        _ => None,
    });
    let by = first.wrapping_sub(strike.unwrap_or_default());
    for frame in &mut frames {
        match &mut frame.message {
            Message::Strike(strike) => {
                strike.first_index = strike.first_index.wrapping_add(by);
                strike.trigger_index = strike.trigger_index.wrapping_add(by);
            }
            Message::Waveform(waveform) => waveform.first_index = waveform.first_index.wrapping_add(by),
            _ => {}
        }
    }
    frames
}

fn replayed(strike: &RecordedStrike) {
    let name = Arc::from("forged");
    let rows = samples::rows(0, &name, strike).count();
    assert_eq!(rows, strike.samples().count());
    assert!(
        rows >= strike.received() && (rows == strike.scans.len() || rows <= usize::from(strike.said.samples))
    );
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
