//! Text tables: CSV as oscilloscopes, spreadsheets and programs write it.
//!
//! # Design
//! Every instrument writes its own head. Of the first lines, the last one with the most numbers is taken as
//! a row, and the table begins at the first line with numbers in the same columns. The lines above are the
//! head: names, perhaps with a line of units below, or settings of the instrument, which are skipped.
//! Semicolons, tabs, commas or blanks separate fields; a comma may be the decimal sign where it separates
//! nothing. A head with more or fewer names than columns would name the wrong ones, so such columns are
//! named by number.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::ops::RangeInclusive;
use std::path::Path;

use crate::choice::{Choice, ColumnAddress};
use crate::columns::{ColumnHeader, pick};
use crate::error::WaveformError;
use crate::rows::{Rows, StrikeFilter};
use crate::signals::Waveform;
use bead_tables::printable::beginning;
use bead_tables::unit;

/// Number of lines that are examined before the table is read.
const AHEAD: usize = 400;
/// Greatest length of a line, bytes.
const LONGEST: u64 = 1 << 16;
/// Range of a step of time in a head, s.
const STEPS: RangeInclusive<f64> = 1e-30..=1e30;
/// Separators of fields; of equally good ones, the first wins.
const SEPARATORS: [char; 4] = [';', '\t', ',', ' '];

pub(super) fn read(path: &Path, choice: &Choice) -> Result<Waveform, WaveformError> {
    let mut lines = TextLines {
        path,
        input: BufReader::new(File::open(path).map_err(WaveformError::unread(path))?),
        number: 0,
    };
    let mut ahead = Vec::new();
    while ahead.len() < AHEAD
        && let Some(line) = lines.next()?
    {
        ahead.push(line);
    }
    let Some(layout) = TableLayout::of(&ahead) else {
        return Err(WaveformError::unfit(
            path,
            "has no rows of numbers in its first lines; give a text table (CSV), WAV, Parquet, or a recording",
        ));
    };
    let of_head = layout.rate_hz.filter(|_| choice.time.is_none());
    let choice = &Choice {
        rate_hz: choice.rate_hz.or(of_head),
        ..choice.clone()
    };
    let named = [&choice.time, &choice.force, &choice.acceleration];
    let has_second = named
        .into_iter()
        .flatten()
        .any(|wanted| matches!(&wanted.column, ColumnAddress::Either(text) | ColumnAddress::Number(text) if text == "2"));
    if layout.is_perhaps_one && !has_second {
        let row = ahead.get(layout.begins).map_or("", |row| row.trim());
        return Err(WaveformError::unfit(
            path,
            format!(
                "rows such as `{}` may be one number with a decimal comma, or two numbers; write decimal points, or a name \
                 above each column",
                beginning(row, 40)
            ),
        ));
    }
    let picks = pick(path, &layout.headers, choice).map_err(|error| {
        let why = layout.misnamed.map(|(head, rows)| {
            format!(
                "its head has {head} and its rows {rows} columns, so give them by number, as in --read force=2:N"
            )
        });
        error.also(why.as_deref())
    })?;
    let mut rows = Rows::picked(path, "line", choice.rate_hz, &picks);
    let columns = [picks.time, picks.force, picks.acceleration];
    let mut strikes = StrikeFilter::new(&picks, choice);
    let mut push = |number: u64, line: &str| -> Result<(), WaveformError> {
        if is_passed(line) {
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
        if strikes.is_wanted(strike) {
            rows.push(number, values)?;
        }
        Ok(())
    };
    for (number, line) in (1..).zip(&ahead).skip(layout.begins) {
        push(number, line)?;
    }
    while let Some(line) = lines.next()? {
        push(lines.number, &line)?;
    }
    strikes.finish(rows)
}

struct TextLines<'a> {
    path: &'a Path,
    input: BufReader<File>,
    /// Number of the last line, from 1.
    number: u64,
}

impl TextLines<'_> {
    fn next(&mut self) -> Result<Option<String>, WaveformError> {
        let mut bytes = Vec::new();
        let read = self.input.by_ref().take(LONGEST).read_until(b'\n', &mut bytes);
        read.map_err(WaveformError::unread(self.path))?;
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
                "has none of the formats that are read: text (CSV), WAV, Parquet, .npy, MATLAB, a recording",
            );
        }
        while bytes.last().is_some_and(|last| matches!(last, b'\n' | b'\r')) {
            bytes.pop();
        }
        let start = if bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
        Ok(Some(match std::str::from_utf8(&bytes[start..]) {
            Ok(text) => text.to_owned(),
            // Older instruments write µ and ² in Latin-1, whose code points are those of Unicode.
            Err(_) => bytes.iter().map(|byte| char::from(*byte)).collect(),
        }))
    }
}

#[derive(Debug, PartialEq)]
struct TableLayout {
    separator: char,
    headers: Vec<ColumnHeader>,
    /// Number of lines above its first row.
    begins: usize,
    /// Rows a second, if the head has the step of time and no column has the time.
    rate_hz: Option<f64>,
    /// Names of the head and columns of the rows, if their counts differ and the names are not used.
    misnamed: Option<(usize, usize)>,
    /// True if its two columns may be one with decimal commas.
    is_perhaps_one: bool,
}

impl TableLayout {
    fn of(lines: &[String]) -> Option<Self> {
        let numbers = |line: &str, separator: char| -> Vec<usize> {
            let is_number = |field: &str| value_of(field, separator).is_some();
            let fields = fields(line, separator).enumerate();
            fields
                .filter(|(_, field)| is_number(field))
                .map(|(place, _)| place)
                .collect()
        };
        // Find the last line with the most numbers, for the separator that leaves the fewest other fields.
        let mut best: Option<((f64, usize), char, usize)> = None;
        for separator in SEPARATORS {
            for (at, line) in lines.iter().enumerate().rev() {
                let filled = fields(line, separator).filter(|field| !field.is_empty()).count();
                let count = numbers(line, separator).len();
                let rank = (count as f64 / filled.max(1) as f64, count);
                if count > 0 && best.is_none_or(|(most, ..)| rank > most) {
                    best = Some((rank, separator, at));
                }
            }
        }
        let (_, separator, at) = best?;
        let places = numbers(&lines[at], separator);
        let is_row = |line: &String| {
            // Both lists are sorted.
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
        let is_unit = |field: &&str| field.is_empty() || unit::parse(field).is_some() || *field == "Sequence";
        let of_places = |row: &Vec<&str>| -> bool {
            let mut own = places.iter().filter_map(|place| row.get(*place));
            own.clone().count() > 0 && own.all(is_unit)
        };
        let row: Vec<_> = fields(&lines[begins], separator).collect();
        let of_step = |names: &Vec<&str>| {
            let mut names = names.iter();
            names.position(|name| name.eq_ignore_ascii_case("increment"))
        };
        // Empty fields at the end do not count. A head with the step of time also names settings.
        let fits = |names: &Vec<&str>| {
            let alike = filled(names) <= row.len() && filled(&row) <= names.len();
            alike || of_step(names).is_some()
        };
        let (names, units) = match &head[..] {
            [.., names, units] if of_places(units) && fits(names) => (Some(names), Some(units)),
            [.., names] if fits(names) => (Some(names), None),
            _ => (None, None),
        };
        let misnamed = head.last().filter(|_| names.is_none());
        let misnamed = misnamed.map(|head| (filled(head), row.len()));
        let mut rows = lines[begins..].iter().filter(|line| !is_passed(line));
        let is_perhaps_one = separator == ',' && names.is_none() && rows.all(|line| may_be_one(line));
        let at = |row: Option<&Vec<&str>>, place: usize| {
            let field = row.and_then(|row| row.get(place));
            field
                .filter(|field| !field.is_empty())
                .map(|field| (*field).to_owned())
        };
        let header = |place: &usize| ColumnHeader {
            place: *place,
            name: at(names, *place).unwrap_or_else(|| (place + 1).to_string()),
            unit: at(units, *place).map(|unit| unit.trim_matches(['(', ')', '[', ']', ' ']).to_owned()),
        };
        // Rigol numbers its rows and writes the step of time into the head.
        let place = names.and_then(of_step);
        let step = place.and_then(|place| value_of(units?.get(place)?, separator));
        Some(Self {
            separator,
            headers: places.iter().map(header).collect(),
            begins,
            rate_hz: step.filter(|step| STEPS.contains(step)).map(|step| 1.0 / step),
            misnamed,
            is_perhaps_one,
        })
    }
}

/// Number of fields without the empty ones at the end.
fn filled(fields: &[&str]) -> usize {
    let last = fields.iter().rposition(|field| !field.is_empty());
    last.map_or(0, |last| last + 1)
}

/// True for a line among the rows that holds no row.
fn is_passed(line: &str) -> bool {
    line.trim().is_empty() || line.starts_with('#')
}

/// True for a line that may be one number with a decimal comma.
fn may_be_one(line: &str) -> bool {
    let (whole, decimals) = line.trim().split_once(',').unwrap_or((line.trim(), "0"));
    let whole = whole.trim_start_matches(['+', '-']);
    let is_whole = !whole.is_empty() && whole.bytes().all(|digit| digit.is_ascii_digit());
    is_whole && decimals.starts_with(|first: char| first.is_ascii_digit()) && !decimals.contains(['.', ','])
}

/// Splits a line into fields. Double quotes hide separators.
fn fields(line: &str, separator: char) -> impl Iterator<Item = &str> {
    let mut quoted = false;
    // Adjacent blanks are one separator.
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

/// The number in a field that holds nothing else.
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
    use std::cell::Cell;

    use super::*;
    use crate::testing::read as waveform;

    /// A choice of columns; an empty text chooses none.
    fn choice(time: &str, force: &str) -> Choice {
        Choice {
            time: time.parse().ok(),
            force: force.parse().ok(),
            ..Choice::default()
        }
    }

    /// A choice for rows without times, one each millisecond.
    fn untimed(force: &str) -> Choice {
        Choice {
            rate_hz: Some(1000.0),
            ..choice("", force)
        }
    }

    type Row<'a> = &'a dyn Fn(f64, f64) -> String;

    /// A head, then twenty rows of a ramp after ten at rest, 1 ms apart from -10 ms on: volts on one channel.
    fn table(head: &str, row: Row<'_>) -> String {
        let line = |n: i32| row(f64::from(n - 10) * 1e-3, f64::from((n - 10).max(0)) * 0.1);
        head.to_owned() + &(0..30).map(line).collect::<String>()
    }

    /// Asserts that two newtons per volt give 3.8 N at the end, 1.8 N in the middle of the ramp.
    fn is_the_ramp(bytes: impl AsRef<[u8]>, choice: &Choice) {
        let mut force = waveform(bytes, choice).unwrap().force.unwrap();
        assert!((force.end() - 29e-3).abs() < 1e-12, "{}", force.end());
        assert!((force.at(19e-3) - 1.8).abs() < 1e-9, "{}", force.at(19e-3));
        assert!((force.last() - 3.8).abs() < 1e-9);
    }

    fn comma(number: f64) -> String {
        format!("{number:.6}").replace('.', ",")
    }

    #[test]
    fn heads_of_oscilloscopes_are_passed_over() {
        let n = Cell::new(0);
        let tektronix = "Model,MSO2024\r\nFirmware Version,1.52\r\n\r\nPoint Format,Y,\r\nHorizontal Units,S,\r\n\
                         Sample Interval,1e-3,\r\n\r\nTIME,CH1,CH2\r\n";
        let lecroy = "LECROYWS,12345,Waveform\nSegments,1,SegmentSize,30\nSegment,TrigTime,TimeSinceSegment1\n\
                      #1,20-Nov-2026 10:00,0\nTime,CH1\n";
        let rigol = "X,CH1,Start,Increment\nSequence,VOLT,-1.0e-2,1.0e-3\n";
        let two: Row<'_> = &|t, v| format!("{t:.6e},{v:.4}\n");
        let tables: [(&str, Row<'_>); 5] = [
            (tektronix, &|t, v| format!("{t:.6e},{v:.4},0.1\r\n")),
            ("x-axis,CH1\nsecond,Volt\n", two),
            (rigol, &|_, v| format!("{},{v:.4},,\n", n.replace(n.get() + 1))),
            ("Time,CH1\n(ms),(V)\n\n", &|t, v| {
                format!("{:.4},{v:.4}\n", 1e3 * t)
            }),
            (lecroy, two),
        ];
        for (head, row) in tables {
            is_the_ramp(table(head, row), &choice("", "CH1:2N"));
        }
        // The oldest instruments write settings to the left and no names.
        let tds = table("", &|t, v| {
            let left = if t < -7e-3 {
                "Record Length,30,Points"
            } else {
                ",,"
            };
            format!("{left},{t:.6},{v:.4},\n")
        });
        is_the_ramp(tds, &choice("4:s", "5:2N"));
    }

    #[test]
    fn decimal_commas_other_separators_and_other_letters_are_read() {
        let tables: [(&str, Row<'_>); 4] = [
            ("Zeit [ms];Kraft [N]\n", &|t, v| {
                format!("{};{}\n", comma(1e3 * t), comma(2.0 * v))
            }),
            ("t/ms\tF/mN\n", &|t, v| {
                format!("{}\t{}\n", comma(1e3 * t), comma(2e3 * v))
            }),
            ("# time_s force_n\n", &|t, v| {
                format!("  {t:.6e}   {:.6e} \n", 2.0 * v)
            }),
            ("\u{feff}\"time, of all (s)\",\"Force (N)\"\n", &|t, v| {
                format!("\"{t:.6}\",{}\n", 2.0 * v)
            }),
        ];
        for (head, row) in tables {
            is_the_ramp(table(head, row), &Choice::default());
        }
        // µ in Latin-1.
        let mut latin = b"t (\xb5s),F (N)\n".to_vec();
        latin.extend(table("", &|t, v| format!("{:.3},{}\n", 1e6 * t, 2.0 * v)).bytes());
        is_the_ramp(latin, &Choice::default());
        is_the_ramp(table("", &|_, v| format!("{v}\n")), &untimed("1:2N"));
    }

    #[test]
    fn names_that_are_not_as_many_as_the_columns_are_no_names() {
        // R writes row numbers without a name, numpy puts blanks before units, and an inch mark opens a
        // quoted text.
        let r = table("\"time_s\" \"force_n\" \"acceleration_mps2\"\n", &|t, v| {
            format!("\"7\" {t:.6} {:.4} 0.1\n", 2.0 * v)
        });
        let numpy = table("# t(s) F [N] a [g]\n", &|t, v| {
            format!("{t:.6} {:.4} 0.1\n", 2.0 * v)
        });
        let inch = table("t (s),5\" force (N),acceleration (m/s2)\n", &|t, v| {
            format!("{t:.6},{:.4},0.1\n", 2.0 * v)
        });
        for (text, counts) in [
            (&r, "has 3 and its rows 4"),
            (&numpy, "has 5 and its rows 3"),
            (&inch, "has 2 and its rows 3"),
        ] {
            for force in ["", "force_n"] {
                let why = waveform(text, &choice("", force)).unwrap_err();
                let wanted =
                    format!("its head {counts} columns, so give them by number, as in --read force=2:N");
                assert!(why.ends_with(&wanted), "{why}");
            }
        }
        is_the_ramp(&r, &choice("2:s", "3:N"));
        let two: Row<'_> = &|t, v| format!("{t:.6},{:.4}\n", 2.0 * v);
        let tables: [(&str, Row<'_>); 3] = [
            // An empty last field may be missing in the head or in the rows.
            ("t (s),F (N),\n", two),
            ("t (s),F (N)\n", &|t, v| format!("{t:.6},{:.4},,\n", 2.0 * v)),
            // A title above a line of units, which are names as well.
            ("Of today, or not, or so\ns,N\n", two),
        ];
        for (head, row) in tables {
            is_the_ramp(table(head, row), &Choice::default());
        }
    }

    #[test]
    fn one_column_with_decimal_commas_is_not_taken_for_two() {
        for head in ["", "force_n\n"] {
            let text = table(head, &|_, v| format!("{v:.1}\n").replace('.', ","));
            let why = waveform(&text, &untimed("1:2N")).unwrap_err();
            let wanted = "rows such as `0,0` may be one number with a decimal comma, or two numbers; write decimal points";
            assert!(why.contains(wanted), "{why}");
            // Whole numbers have no comma there.
            let short = text.replace("1,0\n", "1\n");
            assert_eq!(waveform(&short, &untimed("1:2N")).unwrap_err(), why);
        }
        // These are two columns: by the choice of the second, by their names, or by a point or a sign in the
        // second.
        let row: Row<'_> = &|t, v| format!("{:.0},{:.0}\n", 1e3 * t + 10.0, 10.0 * v);
        for head in ["", "t (ms),v\n"] {
            is_the_ramp(table(head, row), &choice("1:ms", "2:0.2N"));
        }
        let rows: [Row<'_>; 2] = [&|_, v| format!("{:.0},{v:.1}\n", 10.0 * v), &|_, v| {
            format!("{:.0},-1\n", 10.0 * v)
        }];
        for row in rows {
            is_the_ramp(table("", row), &untimed("1:0.2N"));
        }
    }

    #[test]
    fn a_table_that_is_no_waveform_is_refused_with_its_line() {
        let good = table("", &|t, v| format!("{t:.6},{:.4}\n", 2.0 * v));
        // The table with row `at` replaced.
        let one = |at: usize, row: &str| {
            let mut lines: Vec<&str> = good.split_inclusive('\n').collect();
            lines.splice(at..=at, [row]);
            format!("time_s,force_n\n{}", lines.concat())
        };
        for (text, refusal) in [
            (one(12, "0.002,\n"), "F: line 14 has no number for the force;"),
            (one(12, "0.002,nan\n"), "line 14 has no number"),
            (one(12, "0.002,1e999\n"), "line 14 has no number"),
            (one(12, "0.002,eight\n"), "line 14 has no number"),
            (one(12, "0.001,0.2\n"), "time stands still at line 14, from 0.001"),
            (one(12, "-1,0.2\n"), "time goes back at line 14"),
            (one(12, "2e-3,2e30\n"), "line 14 has 2.000e30 N for the force"),
            (one(29, "1e31,0.2\n"), "line 31 has 1.000e31 s for the time"),
            (one(12, ""), "has a gap from 0.001 to 0.003 s, where its lines"),
            ("p,q\n1,2\n".to_owned(), "no column of force"),
            ("time_s,force_n\n1,2\n2,3\n".to_owned(), "has 2 lines of numbers"),
            ("nothing\nat all\n".to_owned(), "no rows of numbers"),
            ("a\0b\n".to_owned(), "none of the formats"),
            (String::new(), "is empty"),
            ("x".repeat(100_000), "none of the formats"),
        ] {
            let error = waveform(text, &Choice::default()).unwrap_err();
            assert!(error.contains(refusal), "{error}");
        }
        let error = waveform(b"\xff\xfet\0", &Choice::default()).unwrap_err();
        assert!(error.contains("UTF-16"), "{error}");
        let strike = Choice {
            strike: Some(1),
            ..Choice::default()
        };
        let error = waveform(one(12, "0.002,0.4\n"), &strike).unwrap_err();
        assert!(error.contains("--read strike"), "{error}");
    }
}
