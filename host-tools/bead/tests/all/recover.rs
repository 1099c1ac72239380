//! Recorders that are killed or flooded, and `bead recover`: data lost, and memory.

use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::Stdio;
use std::thread;
use std::time::{Duration, Instant};

use crate::program::{DATA, RunningProgram, TestFolder, interruptible, tcp};
use bead_console::interrupt::PATIENCE;
use bead_recording::file::{Recording, State};
use bead_recording::frames::{Frame, Item, decode};
use bead_testing::{Speaker, xorshift};
use bead_wire::{Kind, Message};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

/// Longest part that a killed recorder may lose at the end, as `bead record --help` promises.
const LOST_MOST: Duration = Duration::from_secs(2);
/// Memory that a recorder takes at most, as `bead record --help` promises.
const MEMORY_MOST_KB: u64 = 256 * 1024;

/// The frame with this number: an identity first, then states that are drawn.
fn frame(boot: u32, sequence: u32) -> Vec<u8> {
    let mut bead = Speaker {
        boot,
        sequence,
        ..Speaker::at(0)
    };
    let message = match sequence {
        0 => bead.identity().into(),
        _ => Message::draw(Kind::Status, &mut xorshift(sequence.into())),
    };
    bead.frame(100 * u64::from(sequence), &message)
}

/// Starts a recorder whose output is discarded.
fn record(folder: &Path, arguments: &str) -> RunningProgram {
    let mut command = interruptible(folder, &format!("record {arguments}"));
    let silent = command.stdout(Stdio::null()).stderr(Stdio::null());
    RunningProgram::of(silent.spawn().unwrap())
}

/// Peak memory of a process, kB. `None` if it has ended.
fn peak_kb(program: &RunningProgram) -> Option<u64> {
    let status = fs::read_to_string(format!("/proc/{}/status", program.child.id())).ok()?;
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    peak.trim().trim_end_matches(" kB").parse().ok()
}

fn recover(folder: &TestFolder, arguments: &str) -> Value {
    folder.json(&format!("recover --format json {arguments}"))
}

/// The bytes of the recording in `tests/data`.
pub(crate) fn old_bytes() -> Vec<u8> {
    let old = Recording::open(&Path::new(DATA).join("recording-v1.mcap")).unwrap();
    old.pieces().unwrap().flat_map(|piece| piece.bytes).collect()
}

/// True if these bytes are a frame of a kind.
pub(crate) fn is_of(run: &[u8], kind: Kind) -> bool {
    let (frames, _) = decode(run);
    frames.first().is_some_and(|frame| frame.message.kind() == kind)
}

/// Sends frames to a recorder and kills it, after a silence if the seed is even. Returns the number of frames
/// sent more than `LOST_MOST` before, and of frames recovered.
fn killed(seed: u64, folder: &TestFolder) -> (u32, u32) {
    let (listener, port) = tcp();
    let name = format!("{seed}.mcap");
    let mut recorder = record(folder, &format!("--port {port} --out {name} --duration 100"));
    let (mut bead, _) = listener.accept().unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let lasts = Duration::from_millis(2200 + random.random_range(0..2000));
    let started = Instant::now();
    let mut sent = Vec::new();
    while started.elapsed() < lasts {
        bead.write_all(&frame(1, sent.len() as u32)).unwrap();
        sent.push(Instant::now());
        if sent.len().is_multiple_of(10) {
            thread::sleep(Duration::from_millis(random.random_range(1..20)));
        }
    }
    if seed.is_multiple_of(2) {
        thread::sleep(LOST_MOST);
    }
    recorder.child.kill().unwrap();
    let end = Instant::now();
    recorder.child.wait().unwrap();
    let is_due = |at: &&Instant| end.duration_since(**at) >= LOST_MOST;
    let due = sent.iter().filter(is_due).count() as u32;
    let report = recover(folder, &format!("{name}.partial"));
    let recording = Recording::open(&folder.join(&name)).unwrap();
    assert_eq!(recording.state, State::Whole);
    let frames = recording.frames().unwrap().filter_map(Item::frame);
    let frames: Vec<u32> = frames.map(|frame| frame.header.sequence).collect();
    assert_eq!(report["frames"], frames.len(), "{report}");
    // None is missing among them.
    assert_eq!(frames, (0..frames.len() as u32).collect::<Vec<_>>());
    (due, frames.len() as u32)
}

#[test]
fn a_recorder_that_is_killed_twenty_times_never_loses_more_than_its_help_says() {
    let folder = &TestFolder::new();
    thread::scope(|scope| {
        let run = |seed| scope.spawn(move || killed(seed, folder));
        for run in (0..20).map(run).collect::<Vec<_>>() {
            let (due, kept) = run.join().unwrap();
            assert!(due > 0 && kept >= due, "{kept} kept of {due}");
        }
    });
}

#[test]
fn a_flood_of_strikes_of_noise_and_of_restarts_costs_bounded_memory_and_ends_at_the_first_signal() {
    let restarts: Vec<u8> = (0..=255).flat_map(|boot| frame(boot, 0)).collect();
    let strikes = old_bytes().repeat(16);
    let noise = b"x\0".repeat(32 << 10);
    for flood in [strikes, restarts, noise, vec![0; 64 << 10], vec![1; 64 << 10]] {
        let folder = TestFolder::new();
        let (listener, port) = tcp();
        let mut recorder = record(&folder, &format!("--port {port} --out a.mcap --duration 100"));
        let (mut bead, _) = listener.accept().unwrap();
        let sender = thread::spawn(move || {
            let mut sent = 0;
            // Until the recorder hangs up.
            while sent < 200 << 20 && bead.write_all(&flood).is_ok() {
                sent += flood.len() as u64;
            }
            (sent, bead)
        });
        thread::sleep(Duration::from_secs(2));
        let memory = peak_kb(&recorder).unwrap();
        let signalled = Instant::now();
        recorder.signal("INT");
        assert!(recorder.child.wait().unwrap().code().is_some());
        let took = signalled.elapsed();
        let (sent, _) = sender.join().unwrap();
        let [sent_mb, memory_mb] = [sent >> 20, memory >> 10];
        println!("{sent_mb} MB sent, {memory_mb} MB of memory, ended after {took:?}");
        // Twice, since a busy machine takes longer; without the signal it would go on for more than a minute.
        assert!(took < 2 * PATIENCE, "{took:?}");
        assert!(memory < MEMORY_MOST_KB, "{memory} kB after {sent} bytes");
        // There is one file.
        let length = folder.read(folder.names()).len() as u64;
        assert!(length < 4 * sent + 100_000, "{length}");
    }
}

#[test]
fn a_recording_that_is_cut_within_a_strike_is_said_to_lack_its_result() {
    let folder = TestFolder::new();
    let sent = old_bytes();
    let runs: Vec<&[u8]> = sent.split_inclusive(|byte| *byte == 0).collect();
    let is_strike = |run: &&[u8]| is_of(run, Kind::Strike);
    let first = runs.iter().position(is_strike).unwrap();
    for (kept, without) in [(runs.len(), 0), (first + 1, 0), (first, 1), (first - 3, 1)] {
        folder.write("uart.bin", runs[..kept].concat());
        let report = recover(&folder, "uart.bin --out a.mcap --overwrite");
        assert_eq!(report["strikes_without_result"], without, "{kept} runs: {report}");
    }
}

#[test]
fn a_damaged_recording_is_made_whole_and_a_raw_stream_becomes_one() {
    let folder = TestFolder::new();
    let sent: Vec<u8> = (0..2000).flat_map(|number| frame(1, number)).collect();
    folder.write("uart.bin", &sent);
    assert_eq!(recover(&folder, "uart.bin --out a.mcap")["frames"], 2000);
    // A sector that holds frames, and the one at the beginning.
    let mut file = folder.read("a.mcap");
    let begin = &frame(1, 1000)[1..21];
    let middle = file.windows(20).position(|bytes| bytes == begin).unwrap();
    for sector in [0, middle] {
        file[sector..sector + 512].fill(0xFF);
    }
    folder.write("bad.mcap", &file);
    folder.refused("2 | its beginning may be damaged; try: bead recover bad.mcap | replay bad.mcap");
    let report = recover(&folder, "bad.mcap");
    let recovered = Recording::open(&folder.join("bad-recovered.mcap")).unwrap();
    assert_eq!(recovered.state, State::Whole);
    let frames: Vec<_> = recovered.frames().unwrap().filter_map(Item::frame).collect();
    assert!(frames.len() > 2000 - 40, "{}", frames.len());
    let (all, _) = decode(&sent);
    let mut rest = all.iter();
    let is_sent = |frame: &Frame| rest.any(|sent| sent.header == frame.header);
    assert!(frames.iter().all(is_sent));
    assert_eq!(report["frames"], frames.len());
    assert!(report["runs_missing"].as_u64().unwrap() > 0, "{report}");
    assert!(report["found"].as_str().unwrap().contains("bytes in"), "{report}");
}
