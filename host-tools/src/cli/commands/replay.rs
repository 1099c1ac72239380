//! `bead replay`: the recorded samples through the bead's own fixed-point code.

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

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
struct Report {
    identical: bool,
    strikes: Vec<Strike>,
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
    let strikes: Vec<Strike> = received
        .some_strikes()?
        .iter()
        .map(|strike| {
            let replay = replay(strike);
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
    let report = Report {
        identical: strikes.iter().all(|strike| strike.identical),
        strikes,
    };
    match arguments.format {
        Format::Json => output::print_json(&report)?,
        Format::Table => output::print_line(&table(&report))?,
    }
    match report
        .strikes
        .into_iter()
        .find_map(|strike| strike.first_difference)
    {
        None => Ok(()),
        Some(what) => Err(Failure::Verdict(format!("replay differs: {what}"))),
    }
}

fn table(report: &Report) -> String {
    let mut table = output::table(["strike", "sample index", "samples", "chunks", "replay"]);
    for strike in &report.strikes {
        table.add_row([
            strike.strike.to_string(),
            strike.sample_index.to_string(),
            strike.samples.to_string(),
            strike.chunks.to_string(),
            (if strike.identical { "identical" } else { "differs" }).to_owned(),
        ]);
    }
    output::table_text(&table)
}
