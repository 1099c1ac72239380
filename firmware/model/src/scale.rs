//! Powers of two between the coefficients of a bead and their formats.
//!
//! # Design
//!
//! The formats of the coefficients fit beads like the paper's without a power of two. A small or stiff
//! bead has greater coefficients, a large one smaller ones, by up to six orders of magnitude from PTFE of
//! 5 mm to steel of 40 mm. Its coefficients are kept with powers of two taken out. The estimators put these
//! back where a product has room for them. Estimate B has a second copy of its loop for that, so the bead
//! whose powers are all zero does not pay for them.

use serde::{Deserialize, Serialize};

/// Most powers of two of the contact and of the masses.
pub const SHIFT_MAX: u8 = 6;
/// Most powers of two of the incoming force: the host then has 17 mg.
pub const INCOMING_MAX: u8 = 8;
/// Most powers of two of an energy, to either side.
pub const POWERS_MAX: u8 = 24;

/// Number of powers of two taken out of each coefficient.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Scale {
    /// Of [`ReducedChain::contact`](crate::reduced_chain::ReducedChain::contact). Then the square root of an
    /// overlap has room up to `2^(6 - contact)` √µm.
    pub contact: u8,
    /// Of [`ReducedChain::incoming`](crate::reduced_chain::ReducedChain::incoming).
    pub incoming: u8,
    /// Of [`ReducedChain::intruder`](crate::reduced_chain::ReducedChain::intruder) and
    /// [`ReducedChain::host`](crate::reduced_chain::ReducedChain::host).
    pub masses: u8,
    /// Of [`Observer::end`](crate::observer::Observer::end): 0 or 1.
    pub observer: u8,
    /// Of [`Observer::energy`](crate::observer::Observer::energy). Below 0 for a light intruder.
    pub measured: i8,
    /// Of [`ReducedChain::energy`](crate::reduced_chain::ReducedChain::energy).
    pub predicted: i8,
}
