//! `bead simulate`: the full f64 chain.

use std::path::PathBuf;

use clap::Args;
use hertz_chain::{Options, Scenario, Summary, simulate_with, summarise};

use crate::cli::failure::Failure;
use crate::cli::output::{self, Format};
use crate::cli::place::{self, Force, Kind};
use crate::recording::time_series;

const AFTER_HELP: &str = "\
Examples:
  bead simulate docs/scenarios/paper-strike.toml
  bead simulate docs/scenarios/paper-strike.toml --format json | jq .energy
  bead simulate docs/scenarios/paper-strike.toml --out strike.parquet --rate 1e6";

/// Arguments of `bead simulate`.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    /// The scenario, a TOML file in SI units.
    scenario: PathBuf,
    /// Write the time series to this Parquet file, units in the column names.
    #[arg(long, value_name = "F.parquet")]
    out: Option<PathBuf>,
    /// Rows a second in that file, Hz.
    #[arg(long, value_name = "HZ", default_value_t = 1e6, requires = "out")]
    rate: f64,
    #[command(flatten)]
    force: Force,
    /// How to print the summary.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let scenario = Scenario::load(&arguments.scenario)?;
    let out = place::optional(
        arguments.out.as_deref(),
        Kind::Parquet,
        &[&arguments.scenario],
        arguments.force,
    )?;
    let progress = output::part_done(format!("of {} beads simulated", scenario.chain.beads));
    let told = |part| output::set_part(&progress, part);
    let options = Options {
        progress: Some(&told),
        ..Options::default()
    };
    let summary = match &out {
        // Without a file nothing is kept: a chain may have any length.
        None => summarise(&scenario, &options)?,
        Some(out) => {
            let solution = simulate_with(&scenario, &options)?;
            progress.set_message(format!("writing {}", out.path().display()));
            time_series::write(&scenario, &solution, arguments.rate, out)?;
            solution.summary()
        }
    };
    progress.finish_and_clear();
    output::print(arguments.format, &summary, || table(&scenario, &summary))
}

fn table(scenario: &Scenario, summary: &Summary) -> String {
    let mut parts = Vec::new();
    if !scenario.title.is_empty() {
        parts.push(scenario.title.clone());
    }

    let contacts = summary.peak_force.iter().map(|peak| {
        [
            peak.contact.to_string(),
            format!("{:.4}", peak.force),
            format!("{:.4}", peak.time * 1e3),
            peak.fwhm
                .map_or_else(|| "-".to_owned(), |width| format!("{:.4}", width * 1e3)),
        ]
    });
    parts.push(output::table(
        "contact | peak force (N) | at (ms) | width at half (ms)",
        contacts,
    ));

    if !summary.intruders.is_empty() {
        let intruders = summary.intruders.iter().map(|intruder| {
            [
                intruder.bead.to_string(),
                format!("{:.2}", intruder.acceleration_max),
                format!("{:.2}", intruder.acceleration_min),
                format!("{:.3}", intruder.relative_displacement_max * 1e6),
                format!("{:.2}", intruder.dissipated * 1e9),
            ]
        });
        let header =
            "intruder in bead | acceleration max (m/s²) | min (m/s²) | displacement (µm) | dissipated (nJ)";
        parts.push(output::table(header, intruders));
    }

    let energy = &summary.energy;
    let energies = [
        ("striker, initial", energy.striker_initial),
        ("striker, final", energy.striker_final),
        ("chain, final", energy.chain_final),
        ("intruders, final", energy.intruders_final),
        ("dissipated in contacts", energy.dissipated_contacts),
        ("dissipated in intruders", energy.dissipated_intruders),
        ("chain, highest", energy.chain_max),
    ]
    .map(|(name, joule)| {
        let part = format!("{:.3} %", joule / energy.striker_initial * 100.0);
        [name.to_owned(), format!("{:.4}", joule * 1e6), part]
    });
    parts.push(output::table("energy | µJ | of the striker's", energies));

    let solver = &summary.solver;
    parts.push(format!(
        "{:.3} ms simulated in {:.2} s: {} steps, {} evaluations, energy balance closes to {:.1e}",
        summary.final_state.time * 1e3,
        solver.seconds,
        solver.steps,
        solver.evaluations,
        energy.balance_error,
    ));
    parts.join("\n\n")
}
