//! The channels of a recording that other programs read: what the frames say, in SI units, with schemas.
//!
//! # Design
//! They stand beside the raw frames and are made of them; nothing here reads them again. A waveform is
//! written when the strike frame behind it has come, if all of its scans did, in order, and settings before
//! them. So memory is one window for each address, whatever comes. A strike that was fetched is written as if
//! it had come when it was measured, as far as it did not.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::io::{Seek, Write};

use bead_model::Settings;
use bead_model::layout::WINDOW_MAX;
use bead_wire::{Arrival, Fault, Header, Health, Message, Shape, Status, Strike};
use mcap::McapResult;

use crate::recording::again::{Again, Whole};
use crate::recording::file::layout::name_of;
use crate::recording::frames::Frame;
use crate::recording::protobuf::{self, Schema, schema_of};
use crate::recording::signal::Signal;
use crate::recording::strikes::{ScanCodes, push_scans};

/// A channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
enum Topic {
    Strikes,
    Shapes,
    Waveforms,
    Status,
    Health,
    Faults,
}

impl Topic {
    const ALL: [Self; 6] = [
        Self::Strikes,
        Self::Shapes,
        Self::Waveforms,
        Self::Status,
        Self::Health,
        Self::Faults,
    ];

    const fn name(self) -> &'static str {
        match self {
            Self::Strikes => "strikes",
            Self::Shapes => "shapes",
            Self::Waveforms => "waveforms",
            Self::Status => "status",
            Self::Health => "health",
            Self::Faults => "faults",
        }
    }

    fn schema(self) -> Schema {
        match self {
            Self::Strikes => schema_of::<Strike>("Strike"),
            Self::Shapes => schema_of::<Shape>("Shape"),
            Self::Waveforms => protobuf::Waveform::schema(),
            Self::Status => schema_of::<Status>("Status"),
            Self::Health => schema_of::<Health>("Health"),
            Self::Faults => schema_of::<Fault>("Fault"),
        }
    }
}

/// A message to be written.
pub(super) struct Said {
    /// Its channel.
    pub(super) channel: u16,
    /// Its Protobuf.
    pub(super) data: Vec<u8>,
}

/// What a bead has said of the strike that is on its way.
#[derive(Default)]
struct Coming {
    settings: Option<Settings>,
    strike: u32,
    first_index: u64,
    scans: Vec<ScanCodes>,
    /// A part of it came, and its last frame, the shape, did not.
    is_begun: bool,
}

/// The channels, and what waits to be written to them.
pub(super) struct Channels {
    ids: HashMap<Topic, u16>,
    coming: HashMap<u8, Coming>,
    again: Again,
    /// What was written of strikes: channel, address, boot, number.
    told: BTreeSet<(Topic, u8, u8, u32)>,
}

/// Strikes of which it is remembered what was written, times the channels.
const TOLD: usize = 3 * 4096;

impl Channels {
    /// Adds the channels to a file: of one bead among several, or of all.
    pub(super) fn begin<W: Write + Seek>(mcap: &mut mcap::Writer<W>, bead: Option<u8>) -> McapResult<Self> {
        Ok(Self {
            ids: ids(mcap, bead)?,
            coming: HashMap::new(),
            again: Again::default(),
            told: BTreeSet::new(),
        })
    }

    /// Adds the channels to the file that follows.
    pub(super) fn go_on<W: Write + Seek>(
        &mut self,
        mcap: &mut mcap::Writer<W>,
        bead: Option<u8>,
    ) -> McapResult<()> {
        self.ids = ids(mcap, bead)?;
        Ok(())
    }

    /// Whether no strike is on its way.
    pub(super) fn rest(&self) -> bool {
        !self.again.is_begun() && !self.coming.values().any(|coming| coming.is_begun)
    }

    /// What a frame adds to the channels.
    pub(super) fn take(&mut self, frame: &Frame) -> Vec<Said> {
        if frame.arrival == Arrival::Duplicate {
            return Vec::new();
        }
        if let Message::Fetched(fetched) = &frame.message {
            let whole = self.again.take(frame.header.address, fetched);
            return whole.map_or_else(Vec::new, |whole| self.take_again(frame, &whole));
        }
        if let (Arrival::Restart { .. }, 0) = (frame.arrival, frame.header.boot) {
            // After a power cycle strikes have the same names again.
            self.told.clear();
        }
        let said = self.take_first(frame);
        let address = frame.header.address;
        let of_strike = |topic: Topic, strike: u32| (topic, address, frame.header.boot, strike);
        match &frame.message {
            Message::Strike(strike) => {
                self.told.insert(of_strike(Topic::Strikes, strike.strike));
                if said.len() > 1 {
                    self.told.insert(of_strike(Topic::Waveforms, strike.strike));
                }
            }
            Message::Shape(shape) => {
                self.told.insert(of_strike(Topic::Shapes, shape.strike));
            }
            _ => {}
        }
        while self.told.len() > TOLD {
            self.told.pop_first();
        }
        said
    }

    /// What a strike that was fetched adds to them.
    fn take_again(&mut self, frame: &Frame, whole: &Whole) -> Vec<Said> {
        let frame = Frame {
            header: Header {
                boot: whole.boot as u8,
                ..frame.header
            },
            ..frame.clone()
        };
        let strike = &whole.strike;
        let mut scans = Vec::new();
        whole
            .waveforms
            .iter()
            .for_each(|waveform| push_scans(&mut scans, waveform));
        let settings = Settings::decode(whole.settings.block.bytes()).ok();
        let all = [
            (Topic::Strikes, Some(protobuf::message(&frame, strike))),
            (Topic::Waveforms, waveform(&frame, strike, &scans, settings)),
            (Topic::Shapes, Some(protobuf::message(&frame, &whole.shape))),
        ];
        let new = all.into_iter().filter(|(topic, _)| {
            self.told
                .insert((*topic, frame.header.address, frame.header.boot, strike.strike))
        });
        let said = |(topic, data)| {
            Some(Said {
                channel: *self.ids.get(&topic)?,
                data: data?,
            })
        };
        new.filter_map(said).collect()
    }

    fn take_first(&mut self, frame: &Frame) -> Vec<Said> {
        let coming = self.coming.entry(frame.header.address).or_default();
        if let Arrival::First | Arrival::Restart { .. } = frame.arrival {
            // The settings of a bead that restarts are told anew.
            *coming = Coming::default();
        }
        let mut said = Vec::new();
        let mut say = |topic: Topic, data: Vec<u8>| {
            let channel = self.ids.get(&topic).copied();
            said.extend(channel.map(|channel| Said { channel, data }));
        };
        match &frame.message {
            Message::Settings(told) => coming.settings = Settings::decode(told.block.bytes()).ok(),
            Message::Waveform(piece) => {
                coming.is_begun = true;
                let next = coming.first_index.checked_add(coming.scans.len() as u64);
                let goes_on = piece.strike == coming.strike && Some(piece.first_index) == next;
                if !goes_on {
                    coming.scans.clear();
                    (coming.strike, coming.first_index) = (piece.strike, piece.first_index);
                }
                if coming.scans.len() < usize::from(WINDOW_MAX) {
                    push_scans(&mut coming.scans, piece);
                }
            }
            Message::Strike(strike) => {
                say(Topic::Strikes, protobuf::message(frame, strike));
                let scans = std::mem::take(&mut coming.scans);
                let is_whole = (coming.strike, coming.first_index, scans.len())
                    == (strike.strike, strike.first_index, strike.samples.into());
                let settings = coming.settings.filter(|_| is_whole);
                if let Some(data) = waveform(frame, strike, &scans, settings) {
                    say(Topic::Waveforms, data);
                }
            }
            Message::Shape(shape) => {
                coming.is_begun = false;
                say(Topic::Shapes, protobuf::message(frame, shape));
            }
            Message::Status(status) => say(Topic::Status, protobuf::message(frame, status)),
            Message::Health(health) => say(Topic::Health, protobuf::message(frame, health)),
            Message::Fault(fault) => say(Topic::Faults, protobuf::message(frame, fault)),
            _ => {}
        }
        said
    }
}

/// Adds a channel for each topic to a file, and gives their numbers.
fn ids<W: Write + Seek>(mcap: &mut mcap::Writer<W>, bead: Option<u8>) -> McapResult<HashMap<Topic, u16>> {
    let mut add = |topic: Topic| {
        let Schema { name, descriptors } = topic.schema();
        let schema = mcap.add_schema(&name, "protobuf", &descriptors)?;
        let name = name_of(bead, topic.name());
        Ok((
            topic,
            mcap.add_channel(schema, &name, "protobuf", &BTreeMap::new())?,
        ))
    };
    Topic::ALL.into_iter().map(&mut add).collect()
}

/// The window of a strike in SI units; none without settings.
fn waveform(
    frame: &Frame,
    strike: &Strike,
    scans: &[ScanCodes],
    settings: Option<Settings>,
) -> Option<Vec<u8>> {
    let settings = settings?;
    let signal = Signal::of(scans, &settings)?;
    let waveform = protobuf::Waveform {
        frame,
        strike: strike.strike,
        first_index: strike.first_index,
        trigger_index: strike.trigger_index,
        sample_rate_hz: settings.sample_rate_hz,
        signal: &signal,
    };
    Some(waveform.message())
}
