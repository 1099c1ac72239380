//! The strikes of a recording, one after another.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;

use bead_model::settings::Settings;
use bead_wire::{Arrival, Message};

use crate::assembly::{Assembly, Event};
use crate::fetched::FetchedFrames;
use crate::frames::Frame;
pub use crate::strike::{Chunk, RecordedStrike, ScanCodes};

/// Settings that beads were given, for boots whose settings frames are all lost.
#[derive(Debug, Clone, Default)]
pub struct GivenSettings {
    /// By address.
    pub of: BTreeMap<u8, Settings>,
    /// For all others.
    pub any: Option<Settings>,
}

impl GivenSettings {
    fn at(&self, address: u8) -> Option<Settings> {
        self.of.get(&address).copied().or(self.any)
    }
}

impl From<Option<Settings>> for GivenSettings {
    fn from(any: Option<Settings>) -> Self {
        Self {
            any,
            ..Self::default()
        }
    }
}

/// A strike among all: address of the bead, low byte of its boot, number in that boot, first sample index.
pub type StrikeName = (u8, u8, u32, u64);

fn name(strike: &RecordedStrike) -> StrikeName {
    (
        strike.address,
        strike.boot,
        strike.said.strike,
        strike.said.first_index,
    )
}

/// Collects the names of the strikes that are fetched in the frames of a line.
#[derive(Clone, Debug, Default)]
pub struct FetchedNames {
    /// By address.
    frames: BTreeMap<u8, FetchedFrames>,
    names: BTreeSet<StrikeName>,
}

impl FetchedNames {
    /// Takes the next frame.
    pub fn push(&mut self, frame: &Frame) {
        let address = frame.header.address;
        match frame.arrival {
            Arrival::Duplicate => return,
            Arrival::Restart { .. } => _ = self.frames.remove(&address),
            _ => {}
        }
        if let Message::Fetched(fetched) = &frame.message {
            let strike = self.frames.entry(address).or_default().push(address, fetched);
            self.names.extend(strike.as_ref().map(name));
        }
    }

    /// The names of all strikes of which a fetched copy came.
    pub fn finish(self) -> BTreeSet<StrikeName> {
        self.names
    }
}

/// The strikes in frames, an iterator. Each strike comes once: a fetched one in place of a copy that lacks a
/// part. Memory: the newest strikes of each bead.
#[derive(Debug, Clone)]
pub struct Strikes<I> {
    frames: I,
    given: GivenSettings,
    /// Strikes that are fetched further on.
    fetched: Arc<BTreeSet<StrikeName>>,
    assembly: Assembly,
    ready: VecDeque<RecordedStrike>,
}

impl<I: Iterator<Item = Frame>> Strikes<I> {
    /// The strikes in `frames`. A strike of a boot whose settings frames are all lost gets the `given`
    /// settings.
    pub fn new(frames: impl IntoIterator<IntoIter = I>, given: impl Into<GivenSettings>) -> Self {
        Self {
            frames: frames.into_iter(),
            given: given.into(),
            fetched: Arc::default(),
            assembly: Assembly::default(),
            ready: VecDeque::new(),
        }
    }

    /// Leaves out copies with a missing part of strikes that are `fetched` further on ([`FetchedNames`]).
    #[must_use]
    pub fn with_fetched(self, fetched: impl Into<Arc<BTreeSet<StrikeName>>>) -> Self {
        Self {
            fetched: fetched.into(),
            ..self
        }
    }

    /// The frames that are still to come.
    pub fn frames(&self) -> &I {
        &self.frames
    }

    fn strike(&self, event: Event) -> Option<RecordedStrike> {
        let mut strike = match event {
            Event::Restart(_) => return None,
            Event::Whole(assembled) => assembled.strike,
            Event::Gap(assembled) => {
                Some(assembled.strike).filter(|strike| !self.fetched.contains(&name(strike)))?
            }
        };
        strike.settings = strike.settings.or(self.given.at(strike.address));
        Some(strike)
    }
}

impl<I: Iterator<Item = Frame>> Iterator for Strikes<I> {
    type Item = RecordedStrike;

    fn next(&mut self) -> Option<RecordedStrike> {
        loop {
            if let Some(strike) = self.ready.pop_front() {
                return Some(strike);
            }
            let events = match self.frames.next() {
                Some(frame) => self.assembly.push(&frame),
                None => Some(self.assembly.end()).filter(|events| !events.is_empty())?,
            };
            let strikes: Vec<_> = events
                .into_iter()
                .filter_map(|event| self.strike(event))
                .collect();
            self.ready.extend(strikes);
        }
    }
}

/// The strikes in `frames`: see [`Strikes`].
pub fn assemble(frames: Vec<Frame>, given: Option<Settings>) -> Vec<RecordedStrike> {
    let mut fetched = FetchedNames::default();
    frames.iter().for_each(|frame| fetched.push(frame));
    Strikes::new(frames, given)
        .with_fetched(fetched.finish())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::decode;
    use bead_model::design::{Bead, Capture, FrontEnd, derive};
    use bead_model::settings::BLOCK_MAX;
    use bead_wire::{Block, Header, Kind, MAX_FRAME, Strike, encode};

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

    /// The threshold of the settings that each of three strikes gets; their frames are numbered from `first`
    /// on.
    fn thresholds(first: u32) -> Vec<u16> {
        let paper = derive(&Bead::paper(), &FrontEnd::reference(), &Capture::default()).unwrap();
        let mut blocks = Vec::new();
        for threshold in [50_u16, 60] {
            let settings = paper
                .with(|bead| bead.capture.threshold = f64::from(threshold) * bead.force.per_code)
                .unwrap();
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
