//! Recordings, whole and damaged, through every reader.

use bead_compare::replay::replay;
use bead_recording::clock::{self, CommonTime};
use bead_recording::file::{Part, Recording};
use bead_recording::frames::Item;
use bead_recording::raw;

use crate::file;

/// Strikes of one recording that are replayed.
const REPLAYED: usize = 2;

/// Opens the bytes as a file.
///
/// # Panics
/// Two readers do not find the same in it.
pub fn check(bytes: &[u8]) {
    file::with(bytes, |path| {
        let frames = raw::frames_in(path);
        let mut read = 0;
        raw::read(path, |piece| {
            read += piece.len();
            Ok(())
        })
        .expect("a file can be read");
        assert!(read == bytes.len() && frames as usize <= bytes.len());
        if let Ok(recording) = Recording::open(path) {
            through(&recording);
            // At least as many are found if the file is read as damaged, or as raw bytes where neither a
            // message nor a channel marks it as a recording.
            let found = Recording::salvage(path).map_or(frames, |salvaged| salvaged.runs);
            assert!(found >= recording.runs);
        } else if let Ok(recording) = Recording::salvage(path) {
            through(&recording);
        }
        let _ = clock::compare(&[path.to_owned(), path.to_owned()]);
    });
}

fn through(recording: &Recording) {
    assert!(recording.warning().is_none_or(|line| !line.contains('\n')));
    let mut frames = recording.frames().expect("it was opened before");
    let said: Vec<Item> = frames.by_ref().collect();
    let counters = *frames.counters();
    assert_eq!(counters.frames + counters.rejected.total(), said.len() as u64);
    CommonTime::of(recording).expect("it was opened before");
    for part in [Part::Truth, Part::EmulatorReport] {
        let _ = recording.json::<serde_json::Value>(part);
    }
    for one in recording.each() {
        let strikes = one.strikes().expect("it was opened before");
        for (number, strike) in strikes.enumerate() {
            if number < REPLAYED {
                replay(&strike);
            }
        }
    }
}
