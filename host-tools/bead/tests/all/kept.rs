//! `bead record` at beads that store their strikes: a cable that is pulled, resets meanwhile, several ports
//! and wrong ones. And `bead fetch`.

use std::fs;
use std::io::{ErrorKind, Read, Write};
use std::mem;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};

use crate::answering::AnsweringBead;
use crate::program::{RunningProgram, TestFolder, assert_says, done, refused, said};
use bead_recording::file::Recording;
use bead_testing::{block_of, one_sample_strike, paper_settings};
use bead_wire::{Body, Codes, Message, Status};

/// Time from strike to strike.
const EVERY: Duration = Duration::from_millis(40);

/// Boot and number of a strike.
type BootAndNumber = (u32, u32);

/// A bead at a socket that stores its strikes. It acts only in [`serve`], [`run`] and [`settle`].
struct StoringBead {
    bead: AnsweringBead,
    /// Number of strikes since the last reset.
    strikes: u32,
    socket: PathBuf,
    /// `None` while the cable is out.
    listener: Option<UnixListener>,
    line: Option<UnixStream>,
    /// Frames lost on the way, %.
    losses: u32,
    /// Times of its last introduction and of the last request.
    introduced: Instant,
    asked: Instant,
}

impl StoringBead {
    fn new(folder: &Path, name: &str, address: u8) -> Self {
        let now = Instant::now();
        let mut bead = Self {
            bead: AnsweringBead::new(address, block_of(&paper_settings()).block.bytes()),
            strikes: 0,
            socket: folder.join(name),
            listener: None,
            line: None,
            losses: 0,
            introduced: now,
            asked: now,
        };
        bead.bead.speaker.boot = 0;
        bead.plug();
        bead
    }

    fn plug(&mut self) {
        let listener = UnixListener::bind(&self.socket).unwrap();
        listener.set_nonblocking(true).unwrap();
        self.listener = Some(listener);
    }

    fn unplug(&mut self) {
        (self.line, self.listener) = (None, None);
        fs::remove_file(&self.socket).unwrap();
    }

    fn reset(&mut self) {
        (self.strikes, self.bead.speaker.sequence) = (0, 0);
        self.bead.speaker.boot += 1;
        self.introduce();
    }

    /// Sends the bead's frames, except those that the line loses.
    fn send(&mut self) {
        let bytes = mem::take(&mut self.bead.speaker.bytes);
        for frame in bytes.split_inclusive(|byte| *byte == 0) {
            let mix = |drawn: u32, byte: &u8| drawn.wrapping_mul(31).wrapping_add((*byte).into());
            if frame.iter().fold(7, mix) % 100 >= self.losses
                && let Some(line) = &mut self.line
                && line.write_all(frame).is_err()
            {
                self.line = None;
            }
        }
    }

    /// Sends identity, settings and status, as a bead does now and then.
    fn introduce(&mut self) {
        self.introduced = Instant::now();
        self.bead.say_identity();
        self.bead.say_settings();
        let (strikes, status) = (self.strikes, Status::draw(&mut || 0));
        self.bead.say(Status { strikes, ..status });
        self.send();
    }

    /// Measures a strike of 64 samples in two pieces.
    fn strike(&mut self) {
        let (boot, number) = (self.bead.speaker.boot, self.strikes);
        self.strikes += 1;
        let first_index = 10_000 * u64::from(boot) + 100 * u64::from(number);
        let [waveform, strike, shape] = one_sample_strike(number, first_index);
        let (Message::Waveform(waveform), Message::Strike(mut strike)) = (waveform, strike) else {
            panic!("a waveform and a strike");
        };
        (strike.samples, strike.trigger_index) = (64, first_index + 20);
        let piece = |piece: u16| {
            let code = number as u16 % 1000 + 32 * piece;
            let mut waveform = waveform.clone();
            waveform.first_index += 32 * u64::from(piece);
            waveform.codes = Codes::pack((0..32).map(|n| [code + n, 4095 - code])).unwrap();
            Message::from(waveform)
        };
        let frames = [piece(0), piece(1), strike.into(), shape];
        frames.iter().for_each(|frame| self.bead.say(frame.clone()));
        self.send();
        let settings = block_of(&paper_settings()).into();
        let frames = [vec![settings], frames.to_vec()].concat();
        self.bead.kept.push(((boot, number), frames));
    }

    /// Every strike that it measured.
    fn measured(&self) -> Vec<BootAndNumber> {
        self.bead.kept.iter().map(|(name, _)| *name).collect()
    }

    /// Takes a connection and answers requests; introduces itself now and then.
    fn serve(&mut self) {
        if let Some(Ok((line, _))) = self.listener.as_ref().map(UnixListener::accept) {
            line.set_nonblocking(true).unwrap();
            self.line = Some(line);
            self.introduce();
        }
        if self.introduced.elapsed() > Duration::from_millis(200) {
            self.introduce();
        }
        let mut buffer = [0; 4096];
        match self.line.as_mut().map(|line| line.read(&mut buffer)) {
            Some(Ok(length @ 1..)) => {
                self.asked = Instant::now();
                self.bead.hear(&buffer[..length]);
                self.send();
            }
            Some(Err(error)) if error.kind() == ErrorKind::WouldBlock => {}
            _ => self.line = None,
        }
    }
}

/// Runs beads while a condition holds.
fn serve(beads: &mut [&mut StoringBead], mut holds: impl FnMut(&[&mut StoringBead]) -> bool) {
    while holds(beads) {
        beads.iter_mut().for_each(|bead| bead.serve());
        thread::sleep(Duration::from_millis(1));
    }
}

/// Runs beads for this many seconds, with a strike every [`EVERY`].
fn run(beads: &mut [&mut StoringBead], seconds: f64) {
    for _ in 0..(seconds / EVERY.as_secs_f64()).round() as u32 {
        let started = Instant::now();
        beads.iter_mut().for_each(|bead| bead.strike());
        serve(beads, |_| started.elapsed() < EVERY);
    }
}

/// Runs beads until no request has come for a while.
fn settle(beads: &mut [&mut StoringBead]) {
    let calm = Instant::now();
    let is_asked = |bead: &&mut StoringBead| bead.asked.max(calm).elapsed() < Duration::from_millis(1500);
    serve(beads, |beads| {
        beads.iter().any(is_asked) && calm.elapsed() < Duration::from_secs(40)
    });
    assert!(!beads.iter().any(is_asked), "a bead is asked without end");
}

fn record(folder: &Path, arguments: &str) -> RunningProgram {
    let record = format!("record --out a.mcap --duration 60 {arguments}");
    RunningProgram::start(folder, &record)
}

fn open(folder: &Path) -> Recording {
    Recording::open_named(&folder.join("a.mcap")).unwrap()
}

/// The strikes of a recording, sorted; each is whole.
fn whole(received: &Recording) -> Vec<BootAndNumber> {
    let strikes = received.strikes().unwrap();
    let names = strikes.map(|strike| {
        let (number, scans) = (strike.said.strike, &strike.scans);
        assert_eq!((strike.missing(), scans.len()), (0, 64), "strike {number}");
        assert!(strike.shape.is_some() && strike.settings.is_some());
        assert_eq!(scans[0].sensitive[0], number as u16 % 1000);
        (u32::from(strike.boot), number)
    });
    let mut names: Vec<_> = names.collect();
    names.sort_unstable();
    names
}

#[test]
fn a_cable_that_is_pulled_for_a_second_and_a_lossy_line_cost_no_strike_nor_does_a_reset_meanwhile() {
    for is_reset in [false, true] {
        let folder = TestFolder::new();
        let mut bead = StoringBead::new(&folder, "bead.sock", 7);
        bead.losses = 3;
        run(&mut [&mut bead], 0.3);
        let recorder = record(&folder, "--port unix:bead.sock");
        run(&mut [&mut bead], 0.8);
        let before = bead.measured().len();
        bead.unplug();
        run(&mut [&mut bead], 0.4);
        if is_reset {
            bead.reset();
        }
        run(&mut [&mut bead], 0.6);
        bead.plug();
        run(&mut [&mut bead], 0.8);
        settle(&mut [&mut bead]);
        recorder.signal("INT");
        let output = recorder.finish();
        let said = said(&output);
        assert_says(&said, "went away");
        assert_says(&said, "is back");
        let is_complete = said.contains("strikes fetched, 0 could not be fetched");
        assert!(is_reset || is_complete, "{said}");
        assert_says(&done(output), ", fetched\n");
        let names = whole(&open(&folder));
        let expected = &bead.measured()[before..];
        assert!(expected.len() > 30, "{}", expected.len());
        for name in expected {
            assert!(names.contains(name), "strike {name:?}: {said}");
        }
        // Each is there once. Strikes from before the recording are not in it.
        assert!(names.is_sorted_by(|one, other| one < other), "{names:?}");
        assert!(!names.contains(&(0, 0)));
    }
}

#[test]
fn several_beads_go_into_one_recording_and_what_is_wrong_at_a_port_costs_a_line() {
    let folder = TestFolder::new();
    let path = &folder;
    let mut seven = StoringBead::new(path, "seven.sock", 7);
    let mut eight = StoringBead::new(path, "eight.sock", 8);
    run(&mut [&mut seven, &mut eight], 0.1);
    let silent = UnixListener::bind(path.join("silent.sock")).unwrap();
    let ports =
        ["seven", "./seven", "eight", "silent", "none"].map(|name| format!("--port unix:{name}.sock"));
    let recorder = record(path, &ports.join(" "));
    run(&mut [&mut seven, &mut eight], 0.6);
    // The second port comes and goes.
    eight.unplug();
    run(&mut [&mut seven, &mut eight], 0.4);
    eight.plug();
    run(&mut [&mut seven, &mut eight], 0.6);
    settle(&mut [&mut seven, &mut eight]);
    let said = recorder.interrupt(0);
    for part in [
        "unix:./seven.sock is named twice; it is recorded once",
        "cannot connect to unix:none.sock",
        "unix:silent.sock: no frame came",
        "bead 7 at unix:",
    ] {
        assert_says(&said, part);
    }
    let received = open(path);
    let ports = [(7, "unix:seven.sock"), (8, "unix:eight.sock")];
    for (bead, (address, port)) in received.beads.iter().zip(ports) {
        let origin = &bead.origin;
        assert_eq!((origin.address, origin.port.as_deref()), (address, Some(port)));
    }
    assert_eq!(received.beads.len(), 2);
    for (bead, of) in [&seven, &eight].into_iter().zip(received.each()) {
        let names = whole(&of);
        // The recording has all strikes since its first.
        assert!(names.len() > 25 && bead.measured().ends_with(&names), "{names:?}");
    }
    drop(silent);

    // Two beads with one address: the first that sends is recorded.
    fs::remove_file(path.join("a.mcap")).unwrap();
    let mut other = StoringBead::new(path, "other.sock", 7);
    let recorder = record(path, "--port unix:seven.sock --port unix:other.sock");
    run(&mut [&mut seven, &mut other], 0.8);
    let said = recorder.interrupt(0);
    assert_says(&said, "two beads have the address 7; give one of them another");
    assert_says(&said, "the others are");
    assert_eq!(open(path).beads.len(), 1);
}

#[test]
fn what_a_bead_keeps_is_listed_and_fetched_to_a_recording() {
    let folder = TestFolder::new();
    let mut bead = StoringBead::new(&folder, "bead.sock", 7);
    run(&mut [&mut bead], 0.3);
    let fetch = |bead: &mut StoringBead, arguments: &str| {
        let fetch = format!("fetch --port unix:bead.sock {arguments}");
        let mut program = folder.start(&fetch);
        serve(&mut [bead], |_| !program.has_ended());
        program.finish()
    };
    assert_says(&done(fetch(&mut bead, "--format json")), "\"strike\": 0");
    let measured = bead.measured();
    // In the third case the bead sends parts of another strike too.
    for (arguments, repeats, expected) in [
        ("", false, &measured[..]),
        ("1 2", false, &[(0, 1), (0, 2)]),
        ("1 2", true, &[(0, 1), (0, 2)]),
    ] {
        bead.bead.repeats = repeats;
        done(fetch(&mut bead, &format!("{arguments} --out a.mcap --overwrite")));
        assert_eq!(whole(&open(&folder)), expected);
    }
    bead.bead.kept[1].1.clear();
    let left = fetch(&mut bead, "1 2 --out a.mcap --overwrite");
    refused(&left, 1, "strike 1 of boot 0 has meanwhile been replaced");
    let printed = String::from_utf8(left.stdout).unwrap();
    assert_says(&printed, "a.mcap: 1 strikes fetched");
    assert_eq!(whole(&open(&folder)), [(0, 2)]);
    let gone = fetch(&mut bead, "999");
    refused(&gone, 1, "the bead does not keep strike 999");
}
