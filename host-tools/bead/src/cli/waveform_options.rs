//! Reading of the file of a waveform: an option that `bead emulate` and `bead compare` share.

use std::path::Path;

use clap::Args;

use bead_console::failure::Failure;
use bead_console::output::positive;
use bead_instrument::{Choice, Waveform};

/// Option that says what is in a file with a waveform.
#[derive(Debug, Args)]
pub(crate) struct WaveformOptions {
    /// Content of the waveform's file, where the file does not state it; repeat for each item.
    /// force=COLUMN[:UNIT] and acceleration=…: a column by name or number, or a channel of a WAV file by
    /// number; after a colon, what 1 in it means: force=force_n, force=CH1:8.9N, acceleration=3:10g.
    /// time=t:ms: the column of time, in seconds without a unit; or rate=HZ: rows a second. strike=N: which
    /// strike of a recording, or of a table that `bead export` wrote, counted from 0 [default: the columns
    /// with units of force and acceleration, the first column of time, strike 0].
    #[arg(long, value_name = "ITEM=VALUE", value_parser = item)]
    read: Vec<String>,
}

/// Checks an item of `--read`, and returns it as typed.
fn item(text: &str) -> Result<String, String> {
    set(&mut Choice::default(), text).map(|_| text.to_owned())
}

/// Takes an item into a choice. True if that had the item already.
fn set(choice: &mut Choice, text: &str) -> Result<bool, String> {
    let odd = || "give force=, acceleration=, time=, rate= or strike=, as in force=CH1:8.9N".to_owned();
    let (item, value) = text.split_once('=').ok_or_else(odd)?;
    let strike = || {
        value
            .parse::<usize>()
            .map_err(|_| "give a whole number, 0 or more".to_owned())
    };
    Ok(match item {
        "time" => choice.time.replace(value.parse()?).is_some(),
        "force" => choice.force.replace(value.parse()?).is_some(),
        "acceleration" => choice.acceleration.replace(value.parse()?).is_some(),
        "rate" => choice.rate_hz.replace(positive(value)?).is_some(),
        "strike" => choice.strike.replace(strike()?).is_some(),
        _ => return Err(odd()),
    })
}

impl WaveformOptions {
    /// Refuses items where `file` is not given, since nothing would read them.
    pub(crate) fn without(&self, file: &str) -> Result<(), Failure> {
        if self.read.is_empty() {
            return Ok(());
        }
        bail!(Input, "--read describes the file of {file}; give {file} too")
    }

    pub(crate) fn read(&self, path: &Path, bead: Option<usize>) -> Result<Waveform, Failure> {
        Ok(Waveform::read(path, &self.choice()?, bead)?)
    }

    /// The content of the file, as far as the options state it.
    pub(crate) fn choice(&self) -> Result<Choice, Failure> {
        let mut choice = Choice::default();
        for item in &self.read {
            if set(&mut choice, item).map_err(Failure::input)? {
                bail!(Input, "--read gives an item twice; give each once");
            }
        }
        if choice.time.is_some() && choice.rate_hz.is_some() {
            bail!(
                Input,
                "--read gives both time and rate; leave one out, as the rate replaces a column of time"
            );
        }
        Ok(choice)
    }
}
