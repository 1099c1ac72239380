//! Jobs for Slurm: an array with a task for each missing chunk, and a job that merges the parts.

use std::process::{Command, Output};

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
    /// Lines for a shell that submit both jobs. A task that is killed computes its chunk anew.
    pub fn script(&self) -> String {
        let Self { chunks, cpus, .. } = self;
        let [program, folder, out] = [self.program, self.folder, self.out].map(quoted);
        let at_once = self.at_once.map_or(String::new(), |count| format!("%{count}"));
        let array = [
            format!("--array={}{at_once}", ranges(self.missing)),
            format!("--cpus-per-task={cpus}"),
        ];
        let chunk = format!("--chunk \"$SLURM_ARRAY_TASK_ID/{chunks}\" --threads {cpus}");
        let run = format!("exec {program} sweep run {folder} {chunk}");
        let merge = format!("exec {program} sweep merge {folder} --out {out} --overwrite");
        // `sbatch` may print the name of a cluster after the number of a job.
        format!(
            "array=$({}) || exit\necho \"array: job ${{array%%;*}}\"\n{} \"--dependency=afterany:${{array%%;*}}\"",
            self.job("sweep", "log-%a.txt", &array, &run),
            self.job("merge", "log-merge.txt", &[], &merge)
        )
    }

    fn job(&self, name: &str, log: &str, options: &[String], command: &str) -> String {
        let own = [
            format!("--job-name=bead-{name}-{}", self.plan),
            format!("--chdir={}", self.folder),
            format!("--output={log}"),
        ];
        let command = [format!("--wrap={command}")];
        let words = own.iter().chain(options).chain(self.options).chain(&command);
        let words: Vec<_> = words.map(|word| quoted(word)).collect();
        format!(
            "sbatch --parsable --requeue --open-mode=append {}",
            words.join(" ")
        )
    }
}

/// A word for a shell, in single quotes where it needs them.
fn quoted(text: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "_./+,:=@-%".contains(c);
    if text.chars().all(is_plain) {
        return text.to_owned();
    }
    format!("'{}'", text.replace('\'', r"'\''"))
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
        // A stand-in for `sbatch` that prints the words of each call and answers with a job number.
        let sbatch = "sbatch() { printf '%s\\n' \"$@\" >&2; echo '7;cluster'; }";
        let script = format!("{sbatch}\n{}", jobs.script());
        let read = Command::new("sh").args(["-c", &script]).output().unwrap();
        let words = String::from_utf8(read.stderr).unwrap();
        let lines: Vec<&str> = words.lines().collect();
        for line in ["--array=1-2,4%3", "--partition=all", "--dependency=afterany:7"] {
            assert!(lines.contains(&line), "{words}");
        }
        let commands = lines.iter().filter_map(|line| line.strip_prefix("--wrap=exec "));
        let commands: Vec<&str> = commands.collect();
        for (command, last) in commands
            .iter()
            .zip(["--threads\n2\n", "/work/a b.parquet\n--overwrite\n"])
        {
            // The shell on the node reads the command again.
            let print = format!("printf '%s\\n' {command}");
            let read = Command::new("sh").args(["-c", &print]).output().unwrap();
            let words = String::from_utf8(read.stdout).unwrap();
            assert!(words.starts_with("/work/é 1/bead\nsweep\n"), "{words}");
            assert!(
                words.contains("\n/work/it's; $HOME\n") && words.ends_with(last),
                "{words}"
            );
        }
        assert_eq!(commands.len(), 2);
    }
}
