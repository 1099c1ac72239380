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
//!
//! # Noise
//!
//! Noise in the acceleration is energy in the sum, always positive. What it amounts to a sample is measured before the
//! strike, by the very same sum, and taken off. A piece of the window whose sum is not above what noise makes of it is
//! left out: the ring-down is over, and the integral with it, until another wave comes.

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
    /// Σ (a - y)² over the piece that is not complete.
    piece: u64,
    /// Samples in it.
    piece_samples: u16,
    /// Σ (a - y)² over the pieces that count.
    squares: SquareSum<{ 2 * SensedAcceleration::FRAC_NBITS }>,
    /// Samples in them.
    samples: u16,
    /// Σ (a - y)² over the samples before the strike, and how many they are.
    quiet: (u64, u16),
    /// Its mean: what noise adds a sample.
    noise: u64,
}

impl ObserverState {
    /// The piece is complete, and was one of noise only.
    pub(crate) fn close_noise(&mut self) {
        let (squares, samples) = self.quiet;
        self.quiet = (squares.saturating_add(self.piece), samples + self.piece_samples);
        self.noise = self.quiet.0 / u64::from(self.quiet.1.max(1));
        (self.piece, self.piece_samples) = (0, 0);
    }

    /// The piece is complete: it counts if there is more in it than noise. Returns whether it does.
    pub(crate) fn close_piece(&mut self) -> bool {
        let counts = self.piece_counts();
        if counts {
            self.squares.add(self.piece);
            self.samples += self.piece_samples;
        }
        (self.piece, self.piece_samples) = (0, 0);
        counts
    }

    /// The sum over 32 samples of noise scatters by a quarter of itself: at twice its mean it is a signal.
    fn piece_counts(&self) -> bool {
        let noise = u64::from(self.piece_samples).saturating_mul(self.noise);
        self.piece / 2 > noise
    }
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

    /// Takes the accelerations, at most [`PIECE`](crate::layout::PIECE), of the next samples. Never inlined into
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
        state.piece += squares;
        state.piece_samples += accelerations.len() as u16;
    }

    /// The energy absorbed so far.
    pub fn absorbed(&self, state: &ObserverState) -> Energy {
        let mut whole = *state;
        whole.close_piece();
        let noise = u128::from(whole.noise) * u128::from(whole.samples);
        whole.squares.less(noise).energy(self.energy)
    }

    /// The energy that noise would have added, and that was taken off.
    pub fn noise(&self, state: &ObserverState) -> Energy {
        let mut noise = SquareSum::<{ 2 * SensedAcceleration::FRAC_NBITS }>::default();
        noise.add(state.noise.saturating_mul(state.samples.into()));
        noise.energy(self.energy)
    }

    /// Mean square of the acceleration's noise, as far as the intruder's springs do not follow it, (m/s²)².
    pub fn noise_square(&self, state: &ObserverState) -> f32 {
        const UNIT: f32 = 1.0 / (1_u64 << (2 * SensedAcceleration::FRAC_NBITS)) as f32;
        state.noise as f32 * UNIT
    }
}
