//! From codes to quantities: baseline, scale, and the front end's anti-alias pole taken out again.
//!
//! The zero of a channel is the mean of the first [`BASELINE`] codes of a window, before the wave arrives, so
//! that an offset that drifts costs nothing. A one-pole filter in front of the converter turns the signal s
//! into y with `s = y + ẏ/ω_p`; the derivative is the central difference, so the compensated value of a
//! sample is known one sample later.

use crate::quantity::{AdcCode, bounded_product};
use fixed::FixedI32;
use fixed::types::extra::U16;
use fixed::types::{I2F30, I4F28, I16F16};
use serde::{Deserialize, Serialize};

/// Samples at the start of a window whose mean is the zero of the channel: a power of two.
pub const BASELINE: u16 = 64;

/// Calibration of one sensor channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Channel {
    /// Quantity (N or m/s²) per code.
    pub per_code: I4F28,
    /// `f_s/(2 ω_p)`: the pole's time constant in samples, halved for the central difference; 0 for no pole,
    /// below 1.
    pub pole: I2F30,
}

/// What a channel remembers: its zero while it is being measured, then the last two values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ChannelState {
    /// Sum of the baseline's codes: twelve bits by sixty-four samples.
    baseline: u32,
    /// Uncompensated values at the last sample and the one before.
    last: [FixedI32<U16>; 2],
}

impl ChannelState {
    /// Adds a code of the quiet signal to the baseline. Called [`BASELINE`] times before `process`.
    pub fn settle(&mut self, code: AdcCode) {
        self.baseline += u32::from(code.get());
    }
}

impl Channel {
    /// The quantity at the sample *before* this one, relative to the baseline.
    #[inline(always)]
    pub fn process(&self, state: &mut ChannelState, code: AdcCode) -> I16F16 {
        const FRACTION: u32 = BASELINE.trailing_zeros();
        let above = (i32::from(code.get()) << FRACTION) - state.baseline as i32;
        // 4095 codes of at most 8 fit.
        let value: I16F16 = bounded_product(I16F16::from_bits(above << (16 - FRACTION)), self.per_code);
        let [last, before] = state.last;
        state.last = [value, last];
        // A part of a value fits.
        last.saturating_add(bounded_product(value.saturating_sub(before), self.pole))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_behind_the_pole_is_restored() {
        // A one-pole filter delays a ramp by its time constant; compensation by half of it twice over a
        // central difference of two steps takes the delay out.
        let channel = Channel {
            per_code: I4F28::ONE,
            pole: I2F30::from_num(0.25),
        };
        let mut state = ChannelState::default();
        for _ in 0..BASELINE {
            state.settle(AdcCode::new(100));
        }
        channel.process(&mut state, AdcCode::new(110));
        channel.process(&mut state, AdcCode::new(120));
        assert_eq!(
            channel.process(&mut state, AdcCode::new(130)),
            I16F16::from_num(20 + 5)
        );
    }

    #[test]
    fn the_zero_is_the_mean_of_the_baseline_to_a_sixty_fourth_of_a_code() {
        let channel = Channel {
            per_code: I4F28::ONE,
            pole: I2F30::ZERO,
        };
        let mut state = ChannelState::default();
        for i in 0..BASELINE {
            state.settle(AdcCode::new(100 + u16::from(i == 7)));
        }
        channel.process(&mut state, AdcCode::new(100));
        assert_eq!(
            channel.process(&mut state, AdcCode::new(100)),
            I16F16::from_num(-1.0 / 64.0)
        );
    }
}
