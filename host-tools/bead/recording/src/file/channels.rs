//! The channels of a recording that other programs read: the content of the frames in SI units, with schemas.
//!
//! # Design
//! They are made from the raw frames and stored beside them; nothing here reads them again. A frame's message
//! is written when the frame comes. A window is written when its strike is handed on by the [`Assembly`], if
//! every sample of it came. A fetched strike adds the messages that are still missing, with the boot of the
//! strike.

use std::collections::{BTreeMap, HashMap};

use bead_wire::{Arrival, Kind, Message, VERSION};
use mcap::McapResult;

use crate::assembly::{Assembled, Assembly, Event, StrikeParts};
use crate::file::layout::{Mcap, name_of};
use crate::frames::Frame;
use crate::protobuf::{self, Schema};
use crate::signal::Signal;
use crate::strike::RecordedStrike;

/// Name of a channel, name of its messages, and the kind of their frames; `None` for windows.
type Topic = (&'static str, &'static str, Option<Kind>);

const TOPICS: [Topic; 6] = [
    ("strikes", "Strike", Some(Kind::Strike)),
    ("shapes", "Shape", Some(Kind::Shape)),
    ("waveforms", "Waveform", None),
    ("status", "Status", Some(Kind::Status)),
    ("health", "Health", Some(Kind::Health)),
    ("faults", "Fault", Some(Kind::Fault)),
];

/// A message to be written: its channel and its Protobuf.
pub(super) type ChannelMessage = (u16, Vec<u8>);

/// A message with the name of its channel.
type NamedMessage = (&'static str, Vec<u8>);

/// The channels, and the strikes whose windows are to be written to them.
pub(super) struct ReadableChannels {
    /// By name.
    ids: HashMap<&'static str, u16>,
    assembly: Assembly,
}

impl ReadableChannels {
    /// Adds the channels to a file: of one bead among several, or of all.
    pub(super) fn begin(mcap: &mut Mcap, bead: Option<u8>) -> McapResult<Self> {
        let (ids, assembly) = (ids(mcap, bead)?, Assembly::default());
        Ok(Self { ids, assembly })
    }

    /// Adds the channels to the file that follows.
    pub(super) fn go_on(&mut self, mcap: &mut Mcap, bead: Option<u8>) -> McapResult<()> {
        self.ids = ids(mcap, bead)?;
        Ok(())
    }

    /// True if no strike is on its way.
    pub(super) fn are_idle(&self) -> bool {
        self.assembly.is_idle()
    }

    /// Takes the next frame, and returns the messages that follow from it.
    pub(super) fn push(&mut self, frame: &Frame) -> Vec<ChannelMessage> {
        if frame.arrival == Arrival::Duplicate {
            return Vec::new();
        }
        let events = self.assembly.push(frame);
        let kind = Some(frame.message.kind());
        let own = TOPICS.iter().filter(|(.., of)| *of == kind);
        let own = own.map(|(topic, ..)| (*topic, protobuf::message(frame)));
        self.addressed(own.chain(events.iter().flat_map(messages)))
    }

    /// The messages of the waiting strikes at the end of the frames.
    pub(super) fn end(&mut self) -> Vec<ChannelMessage> {
        let events = self.assembly.end();
        self.addressed(events.iter().flat_map(messages))
    }

    fn addressed(&self, messages: impl Iterator<Item = NamedMessage>) -> Vec<ChannelMessage> {
        let addressed = |(topic, data)| Some((*self.ids.get(topic)?, data));
        messages.filter_map(addressed).collect()
    }
}

/// The window of a strike, and the other parts of a fetched one that were not written before.
fn messages(event: &Event) -> Vec<NamedMessage> {
    let Event::Strike(assembled) = event else {
        return Vec::new();
    };
    let Assembled {
        strike,
        header,
        fetched,
    } = &**assembled;
    let frame = |message: Message| Frame {
        version: VERSION,
        header: *header,
        arrival: Arrival::Late,
        sample_rate_hz: strike.sample_rate_hz,
        received_ns: strike.received_ns,
        strike: Some(strike.said),
        message,
    };
    let said = frame(strike.said.into());
    let missing = |is_there: fn(StrikeParts) -> bool| fetched.is_some_and(|copy| !is_there(copy.before));
    let mut messages = Vec::new();
    if missing(|before| before.result) {
        messages.push(("strikes", protobuf::message(&said)));
    }
    if fetched.is_none_or(|copy| !copy.before.window) {
        messages.extend(waveform(&said, strike).map(|data| ("waveforms", data)));
    }
    if let Some(shape) = strike.shape
        && missing(|before| before.shape)
    {
        messages.push(("shapes", protobuf::message(&frame(shape.into()))));
    }
    messages
}

/// The window of a strike in SI units. `None` if a sample or the settings are missing.
fn waveform(frame: &Frame, strike: &RecordedStrike) -> Option<Vec<u8>> {
    let settings = strike.settings.filter(|_| strike.missing() == 0)?;
    let signal = Signal::of(&strike.scans, &settings)?;
    Some(protobuf::waveform(
        frame,
        &strike.said,
        settings.sample_rate_hz,
        &signal,
    ))
}

/// Adds a channel for each topic to a file, and returns their numbers.
fn ids(mcap: &mut Mcap, bead: Option<u8>) -> McapResult<HashMap<&'static str, u16>> {
    let add = |(topic, message, kind): Topic| {
        let schema = kind.map(|kind| protobuf::schema_of(message, kind));
        let Schema { name, descriptors } = schema.unwrap_or_else(protobuf::waveform_schema);
        let schema = mcap.add_schema(&name, "protobuf", &descriptors)?;
        let name = name_of(bead, topic);
        let id = mcap.add_channel(schema, &name, "protobuf", &BTreeMap::new())?;
        Ok((topic, id))
    };
    TOPICS.into_iter().map(add).collect()
}
