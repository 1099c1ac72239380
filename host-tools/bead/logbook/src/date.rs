//! Dates of recordings.
//!
//! # Design
//! A note `date` comes first, since a person may know better than a clock. Then the time at which the first
//! frame was received, unless it counts from a power-up, as that of an emulated bead does; then the time at
//! which the recorder was started; then that of the file.

use chrono::{DateTime, NaiveDate, NaiveDateTime, SecondsFormat, Utc};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Receive times before this, 2000-01-01, count from a power-up, ns since 1970.
const REAL_FROM: i64 = 946_684_800_000_000_000;

/// The source of the date of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DateSource {
    /// Its note `date`.
    Note,
    /// The host's time at its first frame.
    Received,
    /// The host's time at the start of the recorder.
    Started,
    /// The time at which its file was changed last.
    File,
}

impl DateSource {
    /// Its name in a table, as in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Note => "note",
            Self::Received => "received",
            Self::Started => "started",
            Self::File => "file",
        }
    }
}

/// The date of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RecordingDate {
    /// ns since 1970.
    pub unix_ns: i64,
    /// Where it is from.
    pub source: DateSource,
}

/// The possible sources of a recording's date, where they are known.
#[derive(Clone, Copy, Debug, Default)]
pub struct DateFacts<'a> {
    /// The note `date`.
    pub note: Option<&'a str>,
    /// Receive time of the first frame, ns since 1970 or since a power-up.
    pub first_received_ns: Option<u64>,
    /// The recorder's note of its start, RFC 3339.
    pub started: Option<&'a str>,
    /// The time at which the file was changed last, ns since 1970.
    pub file_ns: i64,
}

impl DateFacts<'_> {
    /// The date by the best of the sources.
    pub fn date(self) -> RecordingDate {
        let received = self.first_received_ns.and_then(|ns| i64::try_from(ns).ok());
        let sources = [
            (DateSource::Note, self.note.and_then(parse)),
            (DateSource::Received, received.filter(|ns| *ns >= REAL_FROM)),
            (DateSource::Started, self.started.and_then(parse)),
        ];
        let mut known = sources
            .into_iter()
            .filter_map(|(source, ns)| ns.map(|unix_ns| RecordingDate { unix_ns, source }));
        known.next().unwrap_or(RecordingDate {
            unix_ns: self.file_ns,
            source: DateSource::File,
        })
    }
}

/// Parses a date or a time of UTC, ns since 1970: `2026-11-28`, `2026-11-28 09:30`, or RFC 3339. `None` if it
/// is neither, or before 1678 or after 2261.
pub fn parse(text: &str) -> Option<i64> {
    let day = || {
        let day = NaiveDate::parse_from_str(text, "%Y-%m-%d").ok()?;
        Some(day.and_hms_opt(0, 0, 0)?.and_utc())
    };
    let minute = |form| Some(NaiveDateTime::parse_from_str(text, form).ok()?.and_utc());
    let whole = || Some(DateTime::parse_from_rfc3339(text).ok()?.to_utc());
    let time = whole()
        .or_else(day)
        .or_else(|| minute("%Y-%m-%d %H:%M"))
        .or_else(|| minute("%Y-%m-%dT%H:%M"))
        .or_else(|| minute("%Y-%m-%d %H:%M:%S"))?;
    time.timestamp_nanos_opt()
}

/// A time as text: RFC 3339, UTC, in seconds.
pub fn text(unix_ns: i64) -> String {
    let time: DateTime<Utc> = DateTime::from_timestamp_nanos(unix_ns);
    time.to_rfc3339_opts(SecondsFormat::Secs, true)
}

/// A time for people: `2026-11-28 09:30`.
pub fn short(unix_ns: i64) -> String {
    DateTime::from_timestamp_nanos(unix_ns)
        .format("%Y-%m-%d %H:%M")
        .to_string()
}

/// The first ns of the day of a time.
pub fn day(unix_ns: i64) -> i64 {
    unix_ns.saturating_sub(unix_ns.rem_euclid(DAY_NS))
}

/// A day in ns.
pub const DAY_NS: i64 = 86_400_000_000_000;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_read_as_people_write_them() {
        let first = 1_795_824_000_000_000_000;
        for (text, after) in [
            ("2026-11-28", 0),
            ("2026-11-28 09:30", 34_200),
            ("2026-11-28T09:30", 34_200),
            ("2026-11-28T09:30:05Z", 34_205),
            ("2026-11-28T09:30:05+01:00", 30_605),
        ] {
            assert_eq!(parse(text), Some(first + after * 1_000_000_000), "{text}");
        }
        for odd in ["", "yesterday", "28.11.2026", "2026-11-31", "9999-01-01"] {
            assert_eq!(parse(odd), None, "{odd}");
        }
        assert_eq!(text(first), "2026-11-28T00:00:00Z");
        assert_eq!(short(first + 34_200_000_000_000), "2026-11-28 09:30");
        assert_eq!(day(first + 1), first);
        assert_eq!(day(-1), -DAY_NS);
    }

    #[test]
    fn a_note_comes_before_a_clock_and_a_time_from_power_up_is_none() {
        let date = |facts: DateFacts<'_>| (facts.date().source, text(facts.date().unix_ns));
        let mut facts = DateFacts {
            note: Some("2026-11-28"),
            first_received_ns: Some(1_700_000_000_000_000_000),
            started: Some("2026-11-27T08:00:00Z"),
            file_ns: 1_600_000_000_000_000_000,
        };
        assert_eq!(date(facts), (DateSource::Note, "2026-11-28T00:00:00Z".to_owned()));
        facts.note = Some("yesterday");
        assert_eq!(
            date(facts),
            (DateSource::Received, "2023-11-14T22:13:20Z".to_owned())
        );
        facts.first_received_ns = Some(20_000_000);
        assert_eq!(
            date(facts),
            (DateSource::Started, "2026-11-27T08:00:00Z".to_owned())
        );
        facts.started = None;
        assert_eq!(date(facts), (DateSource::File, "2020-09-13T12:26:40Z".to_owned()));
    }
}
