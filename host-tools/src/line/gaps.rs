//! Which strikes of a bead are missing, and what to ask it for.
//!
//! # Design
//! A bead keeps its last strikes, also over a reset. So a strike whose frames were lost on the way can be
//! fetched, as long as newer ones have not taken its place. [`Gaps`] sees every frame of one bead and says
//! when there is something to ask. It asks for nothing while nothing is missing.
//!
//! Strikes are wanted from the first one on that anything was heard of, or else from the first status on:
//! those before were measured before anybody listened. What is missing of this boot is known from the
//! numbers: of strikes that came, and of the status. Of boots before, only the bead knows: after a reset, or
//! after the line was gone, it is asked for the list of what it keeps.
//!
//! After a power cycle a bead keeps nothing and counts its boots anew, so strikes have the same names again.
//! What is known of a name is therefore forgotten when a boot of that number begins.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::{Duration, Instant};

use bead_wire::{Arrival, Fetched, MAX_REQUEST, Message, Outcome, Request, encode_request};

use crate::recording::again::{Again, Whole};
use crate::recording::frames::Frame;

/// A strike whose frames should have come by now is missing after this time: ten times its frames' time on
/// the line.
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

/// The newest 4096 of the names that it was given. The oldest give way and not the least: after a power cycle
/// new names are less than those before.
#[derive(Debug)]
pub struct Newest<T> {
    names: BTreeSet<T>,
    /// From the oldest to the newest.
    order: VecDeque<T>,
}

impl<T> Default for Newest<T> {
    fn default() -> Self {
        Self {
            names: BTreeSet::new(),
            order: VecDeque::new(),
        }
    }
}

impl<T: Copy + Ord> Newest<T> {
    /// Takes a name. Whether it was not there.
    pub fn insert(&mut self, name: T) -> bool {
        let is_new = self.names.insert(name);
        if is_new {
            self.order.push_back(name);
        }
        if self.order.len() > REMEMBERED
            && let Some(oldest) = self.order.pop_front()
        {
            self.names.remove(&oldest);
        }
        is_new
    }

    /// Whether it is there.
    pub fn contains(&self, name: T) -> bool {
        self.names.contains(&name)
    }

    /// Leaves out some of them.
    pub fn forget(&mut self, which: impl Fn(T) -> bool) {
        self.names.retain(|name| !which(*name));
        self.order.retain(|name| !which(*name));
    }
}

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
    whole: Newest<Name>,
    /// Strikes that the bead does not keep, and how many there were in all.
    gone: Newest<Name>,
    gone_count: u64,
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
            whole: Newest::default(),
            gone: Newest::default(),
            gone_count: 0,
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
        self.gone_count
    }

    /// Takes a frame of the bead. Gives a strike that was missing and is whole with it.
    pub fn note(&mut self, frame: &Frame, now: Instant) -> Option<Whole> {
        let boot = frame.header.boot;
        let is_other = self.boot.replace(boot).is_some_and(|before| before != boot);
        if is_other || matches!(frame.arrival, Arrival::Restart { .. }) {
            self.restart(boot);
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
                self.make_room();
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
                self.make_room();
                let coming = self.coming.entry(strike.strike).or_default();
                coming.samples = Some(strike.samples.into());
            }
            Message::Shape(shape) => {
                self.from.get_or_insert((boot, shape.strike));
                self.find(shape.strike.saturating_add(1), now);
                self.make_room();
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

    /// The bead was reset, and a boot with this low byte begins.
    fn restart(&mut self, boot: u8) {
        self.coming.clear();
        (self.found, self.due, self.settled) = (0, 0, 0);
        self.pending.clear();
        self.boot_number = None;
        if let Some((first, from)) = &mut self.from
            && *first == boot
        {
            *from = 0;
        }
        self.whole.forget(|(of, _)| of == boot);
        self.gone.forget(|(of, _)| of == boot);
        let before = self.wanted.len();
        self.wanted.retain(|&(of, _), _| of as u8 != boot);
        self.gone_count += (before - self.wanted.len()) as u64;
        self.again = Again::default();
        self.came_back();
    }

    /// There are so many strikes in this boot.
    fn find(&mut self, strikes: u32, now: Instant) {
        if strikes <= self.found {
            return;
        }
        self.found = strikes;
        self.fall_due(now);
        match self.pending.len() {
            ..COMING => self.pending.push_back((strikes, now)),
            // So many come at once that some are due a little early.
            _ => self.pending[COMING - 1].0 = strikes,
        }
    }

    /// Notes whose frames should have come.
    fn fall_due(&mut self, now: Instant) {
        while let Some((found, _)) = self
            .pending
            .pop_front_if(|(_, since)| now.duration_since(*since) >= OVERDUE)
        {
            self.due = found;
        }
    }

    /// Makes room for one more strike whose frames come. One that gives way is fetched later.
    fn make_room(&mut self) {
        while self.coming.len() >= COMING {
            self.coming.pop_first();
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
        if self.gone.contains(name) {
            self.gone.forget(|other| other == name);
            self.gone_count -= 1;
        }
    }

    /// It is not to be had.
    fn give_up(&mut self, (boot, strike): (u32, u32)) {
        self.wanted.remove(&(boot, strike));
        self.gone_count += u64::from(self.gone.insert((boot as u8, strike)));
    }

    /// Whether a strike is one that this recording is to have.
    fn is_of_interest(&self, name: Name) -> bool {
        let (boot, strike) = name;
        let since = self
            .from
            .is_some_and(|(first, from)| boot != first || strike >= from);
        since && !self.whole.contains(name)
    }

    fn want(&mut self, boot: u32, strike: u32) {
        if !self.is_of_interest((boot as u8, strike)) || self.wanted.contains_key(&(boot, strike)) {
            return;
        }
        if self.wanted.len() < WANTED {
            self.wanted.insert((boot, strike), 0);
            return;
        }
        // It is asked for the list once more when there is room.
        self.list |= self.lists < ATTEMPTS;
        if let Some(asked) = &mut self.asked {
            asked.lost = true;
        }
    }

    fn take(&mut self, frame: &Fetched) -> Option<Whole> {
        let whole = self.again.take(self.address, frame)?;
        let name = (whole.boot as u8, whole.strike.strike);
        self.wanted.remove(&(whole.boot, whole.strike.strike));
        if self.whole.contains(name) {
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
                self.give_up((boot, strike));
            }
            // A bead of an earlier version keeps nothing.
            (_, Outcome::Kind) => {
                self.list = false;
                self.wanted.clear();
                for name in self.missing() {
                    self.give_up(name);
                }
            }
            (Request::Fetch { boot, strike }, outcome) => {
                // Its frames were lost on the way, unless it is wanted no more.
                let Some(sent) = self.wanted.get_mut(&(boot, strike)) else {
                    return;
                };
                *sent += u32::from(outcome == Outcome::Done);
                if *sent == ATTEMPTS {
                    self.give_up((boot, strike));
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
            !self.whole.contains(name) && !self.gone.contains(name)
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
        self.fall_due(now);
        let room = WANTED.saturating_sub(self.wanted.len());
        for name in self.missing().into_iter().take(room) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use bead_wire::{
        Codes, Energy, Identity, Kept, Kind, Reply, RequestDecoder, ResetCauses, Shape, Status, Strike,
        Waveform,
    };

    const NEXT: Arrival = Arrival::Next { lost: 0 };
    const RESTART: Arrival = Arrival::Restart { lost: 0 };

    /// A bead at its gaps.
    struct Bead {
        gaps: Gaps,
        now: Instant,
    }

    impl Bead {
        /// It begins with this boot, and with no strike.
        fn new(boot: u8) -> Self {
            let mut bead = Self {
                gaps: Gaps::new(0),
                now: Instant::now(),
            };
            bead.begins(boot, Arrival::First);
            bead
        }

        fn says(&mut self, boot: u8, arrival: Arrival, message: impl Into<Message>) {
            self.gaps.note(&Frame::of(0, boot, arrival, message), self.now);
        }

        fn begins(&mut self, boot: u8, arrival: Arrival) {
            let identity = Identity {
                firmware: "".into(),
                git: "".into(),
                uid: [0; 12],
                boot: boot.into(),
                reset_cause: ResetCauses::NONE,
                sample_rate_hz: 100_000,
                channels: 4,
            };
            self.says(boot, arrival, identity);
            self.counts(boot, 0);
        }

        /// It says how many strikes it found.
        fn counts(&mut self, boot: u8, strikes: u32) {
            let Message::Status(status) = Message::draw(Kind::Status, &mut || 0) else {
                panic!("a status");
            };
            self.says(boot, NEXT, Message::Status(Status { strikes, ..status }));
        }

        /// The result of a strike, and nothing else of it.
        fn result(&mut self, boot: u8, number: u32) {
            let Message::Strike(strike) = Message::draw(Kind::Strike, &mut || 0) else {
                panic!("a strike");
            };
            let strike = Strike {
                strike: number,
                samples: 1,
                ..strike
            };
            self.says(boot, NEXT, strike);
        }

        /// All frames of a strike.
        fn strike(&mut self, boot: u8, number: u32) {
            let waveform = Waveform {
                strike: number,
                first_index: 0,
                codes: Codes::pack([[1, 2]]).unwrap(),
                wide: Codes::default(),
                absorbed_measured: Energy::from_bits(0),
                absorbed_predicted: Energy::from_bits(0),
            };
            self.says(boot, NEXT, waveform);
            self.result(boot, number);
            let Message::Shape(shape) = Message::draw(Kind::Shape, &mut || 0) else {
                panic!("a shape");
            };
            let shape = Shape {
                strike: number,
                ..shape
            };
            self.says(boot, NEXT, shape);
        }

        /// It lists these strikes of an earlier boot.
        fn keeps(&mut self, boot: u8, strikes: std::ops::Range<u32>) {
            for strike in strikes {
                let kept = Kept {
                    boot: 4,
                    strike,
                    parts: 4,
                    bytes: 300,
                };
                self.says(boot, NEXT, kept);
            }
        }

        fn replies(&mut self, boot: u8, request: u16, outcome: Outcome) {
            let reply = Reply {
                request,
                outcome,
                detail: "".into(),
            };
            self.says(boot, NEXT, reply);
        }

        /// What it is asked a second later.
        fn asked(&mut self) -> Option<(u16, Request)> {
            self.now += PATIENCE;
            let bytes = self.gaps.next(self.now)?;
            let mut decoder = RequestDecoder::new();
            let asked = bytes.iter().find_map(|byte| decoder.push(*byte));
            let asked = asked.expect("a request").expect("a sound one");
            Some((asked.number, asked.request.expect("a known one")))
        }

        /// The requests of a bead that says what it keeps and has nothing of it, until there is none.
        fn refuses(&mut self, boot: u8) -> Vec<Request> {
            let mut asked = Vec::new();
            while let Some((request, what)) = self.asked() {
                let outcome = match what {
                    Request::ListKept => Outcome::Done,
                    _ => Outcome::NotKept,
                };
                self.replies(boot, request, outcome);
                asked.push(what);
            }
            asked
        }
    }

    #[test]
    fn a_strike_that_came_whole_after_a_power_cycle_is_not_asked_for() {
        let mut bead = Bead::new(1);
        for number in 0..REMEMBERED as u32 + 10 {
            bead.strike(1, number);
        }
        bead.begins(0, RESTART);
        for number in 0..3 {
            bead.strike(0, number);
        }
        assert_eq!(bead.refuses(0), [Request::ListKept]);
    }

    #[test]
    fn strikes_that_are_lost_after_a_power_cycle_are_asked_for_although_their_names_were_there_before() {
        let mut bead = Bead::new(0);
        for number in 0..10 {
            bead.strike(0, number);
        }
        bead.begins(0, RESTART);
        for number in 0..5 {
            bead.strike(0, number);
        }
        bead.counts(0, 7);
        let fetch = |strike| Request::Fetch { boot: 0, strike };
        assert_eq!(bead.refuses(0), [fetch(5), fetch(6), Request::ListKept]);
        assert_eq!(bead.gaps.gone(), 2);
        // These are not to be had a second time.
        bead.begins(0, RESTART);
        bead.counts(0, 6);
        assert_eq!(bead.refuses(0).len(), 7);
        assert_eq!(bead.gaps.gone(), 8);
    }

    #[test]
    fn what_is_known_of_strikes_that_nobody_asks_for_stays_small() {
        let mut bead = Bead::new(0);
        for number in 0..1000 {
            bead.now += Duration::from_millis(1);
            bead.result(0, number);
        }
        assert!(bead.gaps.pending.len() <= COMING, "{}", bead.gaps.pending.len());
        assert!(bead.gaps.coming.len() <= COMING, "{}", bead.gaps.coming.len());
        // None of them is forgotten.
        assert_eq!(bead.refuses(0).len(), 1000);
        assert_eq!(bead.gaps.gone(), 1000);
    }

    #[test]
    fn a_list_that_is_too_long_is_asked_for_again_when_there_is_room() {
        let mut bead = Bead::new(5);
        bead.gaps.came_back();
        let (request, what) = bead.asked().unwrap();
        assert_eq!(what, Request::ListKept);
        bead.keeps(5, 0..100);
        assert_eq!(bead.gaps.wanted.len(), WANTED);
        bead.replies(5, request, Outcome::Done);
        let asked = bead.refuses(5);
        assert_eq!(asked.len(), WANTED + 1);
        assert_eq!(asked.last(), Some(&Request::ListKept));
    }
}
