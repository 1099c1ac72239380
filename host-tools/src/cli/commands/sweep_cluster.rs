//! `bead sweep plan`, `run`, `submit`, `status`, `merge`: a sweep in chunks, on one machine or many.

use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::str::FromStr;

use clap::{Args, ValueEnum};
use schemars::JsonSchema;
use serde::Serialize;

use super::sweep_work::{
    Consent, Threads, axes, compute_missing, grouped, measured, merge as merge_into, time, told,
};
use crate::cli::failure::{Blame, Failure};
use crate::cli::interrupt;
use crate::cli::output::{self, Format};
use crate::cli::place::{self, Kind, Overwrite};
use crate::sweep::folder::{Folder, MOST_CHUNKS, ranges};
use crate::sweep::plan::Plan;
use crate::sweep::slurm::Jobs;
use crate::tables::whole::Target;

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
    /// What runs the jobs.
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
    /// Print the scripts and submit nothing.
    #[arg(long)]
    dry_run: bool,
    #[command(flatten)]
    overwrite: Overwrite,
}

/// What runs jobs.
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

/// Work of a chunk, s of one processor.
const CHUNK_SECONDS: f64 = 600.0;
/// Chunks that a cluster takes as one array: Slurm's default is 1000.
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
        return Err(Failure::input(format!(
            "the plan in {} is there already, in {chunks} chunks; leave --chunks {others} out, or give another --dir",
            planning.dir.display()
        )));
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
        return Err(Failure::input(format!(
            "--chunk {chunk}/{of}: the plan in {} has {} chunks; was the chunk of another plan meant?",
            folder.path().display(),
            folder.chunks()
        )));
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

/// Where the numbers of submitted jobs are written.
const JOBS: &str = "jobs.txt";
/// Bytes of it that are read at most, and how many of the last jobs the cluster is asked for: each is a call
/// of `squeue`.
const JOBS_MOST: u64 = 1 << 20;
const JOBS_ASKED: usize = 64;

pub(crate) fn submit(submitting: &Submitting) -> Result<(), Failure> {
    let Engine::Slurm = submitting.engine;
    let folder = Folder::open(&submitting.dir)?;
    // The job that merges finds a file of its own kind at most.
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
    let whole = |path: &Path| std::path::absolute(path).or_input(|| format!("{}: no path", path.display()));
    let program = std::env::current_exe().or_device(|| "where is this program?")?;
    let (dir, out) = (whole(folder.path())?, whole(&submitting.out)?);
    let jobs = Jobs {
        program: &program,
        folder: &dir,
        out: &out,
        plan: &folder.plan().hash()[..8],
        missing: &missing,
        chunks: folder.chunks(),
        cpus: submitting.cpus,
        at_once: submitting.at_once,
        options: &submitting.sbatch,
    };
    if let Some(why) = jobs.refused() {
        return Err(Failure::input(why));
    }
    if submitting.dry_run {
        return output::print_line(&format!("{}\n{}", jobs.array(), jobs.merge("JOB").trim_end()));
    }
    let waiting = queued(&folder);
    if !waiting.is_empty() {
        return Err(Failure::input(format!(
            "job {} of this plan is still in the queue; wait for it, or end it with: scancel {}",
            waiting.join(" and "),
            waiting.join(" ")
        )));
    }
    let note = |job: &str| {
        let file = OpenOptions::new()
            .create(true)
            .append(true)
            .open(folder.beside(JOBS));
        let written = file.and_then(|mut file| writeln!(file, "{job}"));
        written.or_input(|| format!("job {job} was submitted, but its number cannot be written to {JOBS}"))
    };
    let array = sbatch(&jobs.array())?;
    note(&array)?;
    let merge = sbatch(&jobs.merge(&array))?;
    note(&merge)?;
    output::print_line(&format!(
        "job {array}: {} of {} chunks; job {merge} merges them into {}\nHow it goes: bead sweep status {}",
        missing.len(),
        folder.chunks(),
        out.display(),
        folder.path().display()
    ))
}

/// Submits a script, and gives the job's number.
fn sbatch(script: &str) -> Result<String, Failure> {
    let started = Command::new("sbatch")
        .arg("--parsable")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn();
    let mut child = started.or_device(|| "cannot run sbatch; is Slurm here? --dry-run prints the scripts")?;
    let mut stdin = child.stdin.take().expect("it has just been piped");
    let sent = stdin.write_all(script.as_bytes());
    drop(stdin);
    let output = child.wait_with_output().or_device(|| "sbatch")?;
    let said = String::from_utf8_lossy(&output.stderr);
    let said = said.lines().map(str::trim).collect::<Vec<_>>().join("; ");
    if !output.status.success() {
        return Err(Failure::device(format!("sbatch refuses the job: {said}")));
    }
    sent.or_device(|| "sbatch")?;
    let job = String::from_utf8_lossy(&output.stdout);
    // With several clusters it adds the cluster's name.
    let job = job.trim().split(';').next().unwrap_or_default().to_owned();
    match job.chars().all(|c| c.is_ascii_digit()) && !job.is_empty() {
        true => Ok(job),
        false => Err(Failure::device(format!(
            "sbatch gave no number of a job: {job:?} {said}"
        ))),
    }
}

/// The submitted jobs that have not ended.
fn queued(folder: &Folder) -> Vec<String> {
    let path = folder.beside(JOBS);
    let mut jobs = String::new();
    if path.is_file() {
        // Where nothing can be read, nothing was submitted.
        let _ = File::open(path).and_then(|file| file.take(JOBS_MOST).read_to_string(&mut jobs));
    }
    let is_number = |job: &&str| !job.is_empty() && job.chars().all(|c| c.is_ascii_digit());
    let jobs: Vec<&str> = jobs.lines().filter(is_number).collect();
    let mut waiting: Vec<String> = Vec::new();
    for job in &jobs[jobs.len().saturating_sub(JOBS_ASKED)..] {
        let queue = Command::new("squeue")
            .args(["--noheader", "--format=%T", "--jobs", job])
            .output();
        // Of a job that has long ended, it says an error.
        if queue.is_ok_and(|queue| queue.status.success() && !queue.stdout.trim_ascii().is_empty()) {
            waiting.push((*job).to_owned());
        }
    }
    waiting
}

pub(crate) fn status(standing: &Standing) -> Result<(), Failure> {
    let folder = Folder::open(&standing.dir)?;
    let (missing, chunks) = (folder.missing()?, folder.chunks());
    let waiting = queued(&folder);
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
    told(folder.plan(), &merged, out.path(), None, merging.format)
}

/// The merged table. It takes the place of no part.
fn result(folder: &Folder, out: &Path, overwrite: Overwrite) -> Result<Target, Failure> {
    if folder.has_within(out) {
        return Err(Failure::input(format!(
            "{} lies among the parts of the plan; give the table another folder",
            out.display()
        )));
    }
    place::target(out, Kind::Parquet, &[], overwrite)
}
