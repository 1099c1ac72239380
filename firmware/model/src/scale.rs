//! Powers of two between the coefficients of a bead and their formats.
//!
//! # Design
//!
//! The formats of the coefficients fit beads like the paper's: no power of two. A small or stiff
//! bead has greater coefficients, a large one smaller ones, by up to six orders of magnitude from PTFE of
//! 5 mm to steel of 40 mm. Its coefficients are kept with powers of two taken out. The estimators put these
//! back where a product has room for them. Estimate B has a second copy of its loop for that, so the bead
//! whose powers are all zero does not pay for them.

use serde::{Deserialize, Serialize};

/// Most powers of two of the contact and of the masses.
pub const SHIFT_MAX: u8 = 6;
/// Most powers of two of the incoming force: the host then has 17 mg.
pub const INCOMING_MAX: u8 = 8;

/// By how many powers of two each coefficient is greater than its bits say.
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

impl Scale {
    /// Whether every product has room.
    pub fn is_bounded(&self) -> bool {
        let Self {
            contact,
            incoming,
            masses,
            observer,
            measured,
            predicted,
        } = *self;
        [contact, masses].into_iter().all(|shift| shift <= SHIFT_MAX)
            && incoming <= INCOMING_MAX
            && observer <= 1
            && [measured, predicted]
                .into_iter()
                .all(|shift| shift.unsigned_abs() <= 24)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_number_of_powers_has_its_limits() {
        type Set = fn(&mut Scale, i8);
        let limits: [(Set, [i8; 2]); 6] = [
            (|scale, powers| scale.contact = powers as u8, [0, 6]),
            (|scale, powers| scale.incoming = powers as u8, [0, 8]),
            (|scale, powers| scale.masses = powers as u8, [0, 6]),
            (|scale, powers| scale.observer = powers as u8, [0, 1]),
            (|scale, powers| scale.measured = powers, [-24, 24]),
            (|scale, powers| scale.predicted = powers, [-24, 24]),
        ];
        for (n, (set, [least, most])) in limits.into_iter().enumerate() {
            for powers in [least - 1, least, 0, most, most + 1] {
                let mut scale = Scale::default();
                set(&mut scale, powers);
                let allowed = (least..=most).contains(&powers);
                assert_eq!(scale.is_bounded(), allowed, "number {n}: {powers}");
            }
        }
    }
}
