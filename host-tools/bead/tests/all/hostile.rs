//! Recordings that no bead would send: fields at the ends of their ranges, and repeated numbers. Every
//! command reads them without a panic in limited memory.

use std::path::Path;
use std::process::{Command, Output};

use crate::program::{PROGRAM, SCENARIO, TestFolder, done, said};
use bead_testing::{Speaker, xorshift};
use bead_wire::{Body, Kind, Message, Strike, Waveform};

/// Greatest address space of a command, kB. Threads and libraries take some 300 MB of it, and hardly any
/// memory.
const MEMORY_MOST_KB: u32 = 800_000;

/// Runs `bead` in a folder with little memory.
fn bead(folder: &Path, arguments: &str) -> Output {
    let line = format!("ulimit -v {MEMORY_MOST_KB}; exec {PROGRAM} {arguments}");
    let mut command = Command::new("bash");
    let command = command.current_dir(folder).env("RAYON_NUM_THREADS", "2");
    command.args(["-c", &line]).output().unwrap()
}

/// A folder with a stream as the bead sent it, `raw.bin`, and as a recording, `a.mcap`.
fn recorded(stream: &Speaker) -> TestFolder {
    let folder = TestFolder::new();
    folder.write("raw.bin", &stream.bytes);
    done(bead(&folder, "recover raw.bin --out a.mcap"));
    folder
}

/// Gives a stream to each command that reads recordings.
fn read_by_all(stream: &Speaker) {
    let folder = recorded(stream);
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
        let output = bead(&folder, command);
        let (said, status) = (said(&output), output.status);
        let is_sound = status.code().is_some_and(|code| code < 3) && !said.contains("panicked");
        assert!(is_sound, "{command}: {status}: {said}");
    }
}

#[test]
fn fields_at_the_ends_of_their_ranges_are_read_by_every_command() {
    let mut stream = Speaker::at(1);
    let mut random = xorshift(0x2545_f491_4f6c_dd1d);
    for round in 0..12 {
        // Each boot ends with its round.
        stream.boot = round;
        for &kind in Kind::ALL {
            let mut draw = || match round % 4 {
                0 => u64::MAX,
                1 => 0,
                // Near the ends of every width.
                2 => u64::MAX - random() % 3,
                _ => random(),
            };
            let index = draw();
            stream.say(index, Message::draw(kind, &mut draw));
        }
    }
    read_by_all(&stream);
}

#[test]
fn strikes_and_waveforms_that_all_have_one_number_cost_no_memory() {
    let mut random = xorshift(0x9E37_79B9_7F4A_7C15);
    let (waveform, result) = (Waveform::draw(&mut random), Strike::draw(&mut random));
    let mut stream = Speaker::at(1);
    // A strike of one number, again and again, with more waveforms than a window has samples; then numbers at
    // both sides of 2^32, and first indices near 2^64.
    for n in 0..3000_u32 {
        let strike = if n < 2000 { 7 } else { u32::MAX.wrapping_add(n % 3) };
        let first_index = if n % 2 == 0 { 1000 } else { u64::MAX - 10 };
        let (mut waveform, mut result) = (waveform.clone(), result);
        (waveform.strike, waveform.first_index) = (strike, first_index);
        (result.strike, result.first_index) = (strike, first_index);
        result.samples = if n % 5 == 0 { 0 } else { u16::MAX };
        stream.say(n.into(), waveform);
        stream.say(n.into(), result);
    }
    read_by_all(&stream);
}
