//! The bytes of one bead on their way into a recording.

use std::collections::BTreeMap;

use bead_wire::{Arrival, Message};
use mcap::McapResult;
use mcap::records::MessageHeader;

use crate::file::about::RecordingOrigin;
use crate::file::channels::{ChannelMessage, ReadableChannels};
use crate::file::layout::{ENCODING, LONGEST_RUN, Mcap, RECEIVED, RECEIVED_ENCODING, TOPIC, name_of};
use crate::frames::{FrameReader, Item};

/// The channels of one bead, and the bytes that are not yet written to them. In a recording of one line,
/// those of all its beads.
pub(super) struct Stream {
    /// The bead, if it is one of several.
    origin: Option<RecordingOrigin>,
    channel: u16,
    received: u16,
    channels: ReadableChannels,
    run: Vec<u8>,
    /// Runs that are not frames, each with a delimiter.
    noise: Vec<u8>,
    pub(super) reader: FrameReader,
    pub(super) clock: MessageClock,
    /// Number of messages in this file, and of bytes in them.
    pub(super) written: u32,
    pub(super) bytes: u64,
}

impl Stream {
    pub(super) fn begin(
        mcap: &mut Mcap,
        origin: Option<&RecordingOrigin>,
        sample_rate_hz: u32,
    ) -> McapResult<Self> {
        let (channel, received) = add_channels(mcap, origin)?;
        Ok(Self {
            origin: origin.cloned(),
            channel,
            received,
            channels: ReadableChannels::begin(mcap, origin.map(|origin| origin.address))?,
            run: Vec::new(),
            noise: Vec::new(),
            reader: FrameReader::default(),
            clock: MessageClock {
                sample_rate_hz,
                ..MessageClock::default()
            },
            written: 0,
            bytes: 0,
        })
    }

    /// Adds its channels to the file that follows. Bytes that are not written yet go there; noise must be
    /// [ended](Self::end_noise) before.
    pub(super) fn go_on(&mut self, mcap: &mut Mcap) -> McapResult<()> {
        (self.channel, self.received) = add_channels(mcap, self.origin.as_ref())?;
        self.channels.go_on(mcap, self.bead())?;
        (self.written, self.bytes) = (0, 0);
        Ok(())
    }

    pub(super) fn bead(&self) -> Option<u8> {
        self.origin.as_ref().map(|origin| origin.address)
    }

    /// True if no strike is on its way.
    pub(super) fn is_idle(&self) -> bool {
        self.channels.are_idle()
    }

    pub(super) fn write(
        &mut self,
        mcap: &mut Mcap,
        bytes: &[u8],
        received_ns: Option<u64>,
        mut sink: impl FnMut(Item),
    ) -> McapResult<()> {
        let before = self.written;
        if let Some(received_ns) = received_ns {
            self.clock.receive(received_ns);
        }
        let mut messages = Vec::new();
        for byte in bytes {
            let Self {
                reader,
                clock,
                channels,
                ..
            } = self;
            let mut is_frame = false;
            reader.feed(std::slice::from_ref(byte), received_ns, |item| {
                if let Item::Frame(frame) = &item {
                    is_frame = true;
                    if let Message::Identity(identity) = &frame.message {
                        clock.sample_rate_hz = identity.sample_rate_hz;
                    }
                    clock.tick(frame.header.sample_index, frame.arrival);
                    messages.extend(channels.push(frame));
                }
                sink(item);
            });
            if *byte != 0 {
                self.run.push(*byte);
            }
            match *byte {
                0 if self.run.is_empty() => {}
                // Runs that are not frames share a message, as each costs some 50 bytes.
                0 if !is_frame && self.noise.len() + self.run.len() < LONGEST_RUN => {
                    self.noise.append(&mut self.run);
                    self.noise.push(0);
                }
                0 => self.end_run(mcap)?,
                _ if self.run.len() == LONGEST_RUN => self.end_run(mcap)?,
                _ => {}
            }
            self.write_messages(mcap, messages.drain(..))?;
        }
        self.end_noise(mcap)?;
        if let Some(received_ns) = received_ns.filter(|_| self.written != before) {
            self.write_time(mcap, received_ns)?;
        }
        Ok(())
    }

    /// Records the receive time of the piece with the end of the last run.
    fn write_time(&mut self, mcap: &mut Mcap, received_ns: u64) -> McapResult<()> {
        let last = self.written.wrapping_sub(1);
        let data = [&last.to_le_bytes()[..], &received_ns.to_le_bytes()].concat();
        self.message(mcap, self.received, last, &data)
    }

    pub(super) fn end_noise(&mut self, mcap: &mut Mcap) -> McapResult<()> {
        let noise = std::mem::take(&mut self.noise);
        self.put(mcap, noise)
    }

    fn end_run(&mut self, mcap: &mut Mcap) -> McapResult<()> {
        self.end_noise(mcap)?;
        let mut run = std::mem::take(&mut self.run);
        if !run.is_empty() {
            run.push(0);
        }
        self.put(mcap, run)
    }

    /// Writes all waiting bytes at the end of the stream.
    pub(super) fn end(&mut self, mcap: &mut Mcap) -> McapResult<()> {
        self.end_run(mcap)?;
        let messages = self.channels.end();
        self.write_messages(mcap, messages)
    }

    /// Writes messages for other programs, with the number of the last run.
    fn write_messages(
        &mut self,
        mcap: &mut Mcap,
        messages: impl IntoIterator<Item = ChannelMessage>,
    ) -> McapResult<()> {
        let number = self.written.wrapping_sub(1);
        let mut messages = messages.into_iter();
        messages.try_for_each(|(channel, data)| self.message(mcap, channel, number, &data))
    }

    /// Writes runs, each with its delimiter, so that a search of a damaged file finds each frame.
    fn put(&mut self, mcap: &mut Mcap, run: Vec<u8>) -> McapResult<()> {
        if run.is_empty() {
            return Ok(());
        }
        let number = self.written;
        self.written = number.wrapping_add(1);
        self.message(mcap, self.channel, number, &run)
    }

    fn message(&mut self, mcap: &mut Mcap, channel_id: u16, sequence: u32, data: &[u8]) -> McapResult<()> {
        let header = MessageHeader {
            channel_id,
            sequence,
            log_time: self.clock.log,
            publish_time: self.clock.bead,
        };
        self.bytes += data.len() as u64;
        mcap.write_to_known_channel(&header, data)
    }
}

/// Times of the messages, in nanoseconds.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct MessageClock {
    sample_rate_hz: u32,
    /// Time of the bead since its reset.
    bead: u64,
    /// Log time of the next message.
    pub(super) log: u64,
    /// Log time at the bead's reset.
    reset: u64,
    /// True if log times are those of the host.
    received: bool,
}

impl MessageClock {
    fn tick(&mut self, sample_index: u64, arrival: Arrival) {
        if let Arrival::Restart { .. } = arrival {
            self.reset = self.log;
        }
        let ns = u128::from(sample_index) * 1_000_000_000;
        let time = ns.checked_div(u128::from(self.sample_rate_hz)).unwrap_or(0);
        self.bead = u64::try_from(time).unwrap_or(u64::MAX);
        if !self.received {
            self.log = self.log.max(self.reset.saturating_add(self.bead));
        }
    }

    fn receive(&mut self, received_ns: u64) {
        self.received = true;
        self.log = self.log.max(received_ns);
    }
}

/// Adds the channels of raw frames and of their times of receipt.
fn add_channels(mcap: &mut Mcap, origin: Option<&RecordingOrigin>) -> McapResult<(u16, u16)> {
    let bead = origin.map(|origin| origin.address);
    let mut layout = origin.map(RecordingOrigin::to_map).unwrap_or_default();
    layout.insert("version".into(), bead_wire::VERSION.to_string());
    let channel = mcap.add_channel(0, &name_of(bead, TOPIC), ENCODING, &layout)?;
    let none = BTreeMap::new();
    let received = mcap.add_channel(0, &name_of(bead, RECEIVED), RECEIVED_ENCODING, &none)?;
    Ok((channel, received))
}
