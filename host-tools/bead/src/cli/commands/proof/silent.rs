//! `bead proof silent`: strikes at which the bead would be wrong, and whether it says why.

use super::measure::on_all_cores;
use crate::cli::commands::prelude::*;
use bead_bench::image::find_image;
use bead_bench::silent::{SilentOutcome, cases};

const AFTER_HELP: &str = "\
Each case is a strike at which an estimate is off, because something differs from the settings or from the \
assumptions of the estimates: a second wave, a drooping supply, a spring that hardens. The flash image runs \
in QEMU on it, with the noise of the front end. A and B are the greatest errors among the strikes that no flag \
of the cause explains; a case passes if these are within 3 %, and if every wave is measured, counted or \
reported.

Exit status 1 if a case is off without a flag that names its cause.

Examples:
  bead proof silent
  bead proof silent --group supply --format json";

#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    /// Play only the cases of these groups.
    #[arg(long, value_name = "GROUP", value_delimiter = ',')]
    group: Vec<String>,
    /// The flash image [default: as `cargo xtask build` leaves it, else the one inside this program].
    #[arg(long, value_name = "ELF")]
    firmware: Option<PathBuf>,
    /// Format of the result.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let image = find_image(arguments.firmware.as_deref())?;
    let mut groups: Vec<&str> = cases().iter().map(|case| case.group).collect();
    groups.dedup();
    if let Some(unknown) = arguments
        .group
        .iter()
        .find(|group| !groups.contains(&group.as_str()))
    {
        let known = groups.join(", ");
        bail!(
            Input,
            "--group {unknown}: there is no such group; give one or more of: {known}"
        );
    }
    let wanted = |group: &str| arguments.group.is_empty() || arguments.group.iter().any(|one| one == group);
    let cases: Vec<_> = cases().into_iter().filter(|case| wanted(case.group)).collect();
    let progress = output::progress(cases.len() as u64);
    let outcomes = on_all_cores(&progress, &cases, |case| case.play(&image))?;
    progress.finish_and_clear();
    output::print(arguments.format, &outcomes, || {
        output::table(&HEADINGS.join(" | "), outcomes.iter().map(row))
    })?;
    let silent = outcomes.iter().filter(|outcome| !outcome.told).count();
    if silent > 0 {
        bail!(
            Verdict,
            "{silent} of {} cases are off, and no flag names the cause",
            outcomes.len()
        );
    }
    Ok(())
}

const HEADINGS: [&str; 6] = ["group", "cause", "A (%)", "B (%)", "pass", "flags"];

fn row(outcome: &SilentOutcome) -> [String; 6] {
    let [a, b] = outcome.errors.map(|part| {
        if part.is_nan() {
            "-".to_owned()
        } else {
            format!("{:+.2}", 100.0 * part)
        }
    });
    [
        outcome.group.to_owned(),
        outcome.cause.clone(),
        a,
        b,
        output::either(outcome.told, "yes", "NO"),
        outcome.flags.join(", "),
    ]
}
