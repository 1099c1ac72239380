//! Estimate A: the absorbed energy, measured by the intruder's own acceleration.
//!
//! The accelerometer *is* the intruder. Let x = u - U be its displacement relative to the host. Newton's
//! second law (the paper's Eq. 3) reads `c ẋ + k x = -m a`: first order in x, stable, with the pole λ = k/c,
//! whatever the chain does. `y = -k x/m` is the acceleration that would hold the springs where they are. It
//! is the acceleration behind a low-pass, and the difference of both is the velocity:
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
//! Noise in the acceleration always adds energy to the sum. The same sum before the strike measures how much
//! it adds a sample, and this is subtracted, but no more than the noise that the settings explain: an
//! intruder that still rings from an earlier strike is not noise. A piece of the window does not count if its
//! sum is not more than twice what noise gives: the intruder has stopped ringing, until another wave comes.

use crate::quantity::{SensedAcceleration, SquareSum, high_rounded, square};
use bead_wire::Energy;
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

/// State of estimate A. The intruder starts at rest on its springs.
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
    /// Σ (a - y)² over the samples before the strike, and their number.
    quiet: (u64, u16),
    /// The mean of `quiet`: what noise adds a sample.
    noise: u64,
}

impl ObserverState {
    /// Closes a piece that has only noise, with a mean square limited to `most`: more would be a signal.
    pub(crate) fn close_noise(&mut self, most: u64) {
        let (squares, samples) = self.quiet;
        self.quiet = (squares.saturating_add(self.piece), samples + self.piece_samples);
        self.noise = (self.quiet.0 / u64::from(self.quiet.1.max(1))).min(most);
        (self.piece, self.piece_samples) = (0, 0);
    }

    /// Closes a piece. It counts if it has more than noise; returns true if it counts.
    pub(crate) fn close_piece(&mut self) -> bool {
        let counts = self.piece_counts();
        if counts {
            self.squares.add(self.piece);
            self.samples += self.piece_samples;
        }
        (self.piece, self.piece_samples) = (0, 0);
        counts
    }

    /// The sum over 32 samples of noise scatters by a quarter of itself: a sum of twice its mean is a signal.
    fn piece_counts(&self) -> bool {
        let noise = u64::from(self.piece_samples).saturating_mul(self.noise);
        self.piece / 2 > noise
    }
}

impl Observer {
    /// Bound of the accelerations, m/s²: 2^28 in their format, so that a difference of two stays below 2^29.
    pub const MOST: u32 = 1 << (28 - SensedAcceleration::FRAC_NBITS);

    /// Takes the accelerations of the next samples, at most [`PIECE`](crate::layout::PIECE). The coefficient
    /// `end` is its bits times 2^`powers`. Never inlined, so that its instructions can be counted by its
    /// symbol.
    #[inline(never)]
    pub fn process(&self, powers: u8, state: &mut ObserverState, accelerations: &[SensedAcceleration]) {
        match powers {
            0 => self.run::<0>(state, accelerations),
            _ => self.run::<1>(state, accelerations),
        }
    }

    /// [`Observer::process`] for a number of powers that the compiler knows.
    #[inline(always)]
    fn run<const POWERS: u32>(&self, state: &mut ObserverState, accelerations: &[SensedAcceleration]) {
        let [start, end] = [self.start, self.end].map(I0F32::to_bits);
        let [mut held, mut left] = [state.held, state.left].map(SensedAcceleration::to_bits);
        let mut squares = 0;
        for acceleration in accelerations {
            let acceleration = acceleration.to_bits();
            held += high_rounded(start, left) + high_rounded(end, (acceleration - held) << POWERS);
            left = acceleration - held;
            squares += square(left);
        }
        [state.held, state.left] = [held, left].map(SensedAcceleration::from_bits);
        state.piece += squares;
        state.piece_samples += accelerations.len() as u16;
    }

    /// The energy absorbed so far. The coefficient `energy` is its bits times 2^`powers`.
    pub fn absorbed(&self, powers: i8, state: &ObserverState) -> Energy {
        let mut whole = *state;
        whole.close_piece();
        let noise = u128::from(whole.noise) * u128::from(whole.samples);
        whole.squares.less(noise).energy(self.energy, powers)
    }

    /// The energy that noise would have added. It was subtracted. `powers` as in [`Observer::absorbed`].
    pub fn noise(&self, powers: i8, state: &ObserverState) -> Energy {
        let mut noise = SquareSum::<{ 2 * SensedAcceleration::FRAC_NBITS }>::default();
        noise.add(state.noise.saturating_mul(state.samples.into()));
        noise.energy(self.energy, powers)
    }

    /// Mean square of the noise in a - y, (m/s²)².
    pub fn noise_square(&self, state: &ObserverState) -> f32 {
        const UNIT: f32 = 1.0 / (1_u64 << (2 * SensedAcceleration::FRAC_NBITS)) as f32;
        state.noise as f32 * UNIT
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_piece_counts_if_it_has_more_than_twice_the_noise() {
        for (piece, counts) in [(64, false), (65, false), (66, true)] {
            let mut state = ObserverState {
                noise: 1,
                piece,
                piece_samples: 32,
                ..ObserverState::default()
            };
            assert_eq!(state.close_piece(), counts, "{piece}");
        }
    }
}
