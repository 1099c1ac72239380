//! Runs the programs of the tests and other jobs, as many at a time as there are cores.
//!
//! # Design
//! `cargo test` runs one program after another. Many of them wait, for QEMU to start or for a quiet line, and
//! some end with one long test: cores would be idle for a third of the time. So cargo only compiles and
//! lists the programs. The longest ones start first.

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use serde_json::Value;

use crate::step::{CommandLine, Steps, Stop};

/// A command to run, and its title.
#[derive(Debug, Clone)]
pub(crate) struct Job {
    pub(crate) title: String,
    pub(crate) line: CommandLine,
}

impl Job {
    pub(crate) fn new(title: impl Into<String>, line: CommandLine) -> Self {
        let title = title.into();
        Self { title, line }
    }
}

/// Titles of the longest jobs, longest first. The others take some seconds.
const LONG: [&str; 7] = [
    "-p bead-tests ",
    "-p absorber-bead --test all",
    "the paper's figures",
    "-p bead-fuzz --test campaign",
    "-p hertz-chain --test all",
    "-p stm32f405-qemu --test all",
    "-p absorber-bead --lib",
];

/// Test programs in the output of `cargo test --no-run --message-format json`.
pub(crate) fn programs(told: &str) -> Vec<Job> {
    told.lines().filter_map(program).collect()
}

fn program(artifact: &str) -> Option<Job> {
    let artifact: Value = serde_json::from_str(artifact).ok()?;
    // The target says whether it has tests, the profile whether this program is them.
    if artifact["profile"]["test"] != true {
        return None;
    }
    let executable = artifact["executable"].as_str()?;
    let manifest = Path::new(artifact["manifest_path"].as_str()?);
    // "path+file:///…/host-tools#bead@0.1.0", or without a name if that is the folder's.
    let (path, package) = artifact["package_id"].as_str()?.rsplit_once('#')?;
    let package = match package.split_once('@') {
        Some((package, _)) => package,
        None => path.rsplit_once('/')?.1,
    };
    let name = artifact["target"]["name"].as_str()?;
    let which = match artifact["target"]["kind"][0].as_str() {
        Some("test") => format!("--test {name}"),
        Some("bin") => format!("--bin {name}"),
        _ => "--lib".to_owned(),
    };
    let line = CommandLine::program(executable).within(manifest.parent()?);
    Some(Job::new(
        format!("cargo test --release -p {package} {which}"),
        line,
    ))
}

/// Runs all jobs, and returns the number of tests that passed.
///
/// # Errors
/// The error of a job that fails. Running jobs are waited for, and no other begins.
pub(crate) fn run(steps: &Steps, mut jobs: Vec<Job>) -> Result<usize, Stop> {
    let rank = |job: &Job| LONG.iter().position(|long| job.title.contains(long));
    jobs.sort_by_key(|job| rank(job).unwrap_or(LONG.len()));
    let workers = thread::available_parallelism().map_or(2, usize::from);
    steps.announce(&format!("{} programs, {workers} at a time", jobs.len()));
    let (passed, queue) = (AtomicUsize::new(0), Mutex::new(jobs.into_iter()));
    let steps = steps.beside();
    let work = || {
        loop {
            let job = queue.lock().unwrap_or_else(PoisonError::into_inner).next();
            let Some(Job { title, line }) = job else {
                return Ok(());
            };
            let tell = |printed: &str, took: Duration| {
                let tests = passes(printed);
                passed.fetch_add(tests, Ordering::Relaxed);
                match tests {
                    0 => format!("passed in {:.1} s: {title}", took.as_secs_f64()),
                    _ => format!("{tests} passed in {:.1} s: {title}", took.as_secs_f64()),
                }
            };
            steps.until_one_fails(|| steps.run_and_tell(&title, &line, tell))?;
        }
    };
    thread::scope(|scope| {
        let workers: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
        let ended = workers.into_iter().map(|worker| worker.join());
        let ended: Vec<_> = ended
            .map(|end| end.unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
            .collect();
        Steps::first_failure(ended)
    })?;
    Ok(passed.into_inner())
}

/// Number of passed tests in the output of a test harness.
fn passes(printed: &str) -> usize {
    let results = printed
        .lines()
        .filter_map(|line| line.strip_prefix("test result: ok. "));
    let counts = results.filter_map(|rest| rest.split_once(" passed")?.0.parse::<usize>().ok());
    counts.sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As cargo 1.95 prints it, on one line.
    fn artifact(id: &str, kind: &str, name: &str, test: bool) -> String {
        format!(
            r#"{{"reason":"compiler-artifact","package_id":"path+file:///w/{id}","manifest_path":"/w/tests/Cargo.toml","target":{{"kind":["{kind}"],"name":"{name}","test":true}},"profile":{{"opt_level":"3","test":{test}}},"executable":"/w/target/release/deps/{name}-1","fresh":true}}"#
        )
    }

    #[test]
    fn what_cargo_has_made_becomes_the_commands_that_run_it() {
        let told = [
            artifact("tests#bead-tests@0.1.0", "test", "key", true),
            artifact("xtask#0.1.0", "bin", "xtask", true),
            artifact("host-tools#absorber-bead@0.1.0", "lib", "bead", true),
            artifact("host-tools#bead@0.1.0", "bin", "bead", false),
            r#"{"reason":"build-finished","success":true}"#.to_owned(),
        ];
        let jobs = programs(&told.join("\n"));
        let titles = jobs
            .iter()
            .filter_map(|job| job.title.strip_prefix("cargo test --release -p "));
        let expected = [
            "bead-tests --test key",
            "xtask --bin xtask",
            "absorber-bead --lib",
        ];
        assert_eq!(titles.collect::<Vec<_>>(), expected);
        let line = jobs[0].line.to_string();
        assert_eq!(line, "cd /w/tests && /w/target/release/deps/key-1");
    }

    #[test]
    fn every_job_runs_and_its_tests_are_counted_but_after_a_failure_none_begins() {
        let job = |script: &str| Job::new(script, CommandLine::new("sh -c").arg(script));
        let good = job("echo; echo 'test result: ok. 3 passed; 0 failed'");
        let passed = run(&Steps::start().unwrap(), vec![good.clone(); 20]);
        assert_eq!(passed.unwrap(), 60);
        let folder = tempfile::tempdir().unwrap();
        let mark = folder.path().join("began");
        let mut jobs = vec![job("exit 1")];
        // Each worker may take one beside the first.
        let workers = thread::available_parallelism().unwrap().get();
        jobs.extend(vec![job("sleep 0.5"); workers]);
        jobs.push(job(&format!("touch {}", mark.display())));
        let stop = run(&Steps::start().unwrap(), jobs).unwrap_err();
        assert!(stop.message.contains("sh -c 'exit 1'"), "{}", stop.message);
        assert!(!mark.exists());
    }
}
