//! The channels of a recording that other programs read: what the frames say, in SI units, with schemas.
//!
//! # Design
//! They stand beside the raw frames and are made of them; nothing here reads them again. A waveform is written
//! when the strike frame behind it has come, if all of its scans did, in order, and settings before them. So
//! memory is one window for each address, whatever comes.

use std::collections::{BTreeMap, HashMap};
use std::io::{Seek, Write};

use bead_model::Settings;
use bead_model::layout::WINDOW_MAX;
use bead_wire::{Arrival, Fault, Health, Message, Shape, Status, Strike};
use mcap::McapResult;

use crate::recording::file::layout::name_of;
use crate::recording::frames::Frame;
use crate::recording::protobuf::{self, Schema, schema_of};
use crate::recording::signal::Signal;
use crate::recording::strikes::{ScanCodes, push_scans};

/// A channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
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
}

/// The channels, and what waits to be written to them.
pub(super) struct Channels {
    ids: HashMap<Topic, u16>,
    coming: HashMap<u8, Coming>,
}

impl Channels {
    /// Adds the channels to a file: of one bead among several, or of all.
    pub(super) fn begin<W: Write + Seek>(mcap: &mut mcap::Writer<W>, bead: Option<u8>) -> McapResult<Self> {
        let mut ids = HashMap::new();
        for topic in Topic::ALL {
            let Schema { name, descriptors } = topic.schema();
            let schema = mcap.add_schema(&name, "protobuf", &descriptors)?;
            ids.insert(
                topic,
                mcap.add_channel(schema, &name_of(bead, topic.name()), "protobuf", &BTreeMap::new())?,
            );
        }
        Ok(Self {
            ids,
            coming: HashMap::new(),
        })
    }

    /// What a frame adds to the channels.
    pub(super) fn take(&mut self, frame: &Frame) -> Vec<Said> {
        if frame.arrival == Arrival::Duplicate {
            return Vec::new();
        }
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
            Message::Waveform(waveform) => {
                let next = coming.first_index.checked_add(coming.scans.len() as u64);
                let goes_on = waveform.strike == coming.strike && Some(waveform.first_index) == next;
                if !goes_on {
                    coming.scans.clear();
                    (coming.strike, coming.first_index) = (waveform.strike, waveform.first_index);
                }
                if coming.scans.len() < usize::from(WINDOW_MAX) {
                    push_scans(&mut coming.scans, waveform);
                }
            }
            Message::Strike(strike) => {
                say(Topic::Strikes, protobuf::message(frame, strike));
                let scans = std::mem::take(&mut coming.scans);
                let is_whole = (coming.strike, coming.first_index, scans.len())
                    == (strike.strike, strike.first_index, strike.samples.into());
                let settings = coming.settings.filter(|_| is_whole);
                let signal = settings.and_then(|settings| Signal::of(&scans, &settings));
                if let (Some(signal), Some(settings)) = (signal, settings) {
                    let waveform = protobuf::Waveform {
                        frame,
                        strike: strike.strike,
                        first_index: strike.first_index,
                        trigger_index: strike.trigger_index,
                        sample_rate_hz: settings.sample_rate_hz,
                        signal: &signal,
                    };
                    say(Topic::Waveforms, waveform.message());
                }
            }
            Message::Shape(shape) => say(Topic::Shapes, protobuf::message(frame, shape)),
            Message::Status(status) => say(Topic::Status, protobuf::message(frame, status)),
            Message::Health(health) => say(Topic::Health, protobuf::message(frame, health)),
            Message::Fault(fault) => say(Topic::Faults, protobuf::message(frame, fault)),
            _ => {}
        }
        said
    }
}
