//! Data of a fit, and their models.

use crate::quantity::Quantity;

/// The data of a fit, and their model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Ringing after taps.
    RingDown,
    /// Force and acceleration of taps at a free bead.
    Pairs,
    /// Strikes of a chain that a scenario describes.
    Chain,
}

impl Method {
    /// Its name in results.
    pub fn name(self) -> &'static str {
        match self {
            Self::RingDown => "ring_down",
            Self::Pairs => "pairs",
            Self::Chain => "chain",
        }
    }

    /// Quantities that it fits unless others are asked for.
    pub(crate) fn usual(self) -> Vec<Quantity> {
        let mut fitted = vec![Quantity::Stiffness, Quantity::Damping];
        match self {
            Self::RingDown => {}
            Self::Pairs => fitted.push(Quantity::AccelerationGain),
            Self::Chain => fitted.extend([Quantity::Young, Quantity::Relaxation]),
        }
        fitted
    }
}
