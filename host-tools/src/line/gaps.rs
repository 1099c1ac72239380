//! Which strikes of a bead are missing, and what to ask it for.
//!
//! # Design
//! A bead keeps its last strikes, also over a reset. So a strike whose frames were lost on the way can be fetched,
//! as long as newer ones have not taken its place. [`Gaps`] sees every frame of one bead and says when there is
//! something to ask. It asks for nothing while nothing is missing.
//!
//! Strikes are wanted from the first one on that anything was heard of, or else from the first status on: those before
//! were measured before anybody listened. What is missing
//! of this boot is known from the numbers: of strikes that came, and of the status. Of boots before, only the bead knows:
//! after a reset, or after the line was gone, it is asked for the list of what it keeps.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::{Duration, Instant};

use bead_wire::{Arrival, Fetched, MAX_REQUEST, Message, Outcome, Request, encode_request};

use crate::recording::again::{Again, Whole};
use crate::recording::frames::Frame;

/// A strike whose frames should have come by now is missing after this time: ten times its frames' time on the line.
const OVERDUE: Duration = Duration::from_millis(200);
/// A reply may take so long.
const PATIENCE: Duration = Duration::from_secs(1);
/// So often is the same thing asked.
const ATTEMPTS: u32 = 5;
/// Most strikes whose frames come at once.
const COMING: usize = 64;
/// Most strikes that are asked for at a time: a bead keeps no more.
const WANTED: usize = 64;
/// Most strikes that are remembered.
const REMEMBERED: usize = 4096;

/// A strike: low byte of the boot, and number in it.
type Name = (u8, u32);

/// What is known of a strike whose frames come.
#[derive(Clone, Debug, Default)]
struct Coming {
    /// Scans that came, without a gap from the first on; `None` after a gap.
    scans: Option<u64>,
    next_index: u64,
    /// Scans of the window, once the strike frame came.
    samples: Option<u64>,
    shape: bool,
}

/// What the bead was asked and has not answered.
#[derive(Clone, Debug)]
struct Asked {
    number: u16,
    request: Request,
    since: Instant,
    attempts: u32,
    /// Whether frames were lost since.
    lost: bool,
}

/// Keeps count of one bead's strikes.
#[derive(Debug)]
pub struct Gaps {
    address: u8,
    boot: Option<u8>,
    /// Its whole number, as its identity says.
    boot_number: Option<u32>,
    /// The first strike that is wanted, in the boot that was heard first.
    from: Option<Name>,
    /// Strikes of this boot that are known to be, and those whose frames should have come.
    found: u32,
    due: u32,
    /// All strikes of this boot below this one are here or gone.
    settled: u32,
    /// How many strikes were known to be, and since when, until they are due.
    pending: VecDeque<(u32, Instant)>,
    coming: BTreeMap<u32, Coming>,
    whole: BTreeSet<Name>,
    /// Strikes that the bead does not keep.
    gone: BTreeSet<Name>,
    /// Strikes that are to be fetched, by their whole boot numbers; how often each was sent.
    wanted: BTreeMap<(u32, u32), u32>,
    list: bool,
    /// How often it was asked for in vain.
    lists: u32,
    again: Again,
    asked: Option<Asked>,
    next_number: u16,
    /// Not before.
    rest_until: Option<Instant>,
    fetched: u64,
}

impl Gaps {
    /// Of the bead with this address; nothing of it was heard yet.
    pub fn new(address: u8) -> Self {
        Self {
            address,
            boot: None,
            boot_number: None,
            from: None,
            found: 0,
            due: 0,
            settled: 0,
            pending: VecDeque::new(),
            coming: BTreeMap::new(),
            whole: BTreeSet::new(),
            gone: BTreeSet::new(),
            wanted: BTreeMap::new(),
            list: false,
            lists: 0,
            again: Again::default(),
            asked: None,
            // Other programs count from somewhere else.
            next_number: 0x4000,
            rest_until: None,
            fetched: 0,
        }
    }

    /// The line was gone and is back: there may be strikes that nobody has heard of.
    pub fn came_back(&mut self) {
        self.list = self.from.is_some();
        self.lists = 0;
        self.asked = None;
    }

    /// Strikes that were fetched.
    pub fn fetched(&self) -> u64 {
        self.fetched
    }

    /// Strikes that are known to be missing: the bead no longer keeps them, or never measured them.
    pub fn gone(&self) -> u64 {
        self.gone.len() as u64
    }

    /// Takes a frame of the bead. Gives a strike that was missing and is whole with it.
    pub fn note(&mut self, frame: &Frame, now: Instant) -> Option<Whole> {
        let boot = frame.header.boot;
        if self.boot.replace(boot).is_some_and(|before| before != boot) {
            self.coming.clear();
            (self.found, self.due, self.settled) = (0, 0, 0);
            self.pending.clear();
            self.boot_number = None;
            self.came_back();
        }
        if let (Some(asked), Arrival::Next { lost: 1.. }) = (&mut self.asked, frame.arrival) {
            asked.lost = true;
        }
        match &frame.message {
            Message::Identity(identity) => self.boot_number = Some(identity.boot),
            Message::Status(status) => {
                self.from.get_or_insert((boot, status.strikes));
                self.find(status.strikes, now);
            }
            Message::Waveform(waveform) => {
                self.from.get_or_insert((boot, waveform.strike));
                self.find(waveform.strike.saturating_add(1), now);
                while self.coming.len() > COMING {
                    self.coming.pop_first();
                }
                let coming = self.coming.entry(waveform.strike).or_insert_with(|| Coming {
                    scans: Some(0),
                    next_index: waveform.first_index,
                    ..Coming::default()
                });
                if waveform.first_index != coming.next_index {
                    coming.scans = None;
                }
                let length = waveform.codes.len() as u64;
                coming.scans = coming.scans.map(|scans| scans + length);
                coming.next_index = waveform.first_index.saturating_add(length);
            }
            Message::Strike(strike) => {
                self.from.get_or_insert((boot, strike.strike));
                self.find(strike.strike.saturating_add(1), now);
                let coming = self.coming.entry(strike.strike).or_default();
                coming.samples = Some(strike.samples.into());
            }
            Message::Shape(shape) => {
                self.from.get_or_insert((boot, shape.strike));
                self.find(shape.strike.saturating_add(1), now);
                self.coming.entry(shape.strike).or_default().shape = true;
                self.settle(boot, shape.strike);
            }
            Message::Kept(kept) => self.want(kept.boot, kept.strike),
            Message::Fetched(fetched) => return self.take(fetched),
            Message::Reply(reply) => self.answered(reply.request, reply.outcome, now),
            _ => {}
        }
        None
    }

    /// There are so many strikes in this boot.
    fn find(&mut self, strikes: u32, now: Instant) {
        if strikes > self.found {
            self.found = strikes;
            self.pending.push_back((strikes, now));
        }
    }

    /// All frames of a strike should have come.
    fn settle(&mut self, boot: u8, strike: u32) {
        let is_whole = self
            .coming
            .remove(&strike)
            .is_some_and(|coming| coming.shape && coming.samples.is_some() && coming.scans == coming.samples);
        if is_whole {
            self.remember((boot, strike));
        }
    }

    fn remember(&mut self, name: Name) {
        self.whole.insert(name);
        self.gone.remove(&name);
        while self.whole.len() > REMEMBERED {
            self.whole.pop_first();
        }
    }

    /// Whether a strike is one that this recording is to have.
    fn is_of_interest(&self, name: Name) -> bool {
        let (boot, strike) = name;
        let since = self
            .from
            .is_some_and(|(first, from)| boot != first || strike >= from);
        since && !self.whole.contains(&name)
    }

    fn want(&mut self, boot: u32, strike: u32) {
        if self.is_of_interest((boot as u8, strike)) {
            self.wanted.entry((boot, strike)).or_default();
        }
    }

    fn take(&mut self, frame: &Fetched) -> Option<Whole> {
        let whole = self.again.take(self.address, frame)?;
        let name = (whole.boot as u8, whole.strike.strike);
        self.wanted.remove(&(whole.boot, whole.strike.strike));
        if self.whole.contains(&name) {
            return None;
        }
        self.remember(name);
        self.fetched += 1;
        Some(whole)
    }

    fn answered(&mut self, number: u16, outcome: Outcome, now: Instant) {
        let Some(asked) = self.asked.take_if(|asked| asked.number == number) else {
            return;
        };
        match (asked.request, outcome) {
            (Request::ListKept, Outcome::Done) => {
                // A strike of the list may be among what was lost.
                self.lists += 1;
                self.list = asked.lost && self.lists < ATTEMPTS;
            }
            (Request::Fetch { boot, strike }, Outcome::NotKept) => {
                self.wanted.remove(&(boot, strike));
                self.gone.insert((boot as u8, strike));
            }
            // A bead of an earlier version keeps nothing.
            (_, Outcome::Kind) => {
                self.list = false;
                self.wanted.clear();
                let missing = self.missing();
                self.gone
                    .extend(missing.into_iter().map(|(boot, strike)| (boot as u8, strike)));
            }
            (Request::Fetch { boot, strike }, outcome) => {
                // Its frames were lost on the way, unless it is wanted no more.
                let Some(sent) = self.wanted.get_mut(&(boot, strike)) else {
                    return;
                };
                *sent += u32::from(outcome == Outcome::Done);
                if *sent == ATTEMPTS {
                    self.wanted.remove(&(boot, strike));
                    self.gone.insert((boot as u8, strike));
                }
                self.rest_until = Some(now + OVERDUE);
            }
            _ => self.rest_until = Some(now + OVERDUE),
        }
    }

    /// The strikes of this boot that should have come and did not, by its whole number.
    fn missing(&mut self) -> Vec<(u32, u32)> {
        let (Some(number), Some((first, from))) = (self.boot_number, self.from) else {
            return Vec::new();
        };
        let boot = number as u8;
        let from = if boot == first { from } else { 0 };
        let is_missing = |strike: u32| {
            let name = (boot, strike);
            !self.whole.contains(&name) && !self.gone.contains(&name)
        };
        let from = from.max(self.settled);
        let missing = (from..self.due).filter(|&strike| is_missing(strike));
        let missing: Vec<_> = missing.take(WANTED).map(|strike| (number, strike)).collect();
        self.settled = missing.first().map_or(self.due, |&(_, strike)| strike);
        missing
    }

    /// The bytes to send to the bead now, if there is something to ask. Called often.
    pub fn next(&mut self, now: Instant) -> Option<Vec<u8>> {
        if self.rest_until.is_some_and(|until| now < until) {
            return None;
        }
        self.rest_until = None;
        if let Some(asked) = &mut self.asked {
            if now.duration_since(asked.since) < PATIENCE {
                return None;
            }
            if asked.attempts < ATTEMPTS {
                (asked.since, asked.attempts) = (now, asked.attempts + 1);
                return Some(encoded(self.address, asked.number, &asked.request));
            }
            // It does not answer. What it is asked for stays wanted.
            self.asked = None;
            self.rest_until = Some(now + 10 * PATIENCE);
            return None;
        }
        while let Some((found, _)) = self
            .pending
            .pop_front_if(|(_, since)| now.duration_since(*since) >= OVERDUE)
        {
            self.due = found;
        }
        for name in self.missing() {
            self.wanted.entry(name).or_default();
        }
        let request = match self.wanted.first_key_value() {
            Some((&(boot, strike), _)) => Request::Fetch { boot, strike },
            None if self.list => Request::ListKept,
            None => return None,
        };
        let number = self.next_number;
        self.next_number = self.next_number.wrapping_add(1);
        let bytes = encoded(self.address, number, &request);
        self.asked = Some(Asked {
            number,
            request,
            since: now,
            attempts: 1,
            lost: false,
        });
        Some(bytes)
    }
}

fn encoded(address: u8, number: u16, request: &Request) -> Vec<u8> {
    let mut buffer = [0; MAX_REQUEST];
    let bytes = encode_request(address, number, request, &mut buffer);
    bytes.expect("MAX_REQUEST bytes always suffice").to_vec()
}
