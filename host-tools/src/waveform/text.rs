//! Text tables: CSV as oscilloscopes, spreadsheets and programs write it.
//!
//! # Design
//! No two instruments write the same head, so the end of the first lines tells what a row is: the line with the most
//! numbers. The table begins where all of its columns have numbers, and the lines above are its head: names, perhaps
//! with a line of units below, or settings of the instrument, which are passed over. Fields are separated by
//! semicolons, tabs, commas or blanks; where it is no comma, a comma may be the decimal sign.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::ops::RangeInclusive;
use std::path::Path;

use crate::waveform::choice::Choice;
use crate::waveform::columns::{Header, pick};
use crate::waveform::error::WaveformError;
use crate::waveform::rows::Rows;
use crate::waveform::signals::Waveform;
use crate::waveform::unit;

/// Lines that are looked at before the table is read.
const AHEAD: usize = 400;
/// Bytes of a line at most.
const LONGEST: u64 = 1 << 16;
/// Steps of time that a head may tell, s.
const STEPS: RangeInclusive<f64> = 1e-30..=1e30;
/// What may separate fields; the first of equals wins.
const SEPARATORS: [char; 4] = [';', '\t', ',', ' '];

/// Reads a text table.
pub(super) fn read(path: &Path, choice: &Choice) -> Result<Waveform, WaveformError> {
    let unread = |source| WaveformError::File {
        path: path.to_owned(),
        source,
    };
    let mut lines = Lines {
        path,
        input: BufReader::new(File::open(path).map_err(unread)?),
        number: 0,
    };
    let mut ahead = Vec::new();
    while ahead.len() < AHEAD
        && let Some(line) = lines.next()?
    {
        ahead.push(line);
    }
    let Some(layout) = Layout::of(&ahead) else {
        return Err(WaveformError::unfit(
            path,
            "has no rows of numbers in its first lines; give a text table (CSV), WAV, Parquet, or a recording",
        ));
    };
    let named;
    let (rate_hz, choice) = match (choice.rate_hz, layout.rate_hz) {
        (None, Some(rate)) if choice.time.is_none() => {
            named = Choice {
                rate_hz: Some(rate),
                ..choice.clone()
            };
            (Some(rate), &named)
        }
        (given, _) => (given, choice),
    };
    let picks = pick(path, &layout.headers, choice)?;
    let mut rows = Rows::new(
        path,
        "line",
        rate_hz,
        [picks.force.is_some(), picks.acceleration.is_some()],
    );
    rows.remarks.extend(picks.remarks);
    let columns = [picks.time, picks.force, picks.acceleration];
    let wanted = choice.strike.unwrap_or(0) as f64;
    let mut strikes = Strikes::default();
    let mut take = |number: u64, line: &str| -> Result<(), WaveformError> {
        if line.trim().is_empty() || line.starts_with('#') {
            return Ok(());
        }
        let mut values = [None; 3];
        let mut strike = None;
        for (place, field) in fields(line, layout.separator).enumerate() {
            for (value, column) in values.iter_mut().zip(&columns) {
                if let Some(column) = column.filter(|column| column.place == place) {
                    *value = value_of(field, layout.separator).map(|value| value * column.size);
                }
            }
            if picks.strike == Some(place) {
                strike = value_of(field, layout.separator);
            }
        }
        if strike.is_some_and(|strike| strikes.passes_over(strike, wanted)) {
            return Ok(());
        }
        rows.push(number, values)
    };
    for (number, line) in (1..).zip(&ahead).skip(layout.begins) {
        take(number, line)?;
    }
    while let Some(line) = lines.next()? {
        take(lines.number, &line)?;
    }
    finish(rows, picks.strike.is_some(), &strikes, choice)
}

/// The strikes that were met in a table of several.
#[derive(Default)]
pub(super) struct Strikes {
    last: Option<f64>,
    found: usize,
}

impl Strikes {
    /// Whether a row of this strike is not the wanted one's.
    pub(super) fn passes_over(&mut self, strike: f64, wanted: f64) -> bool {
        if self.last.replace(strike) != Some(strike) {
            self.found += 1;
        }
        strike != wanted
    }
}

/// The waveform of a table that may be one that `bead export` wrote.
pub(super) fn finish(
    mut rows: Rows<'_>,
    is_exported: bool,
    strikes: &Strikes,
    choice: &Choice,
) -> Result<Waveform, WaveformError> {
    if is_exported {
        rows.of_a_bead(strikes.found, choice.strike)?;
    } else if choice.strike.is_some() {
        rows.has_no_strikes()?;
    }
    rows.end()
}

/// Lines of a file, as text.
struct Lines<'a> {
    path: &'a Path,
    input: BufReader<File>,
    /// Of the line that was read last, from 1.
    number: u64,
}

impl Lines<'_> {
    fn next(&mut self) -> Result<Option<String>, WaveformError> {
        let mut bytes = Vec::new();
        let read = self.input.by_ref().take(LONGEST).read_until(b'\n', &mut bytes);
        read.map_err(|source| WaveformError::File {
            path: self.path.to_owned(),
            source,
        })?;
        if bytes.is_empty() {
            return Ok(None);
        }
        self.number += 1;
        let unfit = |what: &str| Err(WaveformError::unfit(self.path, what));
        if bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") {
            return unfit("is text in UTF-16; save it as UTF-8");
        }
        if bytes.len() as u64 == LONGEST || bytes.contains(&0) {
            return unfit(
                "is none of the forms that are read: text tables (CSV), WAV, Parquet, or a recording",
            );
        }
        while bytes.last().is_some_and(|last| matches!(last, b'\n' | b'\r')) {
            bytes.pop();
        }
        let start = if bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
        Ok(Some(match std::str::from_utf8(&bytes[start..]) {
            Ok(text) => text.to_owned(),
            // Older instruments write µ and ² in Latin-1, whose numbers are those of Unicode.
            Err(_) => bytes.iter().map(|byte| char::from(*byte)).collect(),
        }))
    }
}

/// How a table is laid out.
#[derive(Debug, PartialEq)]
struct Layout {
    separator: char,
    headers: Vec<Header>,
    /// Lines above its first row.
    begins: usize,
    /// Rows a second, where its head says it and no column has the time.
    rate_hz: Option<f64>,
}

impl Layout {
    fn of(lines: &[String]) -> Option<Self> {
        let numbers = |line: &str, separator: char| -> Vec<usize> {
            let values = fields(line, separator)
                .map(|field| value_of(field, separator))
                .enumerate();
            values.filter_map(|(place, value)| value.map(|_| place)).collect()
        };
        // The last of the lines with the most numbers. A separator that leaves fewer odd fields is the better one.
        let mut best: Option<(f64, usize, char, usize)> = None;
        for separator in SEPARATORS {
            for (at, line) in lines.iter().enumerate().rev() {
                let told = fields(line, separator).filter(|field| !field.is_empty()).count();
                let count = numbers(line, separator).len();
                let part = count as f64 / told.max(1) as f64;
                if count > 0 && best.is_none_or(|(most, count_most, ..)| (part, count) > (most, count_most)) {
                    best = Some((part, count, separator, at));
                }
            }
        }
        let (_, _, separator, at) = best?;
        let places = numbers(&lines[at], separator);
        let is_row = |line: &String| {
            // Both are in order, and may be long.
            let found = numbers(line, separator);
            places.iter().all(|place| found.binary_search(place).is_ok())
        };
        let begins = lines.iter().position(is_row)?;
        let head: Vec<Vec<&str>> = lines[..begins]
            .iter()
            .map(|line| line.trim_start_matches('#').trim_start_matches(' '))
            .filter(|line| !line.trim().is_empty())
            .map(|line| fields(line, separator).collect())
            .collect();
        let is_unit = |field: &&str| {
            field.is_empty() || unit::unit(field).is_some() || unit::is_volts(field) || *field == "Sequence"
        };
        let of_places = |row: &Vec<&str>| -> bool {
            let mut own = places.iter().filter_map(|place| row.get(*place));
            own.clone().count() > 0 && own.all(is_unit)
        };
        let (names, units) = match &head[..] {
            [.., names, units] if of_places(units) && names.len() >= places.len() => {
                (Some(names), Some(units))
            }
            [.., names] => (Some(names), None),
            [] => (None, None),
        };
        let at = |row: Option<&Vec<&str>>, place: usize| {
            let field = row.and_then(|row| row.get(place));
            field
                .filter(|field| !field.is_empty())
                .map(|field| (*field).to_owned())
        };
        let header = |place: &usize| Header {
            place: *place,
            name: at(names, *place).unwrap_or_else(|| (place + 1).to_string()),
            unit: at(units, *place).map(|unit| unit.trim_matches(['(', ')', '[', ']', ' ']).to_owned()),
        };
        // Some instruments number their rows and write the step of time into the head.
        let of_step = names.and_then(|names| {
            names
                .iter()
                .position(|name| name.eq_ignore_ascii_case("increment"))
        });
        let step = of_step.and_then(|place| value_of(units?.get(place)?, separator));
        Some(Self {
            separator,
            headers: places.iter().map(header).collect(),
            begins,
            rate_hz: step.filter(|step| STEPS.contains(step)).map(|step| 1.0 / step),
        })
    }
}

/// The fields of a line. A separator within double quotes is none.
fn fields(line: &str, separator: char) -> impl Iterator<Item = &str> {
    let mut quoted = false;
    // Blanks in a row are one separator.
    let line = if separator == ' ' { line.trim() } else { line };
    let pieces = line.split(move |c: char| {
        quoted ^= c == '"';
        !quoted && (c == separator)
    });
    let some = move |piece: &&str| separator != ' ' || !piece.is_empty();
    pieces
        .filter(some)
        .map(|piece| piece.trim().trim_matches('"').trim())
}

/// The number in a field, if it is one and nothing else.
fn value_of(field: &str, separator: char) -> Option<f64> {
    let starts = field.chars().next()?;
    if !(starts.is_ascii_digit() || "+-.,".contains(starts)) {
        return None;
    }
    let value = match separator {
        ',' => field.parse(),
        _ if field.contains(',') => field.replace(',', ".").parse(),
        _ => field.parse(),
    };
    value.ok().filter(|value: &f64| value.is_finite())
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::waveform::choice::Wanted;

    fn wanted(text: &str) -> Option<Wanted> {
        text.parse().ok()
    }

    fn waveform(bytes: impl AsRef<[u8]>, choice: &Choice) -> Result<Waveform, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scope.csv");
        fs::write(&path, bytes).unwrap();
        Waveform::read(&path, choice, None)
            .map_err(|error| error.to_string().replace(&*path.to_string_lossy(), "F"))
    }

    fn ch1() -> Choice {
        Choice {
            force: wanted("CH1:2N"),
            ..Choice::default()
        }
    }

    /// Twenty rows of a ramp after ten at rest, 1 ms apart from -10 ms on: volts on one channel.
    fn rows(row: impl Fn(f64, f64) -> String) -> String {
        let line = |n: i32| {
            let volts = f64::from((n - 10).max(0)) * 0.1;
            row(f64::from(n - 10) * 1e-3, volts)
        };
        (0..30).map(line).collect()
    }

    /// Two newtons a volt give 3.8 N at the end, 1.8 N in the middle of the ramp.
    fn is_the_ramp(found: Result<Waveform, String>) {
        let force = found.unwrap().force.unwrap();
        assert!((force.end() - 29e-3).abs() < 1e-12, "{}", force.end());
        let mut force = force;
        assert!((force.at(19e-3) - 1.8).abs() < 1e-9, "{}", force.at(19e-3));
        assert!((force.last() - 3.8).abs() < 1e-9);
    }

    #[test]
    fn heads_of_oscilloscopes_are_passed_over() {
        let tektronix = format!(
            "Model,MSO2024\r\nFirmware Version,1.52\r\n\r\nPoint Format,Y,\r\nHorizontal Units,S,\r\nSample Interval,1e-3,\r\n\
             \r\nTIME,CH1,CH2\r\n{}",
            rows(|t, v| format!("{t:.6e},{v:.4},0.1\r\n"))
        );
        is_the_ramp(waveform(&tektronix, &ch1()));
        let keysight = format!(
            "x-axis,CH1\nsecond,Volt\n{}",
            rows(|t, v| format!("{t:.6e},{v:.4}\n"))
        );
        is_the_ramp(waveform(&keysight, &ch1()));
        let n = std::cell::Cell::new(0);
        let rigol = format!(
            "X,CH1,Start,Increment\nSequence,VOLT,-1.0e-2,1.0e-3\n{}",
            rows(|_, v| format!("{},{v:.4},,\n", n.replace(n.get() + 1)))
        );
        is_the_ramp(waveform(&rigol, &ch1()));
        let pico = format!(
            "Time,CH1\n(ms),(V)\n\n{}",
            rows(|t, v| format!("{:.4},{v:.4}\n", 1e3 * t))
        );
        is_the_ramp(waveform(&pico, &ch1()));
        let lecroy = format!(
            "LECROYWS,12345,Waveform\nSegments,1,SegmentSize,30\nSegment,TrigTime,TimeSinceSegment1\n#1,20-Nov-2026 10:00,0\n\
             Time,CH1\n{}",
            rows(|t, v| format!("{t:.6e},{v:.4}\n"))
        );
        is_the_ramp(waveform(&lecroy, &ch1()));
        // Of the oldest: settings to the left, no names.
        let tds = rows(|t, v| {
            let left = if t < -7e-3 {
                "Record Length,30,Points"
            } else {
                ",,"
            };
            format!("{left},{t:.6},{v:.4},\n")
        });
        let by_number = Choice {
            force: wanted("5:2N"),
            time: wanted("4:s"),
            ..Choice::default()
        };
        is_the_ramp(waveform(&tds, &by_number));
    }

    #[test]
    fn decimal_commas_other_separators_and_other_letters_are_read() {
        let comma = |number: f64| format!("{number:.6}").replace('.', ",");
        let german = format!(
            "Zeit [ms];Kraft [N]\n{}",
            rows(|t, v| format!("{};{}\n", comma(1e3 * t), comma(2.0 * v)))
        );
        is_the_ramp(waveform(&german, &Choice::default()));
        let tabs = format!(
            "t/ms\tF/mN\n{}",
            rows(|t, v| format!("{}\t{}\n", comma(1e3 * t), comma(2e3 * v)))
        );
        is_the_ramp(waveform(&tabs, &Choice::default()));
        let numpy = format!(
            "# time_s force_n\n{}",
            rows(|t, v| format!("  {t:.6e}   {:.6e} \n", 2.0 * v))
        );
        is_the_ramp(waveform(&numpy, &Choice::default()));
        let quoted = format!(
            "\u{feff}\"time, of all (s)\",\"Force (N)\"\n{}",
            rows(|t, v| format!("\"{t:.6}\",{}\n", 2.0 * v))
        );
        is_the_ramp(waveform(&quoted, &Choice::default()));
        // µ in Latin-1.
        let mut latin = b"t (\xb5s),F (N)\n".to_vec();
        latin.extend(rows(|t, v| format!("{:.3},{}\n", 1e6 * t, 2.0 * v)).bytes());
        is_the_ramp(waveform(&latin, &Choice::default()));
        let alone = Choice {
            rate_hz: Some(1000.0),
            force: wanted("1:2N"),
            ..Choice::default()
        };
        is_the_ramp(waveform(rows(|_, v| format!("{v}\n")), &alone));
    }

    #[test]
    fn what_is_no_waveform_is_told_with_its_line() {
        let table = |change: &dyn Fn(usize, &str) -> String| -> String {
            let good = rows(|t, v| format!("{t:.6},{:.4}\n", 2.0 * v));
            let lines = good.lines().enumerate().map(|(at, line)| change(at, line));
            format!("time_s,force_n\n{}", lines.collect::<String>())
        };
        let one = |at: usize, is: &'static str| {
            table(&move |line, good| {
                if line == at {
                    is.to_owned()
                } else {
                    format!("{good}\n")
                }
            })
        };
        let says = |text: String| waveform(text, &Choice::default()).unwrap_err();
        assert!(
            says(one(12, "0.002,\n"))
                .starts_with("F: line 14 has no number for the force; a waveform has no gaps")
        );
        assert!(says(one(12, "0.002,nan\n")).contains("line 14 has no number"));
        assert!(says(one(12, "0.002,1e999\n")).contains("line 14 has no number"));
        assert!(says(one(12, "0.002,eight\n")).contains("line 14 has no number"));
        assert!(
            says(one(12, "0.001,0.2\n"))
                .starts_with("F: time stands still at line 14, from 0.001 to 0.001 s")
        );
        assert!(says(one(12, "-1,0.2\n")).contains("time goes back at line 14"));
        assert!(says(one(12, "2e-3,2e30\n")).contains("line 14 has 2.000e30 N for the force"));
        assert!(says(one(29, "1e31,0.2\n")).contains("line 31 has 1.000e31 s for the time"));
        assert!(
            says(one(12, ""))
                .contains("has a gap from 0.001 to 0.003 s, where its lines are 1.000e-3 s apart")
        );
        assert!(says("p,q\n1,2\n".to_owned()).contains("no column of force"));
        assert!(says("time_s,force_n\n1,2\n2,3\n".to_owned()).contains("has 2 lines of numbers"));
        assert!(says("nothing\nat all\n".to_owned()).contains("no rows of numbers"));
        assert!(says("a\0b\n".to_owned()).contains("none of the forms"));
        assert!(
            waveform(b"\xff\xfet\0", &Choice::default())
                .unwrap_err()
                .contains("UTF-16")
        );
        assert!(waveform("", &Choice::default()).unwrap_err().contains("is empty"));
        assert!(says("x".repeat(100_000)).contains("none of the forms"));
        let strike = Choice {
            strike: Some(1),
            ..Choice::default()
        };
        assert!(
            waveform(one(99, ""), &strike)
                .unwrap_err()
                .contains("--waveform-strike")
        );
    }
}
