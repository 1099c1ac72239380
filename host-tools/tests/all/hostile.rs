//! Recordings that no bead would send: fields at the ends of their ranges, and numbers that repeat. No command may
//! panic or take more memory for them.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use bead_wire::{Header, Kind, MAX_FRAME, Message, Strike, Waveform, encode};

const SCENARIO: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/scenarios/paper-strike.toml");
/// Addresses that a command may use, kB. Threads and libraries take some 300 MB of them, and hardly any memory.
const MEMORY_MOST_KB: u32 = 800_000;

/// Frames one after another, each with a boot, and the sample index that a function of its number gives.
#[derive(Default)]
struct Stream {
    bytes: Vec<u8>,
    sequence: u32,
}

impl Stream {
    fn say(&mut self, boot: u8, sample_index: u64, message: &Message) {
        let header = Header {
            address: 1,
            boot,
            sequence: self.sequence,
            sample_index,
        };
        self.sequence = self.sequence.wrapping_add(1);
        self.bytes
            .extend(encode(&header, message, &mut [0; MAX_FRAME]).unwrap());
    }
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

/// What each command that reads recordings says of these bytes, as a recording and as they came.
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
    let mut stream = Stream::default();
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
            stream.say(round, index, &Message::draw(kind, &mut drawn));
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
    let mut stream = Stream::default();
    // A strike of one number, again and again, with more waveforms than a window has samples; then numbers at both
    // sides of 2^32, and first indices near 2^64.
    for n in 0..3000_u32 {
        let number = if n < 2000 { 7 } else { u32::MAX.wrapping_add(n % 3) };
        let first_index = if n % 2 == 0 { 1000 } else { u64::MAX - 10 };
        stream.say(
            0,
            u64::from(n),
            &Message::from(Waveform {
                strike: number,
                first_index,
                ..waveform.clone()
            }),
        );
        stream.say(
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
fn boots_beyond_those_whose_clocks_are_fitted_are_printed_and_told() {
    let mut numbers = 1..;
    let identity = Message::draw(Kind::Identity, &mut || numbers.next().unwrap());
    let mut stream = Stream::default();
    for boot in 0..4100_u32 {
        stream.sequence = 0;
        stream.say(boot as u8, 0, &identity);
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
