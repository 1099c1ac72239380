//! Which columns of a waveform's file are meant: options that `bead emulate` and `bead compare` share.

use std::path::Path;

use clap::Args;

use crate::cli::failure::Failure;
use bead_instrument::{Choice, Wanted, Waveform};

/// Options that say what is in a file with a waveform.
#[derive(Debug, Args)]
#[command(next_help_heading = "Columns of the waveform's file")]
pub(crate) struct WaveformOptions {
    /// The force: a column by name or number, a channel of a WAV file by number; behind a colon what 1 of it
    /// is, if the file does not say: force_n, CH1:8.9N, 2:500N [default: the column with a unit of force].
    #[arg(long, value_name = "COLUMN[:UNIT]")]
    force_column: Option<Wanted>,
    /// The acceleration, in the same way: CH2:98m/s2, 3:10g [default: the column with a unit of
    /// acceleration].
    #[arg(long, value_name = "COLUMN[:UNIT]")]
    acceleration_column: Option<Wanted>,
    /// The time, in the same way: t:ms [default: the first column of time; without a unit it is in seconds].
    #[arg(long, value_name = "COLUMN[:UNIT]")]
    time_column: Option<Wanted>,
    /// Rows a second, in place of a column of time.
    #[arg(long, value_name = "HZ", conflicts_with = "time_column")]
    sample_rate: Option<f64>,
    /// Which strike of a recording, or of a table that `bead export` wrote, counted from 0 in the file
    /// [default: 0].
    #[arg(long, value_name = "N")]
    waveform_strike: Option<usize>,
}

impl WaveformOptions {
    /// Refuses options that nothing would look at, since `file` is not given.
    pub(crate) fn without(&self, file: &str) -> Result<(), Failure> {
        let given = [
            ("--force-column", self.force_column.is_some()),
            ("--acceleration-column", self.acceleration_column.is_some()),
            ("--time-column", self.time_column.is_some()),
            ("--sample-rate", self.sample_rate.is_some()),
            ("--waveform-strike", self.waveform_strike.is_some()),
        ];
        match given.iter().find(|(_, given)| *given) {
            Some((option, _)) => Err(Failure::input(format!(
                "{option} is of the file of {file}; give that too"
            ))),
            None => Ok(()),
        }
    }

    /// Reads a waveform. `bead` is the one that is meant, if the file is a recording of several.
    pub(crate) fn read(&self, path: &Path, bead: Option<usize>) -> Result<Waveform, Failure> {
        if let Some(rate) = self.sample_rate.filter(|rate| !(*rate > 0.0 && rate.is_finite())) {
            return Err(Failure::input(format!(
                "--sample-rate {rate}: give more than 0, in Hz"
            )));
        }
        let choice = Choice {
            time: self.time_column.clone(),
            force: self.force_column.clone(),
            acceleration: self.acceleration_column.clone(),
            rate_hz: self.sample_rate,
            strike: self.waveform_strike,
        };
        Ok(Waveform::read(path, &choice, bead)?)
    }
}
