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

/// Coordinates: the overlaps behind the host, then the intruder's displacement relative to it.
const COORDINATES: usize = FOLLOWERS + 1;
const INTRUDER: usize = FOLLOWERS;

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

/// What estimate B remembers. Everything starts at rest, beads just touching.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReducedChainState {
    position: [Length; COORDINATES],
    /// Change of each coordinate over the last sample.
    step: [Step; COORDINATES],
    /// Accelerations at the last three samples, the latest first.
    acceleration: [[Step; COORDINATES]; 3],
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
        let [a1, a2, a3] = state.acceleration;
        let velocity = |i: usize| state.step[i].saturating_add((a1[i] * 5 - a2[i] * 2) / 6);

        let mut contact = [Step::ZERO; FOLLOWERS];
        for (i, force) in contact.iter_mut().enumerate() {
            let overlap = state.position[i];
            if overlap > Length::ZERO {
                *force = self.contact_force(overlap, velocity(i));
            }
        }

        let intruder_velocity = velocity(INTRUDER);
        // (k x + c ẋ)/m: both products at Q50, the second after a shift, rounded once to Q24.
        let springs = wide(self.stiffness, state.position[INTRUDER])
            + (wide(self.damping, intruder_velocity) >> (Step::FRAC_NBITS - Length::FRAC_NBITS));
        let springs = limited(Step::from_bits(round_shift(
            springs,
            I2F30::FRAC_NBITS + Length::FRAC_NBITS - 24,
        )));
        let incoming = if measured.abs() < self.gate {
            Force::ZERO
        } else {
            measured
        };

        // A limited acceleration by a ratio below 2 fits.
        let host: Step = limited(product(self.incoming, incoming))
            + bounded_product::<_, _, U24>(self.intruder, springs)
            - bounded_product::<_, _, U24>(self.host, contact[0]);
        let mut acceleration = [Step::ZERO; COORDINATES];
        let mut ahead = host;
        for i in 0..FOLLOWERS {
            let outgoing = if i + 1 < FOLLOWERS {
                contact[i + 1]
            } else {
                Step::ZERO
            };
            let bead = contact[i] - outgoing;
            acceleration[i] = ahead - bead;
            ahead = bead;
        }
        acceleration[INTRUDER] = -springs - host;

        state.squares.add(intruder_velocity);
        let mut saturated = false;
        for i in 0..COORDINATES {
            let a = limited(acceleration[i]);
            let change = a + (a * 2 - a1[i] * 5 + a2[i] * 4 - a3[i]) / 12;
            let step = state.step[i].saturating_add(change);
            // Beads that have parted may drift out of range: an open contact stays open.
            let position = state.position[i].saturating_add(length(step));
            saturated |= a != acceleration[i] || at_range_end(step) || position == Length::MAX;
            acceleration[i] = a;
            state.step[i] = step;
            state.position[i] = position;
        }
        state.saturated |= saturated
            || state.position[INTRUDER] == Length::MIN
            || springs == ACCELERATION.0
            || springs == ACCELERATION.1;
        state.acceleration = [acceleration, a1, a2];
    }

    /// Eq. 1: `κ √δ (δ + (3/2) τ δ̇)` for δ > 0, as an acceleration of a bead.
    #[inline(always)]
    fn contact_force(&self, overlap: Length, velocity: Step) -> Step {
        // 0.04 √2048 and 2·128 fit.
        let stiffness: I2F30 = bounded_product(self.contact, sqrt(overlap));
        let viscous: Length = bounded_product::<_, _, U20>(self.relaxation, velocity);
        limited(product(stiffness, overlap.saturating_add(viscous)))
    }
}

/// A step taken: the same length at the resolution of a position, rounded.
#[inline(always)]
fn length(step: Step) -> Length {
    Length::from_bits(step.to_bits().saturating_add(1 << 3) >> 4)
}
