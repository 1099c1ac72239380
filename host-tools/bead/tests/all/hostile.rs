//! Recordings that no bead would send: fields at the ends of their ranges, and numbers that repeat. No
//! command may panic or take more memory for them.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use bead_model::design::{Bead, Capture, FrontEnd, derive};
use bead_model::settings::BLOCK_MAX;
use bead_testing::Speaker;
use bead_wire::{Block, Codes, Kind, Message, Shape, Strike, StrikeFlags, Waveform};

const SCENARIO: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../docs/scenarios/paper-strike.toml"
);
/// Addresses that a command may use, kB. Threads and libraries take some 300 MB of them, and hardly any
/// memory.
const MEMORY_MOST_KB: u32 = 800_000;

/// Adds a frame of this boot.
fn say(bead: &mut Speaker, boot: u8, sample_index: u64, message: &Message) {
    bead.boot = boot.into();
    bead.say(sample_index, message.clone());
}

/// Runs `bead` with little memory.
fn bead(folder: &Path, arguments: &str) -> Output {
    let line = format!(
        "ulimit -v {MEMORY_MOST_KB}; exec {} {arguments}",
        env!("CARGO_BIN_EXE_bead")
    );
    Command::new("bash")
        .current_dir(folder)
        .env("RAYON_NUM_THREADS", "2")
        .args(["-c", &line])
        .output()
        .unwrap()
}

/// Gives these bytes to each command that reads recordings, as a recording and as they came.
fn read_by_all(bytes: &[u8]) {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::write(folder.join("raw.bin"), bytes).unwrap();
    let made = bead(folder, "recover raw.bin --out a.mcap");
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    for command in [
        "decode raw.bin",
        "decode a.mcap",
        "replay a.mcap",
        "replay a.mcap --format json",
        &format!("compare a.mcap --scenario {SCENARIO} --report a.html"),
        &format!("compare a.mcap --scenario {SCENARIO} --velocity fit --format json"),
        "clock a.mcap",
        "export a.mcap --out tables",
        "recover a.mcap --out b.mcap",
    ] {
        let output = bead(folder, command);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(
            output.status.code().is_some_and(|code| code < 3) && !said.contains("panicked"),
            "{command}: {}: {said}",
            output.status
        );
    }
}

#[test]
fn fields_at_the_ends_of_their_ranges_are_read_by_every_command() {
    let mut stream = Speaker::at(1);
    let mut state = 0x2545_f491_4f6c_dd1d_u64;
    for round in 0..12_u8 {
        for &kind in Kind::ALL {
            let mut drawn = || {
                state ^= state << 13;
                state ^= state >> 7;
                state ^= state << 17;
                match round % 4 {
                    0 => u64::MAX,
                    1 => 0,
                    // Near the ends of every width.
                    2 => u64::MAX - state % 3,
                    _ => state,
                }
            };
            let index = drawn();
            // Each boot ends with its round.
            say(&mut stream, round, index, &Message::draw(kind, &mut drawn));
        }
    }
    read_by_all(&stream.bytes);
}

#[test]
fn strikes_and_waveforms_that_all_have_one_number_cost_no_memory() {
    let mut numbers = (0..).map(|n: u64| n.wrapping_mul(0x9E37_79B9_7F4A_7C15));
    let Message::Waveform(waveform) = Message::draw(Kind::Waveform, &mut || numbers.next().unwrap()) else {
        panic!("a waveform");
    };
    let Message::Strike(strike) = Message::draw(Kind::Strike, &mut || numbers.next().unwrap()) else {
        panic!("a strike");
    };
    let mut stream = Speaker::at(1);
    // A strike of one number, again and again, with more waveforms than a window has samples; then numbers at
    // both sides of 2^32, and first indices near 2^64.
    for n in 0..3000_u32 {
        let number = if n < 2000 { 7 } else { u32::MAX.wrapping_add(n % 3) };
        let first_index = if n % 2 == 0 { 1000 } else { u64::MAX - 10 };
        say(
            &mut stream,
            0,
            u64::from(n),
            &Message::from(Waveform {
                strike: number,
                first_index,
                ..waveform.clone()
            }),
        );
        say(
            &mut stream,
            0,
            u64::from(n),
            &Message::from(Strike {
                strike: number,
                first_index,
                samples: if n % 5 == 0 { 0 } else { u16::MAX },
                ..strike
            }),
        );
    }
    read_by_all(&stream.bytes);
}

#[test]
fn windows_at_the_ends_of_the_indices_and_frames_without_samples_are_read_by_every_command() {
    let settings = derive(&Bead::paper(), &FrontEnd::reference(), &Capture::default()).unwrap();
    let mut block = [0; BLOCK_MAX];
    let length = settings.encode(&mut block).unwrap();
    let block = Block::try_from(&block[..length]).unwrap();
    let [identity, waveform, strike, shape] = [Kind::Identity, Kind::Waveform, Kind::Strike, Kind::Shape]
        .map(|kind| Message::draw(kind, &mut || 100_000));
    let (Message::Waveform(waveform), Message::Strike(strike), Message::Shape(shape)) =
        (waveform, strike, shape)
    else {
        panic!("not what was asked for");
    };
    let mut stream = Speaker::at(1);
    say(&mut stream, 0, 0, &identity);
    say(&mut stream, 0, 0, &bead_wire::Settings { block }.into());
    let mut number = 0;
    // The window alone, with a frame that has no samples, and without its end.
    for (first_index, samples) in [0, 1, 3, 31, 95, 361, 671, 672, 800]
        .map(|before_end| u64::MAX - before_end)
        .into_iter()
        .chain([0, 1000])
        .flat_map(|first| [0, 4, 32, 96, 672].map(|samples| (first, samples)))
    {
        for (empty, cut, flags) in [(false, 0, 0), (true, 0, 0), (false, 32, 0), (false, 0, 1 << 10)] {
            number += 1;
            let piece = |first_index: u64, scans: u16| {
                let codes = Codes::pack((0..scans).map(|_| [100, 2048])).unwrap();
                Message::from(Waveform {
                    strike: number,
                    first_index,
                    codes,
                    wide: Codes::default(),
                    ..waveform.clone()
                })
            };
            if empty {
                say(&mut stream, 0, 0, &piece(first_index, 0));
            }
            for at in (0..u16::saturating_sub(samples, cut)).step_by(32) {
                say(
                    &mut stream,
                    0,
                    0,
                    &piece(first_index.wrapping_add(at.into()), (samples - at).min(32)),
                );
            }
            let strike = Strike {
                strike: number,
                first_index,
                trigger_index: first_index,
                samples,
                flags: StrikeFlags::from_bits(flags),
                ..strike
            };
            say(&mut stream, 0, 0, &strike.into());
            let shape = Shape {
                strike: number,
                first_index,
                ..shape
            };
            say(&mut stream, 0, 0, &shape.into());
        }
    }
    read_by_all(&stream.bytes);
}

#[test]
fn of_very_many_runs_that_are_no_frames_the_first_are_printed_and_all_are_counted() {
    let mut stream = Speaker::at(1);
    say(&mut stream, 0, 0, &Message::draw(Kind::Health, &mut || 0));
    stream.bytes.extend([1, 0].repeat(5000));
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::write(folder.join("raw.bin"), &stream.bytes).unwrap();
    let decoded = bead(folder, "decode raw.bin");
    assert!(decoded.status.success());
    let said = String::from_utf8_lossy(&decoded.stderr);
    let lines: Vec<_> = said.lines().collect();
    let [told @ .., more, last] = &lines[..] else {
        panic!("{said}");
    };
    assert_eq!(told.len(), 1000);
    assert!(
        more.contains("more than 1000 runs of bytes are refused"),
        "{more}"
    );
    assert!(last.contains(" 5000 refused"), "{last}");
}

#[test]
fn boots_beyond_those_whose_clocks_are_fitted_are_printed_and_told() {
    let mut numbers = 1..;
    let identity = Message::draw(Kind::Identity, &mut || numbers.next().unwrap());
    let mut stream = Speaker::at(1);
    for boot in 0..4100_u32 {
        stream.sequence = 0;
        say(&mut stream, boot as u8, 0, &identity);
    }
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::write(folder.join("raw.bin"), &stream.bytes).unwrap();
    assert!(bead(folder, "recover raw.bin --out a.mcap").status.success());
    let decoded = bead(folder, "decode a.mcap");
    assert!(decoded.status.success());
    let lines = decoded.stdout.iter().filter(|&&byte| byte == b'\n').count();
    assert_eq!(lines, 4100);
    let said = String::from_utf8_lossy(&decoded.stderr);
    assert!(
        said.contains("boots of beads after the first 4096 have no host_time"),
        "{said}"
    );
}
