//! `bead proof identify`: beads whose parameters are drawn, which identification has to find.

use super::measure::on_all_cores;
use crate::cli::commands::prelude::*;
use bead_bench::identification::{IdentificationCoverage, Nominal};

const AFTER_HELP: &str = "\
k, c, Young's modulus, tau and the striker's speed of each bead are drawn within 20 % of the paper's. The f64 \
chain strikes the bead, front end and noise make its codes (5 mN, 0.05 m/s²), and `bead identify --scenario` starts \
from the paper's values. Of the 95 % intervals, 93 to 97 % must contain the truth, the rank of the truth within the \
stated normal distribution must be uniform (chi-squared, p > 0.01), k must be within 0.5 % and c within 2 %.

Exit status 1 if any of this does not hold.

Examples:
  bead proof identify
  bead proof identify --beads 100 --seed 2 --format json";

#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    /// Beads to draw.
    #[arg(long, value_name = "N", default_value_t = 500, value_parser = clap::value_parser!(u32).range(20..=100_000))]
    beads: u32,
    /// Strikes of each bead.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=100))]
    strikes: u32,
    /// Seed of the draws and of the noise: the same seed gives the same table.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Format of the result.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// Result of `bead proof identify`.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct IdentifyProof {
    /// Strikes of each bead.
    strikes: u32,
    /// k, c, Y, tau and V over the drawn beads.
    coverage: Vec<IdentificationCoverage>,
    /// Part of the beads whose residuals have a probability below 1 %.
    misfits: f64,
    pass: bool,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let nominal = Nominal::paper()?;
    let progress = output::progress(arguments.beads.into());
    let drawn = on_all_cores(&progress, 0..arguments.beads, |number| {
        nominal.draw(arguments.seed, number, arguments.strikes)
    })?;
    progress.finish_and_clear();
    let coverage = IdentificationCoverage::of(&drawn);
    let misfits = drawn.iter().filter(|bead| bead.probability < 0.01).count();
    let proof = IdentifyProof {
        strikes: arguments.strikes,
        misfits: misfits as f64 / drawn.len() as f64,
        pass: coverage.iter().all(|one| one.holds),
        coverage,
    };
    output::print(arguments.format, &proof, || proof.text())?;
    proof.verdict()
}

impl IdentifyProof {
    fn text(&self) -> String {
        let percent = |part: f64| format!("{:.3}", 100.0 * part);
        let rows = self.coverage.iter().map(|one| {
            [
                one.parameter.to_owned(),
                one.beads.to_string(),
                format!("{:.1}", 100.0 * one.covered),
                format!("{:+.3}", one.mean),
                format!("{:.3}", one.scatter),
                format!("{:.3}", one.probability),
                percent(one.error_rms),
                percent(one.error_most),
                output::either(one.holds, "yes", "NO"),
            ]
        });
        let table = output::table(
            "parameter | beads | covered (%) | mean | scatter | p of ranks | error, rms (%) | worst (%) | holds",
            rows,
        );
        format!(
            "{table}\n\n{:.1} % of the fits have p < 1 %",
            100.0 * self.misfits
        )
    }

    fn verdict(&self) -> Result<(), Failure> {
        match self.coverage.iter().find(|one| !one.holds) {
            Some(off) => bail!(
                Verdict,
                "the intervals of {} cover the truth of {:.1} % of {} beads, the ranks of the truth are uniform with p = {:.3}, \
                 and the error is up to {:.3} %",
                off.parameter,
                100.0 * off.covered,
                off.beads,
                off.probability,
                100.0 * off.error_most
            ),
            None => Ok(()),
        }
    }
}
