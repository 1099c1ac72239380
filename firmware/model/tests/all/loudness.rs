//! Only loud pieces of a window depend on the low gain: the others are the same without its codes, which are
//! not sent.

use std::ops::Range;

use crate::{paper, replayed};
use bead_model::layout::{BASELINE, PIECE};
use bead_model::{Chunk, Scan, Settings, Shape, Strike};
use bead_testing::Collector;

/// The scan that triggers.
const TRIGGER: u64 = 500;

/// Runs a meter on a rise of the force within a quarter of the range, and of a force and an acceleration
/// `loud` codes above their zeros in four scans from `at` on.
fn hear(settings: &Settings, loud: [u16; 2], at: u64) -> Collector {
    let scans: Vec<Scan> = (0..1500)
        .map(|index| {
            let noise = [0, 1, 3, 1, 2][(index % 5) as usize];
            let rise = if index >= TRIGGER { 100 } else { 0 };
            let loud = loud.map(|codes| if (at..at + 4).contains(&index) { codes } else { 0 });
            let [force, acceleration] = [noise + rise.max(loud[0]), noise + loud[1]];
            Scan::new([
                128 + force,
                130 + force / 16,
                2048 + acceleration,
                2046 + acceleration / 16,
            ])
        })
        .collect();
    let heard = Collector::measure(settings, 0, &scans);
    assert_eq!(heard.reports[0].trigger_index, TRIGGER);
    heard
}

/// The report of the same window with different wide codes in the pieces for which `wide` is false.
fn replay(settings: &Settings, heard: &Collector, wide: impl Fn(&Chunk) -> bool) -> (Strike, Shape) {
    let mut scans: Vec<Scan> = Vec::new();
    for chunk in &heard.chunks {
        if wide(chunk) {
            // The two scans before it come with it.
            let before = scans.len().saturating_sub(2);
            let known = scans.len() - before;
            scans[before..].copy_from_slice(&chunk.before[2 - known..]);
            scans.extend(&chunk.scans);
        } else {
            scans.extend(chunk.scans.iter().map(|scan| {
                let [force, force_wide, acceleration, acceleration_wide] = scan.codes();
                Scan::new([
                    force,
                    4095 - force_wide,
                    acceleration,
                    1000 + acceleration_wide / 2,
                ])
            }));
        }
    }
    let (window, record) = replayed(settings, heard.reports[0].first_index, &scans);
    window.report(settings, &record)
}

#[test]
#[cfg_attr(miri, ignore = "tens of thousands of scans")]
fn a_piece_is_loud_in_the_baseline_and_near_a_loud_code_and_only_there_do_wide_codes_matter() {
    let settings = paper();
    let history = u64::from(settings.window.history);
    for loud in [[1100, 0], [3950, 0], [0, 2000], [3950, 2000]] {
        // Wherever the loud scans begin in a piece.
        for at in TRIGGER + 40..TRIGGER + 40 + PIECE as u64 {
            let heard = hear(&settings, loud, at);
            let pieces = |chunk: &Chunk| chunk.first_index..chunk.first_index + PIECE as u64;
            for chunk in &heard.chunks {
                let Range { start, end } = pieces(chunk);
                let in_baseline = start < TRIGGER + 1 - history + u64::from(BASELINE);
                // The codes from at to at + 4 have a part in values up to at + 6.
                let expected = in_baseline || start < at + 6 && at < end;
                assert_eq!(chunk.loud, expected, "{loud:?}, {at}: {start}");
            }
            let report = (heard.reports[0], heard.shapes[0]);
            let same = replay(&settings, &heard, |chunk| chunk.loud);
            assert_eq!(same, report, "{loud:?}, {at}");
            // The result differs where the wide channel supplies the signal.
            let other = replay(&settings, &heard, |chunk| {
                chunk.loud && !pieces(chunk).contains(&at)
            });
            assert_eq!(other == report, loud == [1100, 0], "{loud:?}, {at}");
        }
    }
    let quiet = hear(&settings, [1000, 1000], TRIGGER + 50);
    let loud = quiet.chunks.iter().filter(|chunk| chunk.loud);
    assert_eq!(loud.count() * PIECE, usize::from(BASELINE));
}
