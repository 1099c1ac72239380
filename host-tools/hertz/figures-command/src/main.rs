//! `bead figures`: the paper's figures, each with its data and its checks.

mod drawing;
mod files;
mod pdf;
mod pixels;

use std::path::PathBuf;
use std::process::ExitCode;

use bead_console::failure::Failure;
use bead_console::interrupt;
use bead_console::output::{self, Format};
use bead_console::place::{self, FileKind, Overwrite};
use clap::Parser;
use hertz_figures::lab::Lab;
use hertz_figures::plan::{FigureOutcome, FigurePlan};
use hertz_figures::{catalogue, chapter, plate};
use serde_json::json;

const AFTER_HELP: &str = "\
Each figure is written as figure-NAME.svg, .png, .pdf, .csv and .parquet, an animation as .gif too. If all \
figures of a plate are drawn, plate-NUMBER.svg, .png and .pdf show them as one: (a), (b), (c). index.html \
shows all with their checks.

Examples:
  bead figures --list
  bead figures 5b
  bead figures 6 A4
  bead figures --check --out figures
  bead figures --check --format json | jq '.[] | select(.pass | not)'";

/// Draw the paper's figures, with their data and their checks.
#[derive(Debug, Parser)]
#[command(name = "bead figures", bin_name = "bead figures", version, after_help = AFTER_HELP)]
struct Arguments {
    /// The figures, as the paper numbers them, such as 2a, or 2 for all of Fig. 2; all figures if none is
    /// named.
    names: Vec<String>,
    /// Folder for the files; it is created if it does not exist.
    #[arg(long, value_name = "DIR", default_value = "figures")]
    out: PathBuf,
    #[command(flatten)]
    overwrite: Overwrite,
    /// End with status 1 if a check fails.
    #[arg(long)]
    check: bool,
    /// Write the checks to this file too, as a Markdown table.
    #[arg(long, value_name = "F.md")]
    table: Option<PathBuf>,
    /// Print the names and what the figures show, and draw nothing.
    #[arg(long)]
    list: bool,
    /// How to print the checks.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            output::note(format_args!("{failure}"));
            ExitCode::from(&failure)
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), Failure> {
    interrupt::watch().map_err(|why| Failure::input(format!("cannot listen for signals: {why}")))?;
    let plans = catalogue::chosen(&arguments.names).map_err(Failure::input)?;
    if arguments.list {
        return list(&plans, arguments.format);
    }
    let place = |name: &str, kind| {
        place::targets(&arguments.out, [(name, kind)], &[], arguments.overwrite).map(|mut one| one.remove(0))
    };
    let index = place("index.html", FileKind::Page)?;
    for plan in &plans {
        for (extension, kind) in files::KINDS {
            place(&format!("figure-{}.{extension}", plan.name), kind)?;
        }
    }
    for number in plate::whole(&plans) {
        for (extension, kind) in &files::KINDS[..files::PLATE_KINDS] {
            place(&format!("plate-{number}.{extension}"), *kind)?;
        }
    }
    place::make_directory(&arguments.out)?;
    let table_file = arguments
        .overwrite
        .optional(arguments.table.as_deref(), FileKind::Text, &[])?;
    let progress = output::progress(plans.len() as u64);
    let lab = Lab::default();
    let mut outcomes = Vec::new();
    for number in plate::numbers(&plans) {
        let mut drawn = Vec::new();
        for plan in plans.iter().filter(|plan| plan.plate() == number) {
            progress.set_message(format!("figure {}: {}", plan.name, plan.title));
            let figure = plan.draw(&lab).map_err(Failure::input)?;
            outcomes.push(plan.outcome(&figure, files::write(plan, &figure, place)?));
            drawn.push((*plan, figure));
            progress.inc(1);
        }
        if let Some(plate) = plate::assemble(&drawn) {
            let files = files::write_plate(number, &plate, place)?;
            let first = outcomes.len() - drawn.len();
            outcomes[first..]
                .iter_mut()
                .for_each(|outcome| outcome.plate_files.clone_from(&files));
        }
        lab.clear();
    }
    progress.finish_and_clear();
    index.write_bytes(chapter::html(&outcomes))?;
    if let Some(file) = &table_file {
        file.write_bytes(chapter::markdown(&outcomes))?;
    }
    output::print(arguments.format, &outcomes, || table(&outcomes))?;
    verdict(&outcomes, arguments.check)
}

fn list(plans: &[FigurePlan], format: Format) -> Result<(), Failure> {
    let entry = |plan: &FigurePlan| json!({"name": plan.name, "title": plan.title, "setting": plan.setting});
    let line = |plan: &FigurePlan| format!("{:<5} {}\n      {}", plan.name, plan.title, plan.setting);
    let entries: Vec<_> = plans.iter().map(entry).collect();
    output::print(format, &entries, || {
        plans.iter().map(line).collect::<Vec<_>>().join("\n")
    })
}

fn verdict(outcomes: &[FigureOutcome], check: bool) -> Result<(), Failure> {
    let failed = outcomes.iter().filter(|outcome| !outcome.pass);
    let failed: Vec<&str> = failed.map(|outcome| outcome.name).collect();
    if !check || failed.is_empty() {
        return Ok(());
    }
    Err(Failure::verdict(format_args!(
        "{} of {} figures are out of tolerance: {}; the table says which check",
        failed.len(),
        outcomes.len(),
        failed.join(", ")
    )))
}

fn table(outcomes: &[FigureOutcome]) -> String {
    let rows = outcomes.iter().flat_map(|outcome| {
        outcome.checks.iter().map(|check| {
            [
                format!("{:<5} {}", outcome.name, check.what),
                chapter::number(check.value),
                chapter::expectation(check),
                check.unit.to_owned(),
                output::either(check.pass, "ok", "FAILED"),
            ]
        })
    });
    output::table("figure and check | value | expected | unit |", rows)
}
