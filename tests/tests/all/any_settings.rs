//! Thousands of random valid settings on a model of the bead, made of the code that the image is made of: its
//! meter, its messages, its outbox. After each it is told to look for no strikes, and answers in time.
//! `within_reach.rs` tries dozens on the image itself.

use bead_model::{Chunk, Meter, Scan, Settings, Shape, Sink, Strike};
use bead_tests::any_settings;
use bead_wire::{
    KEPT, Kind, MAX_FRAME, Message, OUTBOX, Outcome, Packed, Queue, Reply, Waveform, room_for_window,
};
use proptest::prelude::Rng;
use proptest::test_runner::{RngAlgorithm, TestRng};

/// Scans in a block, and blocks in a second (`firmware/src/block.rs`).
const BLOCK: usize = 200;
const BLOCKS_PER_SECOND: usize = 500;
/// Bytes that the line carries meanwhile, at 2 Mbaud.
const LINE: usize = 400;
/// For how long a request waits for the room of a window; then half of what is kept is enough
/// (`firmware/src/outbox.rs`).
const PATIENCE: usize = 10;

/// The outbox and the line behind it.
struct Outbox {
    queue: Box<Queue<OUTBOX>>,
    /// Bytes of the frame that is being sent.
    sending: usize,
    dropped: u32,
    /// When the reply had left, in blocks.
    replied: Option<usize>,
}

impl Outbox {
    fn put(&mut self, message: &Message, keep: usize) {
        let mut packed = Packed::new();
        packed.pack(0, 0, message).expect("there is room for any message");
        self.dropped += u32::from(!self.queue.push(&packed, keep));
    }

    fn room(&self) -> usize {
        self.queue.free().saturating_sub(KEPT)
    }

    /// Sends the bytes that leave in the time of a block.
    fn send(&mut self, now: usize) {
        let mut room = LINE;
        loop {
            let sent = room.min(self.sending);
            self.sending -= sent;
            room -= sent;
            let mut packed = Packed::new();
            if room == 0 || !self.queue.pop(&mut packed) {
                return;
            }
            if packed.bytes()[1] == Kind::Reply as u8 {
                self.replied = Some(now + 1);
            }
            self.sending = packed.seal(&mut [0; MAX_FRAME]).expect("a frame fits").len();
        }
    }
}

impl Sink for Outbox {
    fn chunk(&mut self, chunk: &Chunk) {
        self.put(&Waveform::from(chunk).into(), KEPT);
    }

    fn report(&mut self, strike: &Strike, shape: &Shape) {
        self.put(&(*strike).into(), KEPT);
        self.put(&(*shape).into(), KEPT);
    }
}

/// Signals at the sensors of the model.
struct Stimulus {
    /// Rms of the noise in codes, at most; it is even.
    noise: u64,
    /// Scans from strike to strike; none for noise alone.
    every: Option<usize>,
    /// Height of a strike in codes, and its length.
    height: u64,
    length: usize,
}

impl Stimulus {
    fn draw(random: &mut dyn FnMut() -> u64) -> Self {
        Self {
            noise: [0, 1, 3, 40, 4000][random() as usize % 5],
            every: (!random().is_multiple_of(4)).then(|| 130 + (random() % 2000) as usize),
            height: random() % 5000,
            length: 1 + (random() % 400) as usize,
        }
    }

    fn scan(&self, at: usize, random: &mut dyn FnMut() -> u64) -> Scan {
        let strike = match self.every {
            Some(every) if at % every < self.length => {
                // A triangle.
                let rise = (at % every).min(self.length - at % every) as u64;
                2 * self.height * rise / self.length as u64
            }
            _ => 0,
        };
        let bits = random();
        let code = |zero: u64, signal: u64, shift: u32| {
            (zero + signal + (bits >> shift & 0xFFFF) % (self.noise + 1)).min(4095) as u16
        };
        Scan::new([
            code(128, strike, 0),
            code(128, strike / 16, 16),
            code(2048, strike / 2, 32),
            code(2048, strike / 32, 48),
        ])
    }
}

/// Runs the model for some time, then disarms it, and then gives it other settings. Gives the blocks until
/// the reply had left, and until the meter was at rest.
fn run(settings: &Settings, stimulus: &Stimulus, random: &mut dyn FnMut() -> u64) -> (usize, usize, Outbox) {
    let mut meter = Box::new(Meter::new());
    let mut outbox = Outbox {
        queue: Box::new(Queue::new()),
        sending: 0,
        dropped: 0,
        replied: None,
    };
    let disarm = 40 + (random() % 60) as usize;
    let (mut asked, mut rested) = (true, None);
    for now in 0.. {
        let disarmed = now >= disarm;
        // `firmware/src/estimate.rs`.
        meter.pass_over(disarmed || outbox.room() < room_for_window(settings.window.length.into()));
        if disarmed && !meter.is_measuring() {
            rested.get_or_insert(now - disarm);
        }
        if rested.is_none() {
            let scans: Vec<Scan> = (BLOCK * now..BLOCK * (now + 1))
                .map(|at| stimulus.scan(at, random))
                .collect();
            meter.process(settings, (BLOCK * now) as u64, scans, &mut outbox);
        }
        if now % BLOCKS_PER_SECOND == 0 {
            for kind in [
                Kind::Identity,
                Kind::Settings,
                Kind::Status,
                Kind::Health,
                Kind::Link,
                Kind::Guard,
            ] {
                outbox.put(&Message::draw(kind, random), 0);
            }
        }
        // `firmware/src/commands.rs` and `firmware/src/outbox.rs`.
        let patient = now - disarm.min(now) < PATIENCE;
        let enough = if patient {
            KEPT + KEPT / 2 + room_for_window(settings.window.length.into())
        } else {
            KEPT / 2
        };
        if disarmed && asked && outbox.queue.free() >= enough {
            asked = false;
            let reply = Reply {
                request: 1,
                outcome: Outcome::Done,
                detail: Default::default(),
            };
            let dropped = outbox.dropped;
            outbox.put(&reply.into(), 0);
            assert_eq!(outbox.dropped, dropped, "the reply found room");
        }
        outbox.send(now);
        assert!(
            now < disarm + 2 * BLOCKS_PER_SECOND,
            "no reply in two seconds: {settings:?}"
        );
        if let (Some(replied), Some(rested)) = (outbox.replied, rested) {
            return (replied - disarm, rested, outbox);
        }
    }
    unreachable!("the loop ends with a reply or with a failure")
}

#[test]
fn after_any_valid_settings_and_any_strikes_disarm_is_answered_within_a_second() {
    const TRIED: u32 = 3000;
    let mut random = TestRng::deterministic_rng(RngAlgorithm::ChaCha);
    let mut bits = || random.next_u64();
    let (mut slowest, mut busiest, mut full) = (0, 0, 0);
    for _ in 0..TRIED {
        let settings = any_settings(&mut bits);
        let stimulus = Stimulus::draw(&mut bits);
        let (replied, rested, outbox) = run(&settings, &stimulus, &mut bits);
        slowest = slowest.max(replied);
        busiest = busiest.max(rested);
        full += u32::from(outbox.dropped > 0);
    }
    println!(
        "{TRIED} settings: slowest reply after {} ms, no strike measured after {} ms; {full} lost a frame",
        2 * slowest,
        2 * busiest
    );
    assert!(slowest < BLOCKS_PER_SECOND / 4, "{slowest} blocks");
    // The longest window and its lag, and the next block.
    assert!(busiest <= 9, "{busiest} blocks");
}
