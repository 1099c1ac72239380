//! Intruders in their hosts.

use crate::oscillator::Oscillator;

/// An intruder in its host.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct HostedIntruder {
    /// The host bead, from 1.
    pub bead: usize,
    /// Mass, stiffness and damping.
    pub oscillator: Oscillator,
}
