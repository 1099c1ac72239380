//! Strikes, put together from the frames of their beads.
//!
//! # Design
//! A strike has several frames: its window in waveform frames, its result, and its shape. Frames may be lost
//! or late, and a bead may be reset between them. A strike that was lost can be fetched: the bead sends each
//! of its frames again inside a [`Fetched`] frame. [`Assembly`] takes every frame of a line and hands on
//! strikes and restarts. The reader of recordings, their channels for other programs, and the recorder all
//! use it.
//!
//! **Order.** The strikes of a boot are handed on in the order of their numbers. A strike is due when all of
//! its frames are here and no frame before it is missing, or else when a missing frame counts as lost,
//! [`REORDER`] frames later. It also waits for the first settings of its boot, but no longer than until more
//! than `WAITING` strikes wait. A restart and the end of the frames hand on the rest.
//!
//! **Names.** The name of a strike is the low byte of its boot and its number in it. Of each bead's newest
//! `REMEMBERED` strikes the assembly remembers which parts came, and hands on a fetched copy only of a
//! strike that did not come whole.
//!
//! **Restarts.** A bead counts its boots from 0 at power-up, in one byte that wraps after 256 resets, so
//! names recur. When a bead restarts, the assembly forgets the names of all boots that may have begun since
//! its last frame: from the boot after the last one up to the new one, modulo 256. After a power cycle these
//! include boot 0 to the new one; if the byte is the same as before, all 256. The names of other boots stay,
//! as a bead keeps its last strikes over a reset. The byte does not show one case: a power cycle, and then so
//! many unseen resets that the number is higher than before. There the index of the first sample
//! distinguishes two strikes.

use std::collections::{BTreeMap, VecDeque};

use bead_model::layout::WINDOW_MAX;
use bead_model::settings::{Settings, SettingsError};
use bead_wire::{Arrival, Fetched, Header, Message, REORDER, Shape, Strike, Waveform};

use crate::fetched::FetchedFrames;
use crate::frames::Frame;
use crate::strike::RecordedStrike;

/// A frame that comes this many frames too late counts as lost.
const SETTLED: i64 = REORDER as i64;
/// Greatest number of strikes and of settings of a bead that wait. A bead that never sends a result or
/// settings, or whose strikes count down, must not fill the memory.
const WAITING: usize = 64;
/// Number of strikes of a bead whose names are remembered.
const REMEMBERED: usize = 4096;

/// A result of [`Assembly::push`].
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// A bead restarted. The strikes of its boot before were handed on.
    Restart(Restart),
    /// A strike that is whole, or whose missing parts can no longer come in late frames.
    Strike(Box<Assembled>),
}

/// A strike, and how it came.
#[derive(Clone, Debug, PartialEq)]
pub struct Assembled {
    /// The strike.
    pub strike: RecordedStrike,
    /// Header of the strike frame. For a fetched strike, that of its last fetched frame, with the boot of the
    /// strike.
    pub header: Header,
    /// `None` for a strike that came when it was measured.
    pub fetched: Option<FetchedCopy>,
}

/// The fetched copy of a strike.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FetchedCopy {
    /// Number of the boot in which the strike was measured.
    pub boot: u32,
    /// Parts of the strike that were handed on before.
    pub before: StrikeParts,
}

/// A window whose result never came.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnfinishedWindow {
    /// Address of its bead.
    pub address: u8,
    /// Low byte of its boot, and number of the boot among those that were received.
    pub boot: (u8, Option<usize>),
    /// Sample index of the first sample that is known of it.
    pub first_index: u64,
}

/// Parts of a strike that came.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StrikeParts {
    /// The result: its strike frame.
    pub result: bool,
    /// The shape.
    pub shape: bool,
    /// Every sample of the window.
    pub window: bool,
}

impl StrikeParts {
    const ALL: Self = Self {
        result: true,
        shape: true,
        window: true,
    };
}

/// A restart of a bead.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Restart {
    /// Address of the bead.
    pub address: u8,
    /// Low byte of the boot number before.
    pub before: u8,
    /// Low byte of the boot number now.
    pub boot: u8,
}

impl Restart {
    /// True if the boot with this low byte may have begun since the last frame before the restart, so that
    /// its strikes are not those known by the same names.
    pub fn begins(self, boot: u8) -> bool {
        // From the boot after the last one, which is 0 here, to the new one.
        let after = |boot: u8| boot.wrapping_sub(self.before).wrapping_sub(1);
        after(boot) <= after(self.boot)
    }
}

/// Puts the frames of strikes together, of all beads on one line. Memory: at most `WAITING` windows, and
/// `REMEMBERED` names, for each bead.
#[derive(Clone, Debug, Default)]
pub struct Assembly {
    /// By address.
    beads: BTreeMap<u8, BeadFrames>,
}

impl Assembly {
    /// Takes the next frame of the line and returns the events that follow from it, in order.
    pub fn push(&mut self, frame: &Frame) -> Vec<Event> {
        let mut events = Vec::new();
        if frame.arrival == Arrival::Duplicate {
            return events;
        }
        let Header { address, boot, .. } = frame.header;
        let new = || BeadFrames {
            boot,
            ..BeadFrames::default()
        };
        let bead = self.beads.entry(address).or_insert_with(new);
        if let Arrival::Restart { .. } = frame.arrival {
            bead.restart(address, boot, &mut events);
        }
        bead.push(frame, &mut events);
        events
    }

    /// Hands on the waiting strikes at the end of the frames.
    pub fn end(&mut self) -> Vec<Event> {
        let mut events = Vec::new();
        for bead in self.beads.values_mut() {
            bead.end_boot(&mut events);
        }
        events
    }

    /// The windows that wait for their result.
    pub fn unfinished(&self) -> Vec<UnfinishedWindow> {
        let of = |(address, bead): (&u8, &BeadFrames)| {
            let (address, boot) = (*address, (bead.boot, Some(bead.restarts)));
            let waiting = bead.pending.values().filter(|pending| pending.result.is_none());
            let first = waiting.filter_map(|pending| {
                let shape = pending.shape.map(|shape| shape.first_index);
                let scans = pending.waveforms.iter().map(|waveform| waveform.first_index);
                scans.chain(shape).min()
            });
            let window = |first_index| UnfinishedWindow {
                address,
                boot,
                first_index,
            };
            first.map(window).collect::<Vec<_>>()
        };
        self.beads.iter().flat_map(of).collect()
    }

    /// True if every part of a strike came. It is named by the address of its bead, the low byte of its boot,
    /// and its number.
    pub fn is_whole(&self, address: u8, boot: u8, number: u32) -> bool {
        let bead = self.beads.get(&address);
        bead.is_some_and(|bead| bead.register.parts(boot, number) == StrikeParts::ALL)
    }

    /// True if no frames of a strike are on their way: the last frame of each strike that has begun came.
    pub fn is_idle(&self) -> bool {
        let ended = |pending: &Pending| pending.shape.is_some();
        self.beads
            .values()
            .all(|bead| bead.fetched.is_empty() && bead.pending.values().all(ended))
    }
}

/// One bead: the frames since its last restart that were not handed on, and the names of its strikes.
#[derive(Clone, Debug, Default)]
struct BeadFrames {
    boot: u8,
    /// Number of restarts.
    restarts: usize,
    frames: Unwrapped,
    /// Number of the newest frame.
    newest: i64,
    /// Number of the newest frame before which one is missing.
    gap: Option<i64>,
    strikes: Unwrapped,
    /// By the number of their frame, as they may change between two strikes.
    settings: BTreeMap<i64, Settings>,
    /// Version of a settings block that a program from before the first release wrote.
    unreleased_settings: Option<u16>,
    /// By the number of the strike.
    pending: BTreeMap<i64, Pending>,
    uid: Option<[u8; 12]>,
    fetched: FetchedFrames,
    register: StrikeNames,
}

/// The frames of a strike that wait for others.
#[derive(Clone, Debug, Default)]
struct Pending {
    result: Option<StrikeFrame>,
    shape: Option<Shape>,
    waveforms: Vec<Waveform>,
}

#[derive(Clone, Debug)]
struct StrikeFrame {
    number: i64,
    header: Header,
    /// Without samples, shape and settings yet.
    strike: RecordedStrike,
}

impl Pending {
    fn push(&mut self, waveform: &Waveform) {
        if self.waveforms.len() < usize::from(WINDOW_MAX) {
            self.waveforms.push(waveform.clone());
        }
    }

    /// The waveforms of a window that begins at this sample, in order, up to the first gap.
    fn window(&mut self, first_index: u64) -> impl Iterator<Item = &Waveform> {
        self.waveforms.sort_by_key(|waveform| waveform.first_index);
        let mut next = Some(first_index);
        self.waveforms.iter().take_while(move |waveform| {
            let follows = Some(waveform.first_index) == next;
            next = next.and_then(|next| next.checked_add(waveform.codes.len() as u64));
            follows
        })
    }

    /// True if every sample of this strike is here.
    fn has_window(&mut self, strike: &Strike) -> bool {
        let window = self.window(strike.first_index);
        let samples: usize = window.map(|waveform| waveform.codes.len()).sum();
        samples >= usize::from(strike.samples)
    }
}

impl BeadFrames {
    fn restart(&mut self, address: u8, boot: u8, events: &mut Vec<Event>) {
        self.end_boot(events);
        let before = self.boot;
        let restart = Restart {
            address,
            before,
            boot,
        };
        self.register.forget(restart);
        *self = Self {
            boot,
            restarts: self.restarts + 1,
            register: std::mem::take(&mut self.register),
            ..Self::default()
        };
        events.push(Event::Restart(restart));
    }

    fn push(&mut self, frame: &Frame, events: &mut Vec<Event>) {
        let number = self.frames.follow(frame.header.sequence);
        self.newest = self.newest.max(number);
        if let Arrival::Next { lost: 1.. } = frame.arrival {
            self.gap = Some(number);
        }
        match &frame.message {
            Message::Settings(settings) => self.push_settings(number, settings.block.bytes()),
            Message::Identity(identity) => self.uid = Some(identity.uid),
            Message::Waveform(waveform) => {
                let strike = self.strikes.follow(waveform.strike);
                self.pending.entry(strike).or_default().push(waveform);
                self.note_window(strike);
            }
            Message::Strike(strike) => self.push_strike(number, frame, *strike),
            Message::Shape(shape) => {
                let strike = self.strikes.follow(shape.strike);
                self.pending.entry(strike).or_default().shape = Some(*shape);
                self.parts(shape.strike, shape.first_index).shape = true;
            }
            Message::Fetched(fetched) => events.extend(self.push_fetched(frame, fetched)),
            _ => {}
        }
        self.settle(events);
    }

    fn push_settings(&mut self, frame: i64, block: &[u8]) {
        match Settings::decode(block) {
            // Settings come every second and rarely change.
            Ok(settings) if self.settings.values().next_back() != Some(&settings) => {
                self.settings.insert(frame, settings);
            }
            Err(SettingsError::Unreleased(version)) => self.unreleased_settings = Some(version),
            Ok(_) | Err(_) => {}
        }
        while self.settings.len() > WAITING {
            self.settings.pop_first();
        }
    }

    fn push_strike(&mut self, number: i64, frame: &Frame, said: Strike) {
        let recorded = RecordedStrike {
            boot: frame.header.boot,
            nth_boot: Some(self.restarts),
            uid: self.uid,
            sample_rate_hz: frame.sample_rate_hz,
            received_ns: frame.received_ns,
            ..RecordedStrike::new(frame.header.address, said)
        };
        let strike = self.strikes.follow(said.strike);
        self.pending.entry(strike).or_default().result = Some(StrikeFrame {
            number,
            header: frame.header,
            strike: recorded,
        });
        self.parts(said.strike, said.first_index).result = true;
        self.note_window(strike);
    }

    /// Takes a frame of a fetched strike. Returns the strike if this was its last frame and it was not handed
    /// on whole before.
    fn push_fetched(&mut self, frame: &Frame, fetched: &Fetched) -> Option<Event> {
        let address = frame.header.address;
        let strike = self.fetched.push(address, fetched)?;
        let number = strike.said.strike;
        let entry = self.register.entry(strike.boot, number, strike.said.first_index);
        if std::mem::replace(&mut entry.is_handed_on, true) {
            return None;
        }
        let mut before = std::mem::replace(&mut entry.parts, StrikeParts::ALL);
        if strike.boot == self.boot {
            // The copy replaces the parts that wait.
            let waiting = self.pending.len();
            self.pending.retain(|other, _| *other as u32 != number);
            before.window &= self.pending.len() == waiting;
        }
        let mut header = frame.header;
        header.boot = strike.boot;
        let boot = fetched.boot;
        Some(Event::Strike(Box::new(Assembled {
            header,
            strike: RecordedStrike {
                uid: self.uid,
                sample_rate_hz: frame.sample_rate_hz,
                ..strike
            },
            fetched: Some(FetchedCopy { boot, before }),
        })))
    }

    /// Remembers that the window of a strike is whole, if it is.
    fn note_window(&mut self, strike: i64) {
        let Some(pending) = self.pending.get_mut(&strike) else {
            return;
        };
        let Some(said) = pending.result.as_ref().map(|result| result.strike.said) else {
            return;
        };
        if pending.has_window(&said) {
            self.parts(said.strike, said.first_index).window = true;
        }
    }

    fn parts(&mut self, number: u32, first_index: u64) -> &mut StrikeParts {
        &mut self.register.entry(self.boot, number, first_index).parts
    }

    fn settle(&mut self, events: &mut Vec<Event>) {
        while let Some(strike) = self.due() {
            events.extend(self.assemble(strike));
        }
        // The strike frames of the oldest will not come.
        while self.pending.len() > WAITING {
            self.pending.pop_first();
        }
    }

    /// The first strike that has a result, if it is due.
    fn due(&self) -> Option<i64> {
        let mut results = self
            .pending
            .iter()
            .filter_map(|(strike, pending)| Some((*strike, pending.result.as_ref()?)));
        let (strike, result) = results.next()?;
        let said = &result.strike.said;
        let may_be_late = |frame: i64| self.newest - frame <= SETTLED;
        let is_complete = !self.gap.is_some_and(may_be_late)
            && self.register.parts(self.boot, said.strike) == StrikeParts::ALL;
        let is_settled = !self.settings.is_empty() && (is_complete || !may_be_late(result.number));
        (is_settled || self.pending.len() > WAITING).then_some(strike)
    }

    /// Hands on all strikes that have a result.
    fn end_boot(&mut self, events: &mut Vec<Event>) {
        let strikes: Vec<i64> = self.pending.keys().copied().collect();
        events.extend(strikes.into_iter().filter_map(|strike| self.assemble(strike)));
    }

    /// Takes out a strike, and drops all parts of strikes before it, whose strike frames are lost.
    fn assemble(&mut self, strike: i64) -> Option<Event> {
        self.pending.get(&strike)?.result.as_ref()?;
        let behind = self.pending.split_off(&(strike + 1));
        let mut pending = std::mem::replace(&mut self.pending, behind).remove(&strike)?;
        let StrikeFrame {
            number,
            header,
            mut strike,
        } = pending.result.take()?;
        strike.shape = pending.shape;
        strike.settings = self.settings_before(number);
        strike.unreleased_settings = self.unreleased_settings;
        pending.waveforms.sort_by_key(|waveform| waveform.first_index);
        pending
            .waveforms
            .iter()
            .for_each(|waveform| strike.place(waveform));
        let said = &strike.said;
        let entry = self.register.entry(self.boot, said.strike, said.first_index);
        if entry.is_handed_on {
            return None;
        }
        entry.is_handed_on = strike.is_whole();
        Some(Event::Strike(Box::new(Assembled {
            strike,
            header,
            fetched: None,
        })))
    }

    /// The last settings before a frame. If those frames are all lost, the first settings after it, as
    /// settings rarely change. Settings before these are forgotten.
    fn settings_before(&mut self, frame: i64) -> Option<Settings> {
        if let Some((&last, &settings)) = self.settings.range(..frame).next_back() {
            self.settings = self.settings.split_off(&last);
            return Some(settings);
        }
        self.settings.values().next().copied()
    }
}

/// Numbers that continue where those of the wire begin again at 0: after 2^32 frames, which a full line sends
/// in 24 days.
#[derive(Clone, Copy, Debug, Default)]
struct Unwrapped(Option<i64>);

impl Unwrapped {
    /// The number whose lower half is `number` and that is nearest to the number before.
    fn follow(&mut self, number: u32) -> i64 {
        let whole = match self.0 {
            None => number.into(),
            Some(last) => last.saturating_add(i64::from(number.wrapping_sub(last as u32).cast_signed())),
        };
        self.0 = Some(whole);
        whole
    }
}

/// The strikes of a bead by their names: low byte of the boot, and number in it.
#[derive(Clone, Debug, Default)]
struct StrikeNames {
    strikes: BTreeMap<(u8, u32), KnownStrike>,
    /// The names, the oldest first.
    names: VecDeque<(u8, u32)>,
}

#[derive(Clone, Copy, Debug, Default)]
struct KnownStrike {
    first_index: u64,
    parts: StrikeParts,
    /// The strike was handed on whole.
    is_handed_on: bool,
}

impl StrikeNames {
    /// The parts that came of a strike; none of an unknown one.
    fn parts(&self, boot: u8, number: u32) -> StrikeParts {
        let known = self.strikes.get(&(boot, number));
        known.map_or(StrikeParts::default(), |strike| strike.parts)
    }

    /// The entry of a strike, a new one if the window of that name began at another sample. The oldest strike
    /// is dropped if there are too many.
    fn entry(&mut self, boot: u8, number: u32, first_index: u64) -> &mut KnownStrike {
        let name = (boot, number);
        if !self.strikes.contains_key(&name) {
            self.names.push_back(name);
        }
        if self.names.len() > REMEMBERED
            && let Some(oldest) = self.names.pop_front()
        {
            self.strikes.remove(&oldest);
        }
        let strike = self.strikes.entry(name).or_default();
        if strike.first_index != first_index {
            *strike = KnownStrike {
                first_index,
                ..KnownStrike::default()
            };
        }
        strike
    }

    fn forget(&mut self, restart: Restart) {
        self.strikes.retain(|(boot, _), _| !restart.begins(*boot));
        self.names.retain(|(boot, _)| !restart.begins(*boot));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bead_model::design::Description;
    use bead_testing::{block_of, one_sample_strike as strike, paper_settings};
    use bead_wire::{Block, Kind};

    const RESTART: Arrival = Arrival::Restart { lost: 0 };
    const NEXT: Arrival = Arrival::Next { lost: 0 };

    fn settings(threshold: u32) -> Message {
        let change = |bead: &mut Description| {
            bead.capture.threshold = f64::from(threshold) * bead.force.per_code;
        };
        block_of(&paper_settings().with(change).unwrap()).into()
    }

    fn fetched(boot: u32, number: u32, first_index: u64) -> Vec<Message> {
        let frames = [&[settings(50)][..], &strike(number, first_index)].concat();
        bead_testing::fetched(boot, number, &frames)
    }

    /// Beads on a line whose frames an assembly takes.
    #[derive(Default)]
    struct FakeLine {
        assembly: Assembly,
        /// By address: boot, and number of the next frame.
        beads: BTreeMap<u8, (u8, u32)>,
    }

    /// An event in short: whole or not, boot, and number.
    type Short = (bool, u8, u32);

    impl FakeLine {
        fn push(&mut self, address: u8, arrival: Arrival, message: Message) -> Vec<Event> {
            let (boot, sequence) = self.beads.entry(address).or_default();
            let mut frame = Frame::of(address, *boot, arrival, message);
            frame.header.sequence = *sequence;
            *sequence = sequence.wrapping_add(1);
            self.assembly.push(&frame)
        }

        /// A bead restarts with this boot and its settings.
        fn restart(&mut self, address: u8, boot: u8) -> Vec<Short> {
            self.beads.insert(address, (boot, 0));
            short(self.push(address, RESTART, settings(50)))
        }

        fn send(&mut self, address: u8, messages: impl IntoIterator<Item = Message>) -> Vec<Short> {
            let events = messages
                .into_iter()
                .flat_map(|message| self.push(address, NEXT, message));
            short(events.collect())
        }
    }

    fn assembled(events: Vec<Event>) -> Vec<Assembled> {
        let strikes = events.into_iter().filter_map(|event| match event {
            Event::Restart(_) => None,
            Event::Strike(assembled) => Some(*assembled),
        });
        strikes.collect()
    }

    fn short(events: Vec<Event>) -> Vec<Short> {
        let strikes = assembled(events).into_iter().map(|assembled| assembled.strike);
        let short = |strike: RecordedStrike| (strike.is_whole(), strike.boot, strike.said.strike);
        strikes.map(short).collect()
    }

    #[test]
    fn a_whole_strike_comes_at_once_and_one_with_a_gap_when_its_frames_count_as_lost() {
        let mut line = FakeLine::default();
        line.restart(7, 0);
        assert_eq!(line.send(7, strike(0, 10)), [(true, 0, 0)]);
        let [_, result, shape] = strike(1, 20);
        line.push(7, Arrival::Next { lost: 1 }, result);
        assert!(line.send(7, [shape]).is_empty());
        // The strikes of a boot come by their numbers.
        assert!(line.send(7, strike(2, 30)).is_empty());
        let status = || Message::draw(Kind::Status, &mut || 0);
        let others = (0..SETTLED - 4).map(|_| status());
        assert!(line.send(7, others).is_empty());
        assert_eq!(line.send(7, [status()]), [(false, 0, 1), (true, 0, 2)]);
        assert!(line.assembly.is_whole(7, 0, 2) && !line.assembly.is_whole(7, 0, 1));
    }

    #[test]
    fn a_settings_block_of_an_unreleased_build_leaves_its_version_with_the_strike() {
        let mut line = FakeLine::default();
        let mut block = b"BEAD\x06\x00\x00\x00".to_vec();
        block.extend(crc32fast::hash(&block).to_le_bytes());
        let block = Block::try_from(&block[..]).unwrap();
        line.push(7, RESTART, bead_wire::Settings { block }.into());
        line.send(7, strike(0, 10));
        let assembled = assembled(line.assembly.end());
        assert_eq!(assembled[0].strike.settings, None);
        assert_eq!(assembled[0].strike.unreleased_settings, Some(6));
    }

    #[test]
    fn a_strike_has_the_last_settings_before_it_also_where_numbers_begin_again() {
        // A full line sends 2^32 frames in 24 days.
        for first in [0, u32::MAX - 4] {
            let mut line = FakeLine::default();
            line.beads.insert(7, (0, first));
            let mut events = Vec::new();
            for number in 0..3 {
                for message in strike(first.wrapping_add(number), number.into()) {
                    events.extend(line.push(7, NEXT, message));
                }
                events.extend(line.push(7, NEXT, settings(50 + 10 * number)));
            }
            events.extend(line.assembly.end());
            let settings = assembled(events)
                .into_iter()
                .map(|assembled| assembled.strike.settings);
            let thresholds: Vec<u16> = settings
                .map(|settings| settings.unwrap().window.threshold)
                .collect();
            assert_eq!(thresholds, [50, 50, 60], "from frame {first}");
        }
    }

    #[test]
    fn a_strike_names_its_boot_among_those_of_its_bead_also_after_a_power_cycle() {
        let mut line = FakeLine::default();
        let mut events = Vec::new();
        // A power cycle, and a reset.
        for (address, boot, arrival) in [
            (7, 0, Arrival::First),
            (8, 0, Arrival::First),
            (7, 0, RESTART),
            (7, 1, RESTART),
        ] {
            line.beads.insert(address, (boot, 0));
            events.extend(line.push(address, arrival, settings(50)));
            for message in strike(0, 10) {
                events.extend(line.push(address, NEXT, message));
            }
        }
        let boots = assembled(events).into_iter().map(|assembled| assembled.strike);
        let boots: Vec<_> = boots
            .map(|strike| (strike.address, strike.boot, strike.nth_boot))
            .collect();
        assert_eq!(
            boots,
            [(7, 0, Some(0)), (8, 0, Some(0)), (7, 0, Some(1)), (7, 1, Some(2))]
        );
    }

    #[test]
    fn a_late_frame_completes_a_strike_in_its_order() {
        let mut line = FakeLine::default();
        line.restart(7, 0);
        let [waveform, result, shape] = strike(0, 10);
        line.push(7, Arrival::Next { lost: 1 }, result);
        line.send(7, [shape]);
        line.push(7, Arrival::Late, waveform);
        assert_eq!(short(line.assembly.end()), [(true, 0, 0)]);
        assert_eq!(line.assembly.end(), []);
    }

    #[test]
    fn a_name_is_new_after_each_restart_that_may_have_begun_its_boot() {
        let begins = |before, boot, others: &[u8]| {
            let restart = Restart {
                address: 7,
                before,
                boot,
            };
            others
                .iter()
                .map(|other| restart.begins(*other))
                .collect::<Vec<_>>()
        };
        // A reset: the bead keeps its strikes of boots before.
        assert_eq!(begins(3, 4, &[2, 3, 4, 5]), [false, false, true, false]);
        // Resets of which no frame came.
        assert_eq!(begins(3, 6, &[3, 4, 5, 6, 7]), [false, true, true, true, false]);
        assert_eq!(begins(255, 0, &[254, 255, 0, 1]), [false, false, true, false]);
        // A power cycle, and one with two resets of which no frame came.
        assert_eq!(begins(5, 0, &[0, 1, 5, 6]), [true, false, false, true]);
        assert_eq!(begins(5, 2, &[0, 1, 2, 3]), [true, true, true, false]);
        // A power cycle in the first boot, or 256 resets.
        assert_eq!(begins(0, 0, &[0, 1, 255]), [true, true, true]);
        assert_eq!(begins(9, 9, &[8, 9, 10]), [true, true, true]);
    }

    #[test]
    fn after_a_power_cycle_strikes_with_the_names_of_others_are_handed_on_also_fetched_ones() {
        for (before, boot) in [(0, 0), (1, 0), (4, 4)] {
            let mut line = FakeLine::default();
            for address in [7, 8] {
                line.restart(address, boot);
                assert_eq!(line.send(address, strike(0, 10)), [(true, boot, 0)]);
                assert_eq!(line.send(address, strike(0, 10)), [], "it was handed on");
                line.restart(address, before);
            }
            line.restart(7, boot);
            assert!(!line.assembly.is_whole(7, boot, 0));
            // It was lost on the way, and is fetched.
            assert_eq!(line.send(7, fetched(boot.into(), 0, 10)), [(true, boot, 0)]);
            assert_eq!(line.send(7, fetched(boot.into(), 0, 10)), []);
            // The other bead was not reset to that boot, unless all boots began.
            let is_known = before != boot;
            assert_eq!(line.assembly.is_whole(8, boot, 0), is_known, "{before} to {boot}");
            assert_eq!(line.send(8, fetched(boot.into(), 0, 10)).is_empty(), is_known);
        }
    }

    #[test]
    fn a_strike_that_is_fetched_after_a_reset_is_handed_on_unless_it_came_whole() {
        let mut line = FakeLine::default();
        line.restart(7, 3);
        line.send(7, strike(0, 10));
        let [_, result, _] = strike(1, 20);
        line.send(7, [result]);
        assert_eq!(line.restart(7, 4), [(false, 3, 1)]);
        assert_eq!(line.send(7, fetched(3, 0, 10)), []);
        let frames = fetched(3, 1, 20).into_iter();
        let events = frames.flat_map(|frame| line.push(7, NEXT, frame)).collect();
        let [assembled] = &assembled(events)[..] else {
            panic!("one strike");
        };
        let before = StrikeParts {
            result: true,
            ..StrikeParts::default()
        };
        assert_eq!(assembled.fetched, Some(FetchedCopy { boot: 3, before }));
        assert_eq!((assembled.strike.boot, assembled.strike.nth_boot), (3, None));
        assert_eq!(assembled.strike.scans.len(), 1);
        // Equal names of two windows come from a power cycle that the boot number does not show.
        assert_eq!(line.send(7, fetched(3, 0, 999)), [(true, 3, 0)]);
    }

    #[test]
    fn a_fetched_strike_takes_the_place_of_the_parts_that_wait() {
        let mut line = FakeLine::default();
        line.restart(7, 0);
        let [_, result, shape] = strike(0, 10);
        line.push(7, Arrival::Next { lost: 1 }, result);
        line.send(7, [shape]);
        assert_eq!(line.send(7, fetched(0, 0, 10)), [(true, 0, 0)]);
        assert_eq!(short(line.assembly.end()), []);
    }

    #[test]
    fn strikes_that_count_down_windows_alone_and_settings_that_change_wait_in_bounded_room() {
        let mut line = FakeLine::default();
        let mut count = 0;
        for number in (0..1000).rev() {
            let [waveform, result, _] = strike(number, 10);
            line.send(7, [settings(50 + number % 2)]);
            line.send(8, [waveform]);
            count += line.send(9, [result]).len();
            let beads = line.assembly.beads.values();
            assert!(beads.map(|bead| bead.pending.len() + bead.settings.len()).max() <= Some(WAITING));
        }
        assert_eq!(count + line.assembly.end().len(), 1000);
    }

    #[test]
    fn of_very_many_strikes_the_newest_names_are_remembered_for_each_bead() {
        let mut line = FakeLine::default();
        line.restart(0, 0);
        line.send(0, strike(5, 10));
        for boot in 0..4 {
            line.restart(9, boot);
            for number in 0..REMEMBERED as u32 / 2 {
                line.send(9, strike(number, 10));
            }
            let register = &line.assembly.beads[&9].register;
            assert_eq!(register.names.len(), register.strikes.len());
            assert!(register.names.len() <= REMEMBERED);
        }
        assert_eq!(
            [0, 1, 2, 3].map(|boot| line.assembly.is_whole(9, boot, 7)),
            [false, false, true, true]
        );
        assert!(line.assembly.is_whole(0, 0, 5));
    }
}
