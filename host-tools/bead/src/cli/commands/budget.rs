//! `bead budget`: the uncertainty of the energies of a strike.

use bead_model::design::{Day, Uncertainty};
use bead_wire::StrikeFlags;

use crate::cli::commands::compared::{made, no_strike, publish};
use crate::cli::commands::prelude::*;
use crate::cli::commands::settings_file;
use crate::cli::provenance::{name_of, sha256_of, today};
use bead_compare::budget::{BeadRatio, BudgetTables, StrikeBudget, ratios};
use bead_recording::physical::calibration_doubt;

const AFTER_HELP: &str = "\
A budget by the GUM (JCGM 100), for A, B and their difference: every input with its standard uncertainty, \
and its part in the result. Sensitivities are those of this strike: each input is moved in the settings, and the \
recorded codes are run through the bead's code again. The quiet before the strike gives the noise (type A). The \
settings state the other uncertainties; those that they do not state are named, and are missing from U.

--monte-carlo draws all inputs through the bead's code instead (JCGM 101) and says whether the linear budget holds. \
For several beads, the ratios of their energies to those of the first bead follow: uncertainties that both \
beads share cancel there.

Examples:
  bead budget run/bead-8.mcap
  bead budget run/bead-8.mcap --strike 3 --monte-carlo 100000
  bead budget monday.mcap --uncertainty bead.toml --page budget.html";

#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    /// The recording.
    recording: PathBuf,
    /// Which strike of each bead, counted from 0 [default: the first that is whole].
    #[arg(long, value_name = "N")]
    strike: Option<usize>,
    /// Take the uncertainties that these settings state in place of those in the recording.
    #[arg(long, value_name = "F.toml|F.settings")]
    uncertainty: Option<PathBuf>,
    /// Draw the inputs this many times through the bead's code, at least 1000.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1000..=10_000_000))]
    monte_carlo: Option<u32>,
    /// Also write the budget as an HTML page.
    #[arg(long, value_name = "F.html")]
    page: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Format of the result.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// The result as JSON.
#[derive(Serialize, JsonSchema)]
pub(crate) struct BudgetReport {
    /// One for each bead.
    beads: Vec<StrikeBudget>,
    /// Ratios to the first bead.
    ratios: Vec<BeadRatio>,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let inputs = [
        Some(arguments.recording.as_path()),
        arguments.uncertainty.as_deref(),
    ];
    let inputs: Vec<&Path> = inputs.into_iter().flatten().collect();
    let page = arguments
        .overwrite
        .optional(arguments.page.as_deref(), FileKind::Page, &inputs)?;
    let stated = settings_file::uncertainty(arguments.uncertainty.as_deref())?;
    let received = Recording::open_named(&arguments.recording)?;
    let progress = output::spinner("measuring again with each input moved");
    let mut beads = Vec::new();
    for of_bead in received.each() {
        let Some(strike) = chosen(&of_bead, arguments.strike)? else {
            continue;
        };
        if let Some(doubt) = doubt(&strike, stated) {
            progress.suspend(|| note!("bead {}: {doubt}", strike.address));
        }
        let doubts = strike.said.flags.without(StrikeFlags::FROM_OUTSIDE);
        if doubts != StrikeFlags::NONE {
            let (number, flags) = (strike.said.strike, doubts.names().collect::<Vec<_>>().join(", "));
            progress.suspend(|| {
                note!(
                    "strike {number} is flagged: {flags}; the budget does not include the errors behind these flags"
                );
            });
        }
        beads.push(StrikeBudget::of(&strike, stated, arguments.monte_carlo)?);
    }
    progress.finish_and_clear();
    if beads.is_empty() {
        return Err(match arguments.strike {
            Some(strike) => failure!(
                Input,
                "--strike {strike}: no bead of {} has a strike with this number, counted from 0",
                received.path.display()
            ),
            None => no_strike(&received),
        });
    }
    let report = BudgetReport {
        ratios: ratios(&beads),
        beads,
    };
    let of_uncertainty = match &arguments.uncertainty {
        Some(file) => ("uncertainties, SHA-256", sha256_of(file)?),
        None => ("uncertainties", "those in the recording's settings".to_owned()),
    };
    let tables = BudgetTables {
        recording: &name_of(&received.path),
        budgets: &report.beads,
        ratios: &report.ratios,
        made: &made(page.as_ref(), &received, of_uncertainty)?,
    };
    publish(arguments.format, page.as_ref(), &tables.report(), &report)
}

/// The strike with this number from 0; without one, the first that is whole, or the first.
fn chosen(of_bead: &Recording, number: Option<usize>) -> Result<Option<RecordedStrike>, Failure> {
    let mut strikes = of_bead.strikes()?;
    if let Some(number) = number {
        return Ok(strikes.nth(number));
    }
    let first = strikes.next();
    let is_whole = |strike: &RecordedStrike| strike.missing() == 0;
    match first {
        Some(first) if !is_whole(&first) => Ok(strikes.find(is_whole).or(Some(first))),
        first => Ok(first),
    }
}

/// A doubt about the calibration on the day of the strike, or today if that is not known.
fn doubt(strike: &RecordedStrike, stated: Option<Uncertainty>) -> Option<String> {
    // An emulated bead's times are since its power-up.
    let received = strike
        .received_ns
        .and_then(|ns| Day::at((ns / 1_000_000_000) as i64));
    let day = received.or_else(today)?;
    let mut description = *strike.settings.as_ref()?.description();
    description.uncertainty = stated.or(description.uncertainty);
    calibration_doubt(&description, day)
}
