//! Code that the end-to-end tests share: the paper's strike on bead 8, through the flash image in QEMU.
//!
//! The tests need the image and the overlay; `cargo xtask test` builds both before it runs them.
//!
//! # Panics
//! A function panics where it cannot do its work, so that the test fails; the message says why.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use bead_bench::emulation::{Emulation, Placed};
use bead_bench::faults::{self, Planned};
use bead_bench::image::find_image;
use bead_compare::front_end::AnalogFrontEnd;
use bead_compare::sensed::{Timing, load_scenario, simulate_with_ring_down};
use bead_recording::frames::{Frame, decode};
use bead_recording::strikes::{RecordedStrike, assemble};
use bead_testing::bodies;
use bead_wire::{
    ANY, Counters, Fault, FaultCause, Identity, Key, MAX_REQUEST, Message, Request, Status, Ticket,
    encode_request,
};
use hertz_chain::{Scenario, Solution};
use stm32f405_qemu::{Outcome, Run, UartInput};

/// The bead that senses.
pub const HOST: usize = 8;
/// Quiet before the first strike, s.
pub const LEAD_IN: f64 = 0.02;

/// Time that a start waits for the supply before it does anything, s.
pub const SUPPLY_WAIT: f64 = 0.0202;

/// The root of the workspace.
pub fn workspace() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("tests/ lies in the workspace")
}

/// A scenario of `docs/scenarios`.
pub fn scenario(name: &str) -> Scenario {
    let file = workspace().join(format!("docs/scenarios/{name}.toml"));
    load_scenario(&file)
        .unwrap_or_else(|failure| panic!("{failure}"))
        .0
}

/// The motion of its chain until the intruders rest.
pub fn solved(scenario: &Scenario) -> Solution {
    simulate_with_ring_down(scenario).unwrap_or_else(|failure| panic!("{failure}"))
}

/// The flash image, as built.
pub fn image() -> PathBuf {
    find_image(None).unwrap_or_else(|failure| panic!("{failure}"))
}

/// A run of the image on `strikes` strikes of the paper, `interval` seconds apart, with the noise of `seed`.
pub fn paper(strikes: u32, interval: f64, seed: Option<u64>) -> Emulation {
    paper_at(timed(LEAD_IN, strikes, interval), seed)
}

/// A number of strikes, `interval` seconds apart, after `lead_in` seconds of quiet.
pub fn timed(lead_in: f64, strikes: u32, interval: f64) -> Timing {
    Timing {
        lead_in,
        strikes,
        interval,
    }
}

/// As [`paper`], with the strikes at the times of `timing`.
pub fn paper_at(timing: Timing, seed: Option<u64>) -> Emulation {
    // All tests of a program share the motion.
    static PAPER: LazyLock<(Scenario, Solution)> = LazyLock::new(|| {
        let scenario = scenario("paper-strike");
        let solution = solved(&scenario);
        (scenario, solution)
    });
    let (scenario, solution) = &*PAPER;
    place(scenario, solution, Placed::alone(HOST, seed), timing)
}

/// A run of a bead in the motion of a chain, behind the front end that a bead has as a rule.
pub fn place(scenario: &Scenario, solution: &Solution, placed: Placed, timing: Timing) -> Emulation {
    let front_end = AnalogFrontEnd::default();
    Emulation::place(scenario, solution, placed, &front_end, timing, &image())
        .unwrap_or_else(|failure| panic!("{failure}"))
}

/// Faults of these kinds, s after the first scan.
pub fn faults_at(faults: &[(f64, &str)]) -> Vec<Planned> {
    let entry = |(at, kind): &(f64, &str)| format!("[[fault]]\nat = {at}\nkind = \"{kind}\"\n");
    planned(&faults.iter().map(entry).collect::<String>())
}

/// The faults of a file.
pub fn planned(text: &str) -> Vec<Planned> {
    faults::parse(text, "faults").unwrap_or_else(|failure| panic!("{failure}"))
}

/// Runs the image.
pub fn execute(machine: &Run) -> Outcome {
    machine.execute().unwrap_or_else(|error| panic!("{error}"))
}

/// Time at which the last byte of the first reply to a request had left the bead, in s as
/// [`Requests::request`] counts them.
pub fn replied(outcome: &Outcome, request: u16) -> Option<f64> {
    let mut decoder = bead_wire::Decoder::new();
    let mut sent = outcome.uart.iter().zip(&outcome.uart_ns);
    sent.find_map(|(&byte, &at_ns)| match decoder.push(byte)?.ok()?.message {
        Message::Reply(reply) if reply.request == request => Some(at_ns as f64 * 1e-9 - SUPPLY_WAIT),
        _ => None,
    })
}

/// Frames of a run.
pub struct RunFrames {
    /// Bytes that left the bead's port.
    pub stream: Vec<u8>,
    /// The frames in them.
    pub frames: Vec<Frame>,
    /// Counts of the decoder.
    pub counters: Counters,
}

impl RunFrames {
    /// The bodies of the frames of one kind, in the order in which they came.
    pub fn all<'a, B: 'a>(&'a self) -> impl Iterator<Item = &'a B>
    where
        &'a B: TryFrom<&'a Message>,
    {
        bodies(self.frames.iter().map(|frame| &frame.message))
    }

    /// The body of the last frame of a kind.
    pub fn last<'a, B: Copy + 'a>(&'a self) -> B
    where
        &'a B: TryFrom<&'a Message>,
    {
        *self
            .all()
            .last()
            .expect("the bead sends its status, health, link and guard at boot")
    }

    /// Causes of the faults.
    pub fn causes(&self) -> Vec<FaultCause> {
        self.all::<Fault>().map(|fault| fault.cause).collect()
    }

    /// Details of the faults.
    pub fn details(&self) -> Vec<&str> {
        self.all::<Fault>().map(|fault| fault.detail.as_str()).collect()
    }

    /// The last status frame.
    pub fn status(&self) -> Status {
        self.last()
    }

    /// The strikes of all boots.
    pub fn strikes(&self) -> Vec<RecordedStrike> {
        assemble(self.frames.clone(), None)
    }

    /// The replies to a request: their places among the frames.
    pub fn replies(&self, request: u16) -> impl Iterator<Item = (usize, &bead_wire::Reply)> {
        self.frames
            .iter()
            .enumerate()
            .filter_map(move |(place, frame)| match &frame.message {
                Message::Reply(reply) if reply.request == request => Some((place, reply)),
                _ => None,
            })
    }

    /// Outcome and detail of the one reply to a request.
    pub fn answer(&self, request: u16) -> (bead_wire::Outcome, String) {
        let mut replies = self.replies(request);
        let (Some((_, reply)), None) = (replies.next(), replies.next()) else {
            panic!("request {request} has one reply");
        };
        (reply.outcome, reply.detail.as_str().to_owned())
    }

    /// Returns the messages sent within 30 ms before the one reply to a request: the data requested.
    pub fn answered(&self, request: u16) -> Vec<&Message> {
        self.answer(request);
        let (place, _) = self.replies(request).next().expect("there is one");
        let replied = self.frames[place].header.sample_index;
        self.frames[..place]
            .iter()
            .filter(|frame| frame.header.sample_index + 3000 > replied)
            .map(|frame| &frame.message)
            .collect()
    }

    /// Boot and reset cause of each identity, one a boot.
    pub fn boots(&self) -> Vec<(u32, u8)> {
        let identities = self.all::<Identity>();
        let mut boots: Vec<_> = identities
            .map(|identity| (identity.boot, identity.reset_cause.bits()))
            .collect();
        boots.dedup();
        boots
    }

    /// Decodes a stream.
    pub fn new(stream: Vec<u8>) -> Self {
        let (frames, counters) = decode(&stream);
        Self {
            stream,
            frames,
            counters,
        }
    }
}

/// A run of the image that gets requests.
pub struct Requests {
    /// The machine, to be given more.
    pub machine: Run,
    block: Vec<u8>,
    next: u16,
}

impl Requests {
    /// A run without requests so far.
    pub fn new(run: &Emulation) -> Self {
        Self {
            machine: run.machine(),
            block: run.block.clone(),
            next: 0,
        }
    }

    /// Sends a request `at` s after the start that follows [`SUPPLY_WAIT`], or after what is still being
    /// sent; returns its number, counted from 0.
    pub fn request(&mut self, at: f64, request: &Request) -> u16 {
        let number = self.next;
        self.next += 1;
        let mut buffer = [0; MAX_REQUEST];
        let bytes =
            encode_request(ANY, number, request, &mut buffer).unwrap_or_else(|error| panic!("{error}"));
        self.send(at, bytes);
        number
    }

    /// Sends a request signed for the bead with this device id; as [`request`](Self::request).
    pub fn signed(&mut self, at: f64, request: &Request, key: &Key, uid: &[u8; 12], ticket: Ticket) -> u16 {
        let signed = request.signed(key, uid, ANY, self.next, ticket);
        self.request(at, &signed)
    }

    /// Sends any bytes, as [`request`](Self::request) does.
    pub fn send(&mut self, at: f64, bytes: &[u8]) {
        let at_ns = ((SUPPLY_WAIT + at) * 1e9) as u64;
        self.machine.uart_input.push(UartInput::usart1(at_ns, bytes));
    }

    /// Runs the image.
    pub fn run(self) -> RequestsRun {
        let outcome = execute(&self.machine);
        RequestsRun {
            received: RunFrames::new(outcome.uart.clone()),
            rows: self.machine.stimulus,
            block: self.block,
            outcome,
        }
    }

    /// Time of the image's first scan, in s as [`request`](Self::request) counts them. No request changes it.
    pub fn first_scan(&self) -> f64 {
        let mut quick = self.machine.clone();
        quick.stimulus.truncate(1);
        let outcome = execute(&quick);
        outcome.sampling.expect("the image samples").first_ns as f64 * 1e-9 - SUPPLY_WAIT
    }
}

impl RequestsRun {
    /// The store at the end: flash sectors 10 and 11.
    pub fn store(&self) -> &[u8] {
        let bytes = &self.outcome.flash.1;
        &bytes[bytes.len() - 256 * 1024..]
    }
}

/// Outcome of a run with requests.
pub struct RequestsRun {
    /// Outcome from the emulator.
    pub outcome: Outcome,
    /// Frames from the bead.
    pub received: RunFrames,
    /// The codes that the bead was given: row `i` is scan `i + 1`.
    pub rows: Vec<[u16; 4]>,
    /// The settings block that a probe had put into its flash.
    pub block: Vec<u8>,
}
