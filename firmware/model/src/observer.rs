//! Estimate A: the absorbed energy, measured by the intruder's own acceleration.
//!
//! The accelerometer *is* the intruder. With x = u - U its displacement relative to the host, Newton's
//! second law (the paper's Eq. 3) reads `c ẋ + k x = -m a`: first order in x, stable, with the pole
//! λ = k/c, whatever the chain does. In the variable `y = -k x/m`, the acceleration that would hold the
//! springs where they are, it is a low-pass of the acceleration, and what it leaves over is the velocity:
//!
//! ```text
//! ẏ = λ (a - y)        ẋ = (m/c) (y - a)        E = (m²/c) ∫ (a - y)² dt
//! ```
//!
//! For an acceleration that is linear between samples (first-order hold) the solution is exact:
//!
//! ```text
//! y[n+1] = y[n] + β₀ (a[n] - y[n]) + β₁ (a[n+1] - y[n])
//! β₀ = (1 - φ)/(λ dt) - φ        β₁ = 1 - (1 - φ)/(λ dt)        φ = exp(-λ dt)
//! ```
//!
//! Both weights are positive and their sum is below one, so y never leaves the range of a.

use crate::quantity::{Energy, SensedAcceleration, SquareSum, high_rounded, square};
use fixed::types::{I0F32, I2F30};
use serde::{Deserialize, Serialize};

/// Coefficients of estimate A.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Observer {
    /// β₀, weight of the acceleration at the start of the interval.
    pub start: I0F32,
    /// β₁, weight of the acceleration at its end.
    pub end: I0F32,
    /// (m²/c) dt, nJ/(m/s²)².
    pub energy: I2F30,
}

/// What estimate A remembers. The intruder starts at rest on its springs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ObserverState {
    /// y.
    held: SensedAcceleration,
    /// a - y.
    left: SensedAcceleration,
    squares: SquareSum<{ 2 * SensedAcceleration::FRAC_NBITS }>,
}

impl Observer {
    /// Bound of the accelerations, m/s²: 2^28 in their format, so that a difference of two stays below 2^29.
    pub const MOST: u32 = 1 << (28 - SensedAcceleration::FRAC_NBITS);

    /// Whether the coefficients are such as a first-order hold gives.
    pub fn is_bounded(&self) -> bool {
        [self.start, self.end]
            .into_iter()
            .all(|weight| weight >= I0F32::ZERO)
    }

    /// Takes the accelerations, at most [`PIECE`](crate::window::PIECE), of the next samples. Never inlined into
    /// its caller, so that its instructions can be counted by its symbol.
    #[inline(never)]
    pub fn process(&self, state: &mut ObserverState, accelerations: &[SensedAcceleration]) {
        let [start, end] = [self.start, self.end].map(I0F32::to_bits);
        let [mut held, mut left] = [state.held, state.left].map(SensedAcceleration::to_bits);
        let mut squares = 0;
        for acceleration in accelerations {
            let acceleration = acceleration.to_bits();
            held += high_rounded(start, left) + high_rounded(end, acceleration - held);
            left = acceleration - held;
            squares += square(left);
        }
        [state.held, state.left] = [held, left].map(SensedAcceleration::from_bits);
        state.squares.add(squares);
    }

    /// The energy absorbed so far.
    pub fn absorbed(&self, state: &ObserverState) -> Energy {
        state.squares.energy(self.energy)
    }
}
