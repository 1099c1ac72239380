//! Physical quantities: the fixed-point bits that the bead computed, and their units.
//!
//! # Design
//! A quantity is not rounded to SI on its way, because the host that replays the samples compares bits. The
//! type of a field is its unit, stated here once for code, JSON, tables and documentation.

use crate::body::{Field, FieldKind, Value, varint};
use crate::unit::Unit;
use serde::{Deserialize, Serialize};

macro_rules! quantities {
    ($(
        $(#[doc = $doc:literal])*
        $name:ident($bits:ty): $method:ident, $unit:expr;
    )*) => {$(
        $(#[doc = $doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
        #[serde(transparent)]
        pub struct $name($bits);

        impl $name {
            /// Unit, and size of one bit.
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
                self.0 as f64 * Self::UNIT.resolution()
            }
        }

        impl Field for $name {
            const LONGEST: usize = varint(<$bits>::BITS);
            const FORM: &'static str = stringify!($bits);
            const KIND: FieldKind = FieldKind::Quantity(&Self::UNIT);
            fn value(&self) -> Value<'_> {
                Value::Integer(self.0.into())
            }
            fn draw(random: &mut dyn FnMut() -> u64) -> Self {
                Self(random() as $bits)
            }
        }
    )*};
}

quantities! {
    /// Force (I16F16 of a newton).
    Force(i32): newtons, Unit::new("N", "_n", 16);
    /// Acceleration (I16F16 of a metre per second squared).
    Acceleration(i32): metres_per_second_squared, Unit::new("m/s²", "_mps2", 16);
    /// Energy (I40F24 of a nanojoule).
    Energy(i64): joules, Unit { scale: 1e-9, ..Unit::new("J", "_j", 24) };
    /// Part of a whole (I16F16).
    Fraction(i32): ratio, Unit::new("1", "", 16);
    /// Momentum (I48F16 of a newton times a sample period). Divided by the sample rate it is in newton
    /// seconds.
    Impulse(i64): newton_samples, Unit { per_sample: true, ..Unit::new("N·s", "_n_s", 16) };
    /// Time finer than a sample (U16F16 of a sample period), 0 if it was not found. Divided by the sample
    /// rate it is in seconds.
    Samples(u32): samples, Unit { per_sample: true, zero_is_unknown: true, ..Unit::new("s", "_s", 16) };
    /// Frequency (U16F16 of a hertz), 0 if it was not found.
    Frequency(u32): hertz, Unit { zero_is_unknown: true, ..Unit::new("Hz", "_hz", 16) };
    /// Voltage (U4F12 of a volt).
    Voltage(u16): volts, Unit::new("V", "_v", 12);
    /// Temperature (I8F8 of a degree Celsius).
    Temperature(i16): degrees_celsius, Unit::new("°C", "_degc", 8);
    /// Rate of decay (U16F16 of 1/s), 0 if it was not found.
    Decay(u32): per_second, Unit { zero_is_unknown: true, ..Unit::new("1/s", "_per_s", 16) };
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
    fn the_si_value_takes_the_sample_rate_where_time_counts_in_samples_and_0_may_be_unknown() {
        for (unit, bits, rate, si) in [
            (Force::UNIT, -3 << 15, None, Some(-1.5)),
            (Force::UNIT, -3 << 15, Some(10), Some(-1.5)),
            (Force::UNIT, 0, None, Some(0.0)),
            (Impulse::UNIT, 2 << 16, Some(10), Some(0.2)),
            (Impulse::UNIT, 2 << 16, None, None),
            (Impulse::UNIT, 0, Some(10), Some(0.0)),
            (Samples::UNIT, 1 << 16, Some(50_000), Some(20e-6)),
            (Samples::UNIT, 1 << 16, None, None),
            (Samples::UNIT, 0, Some(10), None),
            (Frequency::UNIT, 1 << 16, None, Some(1.0)),
            (Frequency::UNIT, 0, None, None),
            (Decay::UNIT, 0, None, None),
        ] {
            assert_eq!(unit.si(bits, rate), si, "{unit:?}, {bits}, {rate:?}");
        }
        assert_eq!(Energy::from_bits(5 << 24).joules(), 5e-9);
        assert_eq!(Impulse::from_bits(3 << 16).newton_seconds(50_000), 60e-6);
    }

    #[test]
    fn the_arrival_counts_from_the_first_scan_of_the_window_if_it_was_found() {
        for (arrival, index) in [(0, None), (3 << 15, Some(11.5))] {
            let shape = crate::message::Shape {
                first_index: 10,
                arrival: Samples::from_bits(arrival),
                ..Default::default()
            };
            assert_eq!(shape.arrival_index(), index);
        }
    }
}
