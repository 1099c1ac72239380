//! `bead figures`: the paper's figures, each with its data and its checks.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;

use hertz_figures::lab::Lab;
use hertz_figures::plan::{Outcome, Plan};
use hertz_figures::{catalogue, chapter, files};

use crate::cli::failure::{Blame, Failure};
use crate::cli::output::{self, Format};

const AFTER_HELP: &str = "\
Each figure is written as figure-NAME.svg, .png, .csv and .parquet, an animation as .gif too; index.html shows them all
with their checks.

Examples:
  bead figures --list
  bead figures 5b
  bead figures 6 A4
  bead figures --check --out figures
  bead figures --check --format json | jq '.[] | select(.pass | not)'";

/// Arguments of `bead figures`.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    /// The figures, as the paper numbers them, such as 2a, or 2 for all of Fig. 2; every figure without a name.
    names: Vec<String>,
    /// Where the files go; made if it is not there.
    #[arg(long, value_name = "DIR", default_value = "figures")]
    out: PathBuf,
    /// End with status 1 if a check says no.
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

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let plans = catalogue::chosen(&arguments.names)?;
    if arguments.list {
        return list(&plans, arguments.format);
    }
    std::fs::create_dir_all(&arguments.out).or_input(|| {
        format!(
            "cannot make the directory {}; name another with --out",
            arguments.out.display()
        )
    })?;
    let progress = output::progress(plans.len() as u64);
    let lab = Lab::default();
    let mut outcomes = Vec::new();
    let mut plate = "";
    for plan in &plans {
        progress.set_message(format!("figure {}: {}", plan.name, plan.title));
        if plan.plate() != plate {
            lab.clear();
            plate = plan.plate();
        }
        let figure = plan.draw(&lab)?;
        let mut files = Vec::new();
        for file in files::files(plan, &figure)? {
            let path = arguments.out.join(&file.name);
            output::write_whole(&path, |out| Ok(out.write_all(&file.bytes)?))?;
            files.push(path.display().to_string());
        }
        outcomes.push(plan.outcome(&figure, files));
        progress.inc(1);
    }
    progress.finish_and_clear();
    let page = chapter::html(&outcomes);
    output::write_whole(&arguments.out.join("index.html"), |file| {
        Ok(file.write_all(page.as_bytes())?)
    })?;
    if let Some(path) = &arguments.table {
        let table = chapter::markdown(&outcomes);
        output::write_whole(path, |file| Ok(file.write_all(table.as_bytes())?))?;
    }
    match arguments.format {
        Format::Json => output::print_json(&outcomes)?,
        Format::Table => output::print_line(&table(&outcomes))?,
    }
    verdict(&outcomes, arguments.check)
}

fn list(plans: &[Plan], format: Format) -> Result<(), Failure> {
    match format {
        Format::Json => {
            let entries: Vec<_> = plans
                .iter()
                .map(|plan| serde_json::json!({"name": plan.name, "title": plan.title, "setting": plan.setting}))
                .collect();
            output::print_json(&entries)
        }
        Format::Table => {
            let lines: Vec<String> = plans
                .iter()
                .map(|plan| format!("{:<5} {}\n      {}", plan.name, plan.title, plan.setting))
                .collect();
            output::print_line(&lines.join("\n"))
        }
    }
}

fn verdict(outcomes: &[Outcome], check: bool) -> Result<(), Failure> {
    let failed: Vec<&str> = outcomes
        .iter()
        .filter(|outcome| !outcome.pass)
        .map(|outcome| outcome.name)
        .collect();
    if !check || failed.is_empty() {
        return Ok(());
    }
    Err(Failure::Verdict(format!(
        "{} of {} figures out of tolerance: {}; the table says which check",
        failed.len(),
        outcomes.len(),
        failed.join(", ")
    )))
}

fn table(outcomes: &[Outcome]) -> String {
    let mut table = output::table(["figure and check", "value", "expected", "unit", ""]);
    for outcome in outcomes {
        for check in &outcome.checks {
            table.add_row([
                format!("{:<5} {}", outcome.name, check.what),
                chapter::number(check.value),
                chapter::expectation(check),
                check.unit.to_owned(),
                if check.pass { "ok" } else { "FAILED" }.to_owned(),
            ]);
        }
    }
    output::table_text(&table)
}
