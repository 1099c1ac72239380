//! Curves of a strike beside the chain's: what its sensors felt, and the energies.

/// A value of a sensor, its filter's pole removed, and the chain's at that time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SensedPoint {
    /// Time since the striker hit, s.
    pub(crate) time: f64,
    pub(crate) sensed: f64,
    pub(crate) simulated: f64,
}

/// An estimate of the absorbed energy, J, and the chain's at that time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct AbsorbedPoint {
    /// Time since the striker hit, s.
    pub(crate) time: f64,
    pub(crate) estimate: f64,
    pub(crate) chain: f64,
}

/// Curves of a strike; energies by A and by B.
#[derive(Debug, Clone, Default)]
pub(crate) struct Traces {
    /// N.
    pub(crate) force: Vec<SensedPoint>,
    /// m/s², taken [`SCAN_SKEW`](crate::sensed::SCAN_SKEW) after the force.
    pub(crate) acceleration: Vec<SensedPoint>,
    pub(crate) f64_samples: [Vec<AbsorbedPoint>; 2],
    pub(crate) replay: [Vec<AbsorbedPoint>; 2],
    /// From the device, at the ends of its chunks.
    pub(crate) device: [Vec<AbsorbedPoint>; 2],
}
