//! The strikes of a recording: each with its samples, the bead's result, and the settings in force.

use std::collections::{BTreeMap, BTreeSet, HashMap, VecDeque};

use bead_model::Scan;
use bead_model::layout::WINDOW_MAX;
use bead_model::settings::Settings;
use bead_wire::{Arrival, Energy, Message, REORDER, Shape, Strike, Waveform};

use crate::recording::again::{Again, Whole};
use crate::recording::frames::Frame;

/// Energies as they stood after a run of samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Chunk {
    /// Samples of the window up to the end of this chunk.
    pub end: usize,
    /// Estimate A.
    pub absorbed_measured: Energy,
    /// Estimate B.
    pub absorbed_predicted: Energy,
}

/// The codes of one scan: force, then acceleration, at either gain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ScanCodes {
    /// At the high gain.
    pub sensitive: [u16; 2],
    /// At the low gain, where they had a part in the estimates.
    pub wide: Option<[u16; 2]>,
}

impl ScanCodes {
    /// The codes as the bead had them. Codes that had no part in the estimates are 0.
    pub fn scan(&self) -> Scan {
        let ([force, acceleration], [force_wide, acceleration_wide]) =
            (self.sensitive, self.wide.unwrap_or_default());
        Scan::new([force, force_wide, acceleration, acceleration_wide])
    }
}

/// One strike as it was received.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedStrike {
    /// Address of the bead that was struck.
    pub address: u8,
    /// The low byte of its boot number.
    pub boot: u8,
    /// Which of the bead's boots that were received it is of, from 0: after a power cycle the low byte is the
    /// same again. None of a strike that was fetched later, which only tells the byte.
    pub nth_boot: Option<usize>,
    /// Its unique device id; none before its identity came.
    pub uid: Option<[u8; 12]>,
    /// Scans a second, in hertz, by its last identity before the strike.
    pub sample_rate_hz: Option<u32>,
    /// When the host received the strike frame, in ns since 1970, if that is known. It is not of a strike
    /// that was fetched later.
    pub received_ns: Option<u64>,
    /// What the bead said of it.
    pub said: Strike,
    /// What it said of its shape, if that was received.
    pub shape: Option<Shape>,
    /// The window's codes from its start up to the first gap.
    pub scans: Vec<ScanCodes>,
    /// The chunks that they came in.
    pub chunks: Vec<Chunk>,
    /// The settings in force, if any were received.
    pub settings: Option<Settings>,
}

impl RecordedStrike {
    /// A strike of which no samples were received yet.
    pub fn new(address: u8, said: Strike) -> Self {
        Self {
            address,
            boot: 0,
            nth_boot: None,
            uid: None,
            sample_rate_hz: None,
            received_ns: None,
            said,
            shape: None,
            scans: Vec::new(),
            chunks: Vec::new(),
            settings: None,
        }
    }

    /// A strike that was sent once more.
    fn from_whole(address: u8, whole: Whole) -> Self {
        let mut strike = Self {
            boot: whole.boot as u8,
            shape: Some(whole.shape),
            settings: Settings::decode(whole.settings.block.bytes()).ok(),
            ..Self::new(address, whole.strike)
        };
        for waveform in &whole.waveforms {
            strike.push(waveform);
        }
        strike
    }

    /// Scans a second, Hz: as the bead's identity said, else as the settings hold for.
    pub fn rate(&self) -> Option<u32> {
        let of_settings = self.settings.map(|settings| settings.sample_rate_hz);
        self.sample_rate_hz.or(of_settings).filter(|rate| *rate > 0)
    }

    /// Samples of the window that were not received, or came after a gap.
    pub fn missing(&self) -> usize {
        usize::from(self.said.samples).saturating_sub(self.scans.len())
    }

    /// Appends the samples of a waveform frame. One without samples is not taken: no bead sends it.
    pub fn push(&mut self, waveform: &Waveform) {
        if waveform.codes.is_empty() {
            return;
        }
        push_scans(&mut self.scans, waveform);
        self.chunks.push(Chunk {
            end: self.scans.len(),
            absorbed_measured: waveform.absorbed_measured,
            absorbed_predicted: waveform.absorbed_predicted,
        });
    }
}

/// Appends the scans of a waveform frame to those before it.
pub(crate) fn push_scans(scans: &mut Vec<ScanCodes>, waveform: &Waveform) {
    let sensitive = waveform.codes.iter();
    let mut wide = waveform.wide.iter();
    // The codes at the low gain begin with the two scans before those of the frame, or are not there.
    let before = wide.len().saturating_sub(sensitive.len());
    let before: Vec<_> = wide.by_ref().take(before).collect();
    for (scan, wide) in scans.iter_mut().rev().zip(before.into_iter().rev()) {
        scan.wide = Some(wide);
    }
    let wide = wide.map(Some).chain(std::iter::repeat(None));
    let codes = sensitive.zip(wide);
    scans.extend(codes.map(|(sensitive, wide)| ScanCodes { sensitive, wide }));
}

/// A frame that comes this many frames too late counts as lost.
const SETTLED: i64 = REORDER as i64;
/// Greatest number of strikes that wait: for frames that are late, for the first settings of their boot, or
/// for their strike frame. A bead that never sends either, or whose strikes count down, must not fill the
/// memory.
const WAITING: usize = 64;

/// What a bead sent since its last reset and is not yet part of a strike that was handed on.
#[derive(Debug, Clone, Default)]
struct Boot {
    frames: Count,
    numbers: Count,
    /// By the number of their frame, as settings may change between two strikes.
    settings: BTreeMap<i64, Settings>,
    /// By the number of the strike.
    waveforms: BTreeMap<i64, Vec<Waveform>>,
    shapes: BTreeMap<i64, Shape>,
    /// Each with the number of its frame, in the order of the strikes; without samples yet.
    strikes: BTreeMap<i64, (i64, RecordedStrike)>,
    uid: Option<[u8; 12]>,
}

/// Numbers that go on where those of the wire begin anew: after 2^32 frames, which a full line sends in 24
/// days.
#[derive(Debug, Clone, Copy, Default)]
struct Count(Option<i64>);

impl Count {
    /// A number of the wire as the one of its kind that is nearest to the number before.
    fn of(&mut self, number: u32) -> i64 {
        let whole = match self.0 {
            None => number.into(),
            // The lower half of the last number is what the wire had.
            Some(last) => last.saturating_add(i64::from(number.wrapping_sub(last as u32).cast_signed())),
        };
        self.0 = Some(whole);
        whole
    }
}

/// Settings that beads were given, for boots whose settings frames are all lost.
#[derive(Debug, Clone, Default)]
pub struct Known {
    /// By address.
    pub of: BTreeMap<u8, Settings>,
    /// For all others.
    pub any: Option<Settings>,
}

impl Known {
    fn at(&self, address: u8) -> Option<Settings> {
        self.of.get(&address).copied().or(self.any)
    }
}

impl From<Option<Settings>> for Known {
    fn from(any: Option<Settings>) -> Self {
        Self {
            any,
            ..Self::default()
        }
    }
}

/// A strike among all: address of the bead, low byte of its boot, number in that boot, first sample index.
pub type Name = (u8, u8, u32, u64);

/// Most strikes of a bead of which it is remembered that they were handed on whole.
const REMEMBERED: usize = 1 << 16;

fn name(address: u8, boot: u8, strike: &Strike) -> Name {
    (address, boot, strike.strike, strike.first_index)
}

/// The strikes that were sent once more in `frames`, and came whole.
pub fn sent_again(frames: impl IntoIterator<Item = Frame>) -> BTreeSet<Name> {
    let mut again = Again::default();
    let whole = |frame: Frame| match &frame.message {
        Message::Fetched(fetched) => {
            let address = frame.header.address;
            let whole = again.take(address, fetched)?;
            Some(name(address, whole.boot as u8, &whole.strike))
        }
        _ => None,
    };
    frames.into_iter().filter_map(whole).collect()
}

/// Puts frames together to strikes, over resets and with late frames in their place. It only keeps the
/// strikes of the newest frames of each bead.
#[derive(Debug, Clone)]
pub struct Strikes<I> {
    frames: I,
    known: Known,
    /// By address.
    boots: HashMap<u8, Boot>,
    ready: VecDeque<RecordedStrike>,
    again: Again,
    /// Strikes that come once more, further on.
    to_come: BTreeSet<Name>,
    /// By address: strikes that were handed on whole.
    whole: HashMap<u8, BTreeSet<Name>>,
    /// By address: restarts so far.
    restarts: HashMap<u8, usize>,
}

impl<I: Iterator<Item = Frame>> Strikes<I> {
    /// The strikes in `frames`. `known` are settings that the bead was given; they serve for a boot whose
    /// settings frames are all lost.
    pub fn new(frames: impl IntoIterator<IntoIter = I>, known: impl Into<Known>) -> Self {
        Self {
            frames: frames.into_iter(),
            known: known.into(),
            boots: HashMap::new(),
            ready: VecDeque::new(),
            again: Again::default(),
            to_come: BTreeSet::new(),
            whole: HashMap::new(),
            restarts: HashMap::new(),
        }
    }

    /// The same, if it is known which strikes come once more ([`sent_again`]): of a strike that is missing a
    /// part where it came first, only the second copy is handed on.
    pub fn knowing(self, sent_again: BTreeSet<Name>) -> Self {
        Self {
            to_come: sent_again,
            ..self
        }
    }

    /// Hands strikes on, each once.
    fn hand_on(&mut self, strikes: Vec<RecordedStrike>) {
        for strike in strikes {
            let name = name(strike.address, strike.boot, &strike.said);
            let is_whole = strike.missing() == 0 && strike.shape.is_some();
            let whole = self.whole.entry(strike.address).or_default();
            if whole.contains(&name) || !is_whole && self.to_come.contains(&name) {
                continue;
            }
            if is_whole {
                whole.insert(name);
                while whole.len() > REMEMBERED {
                    whole.pop_first();
                }
            }
            self.ready.push_back(strike);
        }
    }

    /// Where the frames come from.
    pub fn frames(&self) -> &I {
        &self.frames
    }

    fn take(&mut self, frame: Frame) {
        let address = frame.header.address;
        match frame.arrival {
            Arrival::Restart { .. } => {
                let boot = self.boots.remove(&address).unwrap_or_default();
                self.hand_on(boot.end(self.known.at(address)));
                *self.restarts.entry(address).or_default() += 1;
                if frame.header.boot == 0 {
                    // After a power cycle strikes have the same names again.
                    self.whole.remove(&address);
                }
            }
            Arrival::Duplicate => return,
            _ => {}
        }
        if let Message::Fetched(fetched) = &frame.message {
            if let Some(whole) = self.again.take(address, fetched) {
                let uid = self.boots.get(&address).and_then(|boot| boot.uid);
                let strike = RecordedStrike {
                    uid,
                    sample_rate_hz: frame.sample_rate_hz,
                    ..RecordedStrike::from_whole(address, whole)
                };
                self.hand_on(vec![strike]);
            }
            return;
        }
        let boot = self.boots.entry(address).or_default();
        let newest = boot.frames.of(frame.header.sequence);
        match frame.message {
            Message::Settings(settings) => {
                let settings = Settings::decode(settings.block.bytes()).ok();
                // Settings come every second and rarely change.
                let is_new = settings.as_ref() != boot.settings.last_entry().as_ref().map(|last| last.get());
                let settings = settings.filter(|_| is_new);
                boot.settings.extend(settings.map(|settings| (newest, settings)));
                while boot.settings.len() > WAITING {
                    boot.settings.pop_first();
                }
            }
            Message::Identity(identity) => boot.uid = Some(identity.uid),
            Message::Waveform(waveform) => {
                let number = boot.numbers.of(waveform.strike);
                let waveforms = boot.waveforms.entry(number).or_default();
                if waveforms.len() < usize::from(WINDOW_MAX) {
                    waveforms.push(waveform);
                }
                while boot.waveforms.len() > WAITING {
                    boot.waveforms.pop_first();
                }
            }
            Message::Strike(strike) => {
                let recorded = RecordedStrike {
                    boot: frame.header.boot,
                    nth_boot: Some(self.restarts.get(&address).copied().unwrap_or_default()),
                    uid: boot.uid,
                    sample_rate_hz: frame.sample_rate_hz,
                    received_ns: frame.received_ns,
                    ..RecordedStrike::new(address, strike)
                };
                boot.strikes
                    .insert(boot.numbers.of(strike.strike), (newest, recorded));
            }
            Message::Shape(shape) => {
                boot.shapes.insert(boot.numbers.of(shape.strike), shape);
                while boot.shapes.len() > WAITING {
                    boot.shapes.pop_first();
                }
            }
            _ => {}
        }
        if frame.arrival != Arrival::Late {
            let settled = boot.settled(newest, self.known.at(address));
            self.hand_on(settled);
        }
    }
}

impl<I: Iterator<Item = Frame>> Iterator for Strikes<I> {
    type Item = RecordedStrike;

    fn next(&mut self) -> Option<RecordedStrike> {
        loop {
            if let Some(strike) = self.ready.pop_front() {
                return Some(strike);
            }
            match self.frames.next() {
                Some(frame) => self.take(frame),
                None => {
                    let mut boots: Vec<_> = self.boots.drain().collect();
                    boots.sort_by_key(|(address, _)| *address);
                    for (address, boot) in boots {
                        self.hand_on(boot.end(self.known.at(address)));
                    }
                    return self.ready.pop_front();
                }
            }
        }
    }
}

impl Boot {
    /// The strikes that are complete at the frame with the number `newest`.
    fn settled(&mut self, newest: i64, known: Option<Settings>) -> Vec<RecordedStrike> {
        let mut settled = Vec::new();
        while let Some((&strike, &(told, _))) = self.strikes.first_key_value() {
            let is_settled = newest - told > SETTLED && !self.settings.is_empty();
            if !is_settled && self.strikes.len() <= WAITING {
                break;
            }
            settled.extend(self.assemble(strike, known));
        }
        settled
    }

    /// All strikes that are left.
    fn end(mut self, known: Option<Settings>) -> Vec<RecordedStrike> {
        let strikes: Vec<i64> = self.strikes.keys().copied().collect();
        strikes
            .into_iter()
            .filter_map(|strike| self.assemble(strike, known))
            .collect()
    }

    /// Takes one strike out, and everything before it.
    fn assemble(&mut self, strike: i64, known: Option<Settings>) -> Option<RecordedStrike> {
        let (told, mut recorded) = self.strikes.remove(&strike)?;
        let said = recorded.said;
        recorded.shape = self.shapes.remove(&strike);
        recorded.settings = self.settings_before(told).or(known);
        let mut waveforms = self.waveforms.remove(&strike).unwrap_or_default();
        waveforms.sort_by_key(|waveform| waveform.first_index);
        for waveform in &waveforms {
            if Some(waveform.first_index) != said.first_index.checked_add(recorded.scans.len() as u64) {
                break;
            }
            recorded.push(waveform);
        }
        // Parts of strikes before this one have lost their strike frame.
        self.waveforms = self.waveforms.split_off(&strike);
        self.shapes = self.shapes.split_off(&strike);
        Some(recorded)
    }

    /// The last settings before a frame. If those frames are all lost, the first settings after it, as
    /// settings rarely change. Settings before these are forgotten.
    fn settings_before(&mut self, sequence: i64) -> Option<Settings> {
        if let Some((&told, &settings)) = self.settings.range(..sequence).next_back() {
            self.settings = self.settings.split_off(&told);
            return Some(settings);
        }
        self.settings.first_key_value().map(|(_, settings)| *settings)
    }
}

/// The strikes in `frames`: see [`Strikes`].
pub fn assemble(frames: Vec<Frame>, known: Option<Settings>) -> Vec<RecordedStrike> {
    let sent_again = sent_again(frames.iter().cloned());
    Strikes::new(frames, known).knowing(sent_again).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::frames::decode;
    use bead_model::design::{Bead, Capture, FrontEnd, derive};
    use bead_model::settings::BLOCK_MAX;
    use bead_wire::{Block, Header, Kind, MAX_FRAME, encode};

    #[test]
    fn a_strike_has_the_settings_told_last_before_it_also_where_numbers_begin_anew() {
        // A full line has sent 2^32 frames after 24 days.
        for first in [0, u32::MAX - 2] {
            assert_eq!(thresholds(first), [50, 50, 60], "from frame {first}");
        }
    }

    fn drawn(kind: Kind) -> Message {
        Message::draw(kind, &mut || 0)
    }

    #[test]
    fn a_strike_tells_which_boot_of_its_bead_it_is_of_also_after_a_power_cycle() {
        let restart = Arrival::Restart { lost: 0 };
        let frames = [
            (7, 0, Arrival::First),
            (8, 0, Arrival::First),
            // A power cycle, and a reset.
            (7, 0, restart),
            (7, 1, restart),
        ];
        let frames =
            frames.map(|(address, boot, arrival)| Frame::of(address, boot, arrival, drawn(Kind::Strike)));
        let mut told: Vec<_> = Strikes::new(frames, None)
            .map(|strike| (strike.address, strike.boot, strike.nth_boot))
            .collect();
        told.sort_unstable();
        assert_eq!(
            told,
            [(7, 0, Some(0)), (7, 0, Some(1)), (7, 1, Some(2)), (8, 0, Some(0))]
        );
    }

    #[test]
    fn strikes_that_count_down_and_settings_that_change_wait_in_bounded_room() {
        let count = 1000_u32;
        let Message::Strike(said) = drawn(Kind::Strike) else {
            panic!("a strike");
        };
        let mut settings = derive(&Bead::paper(), &FrontEnd::reference(), &Capture::default()).unwrap();
        let mut strikes = Strikes::new([], None);
        for number in 0..count {
            settings.window.threshold = 50 + number as u16 % 2;
            let mut block = [0; BLOCK_MAX];
            let length = settings.encode(&mut block).unwrap();
            let block = Block::try_from(&block[..length]).unwrap();
            let mut told = Frame::of(0, 0, Arrival::Next { lost: 0 }, bead_wire::Settings { block });
            told.header.sequence = number;
            Strikes::take(&mut strikes, told);
            assert!(strikes.boots[&0].settings.len() <= WAITING);
        }
        for number in (0..count).rev() {
            let strike = Strike {
                strike: number,
                ..said
            };
            let mut told = Frame::of(0, 0, Arrival::Next { lost: 0 }, strike);
            told.header.sequence = 2 * count - number;
            Strikes::take(&mut strikes, told);
            assert!(strikes.boots[&0].strikes.len() <= WAITING);
        }
        assert_eq!(strikes.count(), count as usize);
    }

    #[test]
    fn strikes_of_one_bead_make_those_of_no_other_forgotten_and_a_power_cycle_only_its_own() {
        let Message::Strike(strike) = drawn(Kind::Strike) else {
            panic!("a strike");
        };
        let Message::Shape(shape) = drawn(Kind::Shape) else {
            panic!("a shape");
        };
        let whole = |address: u8, number: u32| RecordedStrike {
            shape: Some(shape),
            ..RecordedStrike::new(
                address,
                Strike {
                    strike: number,
                    ..strike
                },
            )
        };
        let mut strikes = Strikes::new([], None);
        let is_new = |strikes: &mut Strikes<_>, strike: RecordedStrike| {
            strikes.hand_on(vec![strike]);
            strikes.ready.drain(..).count() == 1
        };
        assert!(is_new(&mut strikes, whole(0, 5)));
        let mut numbers = 0..=REMEMBERED as u32;
        assert!(numbers.all(|number| is_new(&mut strikes, whole(9, number))));
        assert_eq!(strikes.whole[&9].len(), REMEMBERED);
        assert!(!is_new(&mut strikes, whole(0, 5)));
        let restart = Frame::of(9, 0, Arrival::Restart { lost: 0 }, drawn(Kind::Health));
        Strikes::take(&mut strikes, restart);
        assert!(is_new(&mut strikes, whole(9, 7)));
        assert!(!is_new(&mut strikes, whole(0, 5)));
    }

    /// The threshold of the settings that each of three strikes gets; their frames are numbered from `first`
    /// on.
    fn thresholds(first: u32) -> Vec<u16> {
        let mut settings = derive(&Bead::paper(), &FrontEnd::reference(), &Capture::default()).unwrap();
        let mut blocks = Vec::new();
        for threshold in [50, 60] {
            settings.window.threshold = threshold;
            let mut block = [0; BLOCK_MAX];
            let length = settings.encode(&mut block).unwrap();
            blocks.push(block[..length].to_vec());
        }
        let strike = |number: u32| {
            Message::from(Strike {
                strike: number.wrapping_add(first),
                first_index: 0,
                trigger_index: 0,
                samples: 1,
                peak_force: Default::default(),
                peak_index: 0,
                acceleration_max: Default::default(),
                acceleration_min: Default::default(),
                absorbed_measured: Default::default(),
                absorbed_predicted: Default::default(),
                incident_energy: Default::default(),
                absorbed_fraction: Default::default(),
                noise_energy: Default::default(),
                force_noise: Default::default(),
                flags: Default::default(),
            })
        };
        let told = |block: &[u8]| {
            let block = Block::try_from(block).unwrap();
            Message::from(bead_wire::Settings { block })
        };
        let messages = [
            strike(0),
            told(&blocks[0]),
            strike(1),
            told(&blocks[1]),
            strike(2),
        ];
        let stream: Vec<u8> = (0..)
            .zip(&messages)
            .flat_map(|(after, message)| {
                let header = Header {
                    address: 0,
                    boot: 0,
                    sequence: first.wrapping_add(after),
                    sample_index: 0,
                };
                encode(&header, message, &mut [0; MAX_FRAME]).unwrap().to_vec()
            })
            .collect();
        let strikes = assemble(decode(&stream).0, None);
        strikes
            .iter()
            .map(|strike| strike.settings.unwrap().window.threshold)
            .collect()
    }
}
