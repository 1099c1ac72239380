//! `bead replay`: the recorded samples through the bead's own fixed-point code.

use crate::cli::commands::prelude::*;
use std::collections::BTreeMap;

use bead_compare::drift::{Drift, DriftMean, LEAST_STRIKES};
use bead_compare::replay::{ReplayWord, replay};
use bead_compare::report::count;

const AFTER_HELP: &str = "\
Every energy of every chunk and every field of every strike is compared bit for bit, and the strike detector \
must fire at the same sample. Exit status 1 if anything differs; the first difference is shown in SI units \
and in bits, with its usual cause. A strike with lost samples is replayed up to the first of them and is \
\"incomplete\": exit status 1, too. Of more than 100 000 strikes only the first and those that differ are shown.

For a bead with five strikes or more, the means of k, c and the gains, as the waveforms show them, are compared with \
its settings. A mean that is off by three standard errors, and by more than a good bead may be, is marked \
\"drifting\"; the exit status stays the same.

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
    strikes_incomplete: u64,
    strikes_left_out: u64,
    /// Means over the strikes of each bead since its settings changed last.
    drift: Vec<BeadDrift>,
    /// The first difference, or else the first reason why a strike could not be replayed to its end.
    #[serde(skip)]
    failure: Option<String>,
}

#[derive(Serialize, JsonSchema)]
struct BeadDrift {
    /// Address of the bead.
    bead: u8,
    means: Vec<DriftMean>,
}

#[derive(Serialize, JsonSchema)]
struct ReplayedStrike {
    /// Address of the bead.
    bead: u8,
    strike: u32,
    sample_index: u64,
    /// Samples of it that were received.
    samples: usize,
    chunks: usize,
    identical: bool,
    /// In one word.
    replay: ReplayWord,
    first_difference: Option<String>,
    /// Cause for which it was not replayed to its end.
    incomplete: Option<String>,
    #[serde(skip)]
    failure: Option<String>,
}

/// Number of strikes that are shown, and of strikes beyond these that differ.
const SHOWN_MOST: u64 = 100_000;
const DIFFER_MOST: u64 = 1000;

impl ReplayReport {
    fn push(&mut self, strike: ReplayedStrike) {
        let differs = strike.replay == ReplayWord::Differs;
        if self.failure.is_none() || (differs && self.strikes_differ == 0) {
            self.failure = self
                .failure
                .take()
                .filter(|_| !differs)
                .or(strike.failure.clone());
        }
        self.strikes_differ += u64::from(differs);
        self.strikes_incomplete += u64::from(strike.replay == ReplayWord::Incomplete);
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
                strike.replay.name().to_owned(),
            ]
        });
        let mut table = output::table("bead | strike | sample index | samples | chunks | replay", rows);
        let means = self
            .drift
            .iter()
            .flat_map(|of| of.means.iter().map(|mean| (of.bead, mean)));
        let judged: Vec<_> = means.filter(|(_, mean)| mean.strikes >= LEAST_STRIKES).collect();
        if !judged.is_empty() {
            let rows = judged.into_iter().map(|(bead, mean)| {
                [
                    bead.to_string(),
                    mean.quantity.to_owned(),
                    mean.strikes.to_string(),
                    format!("{:+.2} ± {:.2}", 100.0 * mean.mean, 100.0 * mean.standard_error),
                    output::either(mean.drifting, "drifting", "").to_owned(),
                ]
            });
            let drift = output::table("bead | mean of | strikes | off its settings (%) |", rows);
            table = format!("{table}\n\n{drift}");
        }
        if self.strikes_left_out == 0 {
            return table;
        }
        let left_out = count(self.strikes_left_out, "strike");
        format!(
            "{table}\n\n{left_out} more not shown; {} of all strikes differ, {} are incomplete",
            self.strikes_differ, self.strikes_incomplete
        )
    }
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let received = Recording::open_named(&arguments.recording)?;
    let mut recorded = received.strikes()?;
    let mut report = ReplayReport::default();
    let mut drifts = BTreeMap::<u8, Drift>::new();
    for strike in recorded.by_ref() {
        drifts.entry(strike.address).or_default().add(&strike);
        let replay = replay(&strike);
        report.push(ReplayedStrike {
            bead: strike.address,
            strike: strike.said.strike,
            sample_index: strike.said.trigger_index,
            samples: strike.received(),
            chunks: strike.chunks.len(),
            identical: replay.identical(),
            replay: replay.word(),
            failure: replay.failure(),
            first_difference: replay.first_difference,
            incomplete: replay.incomplete,
        });
    }
    if report.strikes.is_empty() {
        return Err(received.no_strike(recorded.frames()).into());
    }
    report.identical = report.failure.is_none();
    let means = |(bead, drift): (u8, Drift)| BeadDrift {
        bead,
        means: drift.means(),
    };
    report.drift = drifts.into_iter().map(means).collect();
    output::print(arguments.format, &report, || report.table())?;
    match report.failure {
        None => Ok(()),
        Some(what) => bail!(Verdict, "{what}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_many_strikes_the_first_and_those_that_differ_are_shown_and_all_are_counted() {
        let mut shown = ReplayReport::default();
        let last = SHOWN_MOST as u32 + 5000;
        let output_of = |number| match number {
            _ if number <= last - 2000 => ReplayWord::Identical,
            _ if number < last - 1997 => ReplayWord::Incomplete,
            _ => ReplayWord::Differs,
        };
        for number in 0..last {
            let differs = number > last - 2000;
            shown.push(ReplayedStrike {
                bead: 0,
                strike: number,
                sample_index: 0,
                samples: 672,
                chunks: 17,
                identical: !differs,
                replay: output_of(number),
                failure: differs.then(|| format!("strike {number}")),
                first_difference: None,
                incomplete: None,
            });
        }
        assert_eq!(shown.strikes.len() as u64, SHOWN_MOST + DIFFER_MOST);
        assert_eq!(
            shown.strikes.len() as u64 + shown.strikes_left_out,
            u64::from(last)
        );
        assert_eq!((shown.strikes_differ, shown.strikes_incomplete), (1997, 2));
        // A difference is graver than a gap before it.
        assert_eq!(shown.failure, Some(format!("strike {}", last - 1997)));
    }
}
