//! Recorders that are killed or flooded, and `bead recover`: what is lost, and what it costs.

use std::fs;
use std::io::Write;
use std::net::TcpListener;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use crate::program::{self, bead};
use bead_recording::file::{Recording, State};
use bead_recording::frames::{Item, decode};
use bead_wire::{Header, Identity, MAX_FRAME, Message, ResetCauses, Status, encode};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

/// Longest part that a killed recorder may lose at the end, as `bead record --help` promises.
const LOST_MOST: Duration = Duration::from_secs(2);
/// Promised memory of a recorder, with some for what the system counts as the program's.
const MEMORY_MOST_KB: u64 = 128 * 1024;

fn frame(boot: u8, sequence: u32, message: &Message) -> Vec<u8> {
    let header = Header {
        address: 0,
        boot,
        sequence,
        sample_index: 100 * u64::from(sequence),
    };
    encode(&header, message, &mut [0; MAX_FRAME]).unwrap().to_vec()
}

fn identity(boot: u8) -> Vec<u8> {
    let identity = Identity {
        firmware: "0.1.0".into(),
        git: "abc".into(),
        uid: [7; 12],
        boot: boot.into(),
        reset_cause: ResetCauses::from_bits(4),
        sample_rate_hz: 100_000,
        channels: 4,
    };
    frame(boot, 0, &identity.into())
}

fn status(sequence: u32) -> Vec<u8> {
    let mut numbers = (1..).map(|n: u32| n.wrapping_mul(0x9E37_79B9));
    let message = Message::draw(bead_wire::Kind::Status, &mut || numbers.next().unwrap().into());
    let Message::Status(status) = message else {
        panic!("a status");
    };
    frame(
        1,
        sequence,
        &Status {
            strikes: sequence,
            ..status
        }
        .into(),
    )
}

/// A recorder of a TCP port; killed if the test fails.
struct Recorder(Child);

impl Recorder {
    fn start(folder: &Path, port: &str, out: &str) -> Self {
        let child = program::interruptible(folder)
            .args(["record", "--port", port, "--out", out, "--duration", "100"])
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        Self(child)
    }

    /// Greatest memory that it ever had, in KB.
    fn memory(&self) -> u64 {
        self.peak().unwrap()
    }

    /// Peak memory of the process; `None` if it has just ended.
    fn peak(&self) -> Option<u64> {
        let status = fs::read_to_string(format!("/proc/{}/status", self.0.id())).ok()?;
        let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
        peak.trim().trim_end_matches(" kB").parse().ok()
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn recover(folder: &Path, arguments: &[&str]) -> Value {
    program::json(&bead(
        folder,
        &[&["recover", "--format", "json"], arguments].concat(),
    ))
}

/// Sends frames to a recorder and kills it. Returns how many were sent `LOST_MOST` before that, and how many
/// of the first ones are in what is recovered.
fn killed(seed: u64, folder: &Path) -> (u32, u32) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let name = format!("{seed}.mcap");
    let port = format!("tcp:{}", listener.local_addr().unwrap());
    let mut recorder = Recorder::start(folder, &port, &name);
    let (mut bead, _) = listener.accept().unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let lasts = Duration::from_millis(2200 + random.random_range(0..2000));
    let started = Instant::now();
    let mut sent = Vec::new();
    bead.write_all(&identity(1)).unwrap();
    for number in 1.. {
        if started.elapsed() > lasts {
            break;
        }
        bead.write_all(&status(number)).unwrap();
        sent.push(Instant::now());
        if number % 10 == 0 {
            thread::sleep(Duration::from_millis(random.random_range(1..20)));
        }
    }
    recorder.0.kill().unwrap();
    let end = Instant::now();
    recorder.0.wait().unwrap();
    let due = sent
        .iter()
        .filter(|at| end.duration_since(**at) >= LOST_MOST)
        .count() as u32;
    let told = recover(folder, &[&format!("{name}.partial")]);
    let recording = Recording::open(&folder.join(&name)).unwrap();
    assert_eq!(recording.state, State::Whole);
    let frames: Vec<u32> = recording
        .frames()
        .unwrap()
        .filter_map(Item::frame)
        .map(|frame| frame.header.sequence)
        .collect();
    assert_eq!(told["frames"], frames.len(), "{told}");
    // None is missing among them.
    assert_eq!(frames, (0..frames.len() as u32).collect::<Vec<_>>());
    (due, (frames.len() as u32).saturating_sub(1))
}

#[test]
fn a_recorder_that_is_killed_twenty_times_never_loses_more_than_its_help_says() {
    let folder = tempfile::tempdir().unwrap();
    thread::scope(|scope| {
        let runs: Vec<_> = (0..20)
            .map(|seed| {
                let folder = folder.path();
                scope.spawn(move || killed(seed, folder))
            })
            .collect();
        for run in runs {
            let (due, kept) = run.join().unwrap();
            assert!(due > 0 && kept >= due, "{kept} kept of {due}");
        }
    });
}

#[test]
fn a_flood_of_noise_and_of_restarts_costs_bounded_memory_and_ends_at_the_first_signal() {
    let noise = b"x\0".repeat(32 * 1024);
    let restarts: Vec<u8> = (0..=255).flat_map(identity).collect();
    let zeros = vec![0; 64 * 1024];
    let line = vec![1; 64 * 1024];
    for flood in [noise, restarts, zeros, line] {
        let folder = tempfile::tempdir().unwrap();
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = format!("tcp:{}", listener.local_addr().unwrap());
        let mut recorder = Recorder::start(folder.path(), &port, "a.mcap");
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
        let asked = Instant::now();
        let interrupt = format!("kill -INT {}", recorder.0.id());
        let memory = recorder.memory();
        assert!(
            Command::new("sh")
                .args(["-c", &interrupt])
                .status()
                .unwrap()
                .success()
        );
        assert!(recorder.0.wait().unwrap().code().is_some());
        let took = asked.elapsed();
        let (sent, _) = sender.join().unwrap();
        println!(
            "{} MB sent, {} MB of memory, ended after {took:?}",
            sent >> 20,
            memory >> 10
        );
        assert!(took < Duration::from_secs(6), "{took:?}");
        assert!(memory < MEMORY_MOST_KB, "{memory} kB after {sent} bytes");
        let names: Vec<_> = fs::read_dir(&folder)
            .unwrap()
            .map(|entry| entry.unwrap())
            .collect();
        assert_eq!(names.len(), 1);
        assert!(names[0].metadata().unwrap().len() < 4 * sent + 100_000);
    }
}

#[test]
#[ignore = "five minutes and 20 GB of disk: cargo test --release -p absorber-bead --test all five_gigabytes -- --ignored --nocapture"]
fn five_gigabytes_of_strikes_are_recorded_in_the_memory_of_any_other_recording() {
    const SENT: u64 = 5_000_000_000;
    let old = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/recording-v1.mcap");
    let old = Recording::open(Path::new(old)).unwrap();
    let strike: Vec<u8> = old.pieces().unwrap().flat_map(|piece| piece.bytes).collect();
    let block = strike.repeat((4 << 20) / strike.len());
    let folder = tempfile::tempdir().unwrap();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = format!("tcp:{}", listener.local_addr().unwrap());
    let arguments = [
        "record",
        "--port",
        &port,
        "--out",
        "a.mcap",
        "--wait",
        "0",
        "--no-fetch",
    ];
    let mut recorder = Recorder(
        Command::new(env!("CARGO_BIN_EXE_bead"))
            .current_dir(&folder)
            .args(arguments)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap(),
    );
    let (mut bead, _) = listener.accept().unwrap();
    let mut sent = 0;
    while sent < SENT {
        bead.write_all(&block).unwrap();
        sent += block.len() as u64;
    }
    drop(bead);
    let mut memory = 0;
    while recorder.0.try_wait().unwrap().is_none() {
        memory = recorder.peak().unwrap_or(memory);
        thread::sleep(Duration::from_millis(20));
    }
    println!("{sent} bytes, {} MB of memory", memory >> 10);
    assert!((1..MEMORY_MOST_KB).contains(&memory), "{memory} kB");
    let recording = Recording::open(&folder.path().join("a.mcap")).unwrap();
    let runs = sent / strike.len() as u64 * strike.iter().filter(|&&byte| byte == 0).count() as u64;
    assert_eq!(recording.runs, runs);
}

#[test]
fn a_recording_that_is_cut_within_a_strike_is_said_to_lack_its_result() {
    let folder = tempfile::tempdir().unwrap();
    let old = Recording::open(Path::new(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../tests/data/recording-v1.mcap"
    )));
    let sent: Vec<u8> = old
        .unwrap()
        .pieces()
        .unwrap()
        .flat_map(|piece| piece.bytes)
        .collect();
    let runs: Vec<&[u8]> = sent.split_inclusive(|byte| *byte == 0).collect();
    let is_strike = |run: &&[u8]| {
        matches!(
            decode(run).0.first().map(|frame| &frame.message),
            Some(Message::Strike(_))
        )
    };
    let first = runs.iter().position(is_strike).unwrap();
    for (kept, without) in [(runs.len(), 0), (first + 1, 0), (first, 1), (first - 3, 1)] {
        fs::write(folder.path().join("uart.bin"), runs[..kept].concat()).unwrap();
        let told = recover(folder.path(), &["uart.bin", "--out", "a.mcap", "--overwrite"]);
        assert_eq!(
            told["strikes_without_result"],
            without,
            "{kept} of {} runs: {told}",
            runs.len()
        );
    }
}

#[test]
fn a_damaged_recording_is_made_whole_and_a_raw_stream_becomes_one() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let sent: Vec<u8> = std::iter::once(identity(1))
        .chain((1..2000).map(status))
        .flatten()
        .collect();
    fs::write(at("uart.bin"), &sent).unwrap();
    // What is no recording is named as what it is, with what to do.
    for command in ["replay", "compare", "clock"] {
        let scenario = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../docs/scenarios/paper-strike.toml"
        );
        let more = if command == "compare" {
            &["--scenario", scenario][..]
        } else {
            &[]
        };
        let output = bead(folder.path(), &[&[command, "uart.bin"], more].concat());
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains("bead recover uart.bin"), "{said}");
    }
    let told = recover(folder.path(), &["uart.bin", "--out", "a.mcap"]);
    assert_eq!(told["frames"], 2000);
    // A sector in the middle, and the one at the beginning.
    let mut file = fs::read(at("a.mcap")).unwrap();
    file[..512].fill(0xFF);
    let middle = file.len() / 2;
    file[middle..middle + 512].fill(0xFF);
    fs::write(at("bad.mcap"), &file).unwrap();
    let output = bead(folder.path(), &["replay", "bad.mcap"]);
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(
        said.contains("its beginning may be damaged; try: bead recover bad.mcap"),
        "{said}"
    );
    let told = recover(folder.path(), &["bad.mcap"]);
    let recovered = Recording::open(&at("bad-recovered.mcap")).unwrap();
    assert_eq!(recovered.state, State::Whole);
    let kept: Vec<u8> = recovered
        .pieces()
        .unwrap()
        .flat_map(|piece| piece.bytes)
        .collect();
    let (frames, _) = decode(&kept);
    let (all, _) = decode(&sent);
    assert!(frames.len() > all.len() - 40, "{}", frames.len());
    let mut rest = all.iter();
    assert!(
        frames
            .iter()
            .all(|frame| rest.any(|sent| sent.header == frame.header))
    );
    assert_eq!(told["frames"], frames.len());
    assert!(told["runs_missing"].as_u64().unwrap() > 0, "{told}");
    assert!(told["found"].as_str().unwrap().contains("bytes in"), "{told}");
    // There is nothing in what is nothing.
    fs::write(at("nothing.mcap"), b"time,force\n0,1\n").unwrap();
    let output = bead(folder.path(), &["recover", "nothing.mcap"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(!at("nothing-recovered.mcap").exists());
}
