//! Lost strikes of a bead, and the requests that fetch them.
//!
//! # Design
//! A bead keeps its last strikes, even across a reset. So a strike whose frames were lost can be fetched
//! until newer ones replace it. [`Gaps`] takes every frame of one bead and returns the requests, none while
//! nothing is missing.
//!
//! Strikes are wanted from the first one with a received frame, or else from the first status: earlier ones
//! were measured before anybody listened. The numbers of the received strikes, and the count in the status,
//! show what is missing of this boot. Only the bead knows about earlier boots: after a reset, and after the
//! line was gone, it is asked for the list of what it keeps.
//!
//! [`Assembly`] says which strikes came whole, and which boots begin with a restart.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::{Duration, Instant};

use bead_wire::{Arrival, Message, Outcome, Request};

use crate::conversation::encoded;
use bead_recording::assembly::{Assembled, Assembly, Event, Restart};
use bead_recording::frames::Frame;

/// Time after which a strike without all its frames is missing: ten times its frames' time on the line.
const OVERDUE: Duration = Duration::from_millis(200);
/// Time-out of a reply.
const PATIENCE: Duration = Duration::from_secs(1);
const ATTEMPTS: u32 = 5;
/// Number of strikes to ask for at a time. A bead keeps at most as many.
const WANTED: usize = 64;
/// Greatest number of lost strikes remembered for a boot.
const REMEMBERED: usize = 4096;

/// A strike: low byte of the boot, and number in it.
type StrikeKey = (u8, u32);

/// A request that the bead has not answered.
#[derive(Clone, Debug)]
struct Asked {
    number: u16,
    request: Request,
    since: Instant,
    attempts: u32,
    /// True if frames were lost since the request.
    lost: bool,
}

/// The lost strikes of one bead.
#[derive(Debug, Default)]
pub struct Gaps {
    address: u8,
    /// Low byte of the boot number.
    boot: u8,
    /// The whole number, by the identity.
    boot_number: Option<u32>,
    assembly: Assembly,
    /// The first wanted strike, in the first boot with a received frame.
    from: Option<StrikeKey>,
    /// Number of strikes of this boot, and of those whose frames should have come.
    count: u32,
    due: u32,
    /// All strikes of this boot below this one came, or are lost.
    settled: u32,
    /// Counts of strikes that are not due yet, each with the time when it was first known.
    counts: VecDeque<(u32, Instant)>,
    /// Strikes that the bead does not keep.
    gone: BTreeMap<u8, BTreeSet<u32>>,
    /// Number of strikes that are lost: the bead no longer keeps them, or never measured them.
    pub lost: u64,
    /// Strikes to fetch, by whole boot number and number, with the number of times that each was sent.
    wanted: BTreeMap<(u32, u32), u32>,
    /// True while the list of kept strikes is to be requested.
    list: bool,
    /// Number of times that the list was requested in vain.
    lists: u32,
    asked: Option<Asked>,
    next_number: u16,
    /// Earliest time of the next request.
    pause_until: Option<Instant>,
    /// Number of strikes that were fetched.
    pub fetched: u64,
}

impl Gaps {
    /// Lost strikes of the bead with this address, before its first frame.
    pub fn new(address: u8) -> Self {
        Self {
            address,
            // Other programs start their numbers elsewhere.
            next_number: 0x4000,
            ..Self::default()
        }
    }

    /// Notes that the line was gone and is back: strikes without any received frame may be lost.
    pub fn reconnect(&mut self) {
        self.list = self.from.is_some();
        self.lists = 0;
        self.asked = None;
    }

    /// Takes the next frame of the bead, at this time. Returns the fetched strike that it completes.
    pub fn push(&mut self, frame: &Frame, now: Instant) -> Option<Assembled> {
        self.boot = frame.header.boot;
        if let (Some(asked), Arrival::Next { lost: 1.. }) = (&mut self.asked, frame.arrival) {
            asked.lost = true;
        }
        let mut fetched = None;
        for event in self.assembly.push(frame) {
            match event {
                Event::Restart(restart) => self.restart(restart),
                Event::Strike(assembled) if assembled.strike.is_whole() => {
                    let strike = &assembled.strike;
                    self.find((strike.boot, strike.said.strike));
                    if let Some(copy) = assembled.fetched {
                        self.wanted.remove(&(copy.boot, strike.said.strike));
                        self.fetched += 1;
                        fetched = Some(*assembled);
                    }
                }
                Event::Strike(_) => {}
            }
        }
        match &frame.message {
            Message::Identity(identity) => self.boot_number = Some(identity.boot),
            Message::Status(status) => self.note_count(status.strikes, status.strikes, now),
            Message::Waveform(waveform) => self.note_strike(waveform.strike, now),
            Message::Strike(strike) => self.note_strike(strike.strike, now),
            Message::Shape(shape) => self.note_strike(shape.strike, now),
            Message::Kept(kept) => self.want(kept.boot, kept.strike),
            Message::Reply(reply) => self.answer(reply.request, reply.outcome, now),
            _ => {}
        }
        fetched
    }

    fn restart(&mut self, restart: Restart) {
        (self.count, self.due, self.settled) = (0, 0, 0);
        self.counts.clear();
        self.boot_number = None;
        if let Some((first, from)) = &mut self.from
            && restart.begins(*first)
        {
            *from = 0;
        }
        self.gone.retain(|boot, _| !restart.begins(*boot));
        let before = self.wanted.len();
        self.wanted.retain(|&(boot, _), _| !restart.begins(boot as u8));
        self.lost += (before - self.wanted.len()) as u64;
        self.reconnect();
    }

    fn note_strike(&mut self, number: u32, now: Instant) {
        self.note_count(number, number.saturating_add(1), now);
    }

    /// Notes that this boot has `count` strikes. For an unknown bead, strikes from number `from` are wanted.
    fn note_count(&mut self, from: u32, count: u32, now: Instant) {
        self.from.get_or_insert((self.boot, from));
        if count <= self.count {
            return;
        }
        self.count = count;
        self.fall_due(now);
        self.counts.push_back((count, now));
    }

    /// Notes the strikes whose frames should have come by now.
    fn fall_due(&mut self, now: Instant) {
        while let Some((count, _)) = self
            .counts
            .pop_front_if(|(_, since)| now.duration_since(*since) >= OVERDUE)
        {
            self.due = count;
        }
    }

    /// Notes that a strike has arrived, even if it was given up.
    fn find(&mut self, (boot, number): StrikeKey) {
        if let Some(gone) = self.gone.get_mut(&boot) {
            self.lost -= u64::from(gone.remove(&number));
        }
    }

    fn give_up(&mut self, (boot, number): (u32, u32)) {
        self.wanted.remove(&(boot, number));
        let gone = self.gone.entry(boot as u8).or_default();
        self.lost += u64::from(gone.insert(number));
        while gone.len() > REMEMBERED {
            gone.pop_first();
        }
    }

    /// True if a strike belongs in this recording and has not arrived.
    fn is_wanted(&self, (boot, number): StrikeKey) -> bool {
        let since = self
            .from
            .is_some_and(|(first, from)| boot != first || number >= from);
        since && !self.assembly.is_whole(self.address, boot, number)
    }

    fn want(&mut self, boot: u32, strike: u32) {
        if self.is_wanted((boot as u8, strike)) {
            self.wanted.entry((boot, strike)).or_default();
        }
    }

    fn answer(&mut self, number: u16, outcome: Outcome, now: Instant) {
        let Some(asked) = self.asked.take_if(|asked| asked.number == number) else {
            return;
        };
        match (asked.request, outcome) {
            (Request::ListKept, Outcome::Done) => {
                // The lost frames may be part of the list.
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
                // If the strike is still wanted, its frames were lost on the way.
                let Some(sent) = self.wanted.get_mut(&(boot, strike)) else {
                    return;
                };
                *sent += u32::from(outcome == Outcome::Done);
                if *sent == ATTEMPTS {
                    self.give_up((boot, strike));
                }
                self.pause_until = Some(now + OVERDUE);
            }
            _ => self.pause_until = Some(now + OVERDUE),
        }
    }

    /// The strikes of this boot that are due and have not arrived, each with the whole boot number.
    fn missing(&mut self) -> Vec<(u32, u32)> {
        let (Some(number), Some((first, from))) = (self.boot_number, self.from) else {
            return Vec::new();
        };
        let boot = number as u8;
        let from = if boot == first { from } else { 0 };
        let is_missing = |strike: u32| {
            let is_gone = self.gone.get(&boot).is_some_and(|gone| gone.contains(&strike));
            !is_gone && !self.assembly.is_whole(self.address, boot, strike)
        };
        let from = from.max(self.settled);
        let missing = (from..self.due).filter(|&strike| is_missing(strike));
        let missing: Vec<_> = missing.take(WANTED).map(|strike| (number, strike)).collect();
        self.settled = missing.first().map_or(self.due, |&(_, strike)| strike);
        missing
    }

    /// The bytes of the next request, if one is due. Call this often.
    pub fn next(&mut self, now: Instant) -> Option<Vec<u8>> {
        if self.pause_until.is_some_and(|until| now < until) {
            return None;
        }
        self.pause_until = None;
        if let Some(asked) = &mut self.asked {
            if now.duration_since(asked.since) < PATIENCE {
                return None;
            }
            if asked.attempts < ATTEMPTS {
                (asked.since, asked.attempts) = (now, asked.attempts + 1);
                return Some(encoded(self.address, asked.number, &asked.request));
            }
            // The bead does not answer. The requested strike stays wanted.
            self.asked = None;
            self.pause_until = Some(now + 10 * PATIENCE);
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

#[cfg(test)]
mod tests {
    use super::*;
    use bead_testing::{Speaker, one_sample_strike};
    use bead_wire::{Body, Reply, RequestDecoder, Status};

    const NEXT: Arrival = Arrival::Next { lost: 0 };
    const RESTART: Arrival = Arrival::Restart { lost: 0 };

    struct FakeBead {
        gaps: Gaps,
        now: Instant,
    }

    impl FakeBead {
        /// A bead that begins with this boot and without strikes.
        fn new(boot: u8) -> Self {
            let mut bead = Self {
                gaps: Gaps::new(0),
                now: Instant::now(),
            };
            bead.begins(boot, Arrival::First);
            bead
        }

        fn says(&mut self, boot: u8, arrival: Arrival, message: impl Into<Message>) {
            self.gaps.push(&Frame::of(0, boot, arrival, message), self.now);
        }

        fn begins(&mut self, boot: u8, arrival: Arrival) {
            let mut bead = Speaker::at(0);
            bead.boot = boot.into();
            self.says(boot, arrival, bead.identity());
            self.counts(boot, 0);
        }

        fn counts(&mut self, boot: u8, strikes: u32) {
            let status = Status::draw(&mut || 0);
            self.says(boot, NEXT, Status { strikes, ..status });
        }

        fn strike(&mut self, boot: u8, number: u32) {
            for message in one_sample_strike(number, 0) {
                self.says(boot, NEXT, message);
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

        /// Returns the request that the bead gets a second later.
        fn asked(&mut self) -> Option<(u16, Request)> {
            self.now += PATIENCE;
            let bytes = self.gaps.next(self.now)?;
            let mut decoder = RequestDecoder::new();
            let asked = bytes.iter().find_map(|byte| decoder.push(*byte));
            let asked = asked.expect("a request").expect("a sound one");
            Some((asked.number, asked.request.expect("a known one")))
        }

        /// All requests to a bead that lists its kept strikes and then refuses each.
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
        let mut bead = FakeBead::new(1);
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
        let mut bead = FakeBead::new(0);
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
        assert_eq!(bead.gaps.lost, 2);
        // These are not to be had a second time.
        bead.begins(0, RESTART);
        bead.counts(0, 6);
        assert_eq!(bead.refuses(0).len(), 7);
        assert_eq!(bead.gaps.lost, 8);
    }
}
