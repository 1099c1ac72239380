//! `bead proof calibrate`: rigs and beads whose truth is drawn, each calibrated; the uncertainties of the
//! results have to cover the truth.

use super::measure::on_all_cores;
use crate::cli::commands::calibrate::reference_description;
use crate::cli::commands::prelude::*;
use bead_calibrate::simulated::coverage::{Deviation, ResultCoverage, drop_test, shakes, taps};
use bead_recording::physical::derived;

const AFTER_HELP: &str = "\
Each bead has gains, stiffness, damping and masses of its own, and each rig a ball, heights, an axis and a reference of \
its own, drawn from what the operator states. Drop test, ring-down, reference, front mass and shaker sweep are \
evaluated as `bead calibrate` does. Of the intervals of ± U, 95 % should contain the truth. Chance may leave fewer: the \
least number that passes, 89 of 100, is reached in 995 of 1000 such proofs.

The bit-exact code of the bead runs on this computer.

Exit status 1 if fewer intervals contain the truth.

Examples:
  bead proof calibrate
  bead proof calibrate --beads 1000 --seed 2 --format json";

#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    /// Beads to draw.
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(10..=100_000))]
    beads: u32,
    /// Number of drops from each of two heights, and of taps.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(2..=100))]
    repeats: u32,
    /// Seed of the draws and of the noise: the same seed gives the same table.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Format of the result.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// Result of `bead proof calibrate`.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct CalibrateProof {
    /// The code that ran: the bead's own on this computer, not the image.
    measured_by: &'static str,
    /// Each result of each procedure.
    results: Vec<ResultCoverage>,
    pass: bool,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let settings = derived(&reference_description())?;
    let progress = output::progress(arguments.beads.into());
    let one = |number: u32| -> Result<Vec<Deviation>, String> {
        // Neighbouring seeds share no random numbers.
        let seed = arguments.seed.wrapping_mul(1_000_003).wrapping_add(number.into());
        let mut found = drop_test(&settings, seed, arguments.repeats as usize)?;
        found.extend(taps(&settings, seed, arguments.repeats)?);
        found.extend(shakes(&settings, seed)?);
        Ok(found)
    };
    let all = on_all_cores(&progress, 0..arguments.beads, one).map_err(Failure::verdict)?;
    progress.finish_and_clear();
    let results = ResultCoverage::of(&all.concat());
    let proof = CalibrateProof {
        measured_by: "bit-exact model",
        pass: results.iter().all(|one| one.holds),
        results,
    };
    output::print(arguments.format, &proof, || proof.text())?;
    let short = proof.results.iter().find(|one| !one.holds);
    short.map_or(Ok(()), |one| {
        Err(failure!(
            Verdict,
            "{} of {} intervals of {} by {} contain the truth; at least {} must",
            one.covered,
            one.beads,
            one.result,
            one.procedure,
            one.least
        ))
    })
}

impl CalibrateProof {
    fn text(&self) -> String {
        output::table(
            "result | beads | within U | at least | mean (U) | rms (U) | holds",
            self.results.iter().map(|one| {
                [
                    format!("{}, {}", one.procedure, one.result),
                    one.beads.to_string(),
                    one.covered.to_string(),
                    one.least.to_string(),
                    format!("{:+.3}", one.mean).replace('-', "−"),
                    format!("{:.3}", one.rms),
                    output::either(one.holds, "yes", "NO"),
                ]
            }),
        )
    }
}
