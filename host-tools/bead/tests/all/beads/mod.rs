//! Beads on one line, as far as requests go: each hears every request and answers those to it.

use std::fs;
use std::io::{Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;
use std::process::{Command, Output};
use std::thread;

use bead_wire::{
    ANY, Block, Check, Codes, Guard, Header, Identity, Kind, Link, Lock, MAX_FRAME, Message, Moment, Outcome,
    Raw, Reply, Request, RequestDecoder, SelfTest, Settings, encode,
};

const CHECKS: [Check; 8] = [
    Check::Supply,
    Check::Force,
    Check::Acceleration,
    Check::Acquisition,
    Check::Settings,
    Check::Stack,
    Check::Estimators,
    Check::Store,
];

/// A bead that knows no physics: its counts and checks are drawn.
pub(crate) struct Bead {
    pub(crate) address: u8,
    pub(crate) boot: u32,
    /// The settings block that it measures with.
    pub(crate) block: Vec<u8>,
    /// Every request that it did.
    pub(crate) done: Vec<Request>,
    uid: [u8; 12],
    lock: Lock,
    sequence: u32,
    decoder: RequestDecoder,
    draw: Box<dyn FnMut() -> u64 + Send>,
}

impl Bead {
    pub(crate) fn new(address: u8, block: &[u8]) -> Self {
        let mut state = 0x2545_f491_4f6c_dd1d_u64 + u64::from(address);
        let draw = move || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            state
        };
        Self {
            address,
            boot: 1,
            block: block.to_vec(),
            done: Vec::new(),
            uid: [address; 12],
            lock: Lock::new([address; 12], None, 0),
            sequence: 0,
            decoder: RequestDecoder::new(),
            draw: Box::new(draw),
        }
    }

    fn say(&mut self, message: &Message) -> Vec<u8> {
        let header = Header {
            address: self.address,
            boot: self.boot as u8,
            sequence: self.sequence,
            sample_index: 1000 * u64::from(self.sequence),
        };
        self.sequence += 1;
        encode(&header, message, &mut [0; MAX_FRAME]).unwrap().to_vec()
    }

    /// A frame with fields that are drawn.
    pub(crate) fn drawn(&mut self, kind: Kind) -> Vec<u8> {
        let message = Message::draw(kind, &mut self.draw);
        self.say(&message)
    }

    fn identity(&mut self) -> Vec<u8> {
        let Message::Identity(drawn) = Message::draw(Kind::Identity, &mut self.draw) else {
            panic!("an identity");
        };
        let (boot, uid) = (self.boot, self.uid);
        self.say(
            &Identity {
                boot,
                uid,
                sample_rate_hz: 100_000,
                ..drawn
            }
            .into(),
        )
    }

    fn settings(&mut self) -> Vec<u8> {
        let block = Block::try_from(&self.block[..]).unwrap();
        self.say(&Settings { block }.into())
    }

    /// Takes these bytes, and returns the bead's answer.
    pub(crate) fn hear(&mut self, bytes: &[u8]) -> Vec<u8> {
        let mut said = Vec::new();
        for &byte in bytes {
            let Some(Ok(heard)) = self.decoder.push(byte) else {
                continue;
            };
            if heard.address != ANY && heard.address != self.address {
                continue;
            }
            let now = Moment {
                boot: self.boot,
                index: 1000 * u64::from(self.sequence),
            };
            let admitted = self
                .lock
                .admit(heard.address, heard.number, heard.request.unwrap(), now);
            let (outcome, restarts) = match admitted {
                Ok(request) => {
                    said.extend(self.execute(&request));
                    let restarts = request == Request::Reboot;
                    self.done.push(request);
                    (Outcome::Done, restarts)
                }
                Err(outcome) => (outcome, false),
            };
            let reply = Reply {
                request: heard.number,
                outcome,
                detail: "as asked".into(),
            };
            said.extend(self.say(&reply.into()));
            if restarts {
                (self.boot, self.sequence) = (self.boot + 1, 0);
                said.extend(self.identity());
            }
        }
        said
    }

    fn execute(&mut self, request: &Request) -> Vec<u8> {
        match request {
            Request::Identity => self.identity(),
            Request::Status => {
                let mut said: Vec<u8> = [Kind::Status, Kind::Health, Kind::Load]
                    .into_iter()
                    .flat_map(|kind| self.drawn(kind))
                    .collect();
                let counter = self.lock.counter();
                let guard = Guard {
                    counter,
                    ..Guard::default()
                };
                said.extend(self.say(&guard.into()));
                said.extend(self.say(&Link::default().into()));
                said
            }
            Request::SelfTest => CHECKS
                .into_iter()
                .flat_map(|check| {
                    let test = SelfTest {
                        check,
                        passed: true,
                        value: 1,
                    };
                    self.say(&test.into())
                })
                .collect(),
            // One frame, and the count at the end.
            Request::Raw { duration_ms } => {
                let codes = Codes::pack((0..32).map(|code| [code, 4095 - code])).unwrap();
                let raw = Raw {
                    first_index: 0,
                    codes,
                };
                let link = Link {
                    raw_sent: 32,
                    raw_dropped: u64::from(*duration_ms) * 100 - 32,
                    ..Link::default()
                };
                [self.say(&raw.into()), self.say(&link.into())].concat()
            }
            Request::WriteSettings { block } => {
                self.block = block.bytes().to_vec();
                if let Ok(settings) = bead_model::settings::Settings::decode(&self.block) {
                    self.address = settings.description().address;
                }
                self.settings()
            }
            Request::ReadSettings | Request::EraseSettings => self.settings(),
            Request::SetKey { key } => {
                self.lock.set(bead_wire::Key::new(*key));
                Vec::new()
            }
            _ => Vec::new(),
        }
    }
}

/// A line that ends in a socket. What several beads say at one time collides.
pub(crate) struct Line {
    folder: tempfile::TempDir,
}

impl Line {
    pub(crate) fn new() -> Self {
        Self {
            folder: tempfile::tempdir().unwrap(),
        }
    }

    /// A folder for files.
    pub(crate) fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Runs `bead` in the folder, with `--port` at the line, until it hangs up.
    pub(crate) fn run(&self, beads: &mut [Bead], arguments: &[&str]) -> Output {
        let socket = self.folder().join("line.sock");
        let _ = fs::remove_file(&socket);
        let listener = UnixListener::bind(&socket).unwrap();
        thread::scope(|scope| {
            let listening = scope.spawn(move || {
                let (mut stream, _) = listener.accept().unwrap();
                let mut buffer = [0; 4096];
                while let Ok(length @ 1..) = stream.read(&mut buffer) {
                    // A program that hung up meanwhile reads no more.
                    let _ = stream.write_all(&collided(beads, &buffer[..length]));
                }
            });
            let output = Command::new(env!("CARGO_BIN_EXE_bead"))
                .current_dir(self.folder())
                .args(arguments)
                .args(["--port", "unix:line.sock", "--timeout", "0.5"])
                .output()
                .unwrap();
            if !listening.is_finished() {
                // One that never connected leaves the other end waiting.
                let _ = UnixStream::connect(&socket);
            }
            output
        })
    }
}

/// Returns the line after these bytes: low wherever a bead pulls it low.
fn collided(beads: &mut [Bead], bytes: &[u8]) -> Vec<u8> {
    let mut line = Vec::new();
    for said in beads.iter_mut().map(|bead| bead.hear(bytes)) {
        line.resize(said.len().max(line.len()), 0xFF);
        line.iter_mut().zip(said).for_each(|(line, said)| *line &= said);
    }
    line
}
