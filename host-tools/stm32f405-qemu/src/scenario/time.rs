//! Times: a text with a unit, or a number of seconds.

use std::fmt;

use serde::de::{self, Deserialize, Deserializer, Visitor};

/// A time since power-up, or a duration, ns.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Time(pub(super) u64);

/// A century.
const LONGEST_S: f64 = 3e9;

impl Time {
    fn of(number: f64, unit: f64) -> Option<Self> {
        let seconds = number * unit;
        let fits = (0.0..LONGEST_S).contains(&seconds);
        // Units are powers of ten: a division loses less precision than a product with a fraction.
        fits.then(|| Self((number / (1e-9 / unit)).round() as u64))
    }
}

impl std::str::FromStr for Time {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let units = [("ns", 1e-9), ("us", 1e-6), ("ms", 1e-3), ("s", 1.0)];
        let unit = units
            .iter()
            .find_map(|(unit, s)| Some((text.strip_suffix(unit)?, *s)));
        let time = unit.and_then(|(number, s)| Self::of(number.trim().parse().ok()?, s));
        time.ok_or_else(|| format!("{text:?} is not a time: give for example \"10ms\", \"2.5us\" or 0.01"))
    }
}

impl<'de> Deserialize<'de> for Time {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        from.deserialize_any(TimeVisitor)
    }
}

struct TimeVisitor;

impl Visitor<'_> for TimeVisitor {
    type Value = Time;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a time such as \"10ms\", or a number of seconds")
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<Time, E> {
        text.parse().map_err(E::custom)
    }

    fn visit_i64<E: de::Error>(self, seconds: i64) -> Result<Time, E> {
        self.visit_f64(seconds as f64)
    }

    fn visit_f64<E: de::Error>(self, seconds: f64) -> Result<Time, E> {
        Time::of(seconds, 1.0).ok_or_else(|| E::custom(format!("{seconds} s is not a valid time")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_is_a_number_with_its_unit_to_the_nearest_nanosecond() {
        for (text, ns) in [
            ("10ms", 10_000_000),
            ("2.5us", 2_500),
            ("7 ns", 7),
            ("0.1s", 100_000_000),
        ] {
            assert_eq!(text.parse(), Ok(Time(ns)), "{text}");
        }
        for text in ["", "5", "-1s", "1h", "1e99s", "nans"] {
            assert!(text.parse::<Time>().is_err(), "{text}");
        }
    }
}
