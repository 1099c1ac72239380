//! `bead periodic`: motions of a driven chain that repeat, and branches of them.

mod branch;
mod motion;

use hertz_chain::{BranchOptions, DriveParameter, PeriodicState};

use self::branch::{BranchReport, follow};
use self::motion::{Motion, Multiplier, unit_of_amplitude};
use bead_console::prelude::*;

const AFTER_HELP: &str = "\
The scenario is driven by a sine. Newton's method, begun from the chain at rest, finds a motion that repeats \
with each period of the sine, stable or not. Its Floquet multipliers say what a small disturbance is multiplied by in \
a period: the motion is stable if none is outside the unit circle.

--along follows the motion as the amplitude (m, or N) or the frequency (Hz) of the drive goes from the \
scenario's value to --to, around folds too: there the branch turns back, and two motions meet and vanish. The \
branch ends at --to, or at --back after it has turned back.

Examples:
  bead periodic docs/scenarios/driven-trimer.toml
  bead periodic docs/scenarios/driven-trimer.toml --along amplitude \\
      --to 4e-8 --picture branch.svg
  bead periodic docs/scenarios/driven-trimer.toml --along frequency \\
      --to 5500 --out branch.csv";

/// Arguments of `bead periodic`.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub struct Arguments {
    /// The scenario, a TOML file in SI units, with a sine in its table [drive].
    scenario: PathBuf,
    /// Follow the motion as this parameter of the drive changes.
    #[arg(long, value_name = "amplitude|frequency", requires = "to")]
    along: Option<DriveParameter>,
    /// Value at which the branch ends, m, N or Hz.
    #[arg(long, value_name = "VALUE", value_parser = positive, requires = "along")]
    to: Option<f64>,
    /// Value at which a branch that turned back ends [default: the scenario's].
    #[arg(long, value_name = "VALUE", value_parser = positive, requires = "along")]
    back: Option<f64>,
    /// Greatest number of points of the branch.
    #[arg(long, value_name = "N", default_value_t = 400, requires = "along")]
    points: usize,
    /// Write the branch to this CSV file, a row for each point, units in the column names.
    #[arg(long, value_name = "F.csv", requires = "along")]
    out: Option<PathBuf>,
    /// Draw the branch to this file.
    #[arg(long, value_name = "F.svg", requires = "along")]
    picture: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Format of the result.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// The result as JSON.
#[derive(Serialize, JsonSchema)]
pub struct PeriodicReport {
    /// The motion of the scenario's own drive.
    motion: Motion,
    /// All Floquet multipliers of it, the greatest magnitude first.
    multipliers: Vec<Multiplier>,
    /// Distance between start and end of a period, as a part of the motion.
    residual: f64,
    /// The branch that was asked for.
    branch: Option<BranchReport>,
}

/// Runs `bead periodic`.
///
/// # Errors
/// [`Failure`], which carries the exit status.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let scenario = Scenario::load(&arguments.scenario)?;
    let inputs = [arguments.scenario.as_path()];
    place::apart(arguments.out.as_deref(), arguments.picture.as_deref())?;
    let overwrite = arguments.overwrite;
    let out = overwrite.optional(arguments.out.as_deref(), FileKind::Table, &inputs)?;
    let picture = overwrite.optional(arguments.picture.as_deref(), FileKind::Drawing, &inputs)?;
    let spinner = output::spinner("looking for a motion that repeats");
    let state = PeriodicState::of(&scenario)?;
    spinner.finish_and_clear();
    let mut report = PeriodicReport {
        motion: Motion::of(&state)?,
        multipliers: state.multipliers().iter().copied().map(Into::into).collect(),
        residual: state.residual(),
        branch: None,
    };
    if let Some((parameter, to)) = arguments.along.zip(arguments.to) {
        let mut options = BranchOptions::default();
        (options.points, options.back) = (arguments.points, arguments.back);
        let branch = report.branch.insert(follow(state, parameter, to, &options)?);
        if let Some(picture) = picture {
            let title = scenario.title.as_str();
            picture.write_bytes(branch.chart(parameter, title).standalone_svg()?)?;
        }
        if let Some(out) = out {
            out.write(|file| branch.write(file))?;
        }
    }
    output::print(arguments.format, &report, || report.table(&scenario))
}

impl PeriodicReport {
    fn table(&self, scenario: &Scenario) -> String {
        let (motion, title) = (&self.motion, &scenario.title);
        let stable = if motion.stable { "stable" } else { "unstable" };
        let line = format!(
            "Drive of {:e} {} at {} Hz: a motion that repeats, {stable}. Greatest force {:.4} N, greatest speed \
             {:.4e} m/s.",
            motion.amplitude,
            unit_of_amplitude(scenario),
            motion.frequency_hz,
            motion.greatest_force(),
            motion.speed_max_mps.iter().copied().fold(0.0, f64::max),
        );
        const SHOWN: usize = 8;
        let multipliers = self.multipliers.iter().take(SHOWN).map(|multiplier| {
            [
                format!("{:.8}", multiplier.magnitude()),
                format!("{:.3}", multiplier.im.atan2(multiplier.re).to_degrees()),
            ]
        });
        let multipliers = output::table("Floquet multiplier | angle (°)", multipliers);
        let title = Some(title.clone()).filter(|title| !title.is_empty());
        let branch = self.branch.as_ref().map(BranchReport::table);
        let parts = title.into_iter().chain([line, multipliers]).chain(branch);
        parts.collect::<Vec<_>>().join("\n\n")
    }
}
