//! Physical quantities as they travel: the fixed-point bits that the bead computed, and their unit.
//!
//! # Design
//! A quantity is not rounded to SI on its way, because the host that replays the samples compares bits. The
//! unit of a field is its type: it is stated here once, for code, JSON and documentation.

use crate::body::{Field, Value};
use crate::unit::Unit;
use serde::{Deserialize, Serialize};

/// Sixteen bits behind the binary point.
const FRACTION_16: f64 = 1.0 / (1u32 << 16) as f64;
/// Twenty-four bits behind the binary point, of a nanojoule.
const NANOJOULE_24: f64 = 1e-9 / (1u32 << 24) as f64;

macro_rules! quantities {
    ($(
        $(#[doc = $doc:literal])*
        $name:ident($bits:ty, $longest:literal, $form:literal): $method:ident, $unit:expr;
    )*) => {$(
        $(#[doc = $doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
        #[serde(transparent)]
        pub struct $name($bits);

        impl $name {
            /// What one bit is worth.
            pub const UNIT: Unit = $unit;

            /// The quantity with these bits.
            pub const fn from_bits(bits: $bits) -> Self {
                Self(bits)
            }

            /// Its bits, as they travel.
            pub const fn bits(self) -> $bits {
                self.0
            }

            #[doc = concat!("Its value in ", stringify!($method), ".")]
            pub fn $method(self) -> f64 {
                self.0 as f64 * Self::UNIT.resolution
            }
        }

        impl Field for $name {
            const LONGEST: usize = $longest;
            const FORM: &'static str = $form;
            fn value(&self) -> Value<'_> {
                Value::Quantity {
                    bits: self.0.into(),
                    unit: &Self::UNIT,
                }
            }
            fn draw(random: &mut dyn FnMut() -> u64) -> Self {
                Self(random() as $bits)
            }
        }
    )*};
}

const fn unit(symbol: &'static str, suffix: &'static str, resolution: f64, per_sample: bool) -> Unit {
    Unit {
        symbol,
        suffix,
        resolution,
        per_sample,
    }
}

quantities! {
    /// A force (I16F16 of a newton).
    Force(i32, 5, "i32, 2^-16 N"): newtons, unit("N", "_n", FRACTION_16, false);
    /// An acceleration (I16F16 of a metre per second squared).
    Acceleration(i32, 5, "i32, 2^-16 m/s²"): metres_per_second_squared,
        unit("m/s²", "_mps2", FRACTION_16, false);
    /// An energy (I40F24 of a nanojoule).
    Energy(i64, 10, "i64, 2^-24 nJ"): joules, unit("J", "_j", NANOJOULE_24, false);
    /// A part of a whole (I16F16).
    Fraction(i32, 5, "i32, 2^-16"): ratio, unit("1", "", FRACTION_16, false);
    /// A momentum (I48F16 of a newton times a sample period). Divided by the sample rate it is in newton
    /// seconds.
    Impulse(i64, 10, "i64, 2^-16 N times a sample period"): newton_samples,
        unit("N·s", "_n_s", FRACTION_16, true);
    /// A time finer than a sample (U16F16 of a sample period). Divided by the sample rate it is in seconds.
    Samples(u32, 5, "u32, 2^-16 sample periods"): samples, unit("s", "_s", FRACTION_16, true);
    /// A frequency (U16F16 of a hertz).
    Frequency(u32, 5, "u32, 2^-16 Hz"): hertz, unit("Hz", "_hz", FRACTION_16, false);
    /// A rate of decay (U16F16 of 1/s).
    Decay(u32, 5, "u32, 2^-16 1/s"): per_second, unit("1/s", "_per_s", FRACTION_16, false);
}

impl Impulse {
    /// Its value in newton seconds, for a sample rate in Hz.
    pub fn newton_seconds(self, sample_rate_hz: u32) -> f64 {
        self.newton_samples() / f64::from(sample_rate_hz)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bits_of_each_quantity_are_worth_what_its_form_says() {
        assert_eq!(Force::from_bits(3 << 15).newtons(), 1.5);
        assert_eq!(
            Acceleration::from_bits(-1 << 16).metres_per_second_squared(),
            -1.0
        );
        assert_eq!(Energy::from_bits(5 << 24).joules(), 5e-9);
        assert_eq!(Fraction::from_bits(1 << 14).ratio(), 0.25);
        assert_eq!(Samples::from_bits(1 << 17).samples(), 2.0);
        assert_eq!(Frequency::from_bits(1700 << 16).hertz(), 1700.0);
        assert_eq!(Decay::from_bits(1 << 15).per_second(), 0.5);
        let impulse = Impulse::from_bits(3 << 16);
        assert_eq!(
            (impulse.newton_samples(), impulse.newton_seconds(50_000)),
            (3.0, 60e-6)
        );
    }
}
