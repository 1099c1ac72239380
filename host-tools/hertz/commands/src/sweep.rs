//! `bead sweep`: a scenario over axes of its parameters.

use std::time::Instant;

use clap::Subcommand;

use super::sweep_work::{Consent, Threads, compute_missing, measured, merge, summary, table_file};
use super::{sweep_cluster, sweep_plot};
use bead_console::prelude::*;
use hertz_sweep::folder::Folder;
use hertz_sweep::plan::Plan;

const AFTER_HELP: &str = "\
SWEEP.toml names a scenario, axes, and the results to keep of each run:
  # A file next to this one; or its tables: [scenario.chain] and so on.
  scenario = \"paper-strike.toml\"

  # Points are all combinations of the axes; the last axis varies fastest. Any
  # key of the scenario will do; tables of a list are counted from 1. Or:
  # linspace = [first, last, how many], range = [first, last, step],
  # values = [...]
  [[axis]]
  key = \"intruder.1.stiffness\"
  logspace = [1e4, 1e6, 41]

  # Keys that change together.
  [[axis]]
  zip = [{ key = \"intruder.1.mass\", linspace = [1e-3, 6e-3, 6] },
         { key = \"intruder.1.beads\", range = [3, 8, 1] }]

  # Drawn points: random = N, or quasirandom = N (evenly spread).
  [[axis]]
  quasirandom = 256
  over = [{ key = \"striker.velocity\", loguniform = [0.1, 1.5] },
          { key = \"chain.relaxation\", uniform = [0, 8e-6] }]

  [outputs]
  absorbed = true      # by intruders: J, share of striker's and of injected energy
  energies = true      # where the energy is at the end
  intruders = [8]      # what the intruder in this bead dissipates
  peaks = [1, 8]       # greatest force at these contacts
  arrivals = [8]       # when it was greatest
  transmission = [8]   # energy behind this bead at the end

After an interruption, the same command continues where it stopped: finished chunks stay in F.parquet.sweep \
until the table is complete. Threads, chunks and interruptions do not change a byte of the table. \
docs/sweeps.md says more, and how to spread a sweep over a cluster.

Examples:
  bead sweep docs/scenarios/stiffness-and-speed.toml --out map.parquet \\
      --plot map.svg
  bead sweep plot map.parquet --x striker_velocity_mps \\
      --y absorbed_of_injected --out curves.svg
  bead sweep plan SWEEP.toml --dir big --chunks 100
  bead sweep submit big --cpus 8 --out big.parquet | sh";

/// Arguments of `bead sweep`.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP, args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub struct Arguments {
    #[command(subcommand)]
    action: Option<SweepAction>,
    #[command(flatten)]
    here: Here,
}

#[derive(Debug, Subcommand)]
enum SweepAction {
    /// Write the plan of a sweep into a folder, to be computed in chunks, here or elsewhere.
    Plan(sweep_cluster::PlanArguments),
    /// Compute one chunk of a plan, or all missing ones. A finished chunk is not computed again.
    Run(sweep_cluster::RunArguments),
    /// Print a script that gives Slurm the missing chunks of a plan, and a job that merges them.
    Submit(sweep_cluster::SubmitArguments),
    /// Show which chunks of a plan are finished.
    Status(sweep_cluster::StatusArguments),
    /// Write the table of all chunks of a plan.
    Merge(sweep_cluster::MergeArguments),
    /// Draw curves or a map of a sweep's table.
    Plot(sweep_plot::PlotArguments),
}

/// A sweep on this machine.
#[derive(Debug, Args)]
#[command(mut_group("PictureOptions", |choice| choice.requires("plot")))]
struct Here {
    /// The sweep, a TOML file.
    #[arg(value_name = "SWEEP.toml", required = true)]
    sweep: Option<PathBuf>,
    /// The table: a row for each point, units in the column names.
    #[arg(long, value_name = "F.parquet", required = true, value_parser = table_file)]
    out: Option<PathBuf>,
    /// Also draw the table to this file, as `bead sweep plot` does.
    #[arg(long, value_name = "F.svg")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    choice: sweep_plot::PictureOptions,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    consent: Consent,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Format of the summary.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// Runs `bead sweep`.
///
/// # Errors
/// [`Failure`], which carries the exit status.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    match &arguments.action {
        Some(SweepAction::Plan(planning)) => sweep_cluster::plan(planning),
        Some(SweepAction::Run(running)) => sweep_cluster::run(running),
        Some(SweepAction::Submit(submitting)) => sweep_cluster::submit(submitting),
        Some(SweepAction::Status(standing)) => sweep_cluster::status(standing),
        Some(SweepAction::Merge(merging)) => sweep_cluster::merge(merging),
        Some(SweepAction::Plot(plotting)) => sweep_plot::plot(plotting),
        None => {
            let here = &arguments.here;
            // clap requires both, but not beside a subcommand.
            let (Some(file), Some(out)) = (&here.sweep, &here.out) else {
                bail!(
                    Input,
                    "give a SWEEP.toml and --out F.parquet; see bead sweep --help"
                );
            };
            here.threads.pool()?.install(|| sweep(here, file, out))
        }
    }
}

/// Intended time of a chunk, s. An interruption can cost a chunk.
const CHUNK_SECONDS: f64 = 5.0;
/// Greatest numbers of points in a chunk and of chunks in a sweep. A sweep of more points than both allow has
/// larger chunks.
const CHUNK_POINTS: u64 = 1 << 16;
const CHUNKS: u64 = 10_000;

fn sweep(here: &Here, file: &Path, result: &Path) -> Result<(), Failure> {
    let plan = Plan::load(file)?;
    let inputs = [file];
    place::apart(Some(result), here.plot.as_deref())?;
    let out = place::target(result, FileKind::Parquet, &inputs, here.overwrite)?;
    let picture = here.plot.as_deref();
    let picture = here.overwrite.optional(picture, FileKind::Drawing, &inputs)?;
    if picture.is_some() {
        here.choice.view().check(&plan).map_err(Failure::input)?;
    }
    let seconds = measured(&plan);
    here.consent.ask(&plan, seconds)?;
    let chunk =
        ((CHUNK_SECONDS / seconds) as u64).clamp(8 * rayon::current_num_threads() as u64, CHUNK_POINTS);
    let chunk = chunk.max(plan.points() / CHUNKS).next_multiple_of(8);
    let mut name = result.as_os_str().to_owned();
    name.push(".sweep");
    let chunks = plan.points().div_ceil(chunk);
    let folder = Folder::create(Path::new(&name), plan, chunks)?;
    interrupt::resumable(format!(
        "finished parts are in {}; the same command continues from there",
        folder.path().display()
    ));
    let clock = Instant::now();
    let computed = compute_missing(&folder)?;
    let (plan, merged) = (folder.plan().clone(), merge(&folder, &out)?);
    folder.remove();
    // The summary comes first: a picture that cannot be drawn must not hide it.
    summary(
        &plan,
        &merged,
        out.path(),
        Some((computed, clock.elapsed().as_secs_f64())),
        here.format,
    )?;
    if let Some(picture) = &picture {
        sweep_plot::draw(out.path(), &here.choice, picture)?;
    }
    Ok(())
}
