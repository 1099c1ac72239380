//! Stand-ins for beads on one line: each receives every request and answers those with its address.

use std::path::Path;
use std::process::Output;

use crate::program::asked;
use bead_testing::{Speaker, fetched, xorshift};
use bead_wire::{
    ANY, Block, Check, Codes, Guard, Identity, Kept, Kind, Link, Lock, Message, Moment, Outcome, Raw,
    ReceivedRequest, Reply, Request, SelfTest, Settings,
};

/// A bead without physics: its counts are drawn, and it passes every check.
pub(crate) struct AnsweringBead {
    pub(crate) speaker: Speaker,
    /// The settings block that it measures with.
    pub(crate) block: Vec<u8>,
    /// Every request that it executed.
    pub(crate) done: Vec<Request>,
    /// Stored strikes: boot, number, and frames. A strike without frames is listed and cannot be fetched.
    pub(crate) kept: Vec<((u32, u32), Vec<Message>)>,
    /// Codes of the scan with each index, of a raw stream that has all scans.
    pub(crate) scans: Option<fn(u64) -> [u16; 2]>,
    /// True to send the strike before a fetched one too, as a late answer to an earlier request.
    pub(crate) repeats: bool,
    uid: [u8; 12],
    lock: Lock,
}

impl AnsweringBead {
    pub(crate) fn new(address: u8, block: &[u8]) -> Self {
        Self {
            speaker: Speaker {
                boot: 1,
                ..Speaker::at(address)
            },
            block: block.to_vec(),
            done: Vec::new(),
            kept: Vec::new(),
            scans: None,
            repeats: false,
            uid: [address; 12],
            lock: Lock::new([address; 12], None, 0),
        }
    }

    /// Index of the next frame's sample.
    fn index(&self) -> u64 {
        1000 * u64::from(self.speaker.sequence)
    }

    pub(crate) fn say(&mut self, message: impl Into<Message>) {
        self.speaker.say(self.index(), message);
    }

    pub(crate) fn say_identity(&mut self) {
        let (uid, identity) = (self.uid, self.speaker.identity());
        self.say(Identity { uid, ..identity });
    }

    pub(crate) fn say_settings(&mut self) {
        let block = Block::try_from(&self.block[..]).unwrap();
        self.say(Settings { block });
    }

    /// Answers the requests in these bytes. The speaker has the frames.
    pub(crate) fn hear(&mut self, bytes: &[u8]) {
        let mut requests = Vec::new();
        let speaker = &mut self.speaker;
        speaker.answer(bytes, |_, asked| requests.push(asked.clone()));
        for asked in requests {
            if [ANY, self.speaker.address].contains(&asked.address) {
                self.answer(asked);
            }
        }
    }

    fn answer(&mut self, asked: ReceivedRequest) {
        let now = Moment {
            boot: self.speaker.boot,
            index: self.index(),
        };
        let (address, request) = (asked.address, asked.request.unwrap());
        let admitted = self.lock.admit(address, asked.number, request, now);
        let outcome = admitted
            .as_ref()
            .map_or_else(|outcome| *outcome, |request| self.execute(request));
        self.say(Reply {
            request: asked.number,
            outcome,
            detail: "as asked".into(),
        });
        if admitted == Ok(Request::Reboot) {
            (self.speaker.boot, self.speaker.sequence) = (self.speaker.boot + 1, 0);
            self.say_identity();
        }
        self.done.extend(admitted);
    }

    fn execute(&mut self, request: &Request) -> Outcome {
        match request {
            Request::Identity => self.say_identity(),
            Request::Status => {
                for kind in [Kind::Status, Kind::Health, Kind::Load] {
                    let drawn = Message::draw(kind, &mut xorshift(1));
                    self.say(drawn);
                }
                let counter = self.lock.counter();
                self.say(Guard {
                    counter,
                    ..Guard::default()
                });
                self.say(Link::default());
            }
            Request::SelfTest => {
                for check in (0..8).map(Check::from_number) {
                    self.say(SelfTest {
                        check,
                        passed: true,
                        value: 1,
                    });
                }
            }
            Request::Raw { duration_ms } => {
                let all = u64::from(*duration_ms) * 100;
                // Without `scans` the bead sends one frame.
                let (scan, sent) = match self.scans {
                    Some(scan) => (scan, all),
                    None => ((|index: u64| [index as u16, 4095]) as fn(u64) -> [u16; 2], 32),
                };
                for first_index in (0..sent).step_by(32) {
                    let codes = (first_index..sent.min(first_index + 32)).map(scan);
                    let codes = Codes::pack(codes).unwrap();
                    self.say(Raw { first_index, codes });
                }
                self.say(Link {
                    raw_sent: sent,
                    raw_dropped: all - sent,
                    ..Link::default()
                });
            }
            Request::WriteSettings { block } => {
                self.block = block.bytes().to_vec();
                if let Ok(settings) = bead_model::Settings::decode(&self.block) {
                    self.speaker.address = settings.description().address;
                }
                self.say_settings();
            }
            Request::ReadSettings | Request::EraseSettings => self.say_settings(),
            Request::SetKey { key } => self.lock.set(bead_wire::Key::new(*key)),
            Request::ListKept => {
                for ((boot, strike), frames) in self.kept.clone() {
                    let (parts, bytes) = (frames.len() as u8, 300);
                    self.say(Kept {
                        boot,
                        strike,
                        parts,
                        bytes,
                    });
                }
            }
            Request::Fetch { boot, strike } => {
                let mut kept = self.kept.iter();
                let found = kept.position(|(name, frames)| *name == (*boot, *strike) && !frames.is_empty());
                let Some(found) = found else {
                    return Outcome::NotKept;
                };
                let sent = self.kept[found - usize::from(self.repeats)..=found].iter();
                let parts = sent.flat_map(|((boot, strike), frames)| fetched(*boot, *strike, frames));
                parts
                    .collect::<Vec<_>>()
                    .into_iter()
                    .for_each(|part| self.say(part));
            }
            _ => {}
        }
        Outcome::Done
    }
}

/// Runs `bead` at a line with these beads. Answers sent at one time collide: the line is low wherever one
/// bead pulls it low.
pub(crate) fn at_line(folder: &Path, beads: &mut [AnsweringBead], arguments: &str) -> Output {
    let collided = |bytes: &[u8]| {
        let mut line = Vec::new();
        for bead in beads.iter_mut() {
            bead.hear(bytes);
            let said = std::mem::take(&mut bead.speaker.bytes);
            line.resize(said.len().max(line.len()), 0xFF);
            line.iter_mut().zip(said).for_each(|(line, said)| *line &= said);
        }
        line
    };
    asked(folder, &format!("{arguments} --timeout 0.5"), collided)
}
