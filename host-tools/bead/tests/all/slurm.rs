//! A sweep on a real Slurm: one node on this machine, killed in the middle and submitted again.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};
use std::time::{Duration, Instant};

use hertz_chain::Scenario;

const ONE_NODE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/slurm/one-node.sh");
/// Long enough to be killed: 40 elastic beads over 80 ms, 6 chunks of 1500.
const SWEEP: &str =
    "scenario = \"long.toml\"\n[[axis]]\nkey = \"striker.velocity\"\nlinspace = [0.2, 1.2, 9000]";

/// Slurm, which is stopped at the end of the test.
struct Slurm(tempfile::TempDir);

impl Slurm {
    /// None where it is not installed.
    fn start() -> Option<Self> {
        let there = |program: &str| {
            let paths = ["/usr/bin", "/usr/sbin", "/usr/local/bin", "/usr/local/sbin"];
            paths.iter().any(|path| Path::new(path).join(program).exists())
        };
        if !["slurmctld", "slurmd", "sbatch", "squeue", "sinfo"]
            .into_iter()
            .all(there)
        {
            return None;
        }
        let slurm = Self(tempfile::tempdir().unwrap());
        let started = Command::new(ONE_NODE)
            .arg("start")
            .arg(slurm.0.path())
            .output()
            .unwrap();
        assert!(
            started.status.success(),
            "{}",
            String::from_utf8_lossy(&started.stderr)
        );
        Some(slurm)
    }

    fn command(&self, folder: &Path, program: &str, arguments: &str) -> Output {
        Command::new(program)
            .current_dir(folder)
            .args(arguments.split_whitespace())
            .env("SLURM_CONF", self.0.path().join("slurm.conf"))
            .output()
            .unwrap()
    }

    fn bead(&self, folder: &Path, arguments: &str) -> String {
        let output = self.command(folder, env!("CARGO_BIN_EXE_bead"), arguments);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{arguments}: {said}");
        String::from_utf8(output.stdout).unwrap()
    }

    /// Waits until something holds, and says what the logs say if it never does.
    fn until(&self, folder: &Path, what: &str, holds: impl Fn() -> bool) {
        let started = Instant::now();
        while !holds() {
            if started.elapsed() > Duration::from_secs(120) {
                let log = |name: &str| fs::read_to_string(folder.join("d").join(name)).unwrap_or_default();
                let queue = self.command(folder, "squeue", "");
                let queue = String::from_utf8_lossy(&queue.stdout).into_owned();
                panic!(
                    "never: {what}\n{queue}\n{}{}",
                    log("log-1.txt"),
                    log("log-merge.txt")
                );
            }
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    fn queue(&self, folder: &Path) -> String {
        let queue = self.command(folder, "squeue", "--noheader --format=%T");
        String::from_utf8(queue.stdout).unwrap()
    }
}

impl Drop for Slurm {
    fn drop(&mut self) {
        let _ = Command::new(ONE_NODE).arg("stop").arg(self.0.path()).status();
        // The daemons write into their folder until they have ended.
        for _ in 0..100 {
            let gone = |name: &str| !self.0.path().join(format!("{name}.pid")).exists();
            if gone("slurmd") && gone("slurmctld") {
                return;
            }
            std::thread::sleep(Duration::from_millis(50));
        }
    }
}

fn parts(folder: &Path) -> usize {
    let entries = fs::read_dir(folder.join("d")).unwrap();
    let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    names.filter(|name| name.starts_with("part-")).count()
}

#[test]
fn a_sweep_that_is_killed_on_slurm_and_submitted_again_comes_out_whole() {
    let Some(slurm) = Slurm::start() else {
        eprintln!("SKIPPED: no Slurm here (Debian: apt-get install --no-install-recommends slurm-wlm)");
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut long = Scenario::paper();
    (long.chain.beads, long.chain.relaxation, long.duration) = (40, 0.0, 0.08);
    fs::write(folder.join("long.toml"), long.to_toml()).unwrap();
    fs::write(folder.join("sweep.toml"), SWEEP).unwrap();
    slurm.bead(folder, "sweep plan sweep.toml --dir d --chunks 6");

    let submit = "sweep submit d --engine slurm --out a.parquet --at-once 2";
    let dry = slurm.bead(folder, &format!("{submit} --dry-run --sbatch=--partition=all"));
    for part in [
        "--array=1-6%2",
        "--partition=all",
        "--dependency=afterany:JOB",
        "sweep run",
    ] {
        assert!(dry.contains(part), "{dry}");
    }
    assert_eq!(slurm.queue(folder), "", "a dry run submits nothing");

    let said = slurm.bead(folder, submit);
    assert!(said.contains("6 of 6 chunks"), "{said}");
    slurm.until(folder, "two chunks are finished", || parts(folder) >= 2);
    let again = slurm.command(folder, env!("CARGO_BIN_EXE_bead"), submit);
    assert_eq!(again.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&again.stderr).contains("is still in the queue"));
    // The array is killed with tasks that run; what merges then finds that chunks are missing.
    let array = said.split_whitespace().nth(1).unwrap().trim_end_matches(':');
    assert!(
        slurm
            .command(folder, "scancel", &format!("--signal=KILL {array}"))
            .status
            .success()
    );
    assert!(slurm.command(folder, "scancel", array).status.success());
    slurm.until(folder, "the queue is empty", || slurm.queue(folder).is_empty());
    let left = parts(folder);
    assert!((2..6).contains(&left), "{left}");
    assert!(!folder.join("a.parquet").exists());
    let log = fs::read_to_string(folder.join("d/log-merge.txt")).unwrap();
    assert!(log.contains("of 6 chunks are missing"), "{log}");

    let said = slurm.bead(folder, submit);
    assert!(said.contains(&format!("{} of 6 chunks", 6 - left)), "{said}");
    slurm.until(folder, "the table is merged", || {
        folder.join("a.parquet").exists()
    });
    assert!(
        slurm
            .bead(folder, submit.replace("a.p", "c.p").as_str())
            .contains("all 6 chunks are finished")
    );
    slurm.bead(folder, "sweep sweep.toml --out b.parquet");
    let at = |name: &str| fs::read(folder.join(name)).unwrap();
    assert!(
        at("a.parquet") == at("b.parquet"),
        "the same bytes as on one machine"
    );
}
