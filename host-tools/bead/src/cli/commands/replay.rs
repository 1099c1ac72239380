//! `bead replay`: the recorded samples through the bead's own fixed-point code.

use crate::cli::commands::prelude::*;
use bead_compare::replay::replay;
use bead_compare::report::count;

const AFTER_HELP: &str = "\
Every energy of every chunk and every field of every strike is compared bit for bit, and the strike detector \
must fire at the same sample. Exit status 1 if anything differs; the first difference is told in SI units \
and in bits, with what it usually means. Of more than 100 000 strikes the first are shown, and those that \
differ.

Example:
  bead replay run/bead-8.mcap";

#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    /// The recording.
    recording: PathBuf,
    /// Format of the result.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// The result as JSON. Of the strikes, those that are shown: a recording may have more than memory holds.
#[derive(Default, Serialize, JsonSchema)]
pub(crate) struct ReplayReport {
    identical: bool,
    strikes: Vec<ReplayedStrike>,
    strikes_differ: u64,
    strikes_left_out: u64,
    #[serde(skip)]
    first_difference: Option<String>,
}

#[derive(Serialize, JsonSchema)]
struct ReplayedStrike {
    /// Address of the bead.
    bead: u8,
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

impl ReplayReport {
    fn push(&mut self, strike: ReplayedStrike) {
        self.strikes_differ += u64::from(!strike.identical);
        if self.first_difference.is_none() {
            self.first_difference = strike.first_difference.clone();
        }
        let shown = self.strikes.len() as u64;
        if shown < SHOWN_MOST || (!strike.identical && shown < SHOWN_MOST + DIFFER_MOST) {
            self.strikes.push(strike);
        } else {
            self.strikes_left_out += 1;
        }
    }

    fn table(&self) -> String {
        let rows = self.strikes.iter().map(|strike| {
            [
                strike.bead.to_string(),
                strike.strike.to_string(),
                strike.sample_index.to_string(),
                strike.samples.to_string(),
                strike.chunks.to_string(),
                output::either(strike.identical, "identical", "differs"),
            ]
        });
        let table = output::table("bead | strike | sample index | samples | chunks | replay", rows);
        if self.strikes_left_out == 0 {
            return table;
        }
        let left_out = count(self.strikes_left_out, "strike");
        format!(
            "{table}\n\n{left_out} more not shown; {} of all strikes differ",
            self.strikes_differ
        )
    }
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let received = Recording::open_named(&arguments.recording)?;
    let mut recorded = received.strikes()?;
    let mut report = ReplayReport::default();
    for strike in recorded.by_ref() {
        let replay = replay(&strike);
        report.push(ReplayedStrike {
            bead: strike.address,
            strike: strike.said.strike,
            sample_index: strike.said.trigger_index,
            samples: strike.scans.len(),
            chunks: strike.chunks.len(),
            identical: replay.identical(),
            first_difference: replay.first_difference,
        });
    }
    if report.strikes.is_empty() {
        return Err(received.no_strike(recorded.frames()).into());
    }
    report.identical = report.strikes_differ == 0;
    output::print(arguments.format, &report, || report.table())?;
    match report.first_difference {
        None => Ok(()),
        Some(what) => bail!(Verdict, "replay differs: {what}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_many_strikes_the_first_and_those_that_differ_are_shown_and_all_are_counted() {
        let mut shown = ReplayReport::default();
        let last = SHOWN_MOST as u32 + 5000;
        for number in 0..last {
            let differs = number > last - 2000;
            shown.push(ReplayedStrike {
                bead: 0,
                strike: number,
                sample_index: 0,
                samples: 672,
                chunks: 17,
                identical: !differs,
                first_difference: differs.then(|| format!("strike {number}")),
            });
        }
        assert_eq!(shown.strikes.len() as u64, SHOWN_MOST + DIFFER_MOST);
        assert_eq!(
            shown.strikes.len() as u64 + shown.strikes_left_out,
            u64::from(last)
        );
        assert_eq!(shown.strikes_differ, 1999);
        assert_eq!(shown.first_difference, Some(format!("strike {}", last - 1999)));
    }
}
