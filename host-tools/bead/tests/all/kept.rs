//! `bead record` at beads that keep their strikes: a cable that is pulled, beads that are reset meanwhile,
//! several ports, and ports at which something is wrong; and `bead fetch`.

use std::collections::VecDeque;
use std::fs;
use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use crate::program;
use bead_model::design::{Bead as Paper, Capture, FrontEnd, derive};
use bead_model::settings::BLOCK_MAX;
use bead_recording::received::Received;
use bead_wire::{
    Block, Codes, Energy, Fetched, Header, Identity, Inner, Kept, Kind, MAX_FRAME, Message, Outcome, Reply,
    Request, RequestDecoder, ResetCauses, Settings, Shape, Status, Strike, Waveform, encode,
};

/// Between two strikes.
const EVERY: Duration = Duration::from_millis(40);
/// Strikes that the bead keeps: of three seconds. A recorder on a busy computer may ask for one a second
/// late.
const KEPT: usize = 80;

/// A frame as it would be sent again.
pub(crate) fn content(message: &Message) -> (u8, Inner) {
    let header = Header {
        address: 0,
        boot: 0,
        sequence: 0,
        sample_index: 0,
    };
    let mut packed = bead_wire::Packed::new();
    packed.pack(header.address, header.boot, message).unwrap();
    let (kind, body) = packed.content();
    let inner = Inner::filled_by(|room| {
        room[..body.len()].copy_from_slice(body);
        body.len()
    });
    (kind, inner)
}

/// The treatment of a bead by a test.
#[derive(Default)]
struct Fate {
    /// The cable is out.
    pulled: AtomicBool,
    /// It is to be reset.
    reset: AtomicBool,
    /// It strikes no more.
    calm: AtomicBool,
    /// With each strike that is fetched, the one before it comes once more: the answer to a copy of its
    /// request.
    late: AtomicBool,
    /// Strike 1 gives way to newer ones after it was listed.
    gives_way: AtomicBool,
    over: AtomicBool,
    /// When it was last asked for something.
    asked: Mutex<Option<Instant>>,
}

/// A bead in this process, at a socket: it sends a strike every [`EVERY`], and keeps its last ones.
struct Simulated {
    address: u8,
    boot: u32,
    strikes: u32,
    sequence: u32,
    since: Instant,
    kept: VecDeque<(u32, u32, Vec<Message>)>,
    line: Option<UnixStream>,
    decoder: RequestDecoder,
    settings: Settings,
    /// Every strike that it measured: boot and number.
    measured: Arc<Mutex<Vec<(u32, u32)>>>,
    /// Of a hundred frames so many are lost on the way.
    lossy: u32,
}

impl Simulated {
    fn send(&mut self, message: &Message) {
        let header = Header {
            address: self.address,
            boot: self.boot as u8,
            sequence: self.sequence,
            sample_index: self.since.elapsed().as_micros() as u64 / 10,
        };
        self.sequence += 1;
        let lost = self.sequence.wrapping_mul(2_654_435_761) >> 8;
        if lost % 100 < self.lossy {
            return;
        }
        let mut buffer = [0; MAX_FRAME];
        let bytes = encode(&header, message, &mut buffer).unwrap();
        if let Some(line) = &mut self.line
            && line.write_all(bytes).is_err()
        {
            self.line = None;
        }
    }

    fn start(&mut self) {
        self.since = Instant::now();
        (self.strikes, self.sequence) = (0, 0);
        self.tell();
    }

    fn tell(&mut self) {
        self.send(&Message::Identity(Identity {
            firmware: "0.1.0".into(),
            git: "abc".into(),
            uid: [self.address; 12],
            boot: self.boot,
            reset_cause: ResetCauses::NONE,
            sample_rate_hz: 100_000,
            channels: 4,
        }));
        self.send(&self.settings.clone().into());
        let Message::Status(status) = Message::draw(Kind::Status, &mut || 0) else {
            panic!("a status");
        };
        self.send(&Message::Status(Status {
            strikes: self.strikes,
            ..status
        }));
    }

    fn strike(&mut self) {
        let strike = self.strikes;
        self.strikes += 1;
        let first_index = 10_000 * u64::from(self.boot) + 100 * u64::from(strike);
        let waveform = |piece: u64| {
            let code = strike as u16 % 1000 + 32 * piece as u16;
            Message::Waveform(Waveform {
                strike,
                first_index: first_index + 32 * piece,
                codes: Codes::pack((0..32).map(|n| [code + n, 4095 - code])).unwrap(),
                wide: Codes::default(),
                absorbed_measured: Energy::from_bits(1),
                absorbed_predicted: Energy::from_bits(2),
            })
        };
        let Message::Strike(said) = Message::draw(Kind::Strike, &mut || 0) else {
            panic!("a strike");
        };
        let Message::Shape(shape) = Message::draw(Kind::Shape, &mut || 0) else {
            panic!("a shape");
        };
        let said = Strike {
            strike,
            first_index,
            trigger_index: first_index + 20,
            samples: 64,
            ..said
        };
        let shape = Shape {
            strike,
            first_index,
            ..shape
        };
        let frames = vec![
            self.settings.clone().into(),
            waveform(0),
            waveform(1),
            said.into(),
            shape.into(),
        ];
        for frame in &frames[1..] {
            self.send(frame);
        }
        self.kept.push_back((self.boot, strike, frames));
        if self.kept.len() > KEPT {
            self.kept.pop_front();
        }
        self.measured.lock().unwrap().push((self.boot, strike));
    }

    fn listen(&mut self, fate: &Fate) {
        let mut buffer = [0; 4096];
        let length = match self.line.as_mut().map(|line| line.read(&mut buffer)) {
            Some(Ok(0)) => {
                self.line = None;
                return;
            }
            Some(Ok(length)) => length,
            Some(Err(error)) if error.kind() == ErrorKind::WouldBlock => return,
            Some(Err(_)) => {
                self.line = None;
                return;
            }
            None => return,
        };
        for byte in &buffer[..length] {
            let Some(Ok(heard)) = self.decoder.push(*byte) else {
                continue;
            };
            *fate.asked.lock().unwrap() = Some(Instant::now());
            let outcome = self.answer(heard.request.unwrap(), fate);
            self.send(&Message::Reply(Reply {
                request: heard.number,
                outcome,
                detail: "".into(),
            }));
        }
    }

    fn answer(&mut self, request: Request, fate: &Fate) -> Outcome {
        match request {
            Request::Identity => self.tell(),
            Request::ListKept => {
                for (boot, strike, frames) in self.kept.clone() {
                    self.send(&Message::Kept(Kept {
                        boot,
                        strike,
                        parts: frames.len() as u8,
                        bytes: 300,
                    }));
                }
            }
            Request::Fetch { boot, strike } => {
                let found = self
                    .kept
                    .iter()
                    .position(|kept| (kept.0, kept.1) == (boot, strike));
                let gave_way = strike == 1 && fate.gives_way.load(Ordering::Relaxed);
                let Some(found) = found.filter(|_| !gave_way) else {
                    return Outcome::NotKept;
                };
                let late = fate.late.load(Ordering::Relaxed);
                for at in found - usize::from(late)..=found {
                    let (boot, strike, frames) = self.kept[at].clone();
                    for (part, frame) in (0..).zip(&frames) {
                        let (kind, body) = content(frame);
                        self.send(&Message::Fetched(Fetched {
                            boot,
                            strike,
                            part,
                            parts: frames.len() as u8,
                            frame_kind: kind,
                            body,
                        }));
                    }
                }
            }
            _ => return Outcome::Kind,
        }
        Outcome::Done
    }

    fn run(mut self, socket: &Path, fate: &Fate) {
        let mut listener = None;
        let (mut next, mut told) = (Instant::now(), Instant::now());
        self.start();
        while !fate.over.load(Ordering::Relaxed) {
            if fate.pulled.load(Ordering::Relaxed) {
                (self.line, listener) = (None, None);
                let _ = fs::remove_file(socket);
            } else {
                let listener = listener.get_or_insert_with(|| {
                    let listener = UnixListener::bind(socket).unwrap();
                    listener.set_nonblocking(true).unwrap();
                    listener
                });
                if let Ok((line, _)) = listener.accept() {
                    line.set_nonblocking(true).unwrap();
                    self.line = Some(line);
                    self.tell();
                }
            }
            if fate.reset.swap(false, Ordering::Relaxed) {
                self.boot += 1;
                self.start();
            }
            if Instant::now() >= next && !fate.calm.load(Ordering::Relaxed) {
                next += EVERY;
                self.strike();
            }
            if told.elapsed() > Duration::from_millis(200) {
                told = Instant::now();
                self.tell();
            }
            self.listen(fate);
            thread::sleep(Duration::from_millis(1));
        }
    }
}

/// A bead on its own thread.
struct Running {
    fate: Arc<Fate>,
    measured: Arc<Mutex<Vec<(u32, u32)>>>,
    thread: Option<JoinHandle<()>>,
    port: String,
}

impl Running {
    fn start(directory: &Path, name: &str, address: u8, lossy: u32) -> Self {
        let (fate, measured) = <(Arc<Fate>, Arc<Mutex<Vec<_>>>)>::default();
        let socket: PathBuf = directory.join(name);
        let settings = derive(&Paper::paper(), &FrontEnd::reference(), &Capture::default()).unwrap();
        let mut block = [0; BLOCK_MAX];
        let length = settings.encode(&mut block).unwrap();
        let bead = Simulated {
            address,
            boot: 0,
            strikes: 0,
            sequence: 0,
            since: Instant::now(),
            kept: VecDeque::new(),
            line: None,
            decoder: RequestDecoder::new(),
            settings: Settings {
                block: Block::try_from(&block[..length]).unwrap(),
            },
            measured: measured.clone(),
            lossy,
        };
        let thread = thread::spawn({
            let (fate, socket) = (fate.clone(), socket.clone());
            move || bead.run(&socket, &fate)
        });
        while !socket.exists() {
            thread::sleep(Duration::from_millis(1));
        }
        Self {
            fate,
            measured,
            thread: Some(thread),
            port: format!("unix:{}", socket.display()),
        }
    }

    fn set(&self, of: impl Fn(&Fate) -> &AtomicBool, value: bool) {
        of(&self.fate).store(value, Ordering::Relaxed);
    }

    /// No more strikes; returns when nothing has been asked for a while.
    fn settle(&self) {
        self.set(|fate| &fate.calm, true);
        let calm = Instant::now();
        while calm.elapsed() < Duration::from_secs(40) {
            pause(0.1);
            let asked = self.fate.asked.lock().unwrap().unwrap_or(calm).max(calm);
            if asked.elapsed() > Duration::from_millis(1500) {
                return;
            }
        }
        panic!("it is asked without end");
    }

    /// Strikes measured from this moment on.
    fn measured_since(&self, start: usize) -> Vec<(u32, u32)> {
        self.measured.lock().unwrap()[start..].to_vec()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.set(|fate| &fate.over, true);
        let thread = self.thread.take().unwrap();
        // A panic there is the test's.
        if thread.join().is_err() && !thread::panicking() {
            panic!("the bead panicked");
        }
    }
}

fn record(directory: &Path, arguments: &[&str]) -> Child {
    program::interruptible(directory)
        .arg("record")
        .args(["--out", "a.mcap", "--duration", "60"])
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

fn interrupt(recorder: Child) -> (i32, String) {
    let kill = format!("kill -INT {}", recorder.id());
    assert!(Command::new("sh").args(["-c", &kill]).status().unwrap().success());
    let Output { status, stderr, .. } = recorder.wait_with_output().unwrap();
    (status.code().unwrap(), String::from_utf8(stderr).unwrap())
}

fn pause(seconds: f64) {
    thread::sleep(Duration::from_secs_f64(seconds));
}

/// The strikes of a recording, whole and sorted: boot and number.
fn whole(received: &Received) -> Vec<(u32, u32)> {
    let strikes = received.strikes().unwrap();
    let mut names: Vec<_> = strikes
        .map(|strike| {
            assert_eq!(
                (strike.missing(), strike.scans.len()),
                (0, 64),
                "{:?}",
                strike.said
            );
            assert!(strike.shape.is_some() && strike.settings.is_some());
            assert_eq!(strike.scans[0].sensitive[0], strike.said.strike as u16 % 1000);
            (u32::from(strike.boot), strike.said.strike)
        })
        .collect();
    names.sort_unstable();
    names
}

/// Pulls the cable of a bead for a while; `meanwhile` it may be reset.
fn cable_is_pulled(meanwhile: impl Fn(&Running)) -> String {
    let directory = tempfile::tempdir().unwrap();
    let bead = Running::start(directory.path(), "bead.sock", 7, 3);
    pause(0.3);
    let recorder = record(directory.path(), &["--port", &bead.port]);
    pause(0.8);
    let start = bead.measured.lock().unwrap().len();
    bead.set(|fate| &fate.pulled, true);
    pause(0.4);
    meanwhile(&bead);
    pause(0.6);
    bead.set(|fate| &fate.pulled, false);
    pause(0.8);
    bead.settle();
    let (status, stderr) = interrupt(recorder);
    assert_eq!(status, 0, "{stderr}");
    let received = Received::open(&directory.path().join("a.mcap")).unwrap();
    let names = whole(&received);
    let expected = bead.measured_since(start);
    assert!(expected.len() > 30, "{}", expected.len());
    for name in &expected {
        let times = names.iter().filter(|other| *other == name).count();
        assert_eq!(times, 1, "strike {name:?}: {stderr}");
    }
    let mut once = names.clone();
    once.dedup();
    assert_eq!(once, names, "each once");
    // Those that were measured before anybody listened are nobody's.
    assert!(!names.contains(&(0, 0)));
    stderr
}

#[test]
fn a_cable_that_is_pulled_for_a_second_and_a_lossy_line_cost_no_strike() {
    let stderr = cable_is_pulled(|_| {});
    assert!(stderr.contains("went away"), "{stderr}");
    assert!(stderr.contains("is back"), "{stderr}");
    assert!(stderr.contains("strikes fetched, 0 not to be had"), "{stderr}");
}

#[test]
fn a_bead_that_is_reset_while_its_cable_is_pulled_loses_no_strike() {
    cable_is_pulled(|bead| bead.set(|fate| &fate.reset, true));
}

#[test]
fn several_beads_go_into_one_recording_and_what_is_wrong_at_a_port_costs_a_line() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path();
    let seven = Running::start(path, "seven.sock", 7, 0);
    let eight = Running::start(path, "eight.sock", 8, 0);
    pause(0.1);
    let silent = UnixListener::bind(path.join("silent.sock")).unwrap();
    let again = path.join(".").join("seven.sock");
    let again = format!("unix:{}", again.display());
    let ports = [
        &seven.port,
        &again,
        &eight.port,
        "unix:silent.sock",
        "unix:none.sock",
    ];
    let mut arguments: Vec<&str> = ports.iter().flat_map(|port| ["--port", port]).collect();
    let recorder = record(path, &arguments);
    pause(0.6);
    // The second comes and goes.
    eight.set(|fate| &fate.pulled, true);
    pause(0.4);
    eight.set(|fate| &fate.pulled, false);
    pause(0.6);
    seven.settle();
    eight.settle();
    let (status, stderr) = interrupt(recorder);
    assert_eq!(status, 0, "{stderr}");
    assert!(
        stderr.contains(&format!("{again} is named twice; it is recorded once")),
        "{stderr}"
    );
    assert!(stderr.contains("cannot connect to unix:none.sock"), "{stderr}");
    assert!(stderr.contains("unix:silent.sock: no frame came"), "{stderr}");
    assert!(stderr.contains("bead 7 at unix:"), "{stderr}");
    let received = Received::open(&path.join("a.mcap")).unwrap();
    let addresses: Vec<_> = received
        .recording
        .beads
        .iter()
        .map(|bead| bead.origin.address)
        .collect();
    assert_eq!(addresses, [7, 8]);
    assert_eq!(
        received.recording.beads[1].origin.port.as_deref(),
        Some(&*eight.port)
    );
    for (bead, of) in [&seven, &eight].into_iter().zip(received.each()) {
        let names = whole(&of);
        let measured = bead.measured_since(0);
        // From the first whole one on, all are there.
        assert!(
            names.len() > 25 && measured.ends_with(&names),
            "{names:?} of {measured:?}"
        );
    }
    drop(silent);

    // Two beads with one address: the first that is heard is recorded.
    fs::remove_file(path.join("a.mcap")).unwrap();
    let other = Running::start(path, "other.sock", 7, 0);
    arguments = vec!["--port", &seven.port, "--port", &other.port];
    let recorder = record(path, &arguments);
    pause(0.8);
    let (status, stderr) = interrupt(recorder);
    assert_eq!(status, 0, "{stderr}");
    assert!(
        stderr.contains("two beads have the address 7; give one of them another"),
        "{stderr}"
    );
    assert!(stderr.contains("the others are"), "{stderr}");
    let received = Received::open(&path.join("a.mcap")).unwrap();
    assert_eq!(received.recording.beads.len(), 1);
}

#[test]
fn what_a_bead_keeps_is_listed_and_fetched_to_a_recording() {
    let directory = tempfile::tempdir().unwrap();
    let bead = Running::start(directory.path(), "bead.sock", 7, 0);
    pause(0.3);
    bead.set(|fate| &fate.calm, true);
    pause(0.1);
    let fetch = |arguments: &[&str]| {
        let output = program::bead(
            directory.path(),
            [&["fetch", "--port", &bead.port], arguments].concat(),
        );
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        (
            output.status.code().unwrap(),
            text(output.stdout),
            text(output.stderr),
        )
    };
    let measured = bead.measured_since(0);
    let (status, list, stderr) = fetch(&["--format", "json"]);
    assert_eq!(status, 0, "{stderr}");
    let list: serde_json::Value = serde_json::from_str(&list).unwrap();
    assert!(list.to_string().contains("\"strike\":0"), "{list}");
    let (status, _, stderr) = fetch(&["--out", "kept.mcap"]);
    assert_eq!(status, 0, "{stderr}");
    assert_eq!(
        whole(&Received::open(&directory.path().join("kept.mcap")).unwrap()),
        measured
    );
    let (status, _, _) = fetch(&["1", "2", "--out", "two.mcap"]);
    assert_eq!(status, 0);
    let two = Received::open(&directory.path().join("two.mcap")).unwrap();
    assert_eq!(whole(&two), [(0, 1), (0, 2)]);
    bead.set(|fate| &fate.late, true);
    let (status, _, stderr) = fetch(&["1", "2", "--out", "late.mcap"]);
    assert_eq!(status, 0, "{stderr}");
    let late = Received::open(&directory.path().join("late.mcap")).unwrap();
    assert_eq!(whole(&late), [(0, 1), (0, 2)]);
    bead.set(|fate| &fate.gives_way, true);
    let (status, stdout, stderr) = fetch(&["1", "2", "--out", "left.mcap"]);
    assert_eq!((status, stderr.lines().count()), (1, 1), "{stderr}");
    assert!(stdout.contains("left.mcap: 1 strikes fetched"), "{stdout}");
    assert!(stderr.contains("strike 1 of boot 0 gave way"), "{stderr}");
    let left = Received::open(&directory.path().join("left.mcap")).unwrap();
    assert_eq!(whole(&left), [(0, 2)]);
    let (status, _, stderr) = fetch(&["999"]);
    assert_eq!((status, stderr.lines().count()), (1, 1), "{stderr}");
    assert!(stderr.contains("the bead does not keep strike 999"), "{stderr}");
}
