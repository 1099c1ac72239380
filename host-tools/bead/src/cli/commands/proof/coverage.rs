//! `bead proof coverage`: beads drawn from a calibration, whose uncertainties have to cover the truth, and
//! healthy strikes, which no flag may doubt.

use super::healthy::{self, HealthyKind};
use super::measure::on_all_cores;
use crate::cli::commands::prelude::*;
use crate::cli::commands::settings_file;
use bead_bench::coverage::{Calibrated, Coverage, careful_laboratory, few_are_doubted};

const AFTER_HELP: &str = "\
The true k, c, m, M, gains, kappa and tau of each bead are drawn from the distributions of a calibration, as \
`bead budget --monte-carlo` draws them, and so are striker and speed. The f64 chain strikes a bead with the \
true parameters, which measures with the settings of the calibration and with noise. Of the intervals of ± 2 u \
that the beads send, 92 to 98 % must contain the truth, and the rank of the truth within the stated normal \
distribution must be uniform (chi-squared, p > 0.01). At most 2 % of the beads may flag a doubt: they do so \
beyond three standard uncertainties.

Then beads of ten kinds of docs/spheres.md, alone and in rows of ten, are struck with correct settings: none \
may flag a doubt.

The bit-exact code of the bead runs on this computer; `bead proof silent` runs the image.

Exit status 1 if any of this does not hold.

Examples:
  bead proof coverage
  bead proof coverage --uncertainty bead.toml --beads 1000
  bead proof coverage --seed 2 --format json";

#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    /// Beads to draw.
    #[arg(long, value_name = "N", default_value_t = 300, value_parser = clap::value_parser!(u32).range(50..=100_000))]
    beads: u32,
    /// Healthy strikes of each of ten kinds of bead at each of 20 speeds and places; 0 for none.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(0..=1000))]
    strikes: u32,
    /// Seed of the draws and of the noise: the same seed gives the same table.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Take the table [uncertainty] of this file [default: that of a careful laboratory,
    /// docs/scenarios/paper-bead.toml].
    #[arg(long, value_name = "BEAD.toml")]
    uncertainty: Option<PathBuf>,
    /// Format of the result.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// Result of `bead proof coverage`.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct CoverageProof {
    /// The code that ran: that of the bead, bit for bit, and not the image.
    measured_by: &'static str,
    /// A, B and A - B over the drawn beads.
    coverage: [Coverage; 3],
    /// Drawn beads that flagged a doubt.
    drawn_flagged: usize,
    /// Healthy strikes by kind of bead.
    healthy: Vec<HealthyKind>,
    pass: bool,
}

const MODEL: &str = "bit-exact model; `bead proof silent` plays the image";

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let stated = settings_file::uncertainty(arguments.uncertainty.as_deref())?;
    let stated = stated.unwrap_or_else(careful_laboratory);
    let kinds = healthy::KINDS
        .iter()
        .flat_map(|kind| [(*kind, false), (*kind, true)]);
    let kinds: Vec<_> = kinds.filter(|_| arguments.strikes > 0).collect();
    let progress = output::progress(u64::from(arguments.beads) + kinds.len() as u64);
    let calibrated = Calibrated::new(stated)?;
    let drawn = on_all_cores(&progress, 0..arguments.beads, |number| {
        calibrated.draw(arguments.seed, number)
    })?;
    let healthy = on_all_cores(&progress, kinds, |(kind, row)| {
        healthy::strike(kind, row, arguments.strikes, stated, arguments.seed)
    })?;
    progress.finish_and_clear();
    let coverage = Coverage::of(&drawn);
    let drawn_flagged = drawn.iter().filter(|bead| bead.is_doubted()).count();
    let are_covered = coverage.iter().all(|one| one.holds) && few_are_doubted(drawn_flagged, drawn.len());
    let proof = CoverageProof {
        measured_by: MODEL,
        drawn_flagged,
        pass: are_covered && healthy.iter().all(HealthyKind::holds),
        coverage,
        healthy,
    };
    output::print(arguments.format, &proof, || proof.text())?;
    proof.verdict()
}

impl CoverageProof {
    fn text(&self) -> String {
        let covered = output::table(
            "result | beads | covered by ± 2 u (%) | mean (u) | scatter (u) | p of ranks | holds",
            self.coverage.iter().map(|one| {
                [
                    one.result.to_owned(),
                    one.beads.to_string(),
                    format!("{:.1}", 100.0 * one.covered),
                    format!("{:+.3}", one.mean),
                    format!("{:.3}", one.scatter),
                    format!("{:.3}", one.probability),
                    output::either(one.holds, "yes", "NO"),
                ]
            }),
        );
        let doubted = format!("{} of the drawn beads flag a doubt", self.drawn_flagged);
        let mut parts = vec![MODEL.to_owned(), covered, doubted];
        if !self.healthy.is_empty() {
            let rows = self.healthy.iter().map(HealthyKind::row);
            parts.push(output::table(
                "healthy beads | strikes | A, worst (%) | B, worst (%) | doubts",
                rows,
            ));
        }
        parts.join("\n\n")
    }

    fn verdict(&self) -> Result<(), Failure> {
        if let Some(off) = self.coverage.iter().find(|one| !one.holds) {
            bail!(
                Verdict,
                "the stated intervals of {} cover the truth of {:.1} % of {} beads, and the ranks of the truth are uniform with p = {:.3}",
                off.result,
                100.0 * off.covered,
                off.beads,
                off.probability
            );
        }
        if !self.pass {
            let sum = |of: fn(&HealthyKind) -> usize| self.healthy.iter().map(of).sum::<usize>();
            bail!(
                Verdict,
                "{} of {} drawn beads flag a doubt; of {} healthy strikes {} were found, and {} of these are flagged",
                self.drawn_flagged,
                self.coverage[0].beads,
                sum(|kind| kind.struck),
                sum(|kind| kind.strikes),
                sum(|kind| kind.flagged)
            );
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_file_the_uncertainties_are_those_of_the_example() {
        let file = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../docs/scenarios/paper-bead.toml"
        );
        let stated = settings_file::uncertainty(Some(Path::new(file)));
        assert_eq!(stated.unwrap(), Some(careful_laboratory()));
    }
}
