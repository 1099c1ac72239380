//! `bead replay`: the recorded samples through the bead's own fixed-point code.

use std::path::PathBuf;

use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;

use crate::cli::failure::Failure;
use crate::cli::output::{self, Format};
use bead_compare::replay::replay;
use bead_compare::report::count;
use bead_recording::received::Received;

const AFTER_HELP: &str = "\
Every energy of every chunk and every field of every strike is compared bit for bit, and the strike detector \
must fire at the same sample. Exit status 1 if anything differs; the first difference is told in SI units \
and in bits, with what it usually means. Of more than 100 000 strikes the first are shown, and those that \
differ.

Example:
  bead replay run/bead-8.mcap";

/// Arguments of `bead replay`.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    /// The recording.
    recording: PathBuf,
    /// How to print the result.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// The result as JSON.
#[derive(Serialize, JsonSchema)]
pub(crate) struct Report<'a> {
    identical: bool,
    strikes: &'a Vec<Strike>,
    strikes_differ: u64,
    strikes_left_out: u64,
}

#[derive(Serialize, JsonSchema)]
struct Strike {
    strike: u32,
    sample_index: u64,
    samples: usize,
    chunks: usize,
    identical: bool,
    first_difference: Option<String>,
}

/// Number of strikes that are shown, and of strikes beyond these that differ.
const SHOWN_MOST: u64 = 100_000;
const DIFFER_MOST: u64 = 1000;

/// The strikes that are shown. A recording may have more than memory holds.
#[derive(Default)]
struct Shown {
    rows: Vec<Strike>,
    differ: u64,
    left_out: u64,
    first_difference: Option<String>,
}

impl Shown {
    fn push(&mut self, strike: Strike) {
        self.differ += u64::from(!strike.identical);
        if self.first_difference.is_none() {
            self.first_difference = strike.first_difference.clone();
        }
        let shown = self.rows.len() as u64;
        if shown < SHOWN_MOST || (!strike.identical && shown < SHOWN_MOST + DIFFER_MOST) {
            self.rows.push(strike);
        } else {
            self.left_out += 1;
        }
    }
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let received = Received::open(&arguments.recording)?;
    let mut recorded = received.strikes()?;
    let mut strikes = Shown::default();
    for strike in recorded.by_ref() {
        let replay = replay(&strike);
        strikes.push(Strike {
            strike: strike.said.strike,
            sample_index: strike.said.trigger_index,
            samples: strike.scans.len(),
            chunks: strike.chunks.len(),
            identical: replay.identical(),
            first_difference: replay.first_difference,
        });
    }
    if strikes.rows.is_empty() {
        return Err(received.no_strike(recorded.frames()).into());
    }
    let report = Report {
        identical: strikes.differ == 0,
        strikes: &strikes.rows,
        strikes_differ: strikes.differ,
        strikes_left_out: strikes.left_out,
    };
    output::print(arguments.format, &report, || table(&strikes))?;
    match strikes.first_difference {
        None => Ok(()),
        Some(what) => Err(failure!(Verdict, "replay differs: {what}")),
    }
}

fn table(strikes: &Shown) -> String {
    let rows = strikes.rows.iter().map(|strike| {
        [
            strike.strike.to_string(),
            strike.sample_index.to_string(),
            strike.samples.to_string(),
            strike.chunks.to_string(),
            output::either(strike.identical, "identical", "differs"),
        ]
    });
    let mut table = output::table("strike | sample index | samples | chunks | replay", rows);
    if strikes.left_out > 0 {
        table += &format!(
            "\n\n{} more not shown; {} of all strikes differ",
            count(strikes.left_out, "strike"),
            strikes.differ
        );
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_many_strikes_the_first_and_those_that_differ_are_shown_and_all_are_counted() {
        let mut shown = Shown::default();
        let last = SHOWN_MOST as u32 + 5000;
        for number in 0..last {
            let differs = number > last - 2000;
            shown.push(Strike {
                strike: number,
                sample_index: 0,
                samples: 672,
                chunks: 17,
                identical: !differs,
                first_difference: differs.then(|| format!("strike {number}")),
            });
        }
        assert_eq!(shown.rows.len() as u64, SHOWN_MOST + DIFFER_MOST);
        assert_eq!(shown.rows.len() as u64 + shown.left_out, u64::from(last));
        assert_eq!(shown.differ, 1999);
        assert_eq!(shown.first_difference, Some(format!("strike {}", last - 1999)));
    }
}
