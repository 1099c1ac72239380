//! `bead sweep plan`, `run`, `submit`, `status`, `merge`: a sweep in chunks, on one machine or many.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use anyhow::Context;
use clap::{Args, ValueEnum};
use schemars::JsonSchema;
use serde::Serialize;

use super::sweep_work::{
    Consent, Threads, axes, compute_missing, grouped, measured, merge as merge_into, summary, time,
};
use crate::cli::failure::Failure;
use crate::cli::interrupt;
use crate::cli::output::{self, Format};
use crate::cli::place::{self, Kind, Overwrite};
use bead_tables::whole::Target;
use hertz_sweep::folder::{Folder, MOST_CHUNKS, ranges};
use hertz_sweep::plan::Plan;
use hertz_sweep::slurm::{self, Jobs};

/// `bead sweep plan`.
#[derive(Debug, Args)]
pub(crate) struct Planning {
    /// The sweep, a TOML file.
    sweep: PathBuf,
    /// The folder for the plan and its parts. Nodes of a cluster must all see it.
    #[arg(long)]
    dir: PathBuf,
    /// How many chunks [default: chunks of ten minutes of one processor each, 1000 at most].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MOST_CHUNKS))]
    chunks: Option<u64>,
    #[command(flatten)]
    consent: Consent,
    /// How to print the plan.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// `bead sweep run`.
#[derive(Debug, Args)]
pub(crate) struct Running {
    /// The folder of the plan.
    dir: PathBuf,
    /// Compute chunk K of the plan's N, and no other.
    #[arg(long, value_name = "K/N")]
    chunk: Option<Chunk>,
    #[command(flatten)]
    threads: Threads,
}

/// `bead sweep submit`.
#[derive(Debug, Args)]
pub(crate) struct Submitting {
    /// The folder of the plan, which all nodes must see.
    dir: PathBuf,
    /// The system that runs the jobs.
    #[arg(long, value_enum, default_value_t)]
    engine: Engine,
    /// The merged table.
    #[arg(long, value_name = "F.parquet")]
    out: PathBuf,
    /// Processors of each task.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=4096))]
    cpus: u32,
    /// Tasks that run at the same time [default: as many as the cluster allows].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    at_once: Option<u32>,
    /// A further option of sbatch for all jobs, such as --sbatch=--partition=short; may be repeated.
    #[arg(long, value_name = "OPTION", allow_hyphen_values = true)]
    sbatch: Vec<String>,
    /// Print the commands and submit nothing.
    #[arg(long)]
    dry_run: bool,
    #[command(flatten)]
    overwrite: Overwrite,
}

/// A system that runs jobs.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
enum Engine {
    /// An array of jobs with sbatch.
    #[default]
    Slurm,
}

/// `bead sweep status`.
#[derive(Debug, Args)]
pub(crate) struct Standing {
    /// The folder of the plan.
    dir: PathBuf,
    /// How to print it.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// `bead sweep merge`.
#[derive(Debug, Args)]
pub(crate) struct Merging {
    /// The folder of the plan. It stays.
    dir: PathBuf,
    /// The table: a row for each point, units in the column names.
    #[arg(long, value_name = "F.parquet")]
    out: PathBuf,
    #[command(flatten)]
    overwrite: Overwrite,
    /// How to print the summary.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// K/N.
#[derive(Debug, Clone, Copy)]
struct Chunk(u64, u64);

impl FromStr for Chunk {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text
            .split_once('/')
            .and_then(|(k, n)| Some((k.parse().ok()?, n.parse().ok()?)));
        match numbers {
            Some((chunk, of)) if chunk >= 1 && chunk <= of => Ok(Self(chunk, of)),
            _ => Err("write K/N, such as 3/16, with K from 1 to N".to_owned()),
        }
    }
}

/// Time of a chunk on one processor, s.
const CHUNK_SECONDS: f64 = 600.0;
/// Chunks of a plan: Slurm takes arrays of 1000 tasks by default.
const CHUNKS: u64 = 1000;

/// The result of `bead sweep plan` as JSON.
#[derive(Serialize, JsonSchema)]
pub(crate) struct PlanReport<'a> {
    plan: &'a str,
    points: u64,
    chunks: u64,
    chunk_points: u64,
    processor_seconds: f64,
    chunk_processor_seconds: f64,
    folder: String,
}

/// The result of `bead sweep status` as JSON.
#[derive(Serialize, JsonSchema)]
pub(crate) struct StatusReport<'a> {
    plan: &'a str,
    points: u64,
    chunks: u64,
    finished: u64,
    /// Numbers of the chunks that are not finished.
    missing: &'a Vec<u64>,
    bytes: u64,
    /// Numbers of Slurm's jobs that wait or run.
    jobs: &'a Vec<String>,
}

pub(crate) fn plan(planning: &Planning) -> Result<(), Failure> {
    let plan = Plan::load(&planning.sweep)?;
    let seconds = measured(&plan);
    planning.consent.ask(&plan, seconds)?;
    let one = seconds * rayon::current_num_threads() as f64;
    let work = one * plan.points() as f64;
    let chunks = planning
        .chunks
        .unwrap_or(((work / CHUNK_SECONDS).ceil() as u64).clamp(1, CHUNKS));
    let folder = Folder::create(&planning.dir, plan, chunks)?;
    let (plan, chunks) = (folder.plan(), folder.chunks());
    if let Some(others) = planning
        .chunks
        .filter(|asked| (*asked).min(plan.points()) != chunks)
    {
        bail!(
            Input,
            "the plan in {} is there already, in {chunks} chunks; leave --chunks {others} out, or give another --dir",
            planning.dir.display()
        );
    }
    let of_chunk = work / chunks as f64;
    let report = PlanReport {
        plan: plan.hash(),
        points: plan.points(),
        chunks,
        chunk_points: folder.most_points(),
        processor_seconds: work,
        chunk_processor_seconds: of_chunk,
        folder: folder.path().display().to_string(),
    };
    output::print(planning.format, &report, || {
        let dir = folder.path().display();
        format!(
            "{} points ({}) in {chunks} chunks of up to {}: about {} of one processor, {} for each chunk\n\
             Compute them: bead sweep run {dir} --chunk K/{chunks}, or bead sweep submit {dir} --engine slurm --out F.parquet",
            grouped(plan.points()),
            axes(plan),
            grouped(folder.most_points()),
            time(work),
            time(of_chunk),
        )
    })
}

pub(crate) fn run(running: &Running) -> Result<(), Failure> {
    let folder = Folder::open(&running.dir)?;
    interrupt::resumable("finished chunks stay, and the same command goes on from there".to_owned());
    let pool = running.threads.pool()?;
    let Some(Chunk(chunk, of)) = running.chunk else {
        let points = pool.install(|| compute_missing(&folder))?;
        return output::print_line(&format!(
            "{} points computed; all {} chunks are finished",
            grouped(points),
            folder.chunks()
        ));
    };
    if of != folder.chunks() {
        bail!(
            Input,
            "--chunk {chunk}/{of}: the plan in {} has {} chunks; was the chunk of another plan meant?",
            folder.path().display(),
            folder.chunks()
        );
    }
    if folder.finished(chunk)? {
        return output::print_line(&format!("chunk {chunk}/{of} is finished already"));
    }
    let points = folder.points(chunk);
    let count = points.end - points.start;
    let bar = output::part_done(format!("of chunk {chunk}/{of}"));
    let tell = |done: f64| output::set_part(&bar, done / count as f64);
    pool.install(|| folder.run(chunk, &tell))?;
    bar.finish_and_clear();
    output::print_line(&format!("chunk {chunk}/{of}: {} points", grouped(count)))
}

pub(crate) fn submit(submitting: &Submitting) -> Result<(), Failure> {
    let Engine::Slurm = submitting.engine;
    let folder = Folder::open(&submitting.dir)?;
    // The job that merges may replace the table only if it could be written now.
    result(&folder, &submitting.out, submitting.overwrite)?;
    let missing = folder.missing()?;
    if missing.is_empty() {
        return output::print_line(&format!(
            "all {} chunks are finished: bead sweep merge {} --out {}",
            folder.chunks(),
            folder.path().display(),
            submitting.out.display()
        ));
    }
    let whole = |path: &Path| -> Result<String, Failure> {
        let path = std::path::absolute(path).with_context(|| format!("{}: no path", path.display()))?;
        let text = path.into_os_string().into_string();
        text.map_err(|path| {
            failure!(
                Input,
                "{}: Slurm takes paths in UTF-8; give another",
                path.display()
            )
        })
    };
    let program = std::env::current_exe()
        .context("where is this program?")
        .map_err(Failure::Device)?;
    let (program, dir, out) = (whole(&program)?, whole(folder.path())?, whole(&submitting.out)?);
    let plan = slurm_name(&folder);
    let jobs = Jobs {
        program: &program,
        folder: &dir,
        out: &out,
        plan,
        missing: &missing,
        chunks: folder.chunks(),
        cpus: submitting.cpus,
        at_once: submitting.at_once,
        options: &submitting.sbatch,
    };
    if submitting.dry_run {
        let commands = [jobs.array(), jobs.merge("JOB")].map(|arguments| slurm::command_line(&arguments));
        return output::print_line(&commands.join("\n"));
    }
    let waiting = slurm::queued(plan);
    if !waiting.is_empty() {
        bail!(
            Input,
            "job {} of this plan is still in the queue; wait for it, or end it with: scancel {}",
            waiting.join(" and "),
            waiting.join(" ")
        );
    }
    let array = slurm::submit(&jobs.array()).map_err(Failure::Device)?;
    let merge = slurm::submit(&jobs.merge(&array)).map_err(Failure::Device)?;
    output::print_line(&format!(
        "job {array}: {} of {} chunks; job {merge} merges them into {out}\nHow it goes: bead sweep status {}",
        missing.len(),
        folder.chunks(),
        folder.path().display()
    ))
}

/// The first letters of the plan's hash, which end the names of its jobs.
fn slurm_name(folder: &Folder) -> &str {
    &folder.plan().hash()[..8]
}

pub(crate) fn status(standing: &Standing) -> Result<(), Failure> {
    let folder = Folder::open(&standing.dir)?;
    let (missing, chunks) = (folder.missing()?, folder.chunks());
    let waiting = slurm::queued(slurm_name(&folder));
    let finished = chunks - missing.len() as u64;
    let report = StatusReport {
        plan: folder.plan().hash(),
        points: folder.plan().points(),
        chunks,
        finished,
        missing: &missing,
        bytes: folder.size(),
        jobs: &waiting,
    };
    output::print(standing.format, &report, || {
        let mut lines = vec![format!(
            "{finished} of {chunks} chunks are finished, of {} points in all",
            grouped(folder.plan().points())
        )];
        if !missing.is_empty() {
            lines.push(format!("missing: {}", ranges(&missing)));
        }
        if !waiting.is_empty() {
            lines.push(format!("in the queue: job {}", waiting.join(", ")));
        } else if !missing.is_empty() {
            lines.push(format!(
                "nothing computes them: bead sweep run {0}, or bead sweep submit {0}",
                folder.path().display()
            ));
        }
        lines.join("\n")
    })
}

pub(crate) fn merge(merging: &Merging) -> Result<(), Failure> {
    let folder = Folder::open(&merging.dir)?;
    let out = result(&folder, &merging.out, merging.overwrite)?;
    let merged = merge_into(&folder, &out)?;
    summary(folder.plan(), &merged, out.path(), None, merging.format)
}

/// The merged table, which replaces no part.
fn result(folder: &Folder, out: &Path, overwrite: Overwrite) -> Result<Target, Failure> {
    if folder.has_within(out) {
        bail!(
            Input,
            "{} lies among the parts of the plan; give the table another folder",
            out.display()
        );
    }
    place::target(out, Kind::Parquet, &[], overwrite)
}
