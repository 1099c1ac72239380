//! Estimate B: the absorbed energy, predicted from the contact force alone.
//!
//! The measured force at the host's incoming contact drives a model of the host, its intruder and
//! [`FOLLOWERS`] beads behind it whose last one is free (a free end is within 0.006 % of the endless chain
//! over the pulse's passage; a wall is 30 % off). The contacts obey the paper's Eq. 1 (Hertz and
//! Kuwabara-Kono), the host its Eq. 2 with M - m, the intruder Eq. 3.
//!
//! # Scheme
//!
//! The state is in *relative* coordinates, the overlaps and the intruder's displacement against its host, so
//! that a bead which travels on leaves no range. Each obeys ẍ = a(x, ẋ), integrated by Störmer's explicit
//! fourth-order formula, one evaluation of the forces a sample:
//!
//! ```text
//! x[n+1] - 2x[n] + x[n-1] = dt² (14 a[n] - 5 a[n-1] + 4 a[n-2] - a[n-3])/12
//! ẋ[n] = (x[n] - x[n-1])/dt + dt (5 a[n-1] - 2 a[n-2])/6
//! ```
//!
//! (Hairer, Nørsett and Wanner, *Solving Ordinary Differential Equations I*, Sec. III.10; the second line is
//! the Taylor expansion with a at n extrapolated from the two samples before). It needs a quarter of the
//! force evaluations of RK4, and no force between samples.

use crate::quantity::{
    EnergyScale, Force, Length, SquareSum, Step, at_range_end, bounded_product, product, round_shift, wide,
};
use crate::sqrt::sqrt;
use fixed::types::I2F30;
use fixed::types::extra::{U20, U24};
use serde::{Deserialize, Serialize};

/// Beads behind the host in the reduced chain.
pub const FOLLOWERS: usize = 4;

/// Coefficients of estimate B. Forces are counted in the acceleration that they give a bead of mass M, µm/sample².
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ReducedChain {
    /// κ dt²/M of the contacts between beads, µm^-0.5/sample².
    pub contact: I2F30,
    /// 3τ/(2 dt): the relaxation time of the contacts, in samples, by 3/2.
    pub relaxation: I2F30,
    /// dt²/(M - m): what the incoming force does to the host, µm/sample² per N.
    pub incoming: I2F30,
    /// M/(M - m): what the outgoing contact does to the host.
    pub host: I2F30,
    /// k dt²/m of the intruder.
    pub stiffness: I2F30,
    /// c dt/m of the intruder.
    pub damping: I2F30,
    /// m/(M - m): what the intruder's springs do to the host.
    pub intruder: I2F30,
    /// Forces below this are noise and taken for zero: they would be rectified by the contacts.
    pub gate: Force,
    /// c (1 µm/sample)² dt, nJ.
    pub energy: EnergyScale,
}

/// One coordinate with what its next step needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Coordinate {
    position: Length,
    /// Change of the position over the last sample.
    step: Step,
    /// Accelerations at the last three samples, the latest first.
    acceleration: [Step; 3],
}

impl Coordinate {
    /// ẋ at the sample at which the position is.
    #[inline(always)]
    fn velocity(&self) -> Step {
        let [a1, a2, _] = self.acceleration;
        self.step.saturating_add((a1 * 5 - a2 * 2) / 6)
    }

    /// Goes one sample on with the acceleration at this one. Whether it had to saturate.
    #[inline(always)]
    fn advance(&mut self, acceleration: Step) -> bool {
        let a = limited(acceleration);
        let [a1, a2, a3] = self.acceleration;
        self.step = self.step.saturating_add(a + (a * 2 - a1 * 5 + a2 * 4 - a3) / 12);
        self.position = self.position.saturating_add(length(self.step));
        self.acceleration = [a, a1, a2];
        // Beads that have parted may drift out of range below: an open contact stays open.
        a != acceleration || at_range_end(self.step) || self.position == Length::MAX
    }
}

/// What estimate B remembers. Everything starts at rest, beads just touching.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReducedChainState {
    /// The overlaps behind the host.
    overlaps: [Coordinate; FOLLOWERS],
    /// The intruder's displacement relative to its host.
    intruder: Coordinate,
    squares: SquareSum,
    saturated: bool,
}

impl ReducedChainState {
    /// Whether a state left its range since the window opened.
    pub fn saturated(&self) -> bool {
        self.saturated
    }

    /// ∫ ẋ² dt of the intruder so far.
    pub fn squares(&self) -> SquareSum {
        self.squares
    }
}

/// Accelerations from -8 to just below 8 µm/sample² (80 km/s² at 100 kHz): a range of 28 bits, which the core
/// saturates to in one instruction, and which keeps the weighted sum of four samples inside 32.
const ACCELERATION: (Step, Step) = (Step::from_bits(-(1 << 27)), Step::from_bits((1 << 27) - 1));

/// Highest coefficient of the contacts: with √2048 it stays below 2.
const CONTACT_MAX: I2F30 = I2F30::lit("0.04");

#[inline(always)]
fn limited(acceleration: Step) -> Step {
    acceleration.clamp(ACCELERATION.0, ACCELERATION.1)
}

#[inline(always)]
fn at_limit(acceleration: Step) -> bool {
    acceleration == ACCELERATION.0 || acceleration == ACCELERATION.1
}

impl ReducedChain {
    /// Whether the coefficients keep every product that is not saturated inside its format.
    pub fn is_bounded(&self) -> bool {
        let coefficients = [
            self.contact,
            self.relaxation,
            self.incoming,
            self.host,
            self.stiffness,
            self.damping,
            self.intruder,
        ];
        coefficients.into_iter().all(|value| value >= I2F30::ZERO) && self.contact <= CONTACT_MAX
    }

    /// Takes the force at the host's incoming contact at one more sample. Never inlined into its caller, so
    /// that its instructions can be counted by its symbol.
    #[inline(never)]
    pub fn process(&self, state: &mut ReducedChainState, measured: Force) {
        let contacts = state
            .overlaps
            .each_ref()
            .map(|overlap| self.contact_force(overlap));

        let velocity = state.intruder.velocity();
        // (k x + c ẋ)/m: both products at Q50, the second after a shift, rounded once to Q24.
        let springs = wide(self.stiffness, state.intruder.position)
            + (wide(self.damping, velocity) >> (Step::FRAC_NBITS - Length::FRAC_NBITS));
        let shift = I2F30::FRAC_NBITS + Length::FRAC_NBITS - Step::FRAC_NBITS;
        let springs = limited(Step::from_bits(round_shift(springs, shift)));
        state.squares.add(velocity);

        let incoming = if measured.unsigned_abs() < self.gate.unsigned_abs() {
            Force::ZERO
        } else {
            measured
        };
        // A limited acceleration by a ratio below 2 fits.
        let host: Step = limited(product(self.incoming, incoming))
            + bounded_product::<_, _, U24>(self.intruder, springs)
            - bounded_product::<_, _, U24>(self.host, contacts[0]);

        let mut ahead = host;
        let mut saturated = state.intruder.advance(-springs - host)
            || state.intruder.position == Length::MIN
            || at_limit(springs);
        for (i, overlap) in state.overlaps.iter_mut().enumerate() {
            let bead = if i + 1 < FOLLOWERS {
                contacts[i] - contacts[i + 1]
            } else {
                contacts[i]
            };
            saturated |= overlap.advance(ahead - bead);
            ahead = bead;
        }
        state.saturated |= saturated;
    }

    /// Eq. 1: `κ √δ (δ + (3/2) τ δ̇)` for δ > 0, as an acceleration of a bead.
    #[inline(always)]
    fn contact_force(&self, contact: &Coordinate) -> Step {
        let overlap = contact.position;
        if overlap <= Length::ZERO {
            return Step::ZERO;
        }
        // 0.04 √2048 and 2·128 fit.
        let stiffness: I2F30 = bounded_product(self.contact, sqrt(overlap));
        let viscous: Length = bounded_product::<_, _, U20>(self.relaxation, contact.velocity());
        limited(product(stiffness, overlap.saturating_add(viscous)))
    }
}

/// A step taken: the same length at the resolution of a position, rounded.
#[inline(always)]
fn length(step: Step) -> Length {
    Length::from_bits(step.to_bits().saturating_add(1 << 3) >> 4)
}
