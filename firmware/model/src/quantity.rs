//! The quantities of the model and their fixed-point formats.
//!
//! | quantity | format | unit | range | resolution |
//! |---|---|---|---|---|
//! | [`Force`] | `I16F16` | N | ±32 kN | 15 µN |
//! | [`Acceleration`] | `I16F16` | m/s² | ±32 km/s² | 15 µm/s² |
//! | [`Length`] | `I12F20` | µm | ±2048 µm | 0.95 pm |
//! | [`Step`] | `I8F24` | µm/sample | ±128 µm/sample (12.8 m/s at 100 kHz) | 6 nm/s |
//! | [`Energy`] | `I40F24` | nJ | ±550 J | 0.06 fJ |

use fixed::FixedI32;
use fixed::traits::Fixed;
use fixed::types::extra::LeEqU32;
use fixed::types::{I8F24, I12F20, I16F16, I40F24};
use serde::{Deserialize, Serialize};

/// A contact force, N.
pub type Force = I16F16;
/// An absolute acceleration, m/s².
pub type Acceleration = I16F16;
/// An overlap or a displacement of the intruder relative to its host, µm.
pub type Length = I12F20;
/// A change of length over one sample (a velocity), or a change of that (an acceleration), µm.
pub type Step = I8F24;
/// An energy, nJ.
pub type Energy = I40F24;

/// A code of the 12-bit converter: 0 at its lower rail, [`AdcCode::MAX`] at its upper one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct AdcCode(u16);

impl AdcCode {
    /// The upper rail.
    pub const MAX: Self = Self(4095);

    /// Takes the twelve bits that the converter's data register holds; higher bits are always 0 there and
    /// are masked, so that a code is in range whatever its origin.
    pub const fn new(register: u16) -> Self {
        Self(register & Self::MAX.0)
    }

    /// The number, 0 to 4095.
    pub const fn get(self) -> u16 {
        self.0
    }

    /// Whether the code stands at a rail, so that the signal may have been beyond it.
    pub const fn is_railed(self) -> bool {
        self.0 == 0 || self.0 == Self::MAX.0
    }
}

/// The two codes of one scan: what the bead senses in one sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Scan {
    /// Total force at the host's incoming contact.
    pub force: AdcCode,
    /// Absolute acceleration of the intruder.
    pub acceleration: AdcCode,
}

/// `a·b` rounded to the nearest value of the format `C`, saturated to its range.
#[inline(always)]
pub(crate) fn product<A, B, C>(a: FixedI32<A>, b: FixedI32<B>) -> FixedI32<C>
where
    A: LeEqU32,
    B: LeEqU32,
    C: LeEqU32,
{
    let shift = const { A::U32 + B::U32 - C::U32 };
    FixedI32::from_bits(round_shift(wide(a, b), shift))
}

/// [`product`] where the ranges of `a` and `b` keep the result inside `C`: no saturation, a third of the
/// instructions. The caller says why it holds; a build with debug assertions checks.
#[inline(always)]
pub(crate) fn bounded_product<A, B, C>(a: FixedI32<A>, b: FixedI32<B>) -> FixedI32<C>
where
    A: LeEqU32,
    B: LeEqU32,
    C: LeEqU32,
{
    let shift = const { A::U32 + B::U32 - C::U32 };
    let rounded = rounded_shift(wide(a, b), shift);
    debug_assert!(i32::try_from(rounded).is_ok(), "a product left its format");
    FixedI32::from_bits(rounded as i32)
}

/// `bits / 2^shift` rounded to nearest and saturated to 32 bits.
#[inline(always)]
pub(crate) fn round_shift(bits: i64, shift: u32) -> i32 {
    rounded_shift(bits, shift).clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32
}

/// `bits / 2^shift` rounded to nearest.
///
/// `shift` is at least 1, and `bits` is a product of two 32-bit numbers or a sum of two such (|bits| < 2^63 -
/// 2^shift), so that the rounding term cannot overflow.
#[inline(always)]
fn rounded_shift(bits: i64, shift: u32) -> i64 {
    (bits + (1 << (shift - 1))) >> shift
}

/// Whether a state variable stands at an end of its format: it has saturated, or is about to.
#[inline(always)]
pub(crate) fn at_range_end<F: Fixed>(value: F) -> bool {
    value == F::MAX || value == F::MIN
}

/// A running sum of squared velocities of the intruder relative to its host, (µm/sample)².
///
/// The trapezoidal rule over a window that starts and ends at rest is the plain sum of its samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SquareSum(u64);

impl SquareSum {
    /// Fraction bits of the sum: a squared [`Step`] (48) less 16, which leaves 2^32 (µm/sample)² of range.
    const FRACTION: u32 = 32;

    /// Adds `velocity²`; saturates.
    #[inline(always)]
    pub(crate) fn add(&mut self, velocity: Step) {
        let bits = i64::from(velocity.to_bits());
        self.0 = self
            .0
            .saturating_add((bits * bits) as u64 >> (2 * Step::FRAC_NBITS - Self::FRACTION));
    }

    /// The energy of the sum, with `scale` in nJ per (µm/sample)².
    pub fn energy(self, scale: EnergyScale) -> Energy {
        let product = u128::from(self.0) * u128::from(scale.to_bits().unsigned_abs());
        let bits = product >> (Self::FRACTION + EnergyScale::FRAC_NBITS - Energy::FRAC_NBITS);
        Energy::from_bits(i64::try_from(bits).unwrap_or(i64::MAX))
    }
}

/// Energy dissipated by the intruder's damping per squared velocity and sample, nJ/(µm/sample)².
pub type EnergyScale = I16F16;

/// `a·b` in 64 bits, for sums of products that are rounded once.
#[inline(always)]
pub(crate) fn wide<A: LeEqU32, B: LeEqU32>(a: FixedI32<A>, b: FixedI32<B>) -> i64 {
    i64::from(a.to_bits()) * i64::from(b.to_bits())
}
