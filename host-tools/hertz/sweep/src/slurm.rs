//! Jobs for Slurm: an array with a task for each missing chunk, and a job that merges the parts.

use std::process::{Command, Output};

use anyhow::Context;

use crate::folder::ranges;

/// A sweep to submit.
#[derive(Debug, Clone)]
pub struct Jobs<'a> {
    /// This program, by its whole path.
    pub program: &'a str,
    /// Folder of the plan, by its whole path.
    pub folder: &'a str,
    /// The merged table, by its whole path.
    pub out: &'a str,
    /// The first letters of the plan's hash, which end the jobs' names.
    pub plan: &'a str,
    /// The missing chunks.
    pub missing: &'a [u64],
    /// Number of chunks.
    pub chunks: u64,
    /// Processors of a task.
    pub cpus: u32,
    /// Tasks that run at the same time at most.
    pub at_once: Option<u32>,
    /// Further options of `sbatch` for both jobs.
    pub options: &'a [String],
}

impl Jobs<'_> {
    /// Arguments of `sbatch` for the array. A task that is killed computes its chunk anew.
    pub fn array(&self) -> Vec<String> {
        let Self { chunks, cpus, .. } = self;
        let at_once = self.at_once.map_or(String::new(), |count| format!("%{count}"));
        let options = [
            format!("--array={}{at_once}", ranges(self.missing)),
            format!("--cpus-per-task={cpus}"),
        ];
        let (program, folder) = (quoted(self.program), quoted(self.folder));
        let command = format!(
            "exec {program} sweep run {folder} --chunk \"$SLURM_ARRAY_TASK_ID/{chunks}\" --threads {cpus}"
        );
        self.job("sweep", "log-%a.txt", &options, &command)
    }

    /// Arguments of `sbatch` for the job that merges, after the last task of `array`.
    pub fn merge(&self, array: &str) -> Vec<String> {
        let [program, folder, out] = [self.program, self.folder, self.out].map(quoted);
        let command = format!("exec {program} sweep merge {folder} --out {out} --overwrite");
        let dependency = format!("--dependency=afterany:{array}");
        self.job("merge", "log-merge.txt", &[dependency], &command)
    }

    fn job(&self, name: &str, log: &str, options: &[String], command: &str) -> Vec<String> {
        let mut arguments = vec![
            "--parsable".to_owned(),
            "--requeue".to_owned(),
            format!("--job-name=bead-{name}-{}", self.plan),
            format!("--chdir={}", self.folder),
            format!("--output={log}"),
            "--open-mode=append".to_owned(),
        ];
        arguments.extend(options.iter().chain(self.options).cloned());
        arguments.push(format!("--wrap={command}"));
        arguments
    }
}

/// A line for a shell that calls `sbatch` with these arguments.
pub fn command_line(arguments: &[String]) -> String {
    let arguments = arguments.iter().map(|argument| quoted(argument));
    format!("sbatch {}", arguments.collect::<Vec<_>>().join(" "))
}

/// A word for a shell, in single quotes where it needs them.
fn quoted(text: &str) -> String {
    if text
        .chars()
        .all(|c| c.is_alphanumeric() || "_./+,:=@-%".contains(c))
    {
        return text.to_owned();
    }
    format!("'{}'", text.replace('\'', r"'\''"))
}

/// Submits a job, and returns its number.
///
/// # Errors
/// `sbatch` cannot be run, or refuses the job.
pub fn submit(arguments: &[String]) -> anyhow::Result<String> {
    let output = Command::new("sbatch").args(arguments).output();
    let output = output.context("cannot run sbatch; is Slurm here? --dry-run prints the commands")?;
    let Output {
        status,
        stdout,
        stderr,
    } = &output;
    let messages = String::from_utf8_lossy(stderr);
    let messages = messages.lines().map(str::trim).collect::<Vec<_>>().join("; ");
    anyhow::ensure!(status.success(), "sbatch refuses the job: {messages}");
    // A cluster's name may follow the number.
    let job = String::from_utf8_lossy(stdout);
    let job = job.trim().split(';').next().unwrap_or_default().to_owned();
    let is_number = !job.is_empty() && job.chars().all(|c| c.is_ascii_digit());
    anyhow::ensure!(is_number, "sbatch gave no number of a job: {job:?} {messages}");
    Ok(job)
}

/// Numbers of the jobs of a plan that have not ended. Without Slurm there are none.
pub fn queued(plan: &str) -> Vec<String> {
    let names = format!("--name=bead-sweep-{plan},bead-merge-{plan}");
    let output = Command::new("squeue")
        .args(["--noheader", "--format=%F", &names])
        .output();
    let Ok(Output { status, stdout, .. }) = output else {
        return Vec::new();
    };
    let text = String::from_utf8_lossy(&stdout);
    let mut jobs: Vec<String> = text.split_whitespace().map(str::to_owned).collect();
    jobs.sort();
    jobs.dedup();
    if status.success() { jobs } else { Vec::new() }
}

#[cfg(test)]
mod tests {
    use std::process::Command;

    use super::*;

    #[test]
    fn a_shell_reads_the_commands_as_they_were_meant() {
        let jobs = Jobs {
            program: "/work/é 1/bead",
            folder: "/work/it's; $HOME",
            out: "/work/a b.parquet",
            plan: "0123abcd",
            missing: &[1, 2, 4],
            chunks: 4,
            cpus: 2,
            at_once: Some(3),
            options: &["--partition=all".to_owned()],
        };
        for (arguments, last) in [
            (jobs.array(), "--threads\n2\n"),
            (jobs.merge("7"), "/work/a b.parquet\n--overwrite\n"),
        ] {
            let line = command_line(&arguments).replacen("sbatch", "printf '%s\\n'", 1);
            let read = Command::new("sh").args(["-c", &line]).output().unwrap();
            assert_eq!(
                String::from_utf8(read.stdout).unwrap(),
                arguments.join("\n") + "\n"
            );
            // The shell on the node reads the command again.
            let command = arguments.last().unwrap().strip_prefix("--wrap=exec ").unwrap();
            let read = Command::new("sh")
                .args(["-c", &format!("printf '%s\\n' {command}")])
                .output()
                .unwrap();
            let words = String::from_utf8(read.stdout).unwrap();
            assert!(words.starts_with("/work/é 1/bead\nsweep\n"), "{words}");
            assert!(
                words.contains("\n/work/it's; $HOME\n") && words.ends_with(last),
                "{words}"
            );
        }
        assert!(jobs.array().contains(&"--array=1-2,4%3".to_owned()));
    }
}
