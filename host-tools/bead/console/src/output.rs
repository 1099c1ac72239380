//! Results leave the program here: data on standard output, everything else on standard error.

use std::fmt;
use std::io::{self, IsTerminal, Write};
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::Context;
use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use serde::Serialize;
use serde_json::Value;

use crate::failure::Failure;
use bead_compare::report::aligned;
use bead_recording::json::SCHEMA_VERSION;
pub use bead_recording::note::note;
use bead_tables::printable::printable;

/// True once an output has the path `-`. What is printed then goes to standard error.
static TAKEN: AtomicBool = AtomicBool::new(false);

/// Reserves standard output for one result. False if another has it.
pub fn take_standard_output() -> bool {
    !TAKEN.swap(true, Ordering::Relaxed)
}

/// Prints a line for people to standard error, with a message as for `format!`.
#[macro_export]
macro_rules! note {
    ($($message:tt)+) => {
        $crate::output::note(format_args!($($message)+))
    };
}

/// The shape of a result on standard output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
pub enum Format {
    /// Aligned columns for people.
    #[default]
    Table,
    /// One JSON document for programs.
    Json,
}

/// Prints a result: `value` as one JSON document, or the text that `table` makes of it.
///
/// # Errors
/// Standard output is closed or full; a reader that has gone away (`bead … | head`) is not an error.
pub fn print(format: Format, value: &impl Serialize, table: impl FnOnce() -> String) -> Result<(), Failure> {
    match format {
        Format::Json => print_json(value),
        Format::Table => print_line(&table()),
    }
}

/// Prints `value` as one JSON document, with the version of its schema (docs/schemas). In a list, every
/// object has the version, as does every line of `bead decode`.
fn print_json(value: &impl Serialize) -> Result<(), Failure> {
    let failed = "cannot write the result as JSON";
    let mut document = serde_json::to_value(value).context(failed)?;
    let objects = match &mut document {
        Value::Array(items) => &mut items[..],
        one => std::slice::from_mut(one),
    };
    for entries in objects.iter_mut().filter_map(Value::as_object_mut) {
        entries.shift_insert(0, "schema_version".to_owned(), SCHEMA_VERSION.into());
    }
    print_line(&serde_json::to_string_pretty(&document).context(failed)?)
}

/// Prints one line, or several, to standard output, or to standard error while a result with the path `-` has
/// standard output. Control characters, which could steer a terminal, are shown, not sent.
///
/// # Errors
/// Standard output is closed or full.
pub fn print_line(text: &str) -> Result<(), Failure> {
    let text = printable(text);
    if TAKEN.load(Ordering::Relaxed) {
        return written(writeln!(io::stderr().lock(), "{text}"));
    }
    written(writeln!(io::stdout().lock(), "{text}"))
}

/// Outcome of writing to standard output. A reader that has gone away is not an error.
///
/// # Errors
/// The system's error, in words.
pub fn written(result: io::Result<()>) -> Result<(), Failure> {
    match result {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => Ok(other.context("cannot write to standard output")?),
    }
}

/// Parses a number above 0.
///
/// # Errors
/// A line that says what to give instead.
pub fn positive(text: &str) -> Result<f64, String> {
    let number = text.parse().ok();
    let number = number.filter(|number: &f64| number.is_finite() && *number > 0.0);
    number.ok_or_else(|| "give a number above 0".to_owned())
}

/// Parses a duration in s, more than 0.
///
/// # Errors
/// A line that says what to give instead.
pub fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = positive(text)
        .ok()
        .and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    let duration = seconds.filter(|duration| !duration.is_zero());
    duration.ok_or_else(|| "give seconds, more than 0".to_owned())
}

/// Parses a duration in s, a day at most: something waits for its end.
///
/// # Errors
/// A line that says what to give instead.
pub fn seconds_of_a_day(text: &str) -> Result<Duration, String> {
    let duration = seconds(text)
        .ok()
        .filter(|duration| duration.as_secs_f64() <= 86_400.0);
    duration.ok_or_else(|| "give seconds, more than 0 and at most 86400 (a day)".to_owned())
}

/// The text of a table without rules: names on the left, numbers on the right. `|` separates the header's
/// cells.
pub fn table<R: Into<comfy_table::Row>>(header: &str, rows: impl IntoIterator<Item = R>) -> String {
    let heads: Vec<&str> = header.split('|').map(str::trim).collect();
    aligned(&heads, rows)
}

/// The text of a table of names and values, without a header.
pub fn rows<N: Into<String>>(rows: impl IntoIterator<Item = (N, String)>) -> String {
    let rows = rows.into_iter().map(|(name, value)| [name.into(), value]);
    table("|", rows).trim_start().to_owned()
}

/// `yes` if something holds, else `no`: for the cells of a table.
pub fn either(holds: bool, yes: &str, no: &str) -> String {
    (if holds { yes } else { no }).to_owned()
}

/// A number with this many significant digits and U+2212 for minus. Powers of ten outside of `plain` are
/// written with an exponent.
pub fn significant(value: f64, digits: i32, plain: Range<i32>) -> String {
    let decade = if value == 0.0 {
        0
    } else {
        value.abs().log10().floor() as i32
    };
    let decimals = |count: i32| count.max(0) as usize;
    let text = if plain.contains(&decade) {
        format!("{value:.*}", decimals(digits - 1 - decade))
    } else {
        format!("{value:.*e}", decimals(digits - 1))
    };
    text.replace('-', "−")
}

/// A spinner on standard error that names the step under way; silent when standard error is not a terminal.
pub fn spinner(step: impl Into<String>) -> ProgressBar {
    let bar = shown(ProgressBar::new_spinner(), "{spinner} {msg} {elapsed}");
    bar.with_message(printable(&step.into()).into_owned())
}

/// A progress bar of `steps` steps on standard error; silent when standard error is not a terminal.
pub fn progress(steps: u64) -> ProgressBar {
    shown(ProgressBar::new(steps), "{bar:24} {pos}/{len} {elapsed} {msg}")
}

/// A progress bar of the part done and the time left, on standard error; silent when standard error is not a
/// terminal. [`set_part`] moves it.
pub fn part_done(step: impl Into<String>) -> ProgressBar {
    let bar = shown(ProgressBar::new(PARTS), "{bar:24} {percent} % {msg}, {left}");
    bar.with_message(printable(&step.into()).into_owned())
}

const PARTS: u64 = 10_000;

/// Moves a bar of [`part_done`] to a part of 0 to 1.
pub fn set_part(bar: &ProgressBar, part: f64) {
    bar.set_position((part * PARTS as f64) as u64);
}

fn shown(bar: ProgressBar, template: &str) -> ProgressBar {
    if !io::stderr().is_terminal() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
        return bar;
    }
    if let Ok(style) = ProgressStyle::with_template(template) {
        let left = |state: &ProgressState, to: &mut dyn fmt::Write| {
            // The time left is unknown before some of the work is done.
            let _ = match state.pos() {
                0 => write!(to, "time left unknown"),
                _ => write!(to, "{:#} left", HumanDuration(state.eta())),
            };
        };
        bar.set_style(style.with_key("left", left));
    }
    bar.enable_steady_tick(Duration::from_millis(100));
    bar
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_duration_is_above_zero_and_one_that_is_waited_for_a_day_at_most() {
        assert_eq!(seconds("0.5"), Ok(Duration::from_millis(500)));
        for text in ["", "0", "-1", "nan", "inf", "1e300", "5s"] {
            assert!(seconds(text).is_err(), "{text}");
        }
        assert_eq!(seconds_of_a_day("86400"), Ok(Duration::from_secs(86_400)));
        assert!(seconds_of_a_day("86400.1").is_err());
    }
}
