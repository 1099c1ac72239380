//! A sweep on a real Slurm: one node on this machine, killed in the middle and submitted again.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use crate::program::{PROGRAM, assert_says, done, names, refused, until};
use hertz_chain::Scenario;

const ONE_NODE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/slurm/one-node.sh");
/// Long enough to be killed: 40 elastic beads over 80 ms, 6 chunks of 1500.
const SWEEP: &str =
    "scenario = \"long.toml\"\n[[axis]]\nkey = \"striker.velocity\"\nlinspace = [0.2, 1.2, 9000]";

/// A Slurm of one node, stopped at the end of the test, and a folder to work in.
struct Slurm {
    node: tempfile::TempDir,
    folder: tempfile::TempDir,
}

impl Slurm {
    /// `None` where it is not installed.
    fn start() -> Option<Self> {
        let is_there = |program: &str| {
            let paths = ["/usr/bin", "/usr/sbin", "/usr/local/bin", "/usr/local/sbin"];
            paths.iter().any(|path| Path::new(path).join(program).exists())
        };
        let programs = ["slurmctld", "slurmd", "sbatch", "squeue", "sinfo"];
        if !programs.into_iter().all(is_there) {
            eprintln!("SKIPPED: no Slurm here (Debian: apt-get install --no-install-recommends slurm-wlm)");
            return None;
        }
        let [node, folder] = [(); 2].map(|()| tempfile::tempdir().unwrap());
        done(
            Command::new(ONE_NODE)
                .arg("start")
                .arg(node.path())
                .output()
                .unwrap(),
        );
        Some(Self { node, folder })
    }

    fn command(&self, program: &str, arguments: &str) -> Output {
        let mut command = Command::new(program);
        command
            .current_dir(&self.folder)
            .args(arguments.split_whitespace());
        let configuration = self.node.path().join("slurm.conf");
        command.env("SLURM_CONF", configuration).output().unwrap()
    }

    fn bead(&self, arguments: &str) -> String {
        done(self.command(PROGRAM, arguments))
    }

    /// Gives a script to a shell.
    fn shell(&self, script: &str) -> String {
        let path = self.path("submit.sh");
        fs::write(&path, script).unwrap();
        done(self.command("sh", "submit.sh"))
    }

    fn queue(&self) -> String {
        done(self.command("squeue", "--noheader --format=%T"))
    }

    fn path(&self, name: &str) -> std::path::PathBuf {
        self.folder.path().join(name)
    }

    /// Number of chunks that are finished.
    fn parts(&self) -> usize {
        let names = names(&self.path("d"));
        names.iter().filter(|name| name.starts_with("part-")).count()
    }
}

impl Drop for Slurm {
    fn drop(&mut self) {
        let _ = Command::new(ONE_NODE).arg("stop").arg(self.node.path()).status();
        // The daemons write into their folder until they have ended.
        let is_gone = |name: &str| !self.node.path().join(format!("{name}.pid")).exists();
        until("the daemons have ended", || {
            is_gone("slurmd") && is_gone("slurmctld")
        });
    }
}

#[test]
fn a_sweep_that_is_killed_on_slurm_and_submitted_again_comes_out_whole() {
    let Some(slurm) = Slurm::start() else {
        return;
    };
    let mut long = Scenario::paper();
    (long.chain.beads, long.chain.relaxation, long.duration) = (40, 0.0, 0.08);
    fs::write(slurm.path("long.toml"), long.to_toml()).unwrap();
    fs::write(slurm.path("sweep.toml"), SWEEP).unwrap();
    slurm.bead("sweep plan sweep.toml --dir d --chunks 6");

    let submit = "sweep submit d --out a.parquet --at-once 2";
    let script = slurm.bead(&format!("{submit} --sbatch=--partition=all"));
    for part in [
        "--array=1-6%2",
        "--partition=all",
        "--dependency=afterany:",
        "sweep run",
    ] {
        assert_says(&script, part);
    }
    assert_eq!(slurm.queue(), "", "a script that is printed submits nothing");

    let submitted = slurm.shell(&slurm.bead(submit));
    until("two chunks are finished", || slurm.parts() >= 2);
    refused(&slurm.command(PROGRAM, submit), 2, "is still in the queue");
    // The array is killed with tasks that run; what merges then finds that chunks are missing.
    let array = submitted
        .lines()
        .find_map(|line| line.strip_prefix("array: job "))
        .unwrap();
    done(slurm.command("scancel", &format!("--signal=KILL {array}")));
    done(slurm.command("scancel", array));
    until("the queue is empty", || slurm.queue().is_empty());
    let left = slurm.parts();
    assert!((2..6).contains(&left), "{left}");
    assert!(!slurm.path("a.parquet").exists());
    let log = fs::read_to_string(slurm.path("d/log-merge.txt")).unwrap();
    assert_says(&log, "of 6 chunks are missing");

    slurm.shell(&slurm.bead(submit));
    until("the table is merged", || slurm.path("a.parquet").exists());
    let again = slurm.command(PROGRAM, &submit.replace("a.p", "c.p"));
    assert_says(
        &String::from_utf8_lossy(&again.stderr),
        "all 6 chunks are finished",
    );
    // The bytes are those of one machine.
    slurm.bead("sweep sweep.toml --out b.parquet");
    let [slurms, own] = ["a.parquet", "b.parquet"].map(|name| fs::read(slurm.path(name)).unwrap());
    assert!(slurms == own);
}
