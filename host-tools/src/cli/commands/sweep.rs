//! `bead sweep`: a scenario over axes of its parameters.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::{Args, Subcommand};
use serde_json::json;

use super::{sweep_cluster, sweep_plot};
use crate::cli::failure::{Blame, Failure};
use crate::cli::interrupt;
use crate::cli::output::{self, Format};
use crate::cli::place::{self, Force, Kind};
use crate::recording::whole::Target;
use crate::sweep::compute;
use crate::sweep::folder::{Folder, Merged};
use crate::sweep::plan::Plan;

const AFTER_HELP: &str = "\
SWEEP.toml names a scenario, axes and what is kept of each run:
  scenario = \"paper-strike.toml\"       beside this file; or the tables themselves: [scenario.chain] …
  [[axis]]                             each axis multiplies the points; the last turns fastest
  key = \"intruder.0.stiffness\"         any key of the scenario; tables of a list are counted from 0
  logspace = [1e4, 1e6, 41]            or linspace = [first, last, how many], range = [first, last, step], values = […]
  [[axis]]                             keys that go together
  zip = [{ key = \"intruder.0.mass\", linspace = [1e-3, 6e-3, 6] }, { key = \"intruder.0.beads\", range = [3, 8, 1] }]
  [[axis]]                             points that are drawn: random, or quasirandom (evenly spread)
  quasirandom = 256
  over = [{ key = \"striker.velocity\", loguniform = [0.1, 1.5] }, { key = \"chain.relaxation\", uniform = [0, 8e-6] }]
  [outputs]
  absorbed = true                      what intruders dissipate: J, of the striker's energy, of the injected
  energies = true                      where the energy is at the end
  intruders = [8]                      what the intruder in this bead dissipates
  peaks = [1, 8]                       greatest force at these contacts
  arrivals = [8]                       when it was greatest
  transmission = [8]                   energy behind this bead at the end

Interrupted, the same command goes on where it was: finished chunks are in F.parquet.sweep until the table is whole. The
table has the same bytes whatever the threads, the chunks and the interruptions. docs/sweeps.md says more, and how to
spread a sweep over a cluster.

Examples:
  bead sweep docs/scenarios/stiffness-and-speed.toml --out map.parquet --plot map.svg
  bead sweep plot map.parquet --x striker_velocity_m_per_s --y absorbed_of_injected --out curves.svg
  bead sweep plan SWEEP.toml --dir big --chunks 100
  bead sweep submit big --engine slurm --cpus 8 --out big.parquet --dry-run";

/// Arguments of `bead sweep`.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP, args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    action: Option<Action>,
    #[command(flatten)]
    here: Here,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Write the plan of a sweep into a folder, to be computed in chunks, here or elsewhere.
    Plan(sweep_cluster::Planning),
    /// Compute a chunk of a plan, or all that are missing. A finished chunk is not computed again.
    Run(sweep_cluster::Running),
    /// Give the missing chunks of a plan to a cluster, and a job that merges them.
    Submit(sweep_cluster::Submitting),
    /// Show which chunks of a plan are finished.
    Status(sweep_cluster::Standing),
    /// Write the table of all chunks of a plan.
    Merge(sweep_cluster::Merging),
    /// Draw curves or a map of a sweep's table.
    Plot(sweep_plot::Plotting),
}

/// A sweep on this machine.
#[derive(Debug, Args)]
struct Here {
    /// The sweep, a TOML file.
    #[arg(value_name = "SWEEP.toml", required = true)]
    sweep: Option<PathBuf>,
    /// The table: a row for each point, units in the column names.
    #[arg(long, value_name = "F.parquet", required = true)]
    out: Option<PathBuf>,
    /// Draw it too, as `bead sweep plot` does.
    #[arg(long, value_name = "F.svg")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    choice: sweep_plot::Choice,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    consent: Consent,
    #[command(flatten)]
    force: Force,
    /// How to print the summary.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// `--threads`.
#[derive(Debug, Clone, Copy, Args)]
pub(crate) struct Threads {
    /// Threads to compute on [default: one for each processor].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=4096))]
    threads: Option<u32>,
}

impl Threads {
    pub(crate) fn pool(self) -> Result<rayon::ThreadPool, Failure> {
        let threads = self.threads.unwrap_or(0) as usize;
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.or_device(|| "cannot start threads")
    }
}

/// `--yes` and `--limit`.
#[derive(Debug, Clone, Copy, Args)]
pub(crate) struct Consent {
    /// Points that are computed without --yes.
    #[arg(long, value_name = "POINTS", default_value_t = 100_000)]
    limit: u64,
    /// Compute any number of points.
    #[arg(long)]
    yes: bool,
}

impl Consent {
    /// Refuses a large sweep that may be a slip.
    pub(crate) fn ask(self, plan: &Plan, seconds: f64) -> Result<(), Failure> {
        if self.yes || plan.points() <= self.limit {
            return Ok(());
        }
        let bytes = plan.points() as f64 * plan.columns().len() as f64 * 8.0;
        Err(Failure::input(format!(
            "{} make {} points, about {} on {} threads here, and {} of table; if that is meant, give --yes, or --limit with a \
             higher number",
            axes(plan),
            grouped(plan.points()),
            time(seconds * plan.points() as f64),
            rayon::current_num_threads(),
            size(bytes),
        )))
    }
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    match &arguments.action {
        Some(Action::Plan(planning)) => sweep_cluster::plan(planning),
        Some(Action::Run(running)) => sweep_cluster::run(running),
        Some(Action::Submit(submitting)) => sweep_cluster::submit(submitting),
        Some(Action::Status(standing)) => sweep_cluster::status(standing),
        Some(Action::Merge(merging)) => sweep_cluster::merge(merging),
        Some(Action::Plot(plotting)) => sweep_plot::plot(plotting),
        None => {
            let here = &arguments.here;
            // A subcommand does without them, so their types do too.
            let (Some(file), Some(out)) = (&here.sweep, &here.out) else {
                return Err(Failure::input(
                    "give a SWEEP.toml and --out F.parquet; see bead sweep --help",
                ));
            };
            here.threads.pool()?.install(|| sweep(here, file, out))
        }
    }
}

/// Chunks of this length can be lost to an interruption, s.
const CHUNK_SECONDS: f64 = 5.0;
/// Points of a chunk at most, and chunks at most.
const CHUNK_POINTS: u64 = 1 << 16;
const CHUNKS: u64 = 10_000;

fn sweep(here: &Here, file: &Path, result: &Path) -> Result<(), Failure> {
    let plan = Plan::load(file)?;
    let inputs = [file];
    let out = place::target(result, Kind::Parquet, &inputs, here.force)?;
    let picture = place::optional(here.plot.as_deref(), Kind::Drawing, &inputs, here.force)?;
    if picture.is_some() {
        sweep_plot::check(&here.choice, &plan)?;
    }
    let seconds = measured(&plan);
    here.consent.ask(&plan, seconds)?;
    let chunk =
        ((CHUNK_SECONDS / seconds) as u64).clamp(8 * rayon::current_num_threads() as u64, CHUNK_POINTS);
    let chunk = chunk.max(plan.points() / CHUNKS).next_multiple_of(8);
    let mut name = result.as_os_str().to_owned();
    name.push(".sweep");
    let folder = Folder::create(Path::new(&name), plan, chunk)?;
    interrupt::resumable(format!(
        "finished parts are in {}, and the same command goes on from there",
        folder.path().display()
    ));
    let clock = Instant::now();
    let computed = compute_missing(&folder)?;
    let (plan, merged) = (folder.plan().clone(), merge(&folder, &out)?);
    folder.remove();
    if let Some(picture) = &picture {
        sweep_plot::draw(out.path(), &here.choice, picture)?;
    }
    told(
        &plan,
        &merged,
        out.path(),
        Some((computed, clock.elapsed().as_secs_f64())),
        here.format,
    )
}

/// How long a point takes, s.
pub(crate) fn measured(plan: &Plan) -> f64 {
    let spinner = output::spinner("trying a few points");
    let seconds = compute::seconds_for_each(plan);
    spinner.finish_and_clear();
    seconds
}

/// Computes the chunks that are missing. Gives how many points those were.
pub(crate) fn compute_missing(folder: &Folder) -> Result<u64, Failure> {
    let (missing, all) = (folder.missing()?, folder.plan().points() as f64);
    let count = |chunk: &u64| {
        let points = folder.points(*chunk);
        points.end - points.start
    };
    let left: u64 = missing.iter().map(count).sum();
    let mut done = folder.plan().points() - left;
    let bar = output::part_done(format!("of {} points", grouped(folder.plan().points())));
    output::set_part(&bar, done as f64 / all);
    // What is done already says nothing about the time left.
    bar.reset_eta();
    for chunk in missing {
        folder.run(chunk, &|points| {
            output::set_part(&bar, (done as f64 + points) / all)
        })?;
        done += count(&chunk);
    }
    bar.finish_and_clear();
    Ok(left)
}

pub(crate) fn merge(folder: &Folder, out: &Target) -> Result<Merged, Failure> {
    let bar = output::part_done("of the table written");
    let merged = folder.merge(out, &|chunk| {
        output::set_part(&bar, chunk as f64 / folder.chunks() as f64)
    })?;
    bar.finish_and_clear();
    Ok(merged)
}

/// Prints what came of a sweep, and how to go on with it.
pub(crate) fn told(
    plan: &Plan,
    merged: &Merged,
    out: &Path,
    computed: Option<(u64, f64)>,
    format: Format,
) -> Result<(), Failure> {
    if let Some(why) = &merged.first {
        output::note(format_args!(
            "{} of {} points could not be computed, and the column `error` says why; the first: {why}",
            grouped(merged.failed),
            grouped(plan.points()),
        ));
    }
    let index: Vec<String> = plan.axes().iter().map(crate::sweep::axis::Axis::index).collect();
    let report = json!({
        "plan": plan.hash(),
        "points": plan.points(),
        "computed": computed.map(|(points, _)| points),
        "failed": merged.failed,
        "seconds": computed.map(|(_, seconds)| seconds),
        "file": out.display().to_string(),
        "index": index,
        "xarray": plan.xarray(out),
    });
    output::print(format, &report, || {
        let computed = computed.map_or(String::new(), |(points, seconds)| {
            format!(", {} computed in {}", grouped(points), time(seconds))
        });
        format!(
            "{}: {} points{computed}\nA cube in Python: {}",
            out.display(),
            grouped(plan.points()),
            plan.xarray(out)
        )
    })
}

/// The axes as a product: `41 × 15`.
pub(crate) fn axes(plan: &Plan) -> String {
    let counts: Vec<String> = plan.axes().iter().map(|axis| grouped(axis.count)).collect();
    match counts.as_slice() {
        [one] => format!("1 axis of {one}"),
        _ => format!("axes of {}", counts.join(" × ")),
    }
}

/// A number in groups of three digits.
pub(crate) fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let first = digits.len() % 3;
    let (head, rest) = digits.split_at(first);
    let mut groups: Vec<&str> = if head.is_empty() { Vec::new() } else { vec![head] };
    groups.extend((0..rest.len()).step_by(3).map(|at| &rest[at..at + 3]));
    groups.join(",")
}

/// A time for people.
pub(crate) fn time(seconds: f64) -> String {
    match seconds {
        s if s < 0.1 => format!("{:.0} ms", s * 1e3),
        s if s < 120.0 => format!("{s:.1} s"),
        s if s < 2.0 * 3600.0 => format!("{:.0} min", s / 60.0),
        s if s < 2.0 * 86_400.0 => format!("{:.1} h", s / 3600.0),
        s => format!("{:.0} days", s / 86_400.0),
    }
}

fn size(bytes: f64) -> String {
    match bytes {
        b if b < 1e9 => format!("{:.0} MB", (b / 1e6).max(1.0)),
        b => format!("{:.0} GB", b / 1e9),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_times_are_for_people() {
        assert_eq!(grouped(7), "7");
        assert_eq!(grouped(1_000_000), "1,000,000");
        assert_eq!(grouped(123_456), "123,456");
        assert_eq!(time(0.012), "12 ms");
        assert_eq!(time(4000.0), "67 min");
    }
}
