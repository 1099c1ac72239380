//! The strikes of a recording, one after another.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;

use bead_model::settings::Settings;
use bead_wire::{Arrival, Message};
use schemars::JsonSchema;
use serde::Serialize;

pub use crate::assembly::UnfinishedWindow;
use crate::assembly::{Assembly, Event};
use crate::fetched::FetchedFrames;
use crate::frames::Frame;
pub use crate::strike::{RecordedStrike, ScanCodes, ScansAfterGap, WindowChunk};

/// Settings that beads were given, by address, for boots whose settings frames are all lost; `None` stands
/// for all other beads.
pub type GivenSettings = BTreeMap<Option<u8>, Settings>;

/// Identity of a strike: address of the bead, low byte of its boot, number in that boot, first sample index.
pub type StrikeName = (u8, u8, u32, u64);

fn name(strike: &RecordedStrike) -> StrikeName {
    (
        strike.address,
        strike.boot,
        strike.said.strike,
        strike.said.first_index,
    )
}

/// A strike that has no part in a result.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct LeftOut {
    /// Path of the recording.
    pub recording: String,
    /// Number of the strike, as its bead counts.
    pub strike: u32,
    /// The reason.
    pub why: String,
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

    /// The names of all strikes whose fetched copy came.
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
    /// Strikes that are fetched later.
    fetched: Arc<BTreeSet<StrikeName>>,
    assembly: Assembly,
    ready: VecDeque<RecordedStrike>,
}

impl<I: Iterator<Item = Frame>> Strikes<I> {
    /// The strikes in `frames`. A strike of a boot whose settings frames are all lost gets the `given`
    /// settings.
    pub fn new(frames: impl IntoIterator<IntoIter = I>, given: GivenSettings) -> Self {
        Self {
            frames: frames.into_iter(),
            given,
            fetched: Arc::default(),
            assembly: Assembly::default(),
            ready: VecDeque::new(),
        }
    }

    /// Leaves out incomplete copies of strikes that are `fetched` later ([`FetchedNames`]).
    #[must_use]
    pub fn with_fetched(self, fetched: impl Into<Arc<BTreeSet<StrikeName>>>) -> Self {
        Self {
            fetched: fetched.into(),
            ..self
        }
    }

    /// The windows without a result after the last strike that was handed on. They are known once all frames
    /// have been read.
    pub fn unfinished(&self) -> Vec<UnfinishedWindow> {
        self.assembly.unfinished()
    }

    /// The frames that are still to come.
    pub fn frames(&self) -> &I {
        &self.frames
    }

    fn strike(&self, event: Event) -> Option<RecordedStrike> {
        let Event::Strike(assembled) = event else {
            return None;
        };
        let mut strike = assembled.strike;
        if !strike.is_whole() && self.fetched.contains(&name(&strike)) {
            return None;
        }
        let given = self.given.get(&Some(strike.address)).or(self.given.get(&None));
        strike.settings = strike.settings.or(given.copied());
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
    let given = given.map(|settings| (None, settings));
    Strikes::new(frames, given.into_iter().collect())
        .with_fetched(fetched.finish())
        .collect()
}
