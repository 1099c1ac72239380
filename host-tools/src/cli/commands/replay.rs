//! `bead replay`: the recorded samples through the bead's own fixed-point code.

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;
use serde_json::json;

use crate::cli::failure::Failure;
use crate::cli::output::{self, Format};
use crate::comparison::replay::replay;
use crate::recording::received::Received;

const AFTER_HELP: &str = "\
Every energy of every chunk and every field of every strike is compared bit for bit, and the strike detector must
fire at the same sample. Exit status 1 if anything differs; the first difference is named.

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

#[derive(Serialize)]
struct Strike {
    strike: u32,
    sample_index: u64,
    samples: usize,
    chunks: usize,
    identical: bool,
    first_difference: Option<String>,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let received = Received::open(&arguments.recording)?;
    let mut recorded = received.strikes()?;
    let strikes: Vec<Strike> = recorded
        .by_ref()
        .map(|strike| {
            let replay = replay(&strike);
            Strike {
                strike: strike.said.strike,
                sample_index: strike.said.trigger_index,
                samples: strike.scans.len(),
                chunks: strike.chunks.len(),
                identical: replay.identical(),
                first_difference: replay.first_difference,
            }
        })
        .collect();
    if strikes.is_empty() {
        return Err(received.no_strike(recorded.frames()).into());
    }
    let identical = strikes.iter().all(|strike| strike.identical);
    let report = json!({ "identical": identical, "strikes": &strikes });
    output::print(arguments.format, &report, || table(&strikes))?;
    match strikes.into_iter().find_map(|strike| strike.first_difference) {
        None => Ok(()),
        Some(what) => Err(Failure::Verdict(format!("replay differs: {what}"))),
    }
}

fn table(strikes: &[Strike]) -> String {
    let rows = strikes.iter().map(|strike| {
        [
            strike.strike.to_string(),
            strike.sample_index.to_string(),
            strike.samples.to_string(),
            strike.chunks.to_string(),
            output::either(strike.identical, "identical", "differs"),
        ]
    });
    output::table("strike | sample index | samples | chunks | replay", rows)
}
