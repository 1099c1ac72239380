//! Frames of strikes, and numbers to draw messages from.

use bead_wire::{Codes, Energy, Fetched, Inner, Kind, Message, Packed, Shape, Strike, Waveform};

/// Returns the window of one sample, the result and the shape of a strike that begins at this index.
///
/// # Panics
/// Never: the messages are of the kinds that are drawn.
pub fn one_sample_strike(number: u32, first_index: u64) -> [Message; 3] {
    let [Message::Strike(strike), Message::Shape(shape)] =
        [Kind::Strike, Kind::Shape].map(|kind| Message::draw(kind, &mut || 0))
    else {
        panic!("a strike and a shape");
    };
    let waveform = Waveform {
        strike: number,
        first_index,
        codes: Codes::pack([[1, 2]]).expect("a sample of two codes"),
        wide: Codes::default(),
        absorbed_measured: Energy::from_bits(0),
        absorbed_predicted: Energy::from_bits(0),
    };
    let strike = Strike {
        strike: number,
        first_index,
        samples: 1,
        ..strike
    };
    let shape = Shape {
        strike: number,
        first_index,
        ..shape
    };
    [waveform.into(), strike.into(), shape.into()]
}

/// Wraps the frames of a strike as a bead sends them again on request.
///
/// # Panics
/// A message is longer than a frame holds.
pub fn fetched(boot: u32, strike: u32, frames: &[Message]) -> Vec<Message> {
    let parts = frames.len() as u8;
    let wrap = |(part, message): (u8, &Message)| {
        let mut packed = Packed::new();
        packed.pack(0, 0, message).expect("a message that fits a frame");
        let (frame_kind, content) = packed.content();
        let body = Inner::filled_by(|room| {
            room[..content.len()].copy_from_slice(content);
            content.len()
        });
        Fetched {
            boot,
            strike,
            part,
            parts,
            frame_kind,
            body,
        }
        .into()
    };
    (0..).zip(frames).map(wrap).collect()
}

/// Numbers of a xorshift64 generator (Marsaglia 2003), the same in every run. The seed is not 0.
pub fn xorshift(seed: u64) -> impl FnMut() -> u64 + Send {
    let mut state = seed;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state
    }
}
