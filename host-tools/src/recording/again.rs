//! Strikes that a bead sent once more: fetched frames, put together.

use std::collections::{BTreeMap, HashMap};

use bead_wire::{Fetched, Message, Settings, Shape, Strike, Waveform};

/// A strike of which every frame came.
#[derive(Clone, Debug, PartialEq)]
pub struct Whole {
    /// The boot in which it was measured.
    pub boot: u32,
    /// The settings that it was measured with.
    pub settings: Settings,
    /// Its window, in order and without a gap.
    pub waveforms: Vec<Waveform>,
    /// The strike.
    pub strike: Strike,
    /// Its shape.
    pub shape: Shape,
}

/// The frames of a strike that have come so far, by their places.
#[derive(Clone, Debug, Default)]
struct Coming {
    of: (u32, u32, u8),
    parts: BTreeMap<u8, Message>,
}

/// Puts fetched frames together. It keeps those of one strike for each bead. A strike that was fetched twice
/// since frames were lost is whole when each came once.
#[derive(Clone, Debug, Default)]
pub struct Again {
    coming: HashMap<u8, Coming>,
}

impl Again {
    /// Whether a part of a strike came, and another part did not.
    pub fn is_begun(&self) -> bool {
        self.coming.values().any(|coming| !coming.parts.is_empty())
    }

    /// Takes a frame of the bead with this address; gives the strike that it makes whole.
    pub fn take(&mut self, address: u8, frame: &Fetched) -> Option<Whole> {
        let coming = self.coming.entry(address).or_default();
        let of = (frame.boot, frame.strike, frame.parts);
        if coming.of != of {
            *coming = Coming {
                of,
                ..Coming::default()
            };
        }
        if frame.part >= frame.parts {
            return None;
        }
        coming.parts.insert(frame.part, frame.message().ok()?);
        if coming.parts.len() < usize::from(frame.parts) {
            return None;
        }
        let parts = std::mem::take(coming).parts;
        whole(frame.boot, frame.strike, parts.into_values())
    }
}

fn whole(boot: u32, number: u32, messages: impl Iterator<Item = Message>) -> Option<Whole> {
    let (mut settings, mut strike, mut shape) = (None, None, None);
    let mut waveforms = Vec::new();
    for message in messages {
        match message {
            Message::Settings(told) => settings = Some(told),
            Message::Waveform(waveform) => waveforms.push(waveform),
            Message::Strike(said) => strike = Some(said),
            Message::Shape(said) => shape = Some(said),
            // A later bead may keep more.
            _ => {}
        }
    }
    let strike: Strike = strike?;
    let mut next = strike.first_index;
    for waveform in &waveforms {
        if waveform.first_index != next {
            return None;
        }
        next = next.checked_add(waveform.codes.len() as u64)?;
    }
    let is_whole =
        strike.strike == number && next.checked_sub(strike.first_index)? == u64::from(strike.samples);
    is_whole.then_some(Whole {
        boot,
        settings: settings?,
        waveforms,
        strike,
        shape: shape?,
    })
}
