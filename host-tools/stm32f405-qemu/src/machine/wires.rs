//! Wires between pins of the part.
//!
//! # Design
//!
//! A wire carries the level that an output drives to the pin at its other end, and the frames of a
//! transmitter to the receiver there. Frames go as a whole, at the time at which they end: the bits of a
//! frame are not seen as levels.

use super::wiring::PinIndex;

#[derive(Debug, Clone, Default)]
pub(super) struct Wires(Vec<[PinIndex; 2]>);

impl Wires {
    pub(super) fn new(wires: Vec<[PinIndex; 2]>) -> Self {
        Self(wires)
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Each wire twice: from a pin to the pin at its other end.
    pub(super) fn ends(&self) -> impl Iterator<Item = (PinIndex, PinIndex)> + '_ {
        self.0.iter().flat_map(|[a, b]| [(*a, *b), (*b, *a)])
    }

    /// The pins at the other ends of the wires at a pin.
    pub(super) fn from(&self, pin: PinIndex) -> impl Iterator<Item = PinIndex> + '_ {
        self.ends()
            .filter(move |(from, _)| *from == pin)
            .map(|(_, to)| to)
    }
}
