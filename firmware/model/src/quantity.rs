//! The quantities of the model and their fixed-point formats.
//!
//! | quantity | format | unit | range | resolution |
//! |---|---|---|---|---|
//! | [`SensedForce`], of a sample | `I16F16` | N | ±32 kN | 15 µN |
//! | [`SensedAcceleration`], of a sample | `I20F12` | m/s² | ±524 km/s² | 0.24 mm/s² |
//! | [`Length`] | `I10F22` | µm | ±512 µm | 0.24 pm |
//! | [`Step`] | `I8F24` | µm/sample | ±128 µm/sample (12.8 m/s at 100 kHz) | 6 nm/s |
//! | [`Energy`] | `I40F24` | nJ | ±550 J | 0.06 fJ |
//!
//! The results of a strike are quantities of [`bead_wire`], such as [`Energy`]: what is computed here is sent
//! as it is.
//!
//! # Products
//! In one instruction the core multiplies 32 by 32 bits, keeps the upper 32, rounds and adds (SMMUL, SMMULR,
//! SMMLA, SMMLAR; Armv7-M Architecture Reference Manual, A7.7). So two factors together have 32 fraction bits
//! more than their product: there is no shift, and no product leaves its format. The host puts the necessary
//! powers of two into the coefficients.

use bead_wire::{Codes, Energy};
use fixed::FixedI32;
use fixed::types::extra::LeEqU32;
use fixed::types::{I8F24, I10F22, I16F16, I20F12};
use serde::{Deserialize, Serialize};

/// Contact force of one sample, N.
pub type SensedForce = I16F16;
/// Absolute acceleration of one sample, m/s²: the resolution is 1/500 of a code of 0.12 m/s².
pub type SensedAcceleration = I20F12;
/// An overlap or a displacement of the intruder relative to its host, µm.
pub type Length = I10F22;
/// A change of length over one sample (a velocity), µm.
pub type Step = I8F24;

/// A code of the 12-bit converter: 0 at its lower rail, [`AdcCode::MAX`] at its upper one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct AdcCode(u16);

impl AdcCode {
    /// The upper rail.
    pub const MAX: Self = Self(4095);

    /// From the converter's data register. Only its lower twelve bits count, so that a code is always in
    /// range.
    pub const fn new(register: u16) -> Self {
        Self(register & Self::MAX.0)
    }

    /// The number, 0 to 4095.
    pub const fn get(self) -> u16 {
        self.0
    }

    /// Returns `true` if the code is at a rail: the signal may have been beyond it.
    pub const fn is_railed(self) -> bool {
        self.0 == 0 || self.0 == Self::MAX.0
    }
}

/// The codes of the two amplifiers of a sensor in one scan, in one word, as the converter puts them into
/// memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pair(u32);

impl Pair {
    /// From the converter's register at the high and at the low gain. The lower twelve bits of each count.
    #[inline(always)]
    pub const fn new(sensitive: u16, wide: u16) -> Self {
        Self((sensitive as u32 | (wide as u32) << 16) & 0x0FFF_0FFF)
    }

    /// The code at the high gain.
    #[inline(always)]
    pub const fn sensitive(self) -> AdcCode {
        AdcCode(self.0 as u16)
    }

    /// The code at the low gain.
    #[inline(always)]
    pub const fn wide(self) -> AdcCode {
        AdcCode((self.0 >> 16) as u16)
    }
}

/// The four codes of one sample, in the order of their conversion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Scan {
    /// Total force at the host's incoming contact.
    pub force: Pair,
    /// Absolute acceleration of the intruder.
    pub acceleration: Pair,
}

impl Scan {
    /// All codes at their lower rail.
    pub const ZERO: Self = Self::new([0; 4]);

    /// From the converter's registers, in the order of the conversions.
    #[inline(always)]
    pub const fn new([force, force_wide, acceleration, acceleration_wide]: [u16; 4]) -> Self {
        Self {
            force: Pair::new(force, force_wide),
            acceleration: Pair::new(acceleration, acceleration_wide),
        }
    }

    /// Force and acceleration at the high gain.
    pub const fn sensitive(self) -> [u16; 2] {
        [self.force.sensitive().get(), self.acceleration.sensitive().get()]
    }

    /// Force and acceleration at the low gain.
    pub const fn wide(self) -> [u16; 2] {
        [self.force.wide().get(), self.acceleration.wide().get()]
    }

    /// The codes in the order of the conversions.
    pub const fn codes(self) -> [u16; 4] {
        let Self { force, acceleration } = self;
        [
            force.sensitive().get(),
            force.wide().get(),
            acceleration.sensitive().get(),
            acceleration.wide().get(),
        ]
    }
}

/// Packs the codes of scans at one gain, [`Scan::sensitive`] or [`Scan::wide`].
///
/// # Panics
/// More scans than fit.
#[inline(always)]
pub fn pack<const BYTES: usize>(
    scans: impl Iterator<Item = Scan>,
    gain: impl Fn(Scan) -> [u16; 2],
) -> Codes<BYTES> {
    // No `expect`: it would print the error, and formats take flash.
    let Ok(codes) = Codes::pack(scans.map(gain)) else {
        panic!("a piece has at most MAX_SCANS scans, of codes of 12 bits");
    };
    codes
}

/// The upper half of `a·b`, rounded down.
#[inline(always)]
pub(crate) fn high(a: i32, b: i32) -> i32 {
    ((i64::from(a) * i64::from(b)) >> 32) as i32
}

/// The upper half of `a·b`, rounded to nearest.
#[inline(always)]
pub(crate) fn high_rounded(a: i32, b: i32) -> i32 {
    ((i64::from(a) * i64::from(b) + (1 << 31)) >> 32) as i32
}

/// A running sum of squares of numbers with `FRACTION / 2` fraction bits.
///
/// It is exact, so it does not depend on how the samples were cut into pieces. For a window that starts and
/// ends at rest, the plain sum of its samples is the trapezoidal rule.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SquareSum<const FRACTION: u32>(u128);

impl<const FRACTION: u32> SquareSum<FRACTION> {
    /// Adds the sum of a piece.
    pub(crate) fn add(&mut self, piece: u64) {
        self.0 += u128::from(piece);
    }

    /// The sum less `squares`; 0 if that would be negative.
    pub(crate) fn less(self, squares: u128) -> Self {
        Self(self.0.saturating_sub(squares))
    }

    /// The sum as an energy, with `scale · 2^powers` in nJ for a square of 1; saturates. `powers` is at most
    /// 24 to either side.
    pub(crate) fn energy<F: LeEqU32>(self, scale: FixedI32<F>, powers: i8) -> Energy {
        // A window has at most 2^12 squares below 2^58.
        let product = self.0 * u128::from(scale.to_bits().unsigned_abs());
        let fraction =
            (FRACTION + F::U32 - Energy::UNIT.fraction_bits).saturating_add_signed(-i32::from(powers));
        Energy::from_bits(i64::try_from(product >> fraction).unwrap_or(i64::MAX))
    }
}

/// The square of a number below 2^29. 32 of them fit the sum of a piece.
#[inline(always)]
pub(crate) fn square(value: i32) -> u64 {
    (i64::from(value) * i64::from(value)) as u64
}

/// Energy dissipated by the intruder's damping per squared velocity and sample, nJ/(µm/sample)².
pub type EnergyScale = I16F16;

/// 2^`power`, for powers in ±300.
pub(crate) fn two_to(power: i32) -> f64 {
    f64::from_bits(((1023 + power) as u64) << 52)
}

/// The nearest number of a format.
pub(crate) fn nearest<F: LeEqU32>(value: f64) -> FixedI32<F> {
    FixedI32::from_bits(libm::rint(value * two_to(F::I32)) as i32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fixed::types::extra::{U16, U30};

    #[test]
    fn a_scan_has_the_codes_of_the_conversions_in_their_order_and_by_their_gain() {
        let scan = Scan::new([1, 2, 3, 4]);
        assert_eq!(scan.codes(), [1, 2, 3, 4]);
        assert_eq!((scan.sensitive(), scan.wide()), ([1, 3], [2, 4]));
        // A register has twelve bits.
        assert_eq!(Scan::new([0xFFFF; 4]).codes(), [4095; 4]);
        let railed = [0, 1, 2048, 4094, 4095].map(|code| AdcCode::new(code).is_railed());
        assert_eq!(railed, [true, false, false, false, true]);
    }

    /// Numbers at the ends of ranges: 0, powers of two, and their neighbours, of both signs.
    fn edges() -> impl Iterator<Item = i32> + Clone {
        let powers = (0..32).map(|power| 1_i64 << power);
        let near = powers.flat_map(|power| [power - 1, power, power + 1]);
        near.flat_map(|number| [number, -number])
            .filter_map(|number| i32::try_from(number).ok())
    }

    /// Checks each sum with each scale and each power that settings may have: the result is the exact
    /// energy, or the greatest.
    fn energies<const FRACTION: u32, F: LeEqU32>() {
        let dense = if cfg!(miri) { 7 } else { 1 };
        for bit in (0..70).step_by(dense) {
            for sum in [1_u128 << bit, (1 << bit) - 1, (1 << bit) + 1] {
                for scale in edges().filter(|scale| *scale >= 0).step_by(dense) {
                    for powers in (-24..=24_i8).step_by(dense) {
                        let energy =
                            SquareSum::<FRACTION>(sum).energy(FixedI32::<F>::from_bits(scale), powers);
                        let bits = FRACTION + F::U32 - Energy::UNIT.fraction_bits;
                        let divisor = 1_u128 << (bits as i32 - i32::from(powers));
                        let exact = sum * scale as u128 / divisor;
                        let stated = exact.min(i64::MAX as u128) as i64;
                        assert_eq!(energy.bits(), stated, "{sum} {scale} {powers}");
                    }
                }
            }
        }
    }

    #[test]
    fn an_energy_is_exact_or_saturates_over_all_scales_and_powers() {
        // Estimate A's sum with its scale, and estimate B's.
        energies::<24, U30>();
        energies::<44, U16>();
    }

    #[test]
    fn nothing_is_left_of_a_sum_less_than_what_is_taken_off() {
        let sum = SquareSum::<40>(100);
        let left = [99, 100, u128::MAX].map(|taken| sum.less(taken).0);
        assert_eq!(left, [1, 0, 0]);
    }
}
