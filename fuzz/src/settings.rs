//! Blocks of settings, and what a meter does with those that are accepted.
//!
//! An input is a block, and what the sensors say: groups of five bytes, a number of scans and two codes for
//! all of them.

use bead_model::settings::BLOCK_MAX;
use bead_model::{Meter, Scan, Settings, StrikeFlags};
use bead_recording::physical::{parse, to_toml};
use bead_recording::signal::Signal;
use bead_recording::strikes::ScanCodes;
use bead_testing::Collector;

use crate::line::crc;

/// Scans that the bytes of an input stand for at most.
const SCANS_MOST: usize = 1500;

/// Reads the block as it is and with a right checksum.
///
/// # Panics
/// A block that was accepted is not written as it was read, or the meter leaves its ranges, or its results
/// depend on how scans are cut into calls.
pub fn check(bytes: &[u8]) {
    // Other inputs check what an accepted block holds.
    let _ = Settings::decode(bytes);
    let Some(length) = Settings::block_length(bytes).filter(|length| *length <= bytes.len()) else {
        return;
    };
    let (block, codes) = bytes.split_at(length);
    let covered = &block[..length - 4];
    let block = [covered, &crc(covered)].concat();
    let Ok(settings) = Settings::decode(&block) else {
        return;
    };
    let mut buffer = [0; BLOCK_MAX];
    let length = settings.encode(&mut buffer).expect("a block fits");
    let again = Settings::decode(&buffer[..length]).expect("what was written is a block");
    assert_eq!(again, settings);
    let mut second = [0; BLOCK_MAX];
    assert_eq!(again.encode(&mut second), Ok(length));
    assert_eq!(buffer, second);
    shown(&settings);
    measured(&settings, codes);
}

/// Checks that settings come back unchanged from the file that shows them.
fn shown(settings: &Settings) {
    let description = settings.description();
    serde_json::to_string(description).expect("settings are JSON");
    let text = to_toml(description);
    assert!(!text.contains(|c: char| c.is_control() && c != '\n'), "{text:?}");
    match parse(&text, "bead.toml") {
        Ok(same) => assert_eq!(same, *settings, "{text}"),
        // The image has one sample rate.
        Err(error) => assert_eq!(error.key, "capture.sample_rate", "{error}: {text}"),
    }
}

fn scans(settings: &Settings, bytes: &[u8]) -> Vec<Scan> {
    let scan = |force: u16, acceleration: u16| {
        let [force, acceleration] = [force, acceleration].map(|code| code & 0xFFF);
        Scan::new([force, force / 8, acceleration, acceleration / 8 + 1792])
    };
    // The meter arms after a history of quiet, and a window ends in time.
    let mut scans = vec![scan(100, 2048); 2 * usize::from(settings.window.history) + 1];
    let before = scans.len();
    for group in bytes.chunks_exact(5) {
        let [many, f, g, a, b] = [group[0], group[1], group[2], group[3], group[4]];
        let many = usize::from(many).min(before + SCANS_MOST - scans.len());
        scans.resize(
            scans.len() + many,
            scan(u16::from_le_bytes([f, g]), u16::from_le_bytes([a, b])),
        );
    }
    let quiet = usize::from(settings.window.length);
    scans.resize(scans.len() + quiet, scan(100, 2048));
    scans
}

fn measured(settings: &Settings, bytes: &[u8]) {
    let scans = scans(settings, bytes);
    let first = 1 << 40;
    let run = |lengths: &mut dyn Iterator<Item = usize>| {
        let (mut meter, mut said) = (Box::new(Meter::new()), Collector::default());
        let (mut index, mut rest) = (first, &scans[..]);
        while !rest.is_empty() {
            let (some, after) = rest.split_at(lengths.next().unwrap_or(256).clamp(1, rest.len()));
            meter.process(settings, index, some.iter().copied(), &mut said);
            (index, rest) = (index + some.len() as u64, after);
        }
        // Quiet scans let the bead measure the strikes that still wait.
        for _ in 0..12 {
            let quiet = [*scans.last().expect("there are scans"); 256];
            meter.process(settings, index, quiet, &mut said);
            index += 256;
        }
        said
    };
    let said = run(&mut std::iter::repeat(64));
    let mut lengths = bytes.iter().map(|byte| usize::from(*byte) + 1);
    let other = run(&mut lengths);
    assert_eq!(said.reports, other.reports);
    assert_eq!(said.chunks, other.chunks);
    for report in &said.reports {
        let chunks = said.chunks.iter().filter(|chunk| chunk.strike == report.strike);
        let codes: Vec<Scan> = chunks.flat_map(|chunk| chunk.scans.iter().copied()).collect();
        assert_eq!(codes.len(), usize::from(report.samples));
        let is_cut = report.flags.has(StrikeFlags::WINDOW_CUT);
        assert_eq!(is_cut, report.samples < settings.window.length);
        let codes: Vec<ScanCodes> = codes.iter().map(codes_of).collect();
        let _ = Signal::of(&codes, settings);
    }
}

fn codes_of(scan: &Scan) -> ScanCodes {
    ScanCodes {
        sensitive: scan.sensitive(),
        wide: Some(scan.wide()),
    }
}
