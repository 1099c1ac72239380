//! Days of the calendar.

use core::fmt;

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

/// Days from 1970-01-01 to 2020-01-01.
const FIRST: i64 = 18_262;

/// A day from 2020-01-01 to 2199-06-06. Text as 2026-11-24 in JSON and TOML, a number of days in a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Day(#[cfg_attr(feature = "schema", schemars(with = "&str"))] u16);

impl Day {
    /// The day of an instant in s since 1970 (UTC); `None` outside the range.
    pub fn at(unix_s: i64) -> Option<Self> {
        u16::try_from(unix_s.div_euclid(86_400) - FIRST).ok().map(Self)
    }

    /// The day that a text such as `2026-11-24` names (Gregorian calendar).
    pub fn parse(text: &str) -> Option<Self> {
        let mut parts = text.splitn(3, '-');
        let mut part = |digits| {
            let part = parts.next()?;
            let is_plain = part.len() == digits && part.bytes().all(|byte| byte.is_ascii_digit());
            part.parse::<i64>().ok().filter(|_| is_plain)
        };
        let (year, month, date) = (part(4)?, part(2)?, part(2)?);
        // Years begin in March, so that a leap day ends one.
        let (years, months) = (year - i64::from(month < 3), (month + 9) % 12);
        let leaps = years / 4 - years / 100 + years / 400;
        let since_1970 = 365 * years + leaps + (153 * months + 2) / 5 + date - 1 - 719_468;
        let day = Self(u16::try_from(since_1970 - FIRST).ok()?);
        // A date that does not exist, such as 31 April, comes out as a different one.
        (day.date() == [year, month, date]).then_some(day)
    }

    /// Year, month and day of the month.
    fn date(self) -> [i64; 3] {
        // Days since 2000-03-01. Each century up to 2199 has 36 524 days.
        let days = i64::from(self.0) + FIRST - 11_017;
        let centuries = days / 36_524;
        let of_century = days - 36_524 * centuries;
        let years = (4 * of_century + 3) / 1461;
        let of_year = of_century - 1461 * years / 4;
        let months = (5 * of_year + 2) / 153;
        let (date, month) = (of_year - (153 * months + 2) / 5 + 1, (months + 2) % 12 + 1);
        [2000 + 100 * centuries + years + i64::from(month < 3), month, date]
    }
}

impl fmt::Display for Day {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [year, month, date] = self.date();
        write!(f, "{year}-{month:02}-{date:02}")
    }
}

impl Serialize for Day {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if serializer.is_human_readable() {
            serializer.collect_str(self)
        } else {
            self.0.serialize(serializer)
        }
    }
}

impl<'de> Deserialize<'de> for Day {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        if deserializer.is_human_readable() {
            deserializer.deserialize_str(DayVisitor)
        } else {
            u16::deserialize(deserializer).map(Self)
        }
    }
}

struct DayVisitor;

impl de::Visitor<'_> for DayVisitor {
    type Value = Day;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a date in quotes, such as \"2026-11-24\"")
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<Day, E> {
        Day::parse(text).ok_or_else(|| E::invalid_value(de::Unexpected::Str(text), &self))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_day_is_read_as_it_is_shown_and_follows_the_one_before() {
        let dates = (2020..).flat_map(|year| {
            let is_leap = year % 4 == 0 && year % 100 != 0;
            let february = 28 + i64::from(is_leap);
            let lengths = [31, february, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
            (1..)
                .zip(lengths)
                .flat_map(move |(month, length)| (1..=length).map(move |date| [year, month, date]))
        });
        for (day, date) in (0..=u16::MAX).map(Day).zip(dates) {
            assert_eq!(day.date(), date);
            let text = format!("{day}");
            assert_eq!(Day::parse(&text), Some(day), "{text}");
        }
        // `date -ud 2026-11-24 +%s`
        assert_eq!(Day::at(1_795_478_400), Day::parse("2026-11-24"));
        assert_eq!(Day::at(1_795_478_399), Day::parse("2026-11-23"));
        for none in "2026 2026-11 2026-02-29 2026-04-31 2019-12-31 2026-1-1 2026-+1-01 ".split(' ') {
            assert_eq!(Day::parse(none), None, "{none}");
        }
    }
}
