//! Work and precision of the chain simulator and of general solvers, in one process.
//!
//! Exit status: 0 if it ran, whether or not each target is met; 2 for words that it does not know.

mod cases;
mod ensemble;
mod growth;
mod ours;
mod peers;
mod python;
mod report;
mod single;

use clap::{Parser, ValueEnum};

use crate::report::Report;

/// Times the chain simulator and general solvers for a given error, one after another in one process.
#[derive(Debug, Parser)]
struct Words {
    /// How to print the results.
    #[arg(long, value_enum, default_value = "table")]
    format: Format,
    /// Time each solver a few times only: for a look, not for numbers to quote.
    #[arg(long)]
    quick: bool,
    /// Time solvers of Python too, those that are installed: SciPy, numba, diffrax, heyoka. BEAD_PYTHON names the
    /// Python [default: python3].
    #[arg(long)]
    peers: bool,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Format {
    Table,
    Json,
}

fn main() {
    let words = Words::parse();
    let rounds = if words.quick { 5 } else { 60 };
    let mut report = Report::new();
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
    eprintln!("growth with the chain");
    growth::measure(&mut report, words.quick);
    eprintln!("an ensemble");
    ensemble::measure(&mut report, words.quick);
    if words.peers {
        match python::rows(&cases) {
            Ok(rows) => report.peers = rows,
            Err(why) => eprintln!("no solvers of Python: {why}"),
        }
    }
    match words.format {
        Format::Table => print!("{report}"),
        Format::Json => println!("{}", report.json()),
    }
}
