//! From the codes of one channel to a quantity: zero, scale, and compensation of the anti-alias pole.
//!
//! The zero of a channel is the mean of the first [`BASELINE`] codes of a window, before the wave arrives. So
//! an offset that drifts costs nothing. A one-pole filter in front of the converter turns the signal s into y
//! with `s = y + ẏ/ω_p`, and a channel that is converted a time δ after the first channel of its sensor is
//! late by δ. Both are taken out with three codes (`correction`), so the value of a
//! sample is known one sample later:
//!
//! ```text
//! s[n-1] = g (code[n-1] - zero) + slope (code[n] - code[n-2]) + curve (code[n] - 2 code[n-1] + code[n-2])
//! ```
//!
//! The value is the one at the time of the sensor's first conversion.

use crate::layout::BASELINE;
use crate::quantity::{AdcCode, high_rounded};
use fixed::FixedI32;
use fixed::types::extra::LeEqU32;
use serde::{Deserialize, Serialize};

/// Fraction bits of a code in the sums. The difference of two codes has a sign and twelve bits before them.
const CODE_FRACTION: u32 = 18;

/// Calibration of one sensor channel. Its coefficients have `F` fraction bits, its values have 14 fewer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Channel<F: LeEqU32> {
    /// g, quantity (N or m/s²) per code.
    pub per_code: FixedI32<F>,
    /// Quantity per change of the code over two samples, about `g f_s (1/ω_p - δ)/2`; 0 for no pole and no
    /// delay.
    pub slope: FixedI32<F>,
    /// Quantity per second difference of the codes, about `g f_s² (δ²/2 - δ/ω_p)`; 0 for no delay.
    pub curve: FixedI32<F>,
}

/// State of a channel: its zero and its last two codes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ChannelState {
    /// Sum of the 64 codes of the baseline.
    baseline: u32,
    /// Codes of the last sample and of the one before, less the zero.
    last: [i32; 2],
}

impl ChannelState {
    /// Adds a code of the quiet signal to the baseline. Called [`BASELINE`] times before `process`.
    pub fn settle(&mut self, code: AdcCode) {
        self.baseline += u32::from(code.get());
    }

    /// The zero of the channel, to a whole code.
    pub fn zero(&self) -> u16 {
        (self.baseline / u32::from(BASELINE)) as u16
    }

    /// Takes codes whose values are not needed.
    pub fn skip(&mut self, codes: impl DoubleEndedIterator<Item = AdcCode>) {
        let mut latest = codes.rev().map(|code| self.above(code));
        if let Some(last) = latest.next() {
            let before = latest.next().unwrap_or(self.last[0]);
            drop(latest);
            self.last = [last, before];
        }
    }

    /// A code less the zero, with [`CODE_FRACTION`] fraction bits.
    fn above(&self, code: AdcCode) -> i32 {
        let zero = (self.baseline << (CODE_FRACTION - BASELINE.trailing_zeros())) as i32;
        (i32::from(code.get()) << CODE_FRACTION) - zero
    }
}

impl<F: LeEqU32> Channel<F> {
    /// The values at the samples *before* those of the codes, relative to the baseline.
    #[inline(always)]
    pub fn process<V: LeEqU32>(
        &self,
        state: &mut ChannelState,
        codes: impl Iterator<Item = AdcCode>,
        values: &mut [FixedI32<V>],
    ) {
        const { assert!(F::U32 + CODE_FRACTION == V::U32 + 32) };
        let [mut last, mut before] = state.last;
        let [per_code, slope, curve] = [self.per_code, self.slope, self.curve].map(FixedI32::to_bits);
        let [newest, middle, oldest] = [
            curve.saturating_add(slope),
            per_code.saturating_sub(curve.saturating_mul(2)),
            curve.saturating_sub(slope),
        ];
        for (code, value) in codes.zip(values) {
            let above = state.above(code);
            // `is_below` bounds the sum.
            *value = FixedI32::from_bits(
                high_rounded(middle, last) + high_rounded(newest, above) + high_rounded(oldest, before),
            );
            before = last;
            last = above;
        }
        state.last = [last, before];
    }

    /// Returns `true` if every value that the codes can give is below `most`: it is greatest where each code
    /// is at the rail that its weight favours, and the zero at a rail too.
    pub fn is_below(&self, most: u32) -> bool {
        let [per_code, slope, curve] =
            [self.per_code, self.slope, self.curve].map(|value| i64::from(value.to_bits()));
        let weights = [curve + slope, per_code - 2 * curve, curve - slope];
        let sum = |sign: i64| weights.map(|weight| (sign * weight).max(0)).iter().sum::<i64>();
        (i64::from(AdcCode::MAX.get()) * sum(1).max(sum(-1))) >> F::U32 < i64::from(most)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quantity::SensedForce;
    use fixed::types::I2F30;
    use fixed::types::extra::U30;

    fn settled(codes: impl Iterator<Item = u16>) -> ChannelState {
        let mut state = ChannelState::default();
        codes.for_each(|code| state.settle(AdcCode::new(code)));
        state
    }

    fn channel(slope: f64) -> Channel<U30> {
        Channel {
            per_code: I2F30::ONE,
            slope: I2F30::from_num(slope),
            curve: I2F30::from_num(0.125),
        }
    }

    /// The last value of these codes.
    fn last_of<const N: usize>(channel: Channel<U30>, state: &mut ChannelState, codes: [u16; N]) -> f64 {
        let mut values = [SensedForce::ZERO; N];
        channel.process(state, codes.into_iter().map(AdcCode::new), &mut values);
        values[N - 1].to_num()
    }

    #[test]
    fn a_ramp_behind_the_pole_is_restored() {
        // A one-pole filter delays a ramp by its time constant. The slope of half of it, over the two steps
        // of the central difference, takes the delay out.
        let mut state = settled([100; BASELINE as usize].into_iter());
        let value = last_of(channel(0.25), &mut state, [110, 120, 130]);
        assert_eq!(value, 20.0 + 5.0);
        // A bend counts by the curve: an eighth of its second difference.
        let value = last_of(channel(0.25), &mut state, [110, 120, 146]);
        assert_eq!(value, 20.0 + 0.25 * 36.0 + 0.125 * 16.0);
    }

    #[test]
    fn the_zero_is_the_mean_of_the_baseline_to_a_sixty_fourth_of_a_code() {
        let mut state = settled((0..BASELINE).map(|i| 100 + u16::from(i == 7)));
        assert_eq!(last_of(channel(0.0), &mut state, [100; 3]), -1.0 / 64.0);
    }
}
