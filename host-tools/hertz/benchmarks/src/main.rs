//! Work and precision of the chain simulator and of general solvers, in one process.
//!
//! Exit status: 0 if it ran, whether or not each target is met; 1 if a picture cannot be written or a program
//! not be run; 2 for words that it does not know.

mod cases;
mod designs;
mod ensemble;
mod growth;
mod kept;
mod machine;
mod ours;
mod pace;
mod peers;
mod picture;
mod python;
mod report;
mod sensitivities;
mod single;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, ValueEnum};

use crate::report::Measurements;

/// Times the chain simulator and general solvers for a given error, one after another in one process.
#[derive(Debug, Parser)]
struct Words {
    /// How to print the results.
    #[arg(long, value_enum, default_value = "table")]
    format: PrintFormat,
    /// Time each solver a few times only: for a look, not for numbers to quote.
    #[arg(long)]
    quick: bool,
    /// Time diffrax too, a solver of Python: pip install numpy jax diffrax. BEAD_PYTHON names the Python
    /// [default: python3].
    #[arg(long)]
    peers: bool,
    /// Draw time over error for each case into this folder: work-precision-a.svg, work-precision-b.svg.
    #[arg(long, value_name = "FOLDER")]
    plots: Option<PathBuf>,
    /// Compare with this program too: the same one, compiled for this processor.
    #[arg(long, value_name = "PROGRAM")]
    native: Option<PathBuf>,
    /// Print some times in one line and end: what `--native` runs.
    #[arg(long, hide = true)]
    pace: bool,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum PrintFormat {
    Table,
    Json,
}

fn main() -> ExitCode {
    let words = Words::parse();
    if words.pace {
        pace::print();
        return ExitCode::SUCCESS;
    }
    match measure(&words) {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("error: {why}");
            ExitCode::FAILURE
        }
    }
}

fn measure(words: &Words) -> Result<(), String> {
    // A picture that cannot be written is known before the minutes of measuring.
    if let Some(folder) = &words.plots {
        std::fs::create_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    }
    let rounds = if words.quick { 5 } else { 60 };
    let mut report = Measurements::new();
    let cases = cases::Case::all();
    for case in &cases {
        for sampled in [false, true] {
            eprintln!(
                "{}, {}",
                case.name,
                if sampled { "1000 samples" } else { "end only" }
            );
            report.add(single::compare(case, sampled, rounds));
        }
    }
    eprintln!("runs that keep their motion");
    kept::measure(&mut report, &cases, words.quick);
    eprintln!("growth with the chain");
    growth::measure(&mut report, words.quick);
    eprintln!("an ensemble");
    ensemble::measure(&mut report, words.quick);
    eprintln!("a search");
    designs::measure(&mut report, words.quick);
    eprintln!("derivatives");
    sensitivities::measure(&mut report, words.quick);
    if let Some(native) = &words.native {
        eprintln!("beside a native program");
        pace::compare(&mut report, native, if words.quick { 2 } else { 10 })?;
    }
    if words.peers {
        let ends = report.comparisons.iter().filter(|comparison| !comparison.sampled);
        let accuracies: Vec<_> = ends.map(|comparison| comparison.rows[0].accuracy).collect();
        match python::rows(&cases, &accuracies) {
            Ok(rows) => report.peers = rows,
            Err(why) => eprintln!("no solver of Python: {why}"),
        }
    }
    if let Some(folder) = &words.plots {
        picture::draw(&report, folder)?;
    }
    match words.format {
        PrintFormat::Table => print!("{report}"),
        PrintFormat::Json => println!("{}", report.json()),
    }
    Ok(())
}
