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

use crate::quantity::{EnergyScale, Force, Length, SquareSum, Step, at_range_end, product};
use crate::sqrt::sqrt;
use fixed::types::extra::{U16, U20, U24};
use fixed::types::{I2F30, I8F24, I12F20};
use serde::{Deserialize, Serialize};

/// Beads behind the host in the reduced chain.
pub const FOLLOWERS: usize = 4;

/// Coordinates: the overlaps behind the host, then the intruder's displacement relative to it.
const COORDINATES: usize = FOLLOWERS + 1;
const INTRUDER: usize = FOLLOWERS;

/// Coefficients of estimate B.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ReducedChain {
    /// κ of the contacts between beads, N/µm^1.5.
    pub contact: I8F24,
    /// 3τ/(2 dt): the relaxation time of the contacts, in samples, by 3/2.
    pub relaxation: I2F30,
    /// dt²/M of a bead, µm/sample² per N.
    pub bead: I2F30,
    /// dt²/(M - m) of the host without its intruder, µm/sample² per N.
    pub host: I2F30,
    /// dt²/m of the intruder, µm/sample² per N.
    pub intruder: I2F30,
    /// k of the intruder, N/µm.
    pub stiffness: I8F24,
    /// c/dt of the intruder, N/(µm/sample).
    pub damping: I8F24,
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
    /// Accelerations (µm/sample²) at the last three samples, the latest first.
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

/// An acceleration beyond ±4 µm/sample² (40 km/s² at 100 kHz) is no bead's; the limit keeps the weighted sum of
/// four samples inside 32 bits.
const ACCELERATION_LIMIT: Step = Step::lit("4");

impl ReducedChain {
    /// Takes the force at the host's incoming contact at one more sample. Never inlined into its caller, so
    /// that its instructions can be counted by its symbol.
    #[inline(never)]
    pub fn process(&self, state: &mut ReducedChainState, measured: Force) {
        let [a1, a2, a3] = state.acceleration;
        let velocity = |i: usize| state.step[i].saturating_add((a1[i] * 5 - a2[i] * 2) / 6);

        let mut contact = [Force::ZERO; FOLLOWERS];
        for (i, force) in contact.iter_mut().enumerate() {
            let overlap = state.position[i];
            if overlap > Length::ZERO {
                *force = self.contact_force(overlap, velocity(i));
            }
        }

        let intruder_velocity = velocity(INTRUDER);
        let spring: Force = product::<_, _, U16>(self.stiffness, state.position[INTRUDER])
            .saturating_add(product(self.damping, intruder_velocity));
        let incoming = if measured.abs() < self.gate {
            Force::ZERO
        } else {
            measured
        };

        let host: Step = product(
            self.host,
            incoming.saturating_add(spring).saturating_sub(contact[0]),
        );
        let mut acceleration = [Step::ZERO; COORDINATES];
        let mut ahead = host;
        for i in 0..FOLLOWERS {
            let outgoing = if i + 1 < FOLLOWERS {
                contact[i + 1]
            } else {
                Force::ZERO
            };
            let bead: Step = product(self.bead, contact[i].saturating_sub(outgoing));
            acceleration[i] = ahead.saturating_sub(bead);
            ahead = bead;
        }
        acceleration[INTRUDER] = -product::<_, _, U24>(self.intruder, spring).saturating_add(host);

        state.squares.add(intruder_velocity);
        for i in 0..COORDINATES {
            let a = acceleration[i].clamp(-ACCELERATION_LIMIT, ACCELERATION_LIMIT);
            let step = state.step[i].saturating_add((a * 14 - a1[i] * 5 + a2[i] * 4 - a3[i]) / 12);
            // Beads that have parted may drift out of range: an open contact stays open.
            let position = state.position[i].saturating_add(length(step));
            state.saturated |= a.abs() == ACCELERATION_LIMIT
                || at_range_end(step)
                || position == Length::MAX
                || (i == INTRUDER && at_range_end(position));
            acceleration[i] = a;
            state.step[i] = step;
            state.position[i] = position;
        }
        state.acceleration = [acceleration, a1, a2];
    }

    /// Eq. 1: `κ √δ (δ + (3/2) τ δ̇)` for δ > 0.
    #[inline(always)]
    fn contact_force(&self, overlap: Length, velocity: Step) -> Force {
        let stiffness: I12F20 = product(self.contact, sqrt(overlap));
        let viscous: Length = product::<_, _, U20>(self.relaxation, velocity);
        product(stiffness, overlap.saturating_add(viscous))
    }
}

/// A step taken: the same length at the resolution of a position, rounded.
#[inline(always)]
fn length(step: Step) -> Length {
    Length::from_bits(step.to_bits().saturating_add(1 << 3) >> 4)
}
