//! Jobs for Slurm: an array with a task for each chunk, and one that merges.

use std::path::Path;

use crate::sweep::folder::ranges;

/// What the jobs are given.
#[derive(Debug, Clone)]
pub struct Jobs<'a> {
    /// This program, by its whole path.
    pub program: &'a Path,
    /// The folder of the sweep, by its whole path.
    pub folder: &'a Path,
    /// The merged table, by its whole path.
    pub out: &'a Path,
    /// Beginning of the plan's hash.
    pub plan: &'a str,
    /// The chunks that are missing.
    pub missing: &'a [u64],
    /// How many chunks there are.
    pub chunks: u64,
    /// Processors of a task.
    pub cpus: u32,
    /// Tasks at a time, if not all.
    pub at_once: Option<u32>,
    /// Further options of `sbatch`, for both jobs.
    pub options: &'a [String],
}

impl Jobs<'_> {
    /// What the jobs cannot be given: a shell reads the paths, and Slurm reads `%` in the names of logs.
    pub fn refused(&self) -> Option<String> {
        let odd = |text: &str| text.contains(|c: char| !c.is_alphanumeric() && !"_./+,:=@-".contains(c));
        let paths = [self.program, self.folder, self.out];
        let path = paths.into_iter().find(|path| path.to_str().is_none_or(odd));
        let path = path.map(|path| {
            format!(
                "{}: a path in a script of Slurm has letters, digits and _./+,:=@- alone; give another",
                path.display()
            )
        });
        let line = self
            .options
            .iter()
            .find(|option| option.contains(char::is_control));
        path.or_else(|| {
            line.map(|option| format!("--sbatch {option:?} is more than one line; give it for each option"))
        })
    }

    fn head(&self, name: &str, log: &str) -> String {
        let options = self.options.iter().map(|option| format!("#SBATCH {option}\n"));
        format!(
            "#!/bin/sh\n#SBATCH --job-name=bead-{name}-{}\n#SBATCH --output={}/{log}\n#SBATCH --open-mode=append\n{}",
            self.plan,
            self.folder.display(),
            options.collect::<String>()
        )
    }

    /// The script of the array. A task that is killed and starts again computes its chunk anew; a finished
    /// chunk stays.
    pub fn array(&self) -> String {
        let at_once = self.at_once.map_or(String::new(), |count| format!("%{count}"));
        format!(
            "{}#SBATCH --array={}{at_once}\n#SBATCH --cpus-per-task={}\n#SBATCH --requeue\n\
             exec {} sweep run {} --chunk \"$SLURM_ARRAY_TASK_ID/{}\" --threads {}\n",
            self.head("sweep", "log-%a.txt"),
            ranges(self.missing),
            self.cpus,
            self.program.display(),
            self.folder.display(),
            self.chunks,
            self.cpus,
        )
    }

    /// The script of the job that merges, once each task of the array has ended. It checks that all is there.
    pub fn merge(&self, array: &str) -> String {
        format!(
            "{}#SBATCH --dependency=afterany:{array}\n#SBATCH --requeue\nexec {} sweep merge {} --out {} --overwrite\n",
            self.head("merge", "log-merge.txt"),
            self.program.display(),
            self.folder.display(),
            self.out.display(),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_that_a_shell_would_read_is_refused() {
        let jobs = |out: &str| {
            let path = Path::new("/work/é-1,2");
            let jobs = Jobs {
                program: path,
                folder: path,
                out: Path::new(out),
                plan: "0123abcd",
                missing: &[1],
                chunks: 1,
                cpus: 1,
                at_once: None,
                options: &[],
            };
            jobs.refused()
        };
        assert_eq!(jobs("/work/big_2.parquet"), None);
        for odd in [
            "a;id", "a$HOME", "a&b", "a(b)", "a#b", "a b", "a%j", "a'b", "a|b", "a>b", "a*b", "~a", "a\nb",
        ] {
            assert!(jobs(odd).is_some(), "{odd}");
        }
    }
}
