//! Assembles fetched frames into their strike.

use std::collections::BTreeMap;

use bead_model::settings::Settings;
use bead_wire::{Fetched, Message};

use crate::strike::RecordedStrike;

/// The fetched frames of one strike of a bead, by their places. A strike that is fetched twice because frames
/// were lost is complete when each frame came once.
#[derive(Clone, Debug, Default)]
pub(super) struct FetchedFrames {
    /// Boot and number of the strike, and its count of frames.
    strike: (u32, u32, u8),
    messages: BTreeMap<u8, Message>,
}

impl FetchedFrames {
    /// True if no frame waits for another.
    pub(super) fn is_empty(&self) -> bool {
        self.messages.is_empty()
    }

    /// Takes a frame of the bead with this address. Returns the strike if this was its last frame.
    pub(super) fn push(&mut self, address: u8, frame: &Fetched) -> Option<RecordedStrike> {
        let strike = (frame.boot, frame.strike, frame.parts);
        if self.strike != strike {
            *self = Self {
                strike,
                messages: BTreeMap::new(),
            };
        }
        if frame.part >= frame.parts {
            return None;
        }
        self.messages.insert(frame.part, frame.message().ok()?);
        if self.messages.len() < usize::from(frame.parts) {
            return None;
        }
        let messages = std::mem::take(&mut self.messages);
        let strike = whole(address, messages.into_values())?;
        (strike.said.strike == frame.strike).then_some(RecordedStrike {
            boot: frame.boot as u8,
            ..strike
        })
    }
}

/// The strike of these messages. `None` if one of its parts is missing.
fn whole(address: u8, messages: impl Iterator<Item = Message>) -> Option<RecordedStrike> {
    let (mut settings, mut strike, mut shape) = (None, None, None);
    let mut waveforms = Vec::new();
    for message in messages {
        match message {
            Message::Settings(message) => settings = Some(message),
            Message::Waveform(message) => waveforms.push(message),
            Message::Strike(message) => strike = Some(message),
            Message::Shape(message) => shape = Some(message),
            // A later bead may keep more.
            _ => {}
        }
    }
    let mut strike = RecordedStrike {
        shape: Some(shape?),
        settings: Settings::decode(settings?.block.bytes()).ok(),
        ..RecordedStrike::new(address, strike?)
    };
    let samples = strike.said.samples;
    let _end = strike.said.first_index.checked_add(samples.into())?;
    for waveform in &waveforms {
        let next = strike.said.first_index.checked_add(strike.scans.len() as u64);
        if Some(waveform.first_index) != next {
            return None;
        }
        strike.push(waveform);
    }
    (strike.scans.len() == usize::from(samples)).then_some(strike)
}
