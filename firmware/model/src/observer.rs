//! Estimate A: the absorbed energy, measured by the intruder's own acceleration.
//!
//! The accelerometer *is* the intruder. With x = u - U its displacement relative to the host, Newton's
//! second law (the paper's Eq. 3) reads `c ẋ + k x = -m a`: first order in x, stable, with the pole
//! λ = k/c, whatever the chain does. For an acceleration that is linear between samples (first-order hold)
//! its solution is exact:
//!
//! ```text
//! x[n+1] = φ x[n] + b₀ a[n] + b₁ a[n+1]        φ = exp(-λ dt)
//! ẋ[n]   = -λ x[n] - (m/c) a[n]
//! E      = c dt Σ ẋ[n]²
//! ```

use crate::quantity::{
    Acceleration, EnergyScale, Length, SquareSum, Step, at_range_end, product, round_shift, wide,
};
use fixed::types::{I2F30, I8F24};
use serde::{Deserialize, Serialize};

/// Coefficients of estimate A.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Observer {
    /// φ = exp(-k dt/c), the decay of the displacement over one sample.
    pub decay: I2F30,
    /// b₀, response to the acceleration at the start of the interval, µm per m/s².
    pub start: I2F30,
    /// b₁, response to the acceleration at its end, µm per m/s².
    pub end: I2F30,
    /// k dt/c: velocity per displacement, (µm/sample)/µm.
    pub velocity_per_displacement: I8F24,
    /// (m/c) dt: velocity per acceleration, (µm/sample)/(m/s²).
    pub velocity_per_acceleration: I2F30,
    /// c (1 µm/sample)² dt, nJ.
    pub energy: EnergyScale,
}

/// What estimate A remembers. The intruder starts at rest on its springs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ObserverState {
    displacement: Length,
    acceleration: Acceleration,
    squares: SquareSum,
    saturated: bool,
}

impl ObserverState {
    /// Whether a state left its range since the window opened.
    pub fn saturated(&self) -> bool {
        self.saturated
    }

    /// ∫ ẋ² dt so far.
    pub fn squares(&self) -> SquareSum {
        self.squares
    }
}

impl Observer {
    /// Whether the coefficients keep the sum of three products inside 64 bits.
    pub fn is_bounded(&self) -> bool {
        [self.start, self.end]
            .into_iter()
            .all(|value| (-I2F30::ONE..=I2F30::ONE).contains(&value))
    }

    /// Takes the acceleration of one more sample. Never inlined into its caller, so that its instructions
    /// can be counted by its symbol.
    #[inline(never)]
    pub fn process(&self, state: &mut ObserverState, acceleration: Acceleration) {
        const { assert!(I2F30::FRAC_NBITS - Length::FRAC_NBITS + Acceleration::FRAC_NBITS == 26) };
        // φ·x is Q50, b·a is Q46: add at Q46, round once to Q20.
        let sum = (wide(self.decay, state.displacement) >> 4)
            + wide(self.start, state.acceleration)
            + wide(self.end, acceleration);
        let displacement = Length::from_bits(round_shift(sum, 26));
        let velocity: Step =
            product::<_, _, fixed::types::extra::U24>(self.velocity_per_displacement, displacement)
                .saturating_add(product(self.velocity_per_acceleration, acceleration));
        // The sign of ẋ does not matter to ẋ².
        state.squares.add(velocity);
        state.saturated |= at_range_end(displacement) | at_range_end(velocity);
        state.displacement = displacement;
        state.acceleration = acceleration;
    }
}
