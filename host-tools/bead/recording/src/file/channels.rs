//! The channels of a recording that other programs read: the content of the frames in SI units, with schemas.
//!
//! # Design
//! They stand beside the raw frames and are made of them; nothing here reads them again. A frame's message is
//! written when the frame comes. A window is written when its strike is handed on by the [`Assembly`], if
//! every sample of it came. A fetched strike adds the messages that are still missing, with the boot of the
//! strike.

use std::collections::{BTreeMap, HashMap};
use std::io::{Seek, Write};

use bead_wire::{Arrival, Fault, Fields, Health, Message, Shape, Status, Strike, VERSION};
use mcap::McapResult;

use crate::assembly::{Assembled, Assembly, Event, Parts};
use crate::file::layout::name_of;
use crate::frames::Frame;
use crate::protobuf::{self, Schema, schema_of};
use crate::signal::Signal;
use crate::strike::RecordedStrike;

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
pub(super) struct ChannelMessage {
    /// Its channel.
    pub(super) channel: u16,
    /// Its Protobuf.
    pub(super) data: Vec<u8>,
}

/// The channels, and the strikes whose windows are to be written to them.
pub(super) struct Channels {
    ids: HashMap<Topic, u16>,
    assembly: Assembly,
}

impl Channels {
    /// Adds the channels to a file: of one bead among several, or of all.
    pub(super) fn begin<W: Write + Seek>(mcap: &mut mcap::Writer<W>, bead: Option<u8>) -> McapResult<Self> {
        Ok(Self {
            ids: ids(mcap, bead)?,
            assembly: Assembly::default(),
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

    /// True if no strike is on its way.
    pub(super) fn are_idle(&self) -> bool {
        self.assembly.is_idle()
    }

    /// Takes the next frame, and gives the messages that follow from it.
    pub(super) fn push(&mut self, frame: &Frame) -> Vec<ChannelMessage> {
        if frame.arrival == Arrival::Duplicate {
            return Vec::new();
        }
        let events = self.assembly.push(frame);
        let message = |topic: Topic, body: &dyn Fields| (topic, protobuf::message(frame, body));
        let own = match &frame.message {
            Message::Strike(strike) => Some(message(Topic::Strikes, strike)),
            Message::Shape(shape) => Some(message(Topic::Shapes, shape)),
            Message::Status(status) => Some(message(Topic::Status, status)),
            Message::Health(health) => Some(message(Topic::Health, health)),
            Message::Fault(fault) => Some(message(Topic::Faults, fault)),
            _ => None,
        };
        let assembled = events.iter().flat_map(messages);
        self.addressed(own.into_iter().chain(assembled))
    }

    /// The messages of the strikes that wait, for no more frames come.
    pub(super) fn end(&mut self) -> Vec<ChannelMessage> {
        let events = self.assembly.end();
        self.addressed(events.iter().flat_map(messages))
    }

    fn addressed(&self, messages: impl Iterator<Item = (Topic, Vec<u8>)>) -> Vec<ChannelMessage> {
        let addressed = |(topic, data)| {
            let channel = *self.ids.get(&topic)?;
            Some(ChannelMessage { channel, data })
        };
        messages.filter_map(addressed).collect()
    }
}

/// The window of a strike, and the other parts of a fetched one that were not written before.
fn messages(event: &Event) -> Vec<(Topic, Vec<u8>)> {
    let (Event::Whole(assembled) | Event::Gap(assembled)) = event else {
        return Vec::new();
    };
    let Assembled {
        strike,
        header,
        fetched,
    } = &**assembled;
    let frame = Frame {
        version: VERSION,
        header: *header,
        arrival: Arrival::Late,
        sample_rate_hz: strike.sample_rate_hz,
        received_ns: strike.received_ns,
        message: strike.said.into(),
    };
    let missing = |is_there: fn(Parts) -> bool| fetched.is_some_and(|copy| !is_there(copy.before));
    let mut messages = Vec::new();
    if missing(|before| before.result) {
        messages.push((Topic::Strikes, protobuf::message(&frame, &strike.said)));
    }
    if fetched.is_none_or(|copy| !copy.before.window) {
        messages.extend(waveform(&frame, strike).map(|data| (Topic::Waveforms, data)));
    }
    if let Some(shape) = &strike.shape
        && missing(|before| before.shape)
    {
        messages.push((Topic::Shapes, protobuf::message(&frame, shape)));
    }
    messages
}

/// The window of a strike in SI units. `None` if a sample or the settings are missing.
fn waveform(frame: &Frame, strike: &RecordedStrike) -> Option<Vec<u8>> {
    let settings = strike.settings.filter(|_| strike.missing() == 0)?;
    let signal = Signal::of(&strike.scans, &settings)?;
    let waveform = protobuf::Waveform {
        frame,
        strike: strike.said.strike,
        first_index: strike.said.first_index,
        trigger_index: strike.said.trigger_index,
        sample_rate_hz: settings.sample_rate_hz,
        signal: &signal,
    };
    Some(waveform.message())
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
