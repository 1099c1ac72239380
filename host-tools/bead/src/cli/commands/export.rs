//! `bead export`: strikes and samples for other programs.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::sync::Arc;

use clap::ValueEnum;
use indicatif::ProgressBar;

use crate::cli::commands::prelude::*;
use crate::cli::recordings::open_all;
use crate::cli::table_file::begin;
use bead_compare::report::count;
use bead_recording::export::{samples, strikes as strikes_table, uff};
use bead_recording::file::RecordingError;

const AFTER_HELP: &str = "\
Parquet and CSV are two tables: `strikes` has a row for each strike of each bead, with the bead's result and \
the settings that it measured with; `samples` has a row for each sample of each window. `id` joins them. All \
values are in SI units, which end the names of the columns. Columns that end in _raw hold the bits that the \
bead computed, columns that end in _code the codes of its converter. docs/export.md explains each column.

UFF is one file of datasets of type 58: force and acceleration of each strike over time.

Examples:
  bead export run/bead-8.mcap --out tables
  bead export monday/*.mcap --out monday/tables --format csv
  bead export run/bead-8.mcap --out tables --format uff";

/// Form of the exported files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
enum ExportForm {
    /// `strikes.parquet` and `samples.parquet`.
    #[default]
    Parquet,
    /// `strikes.csv` and `samples.csv`.
    Csv,
    /// `strikes.uff`: Universal File Format, datasets of type 58.
    Uff,
}

#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    /// Recordings made by `bead record` or `bead emulate`.
    #[arg(value_name = "F.mcap", required = true)]
    recordings: Vec<PathBuf>,
    /// The directory for the files; it is made if it is not there.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// The form of the files.
    #[arg(long, value_enum, default_value_t)]
    format: ExportForm,
    #[command(flatten)]
    overwrite: Overwrite,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let recordings = open_all(&arguments.recordings)?;
    let (out, form) = (arguments.out.as_path(), arguments.format);
    let inputs: Vec<&Path> = arguments.recordings.iter().map(PathBuf::as_path).collect();
    let files = match form {
        ExportForm::Parquet => vec![
            ("strikes.parquet", FileKind::Parquet),
            ("samples.parquet", FileKind::Parquet),
        ],
        ExportForm::Csv => vec![("strikes.csv", FileKind::Table), ("samples.csv", FileKind::Table)],
        ExportForm::Uff => vec![("strikes.uff", FileKind::Universal)],
    };
    let targets = place::targets(out, files, &inputs, arguments.overwrite)?;
    place::make_directory(out)?;
    let mut tally = Tally {
        recordings: &recordings,
        strikes: 0,
        samples: 0,
        without_settings: 0,
        left_out: 0,
        progress: output::spinner("reading"),
    };
    match &targets[..] {
        [strikes, samples] => strikes
            .write(|strikes| Ok(samples.write(|samples| tables(form, strikes, samples, &mut tally))?))?,
        one => one[0].write(|file| universal(file, &mut tally))?,
    }
    tally.end(out);
    output::print_line(&opened_by(form, out))
}

/// The recordings, counts of the written strikes, and the progress.
struct Tally<'a> {
    recordings: &'a [Recording],
    strikes: u64,
    samples: u64,
    /// Strikes without settings. Their samples have only codes.
    without_settings: u64,
    /// Strikes that were not written.
    left_out: u64,
    progress: ProgressBar,
}

impl Tally<'_> {
    /// Calls `write` for every strike with its number and the name of its recording. `write` returns true if
    /// it wrote the strike; only those are counted.
    fn each(
        &mut self,
        mut write: impl FnMut(u64, &Arc<str>, &RecordedStrike) -> anyhow::Result<bool>,
    ) -> anyhow::Result<()> {
        let all = self.recordings.len();
        for (number, received) in (1..).zip(self.recordings) {
            let name: Arc<str> = received.path.display().to_string().into();
            let (mut strikes, before) = (received.strikes()?, self.strikes + self.left_out);
            for strike in strikes.by_ref() {
                if write(self.strikes, &name, &strike)? {
                    self.strikes += 1;
                    self.samples += strike.received() as u64;
                    self.without_settings += u64::from(strike.settings.is_none());
                } else {
                    self.left_out += 1;
                }
                let status = format!("recording {number} of {all}: {} strikes", self.strikes);
                self.progress.set_message(status);
            }
            if self.strikes + self.left_out == before {
                match received.no_strike(strikes.frames()) {
                    future @ RecordingError::FromTheFuture { .. } => return Err(future.into()),
                    _ => self.progress.suspend(|| note!("{name}: no strike in it")),
                }
            }
        }
        Ok(())
    }

    fn end(&self, out: &Path) {
        self.progress.finish_and_clear();
        let (recordings, strikes) = (self.recordings.len() as u64, self.strikes);
        note!(
            "{} with {} samples, of {}, now in {}",
            count(strikes, "strike"),
            self.samples,
            count(recordings, "recording"),
            out.display()
        );
        if self.without_settings > 0 {
            note!(
                "{} of them came without settings, so their samples are codes, not in SI units",
                self.without_settings
            );
        }
        if self.left_out > 0 {
            note!(
                "{} more {} not written: SI units need settings and a quiet start; --format parquet and csv write the codes",
                self.left_out,
                output::either(self.left_out == 1, "strike is", "strikes are"),
            );
        }
    }
}

fn tables(
    form: ExportForm,
    strikes: &mut File,
    samples: &mut File,
    tally: &mut Tally<'_>,
) -> anyhow::Result<()> {
    let is_csv = form == ExportForm::Csv;
    let mut strike_table = begin(strikes, is_csv, "strikes", &strikes_table::columns())?;
    let mut sample_table = begin(samples, is_csv, "samples", &samples::columns())?;
    tally.each(|id, recording, strike| {
        strike_table.push(strikes_table::row(id, recording, strike))?;
        samples::rows(id, recording, strike).try_for_each(|row| sample_table.push(row))?;
        Ok(true)
    })?;
    strike_table.finish()?;
    sample_table.finish()
}

fn universal(file: &mut File, tally: &mut Tally<'_>) -> anyhow::Result<()> {
    let mut out = BufWriter::new(file);
    uff::begin(&mut out)?;
    tally.each(|_, recording, strike| Ok(uff::strike(&mut out, recording, strike)?))?;
    Ok(out.flush()?)
}

/// Lines of other programs that open the files.
fn opened_by(form: ExportForm, out: &Path) -> String {
    let path = |name: &str| format!("{:?}", out.join(name).display().to_string());
    if form == ExportForm::Uff {
        let strikes = path("strikes.uff");
        return format!("pyuff   pyuff.UFF({strikes}).read_sets()\nMATLAB  readuff({strikes})");
    }
    let (samples, read, matlab) = match form {
        ExportForm::Csv => (path("samples.csv"), "read_csv", "readtable"),
        _ => (path("samples.parquet"), "read_parquet", "parquetread"),
    };
    let cube = "set_index([\"id\", \"sample\"])[[\"force_n\", \"acceleration_mps2\"]].to_xarray()";
    format!(
        "pandas  pandas.{read}({samples})\npolars  polars.{read}({samples})\n\
         xarray  pandas.{read}({samples}).{cube}\nMATLAB  {matlab}({samples})"
    )
}
