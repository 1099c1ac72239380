//! The frames of a strike that has one sample.

use bead_wire::{Codes, Energy, Kind, Message, Shape, Strike, Waveform};

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
