//! A sweep on a real Slurm: one node on this machine, killed in the middle and submitted again.

use std::process::{Command, Output};
use std::thread;
use std::time::Duration;

use crate::program::{PROGRAM, TestFolder, assert_says, done, names, refused, said, until};
use hertz_chain::Scenario;

const ONE_NODE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/slurm/one-node.sh");
/// Long enough to be killed: 40 elastic beads over 80 ms, 6 chunks of 1500.
const SWEEP: &str =
    "scenario = \"long.toml\"\n[[axis]]\nkey = \"striker.velocity\"\nlinspace = [0.2, 1.2, 9000]";

/// A Slurm of one node, stopped at the end of the test, and a folder to work in.
struct Slurm {
    node: TestFolder,
    folder: TestFolder,
}

impl Slurm {
    /// `None` where it is not installed.
    fn start() -> Option<Self> {
        let script =
            "export PATH=$PATH:/usr/sbin:/usr/local/sbin; command -v slurmctld slurmd sbatch squeue sinfo";
        let mut shell = Command::new("sh");
        let found = shell.args(["-c", script]).output().unwrap();
        if found.stdout.iter().filter(|&&byte| byte == b'\n').count() < 5 {
            eprintln!("SKIPPED: no Slurm here (Debian: apt-get install --no-install-recommends slurm-wlm)");
            return None;
        }
        let [node, folder] = [(); 2].map(|()| TestFolder::new());
        done(Command::new(ONE_NODE).arg("start").arg(&*node).output().unwrap());
        Some(Self { node, folder })
    }

    fn command(&self, program: &str, arguments: &str) -> Output {
        let mut command = Command::new(program);
        command.current_dir(&*self.folder);
        command.args(arguments.split_whitespace());
        let configuration = self.node.join("slurm.conf");
        command.env("SLURM_CONF", configuration).output().unwrap()
    }

    fn bead(&self, arguments: &str) -> String {
        done(self.command(PROGRAM, arguments))
    }

    /// Gives a script to a shell.
    fn shell(&self, script: &str) -> String {
        self.folder.write("submit.sh", script);
        done(self.command("sh", "submit.sh"))
    }

    fn queue(&self) -> String {
        done(self.command("squeue", "--noheader --format=%T"))
    }

    /// Number of chunks that are finished.
    fn parts(&self) -> usize {
        let names = names(&self.folder.join("d"));
        names.iter().filter(|name| name.starts_with("part-")).count()
    }
}

impl Drop for Slurm {
    fn drop(&mut self) {
        let _ = Command::new(ONE_NODE).arg("stop").arg(&*self.node).status();
        // The daemons write into their folder until they have ended.
        let is_gone = |name: &str| !self.node.join(name).exists();
        let mut waits = 0..100;
        while waits.next().is_some() && !(is_gone("slurmd.pid") && is_gone("slurmctld.pid")) {
            thread::sleep(Duration::from_millis(50));
        }
    }
}

#[test]
fn a_sweep_that_is_killed_on_slurm_and_submitted_again_comes_out_whole() {
    let Some(slurm) = Slurm::start() else {
        return;
    };
    let mut long = Scenario::paper();
    (long.chain.beads, long.chain.relaxation, long.duration) = (40, 0.0, 0.08);
    slurm.folder.write("long.toml", long.to_toml());
    slurm.folder.write("sweep.toml", SWEEP);
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
    // The array is killed while tasks run. The merging job then finds that chunks are missing.
    let mut lines = submitted.lines();
    let array = lines.find_map(|line| line.strip_prefix("array: job ")).unwrap();
    done(slurm.command("scancel", &format!("--signal=KILL {array}")));
    done(slurm.command("scancel", array));
    until("the queue is empty", || slurm.queue().is_empty());
    let left = slurm.parts();
    assert!((2..6).contains(&left), "{left}");
    assert!(!slurm.folder.join("a.parquet").exists());
    let log = slurm.folder.text("d/log-merge.txt");
    assert_says(&log, "of 6 chunks are missing");

    slurm.shell(&slurm.bead(submit));
    until("the table is merged", || slurm.folder.join("a.parquet").exists());
    let again = slurm.command(PROGRAM, &submit.replace("a.p", "c.p"));
    assert_says(&said(&again), "all 6 chunks are finished");
    // One machine gives the same bytes.
    slurm.bead("sweep sweep.toml --out b.parquet");
    let [slurms, own] = ["a.parquet", "b.parquet"].map(|name| slurm.folder.read(name));
    assert!(slurms == own);
}
