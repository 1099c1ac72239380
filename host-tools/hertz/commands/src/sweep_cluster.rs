//! `bead sweep plan`, `run`, `submit`, `status`, `merge`: a sweep in chunks, on one machine or many.

use indicatif::HumanCount;

use super::sweep_work::{
    Consent, Threads, axes, compute_missing, measured, merge as merge_into, summary, time,
};
use bead_console::prelude::*;
use hertz_sweep::folder::{Folder, MOST_CHUNKS, ranges};
use hertz_sweep::plan::Plan;
use hertz_sweep::slurm::{self, Jobs};

/// `bead sweep plan`.
#[derive(Debug, Args)]
pub(crate) struct PlanArguments {
    /// The sweep, a TOML file.
    sweep: PathBuf,
    /// The folder for the plan and its parts. Nodes of a cluster must all see it.
    #[arg(long)]
    dir: PathBuf,
    /// Number of chunks [default: chunks of ten minutes of one processor each, 1000 at most].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MOST_CHUNKS))]
    chunks: Option<u64>,
    #[command(flatten)]
    consent: Consent,
    /// Format of the plan.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// `bead sweep run`.
#[derive(Debug, Args)]
pub(crate) struct RunArguments {
    /// The folder of the plan.
    dir: PathBuf,
    /// Compute only chunk K of the plan's N chunks.
    #[arg(long, value_name = "K/N", value_parser = chunk)]
    chunk: Option<(u64, u64)>,
    #[command(flatten)]
    threads: Threads,
}

/// `bead sweep submit`.
#[derive(Debug, Args)]
pub(crate) struct SubmitArguments {
    /// The folder of the plan, which all nodes must see.
    dir: PathBuf,
    /// The merged table.
    #[arg(long, value_name = "F.parquet", value_parser = super::sweep_work::table_file)]
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
    #[command(flatten)]
    overwrite: Overwrite,
}

/// `bead sweep status`.
#[derive(Debug, Args)]
pub(crate) struct StatusArguments {
    /// The folder of the plan.
    dir: PathBuf,
    /// Format of the result.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// `bead sweep merge`.
#[derive(Debug, Args)]
pub(crate) struct MergeArguments {
    /// The folder of the plan. It is kept.
    dir: PathBuf,
    /// The table: a row for each point, units in the column names.
    #[arg(long, value_name = "F.parquet", value_parser = super::sweep_work::table_file)]
    out: PathBuf,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Format of the summary.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// Parses K/N.
fn chunk(text: &str) -> Result<(u64, u64), String> {
    let numbers = text
        .split_once('/')
        .and_then(|(k, n)| Some((k.parse().ok()?, n.parse().ok()?)));
    let numbers = numbers.filter(|(chunk, of)| (1..=*of).contains(chunk));
    numbers.ok_or_else(|| "write K/N, such as 3/16, with K from 1 to N".to_owned())
}

/// Time of a chunk on one processor, s.
const CHUNK_SECONDS: f64 = 600.0;
/// Chunks of a plan: Slurm takes arrays of 1000 tasks by default.
const CHUNKS: u64 = 1000;

/// The result of `bead sweep plan` as JSON.
#[derive(Serialize, JsonSchema)]
pub struct PlanReport<'a> {
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
pub struct StatusReport<'a> {
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

pub(crate) fn plan(planning: &PlanArguments) -> Result<(), Failure> {
    let plan = Plan::load(&planning.sweep)?;
    let seconds = measured(&plan);
    planning.consent.ask(&plan, seconds)?;
    let work = seconds * rayon::current_num_threads() as f64 * plan.points() as f64;
    let suited = ((work / CHUNK_SECONDS).ceil() as u64).clamp(1, CHUNKS);
    let folder = Folder::create(&planning.dir, plan, planning.chunks.unwrap_or(suited))?;
    let (plan, chunks, dir) = (folder.plan(), folder.chunks(), folder.path().display());
    let other = |asked: &u64| (*asked).min(plan.points()) != chunks;
    if let Some(asked) = planning.chunks.filter(other) {
        bail!(
            Input,
            "{dir} already holds this plan in {chunks} chunks; leave out --chunks {asked}, or give another --dir"
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
        folder: dir.to_string(),
    };
    output::print(planning.format, &report, || {
        format!(
            "{} points ({}) in {chunks} chunks of up to {}: about {} on one processor, {} for each chunk\n\
             Compute them: bead sweep run {dir} --chunk K/{chunks}, or bead sweep submit {dir} --out F.parquet",
            HumanCount(plan.points()),
            axes(plan),
            HumanCount(folder.most_points()),
            time(work),
            time(of_chunk),
        )
    })
}

pub(crate) fn run(running: &RunArguments) -> Result<(), Failure> {
    let folder = Folder::open(&running.dir)?;
    interrupt::resumable("finished chunks are kept; the same command continues from there".to_owned());
    let (pool, all) = (running.threads.pool()?, folder.chunks());
    let Some((chunk, of)) = running.chunk else {
        let points = HumanCount(pool.install(|| compute_missing(&folder))?);
        return output::print_line(&format!(
            "{points} points computed; all {all} chunks are finished"
        ));
    };
    if of != all {
        bail!(
            Input,
            "--chunk {chunk}/{of}: the plan in {} has {all} chunks; give K/{all}, or the folder of another plan",
            folder.path().display()
        );
    }
    if folder.finished(chunk)? {
        return output::print_line(&format!("chunk {chunk}/{of} is finished already"));
    }
    let points = folder.points(chunk);
    let count = points.end - points.start;
    let bar = output::part_done(format!("of chunk {chunk}/{of}"));
    pool.install(|| folder.run(chunk, &|done| output::set_part(&bar, done / count as f64)))?;
    bar.finish_and_clear();
    output::print_line(&format!("chunk {chunk}/{of}: {} points", HumanCount(count)))
}

pub(crate) fn submit(submitting: &SubmitArguments) -> Result<(), Failure> {
    let folder = Folder::open(&submitting.dir)?;
    // The merging job replaces the table, so its place is checked now.
    result(&folder, &submitting.out, submitting.overwrite)?;
    let (missing, chunks, plan) = (folder.missing()?, folder.chunks(), slurm_name(&folder));
    if missing.is_empty() {
        let (dir, out) = (folder.path().display(), submitting.out.display());
        note!("all {chunks} chunks are finished; merge them with: bead sweep merge {dir} --out {out}");
        return Ok(());
    }
    let waiting = slurm::queued(plan);
    if !waiting.is_empty() {
        let (jobs, numbers) = (waiting.join(" and "), waiting.join(" "));
        bail!(
            Input,
            "job {jobs} of this plan is still in the queue; wait for it, or end it with: scancel {numbers}"
        );
    }
    let whole = |path: &Path| -> Result<String, Failure> {
        let path = std::path::absolute(path).with_context(|| format!("{}: not a path", path.display()))?;
        let text = path.into_os_string().into_string();
        text.map_err(|path| {
            let path = path.display();
            failure!(
                Input,
                "{path}: Slurm takes only paths in UTF-8; give another path"
            )
        })
    };
    let program = std::env::current_exe()
        .context("cannot find the path of this program")
        .map_err(Failure::Device)?;
    let jobs = Jobs {
        program: &whole(&program)?,
        folder: &whole(folder.path())?,
        out: &whole(&submitting.out)?,
        plan,
        missing: &missing,
        chunks,
        cpus: submitting.cpus,
        at_once: submitting.at_once,
        options: &submitting.sbatch,
    };
    note!(
        "{} of {chunks} chunks are missing; pipe these lines to sh to submit them",
        missing.len()
    );
    output::print_line(&jobs.script())
}

/// The first letters of the plan's hash, which end the names of its jobs.
fn slurm_name(folder: &Folder) -> &str {
    &folder.plan().hash()[..8]
}

pub(crate) fn status(standing: &StatusArguments) -> Result<(), Failure> {
    let folder = Folder::open(&standing.dir)?;
    let (missing, chunks, points) = (folder.missing()?, folder.chunks(), folder.plan().points());
    let jobs = slurm::queued(slurm_name(&folder));
    let finished = chunks - missing.len() as u64;
    let report = StatusReport {
        plan: folder.plan().hash(),
        points,
        chunks,
        finished,
        missing: &missing,
        bytes: folder.size(),
        jobs: &jobs,
    };
    output::print(standing.format, &report, || {
        let points = HumanCount(points);
        let mut text = format!("{finished} of {chunks} chunks are finished; the plan has {points} points");
        if !missing.is_empty() {
            text += &format!("\nmissing: {}", ranges(&missing));
        }
        if !jobs.is_empty() {
            text += &format!("\nin the queue: job {}", jobs.join(", "));
        } else if !missing.is_empty() {
            let dir = folder.path().display();
            text += &format!(
                "\nno job computes them; start one with: bead sweep run {dir}, or bead sweep submit {dir}"
            );
        }
        text
    })
}

pub(crate) fn merge(merging: &MergeArguments) -> Result<(), Failure> {
    let folder = Folder::open(&merging.dir)?;
    let out = result(&folder, &merging.out, merging.overwrite)?;
    let merged = merge_into(&folder, &out)?;
    summary(folder.plan(), &merged, out.path(), None, merging.format)
}

fn result(folder: &Folder, out: &Path, overwrite: Overwrite) -> Result<Target, Failure> {
    if folder.has_within(out) {
        let out = out.display();
        bail!(
            Input,
            "{out} is in the folder of the plan's parts; give the table another folder"
        );
    }
    place::target(out, FileKind::Parquet, &[], overwrite)
}
