//! Commands that are interrupted: what they leave behind, and how they end.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

use std::fs;
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

const SCENARIO: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/scenarios/paper-strike.toml");

/// A child that is killed if the test fails before it ends.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Running {
    fn ended(&self) -> bool {
        // A child that has ended and was not waited for is a zombie.
        let state = fs::read_to_string(format!("/proc/{}/stat", self.0.id())).unwrap_or_default();
        state
            .rsplit_once(") ")
            .is_none_or(|(_, rest)| rest.starts_with('Z'))
    }

    fn signal(&self, name: &str) {
        let kill = format!("kill -{name} {}", self.0.id());
        assert!(Command::new("sh").args(["-c", &kill]).status().unwrap().success());
    }
}

/// Waits until something holds.
fn until(what: &str, holds: impl Fn() -> bool) {
    let started = Instant::now();
    while !holds() {
        assert!(started.elapsed() < Duration::from_secs(60), "never: {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn names(directory: &Path) -> Vec<String> {
    let entries = fs::read_dir(directory).unwrap();
    entries
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect()
}

#[test]
fn a_result_that_is_interrupted_leaves_no_part_of_it() {
    for (signal, status) in [("INT", 130), ("TERM", 143), ("HUP", 129)] {
        let directory = tempfile::tempdir().unwrap();
        let mut running = Running(
            Command::new(env!("CARGO_BIN_EXE_bead"))
                .current_dir(&directory)
                // Half a gigabyte of rows: there is time to interrupt it.
                .args(["simulate", SCENARIO, "--out", "a.parquet", "--rate", "1e8"])
                .stdout(Stdio::null())
                .stderr(Stdio::piped())
                .spawn()
                .unwrap(),
        );
        let hidden = || {
            names(directory.path())
                .iter()
                .any(|name| name.starts_with(".bead-"))
        };
        // The first such file only shows that the directory can be written to.
        until("the result is being written", || {
            hidden() && {
                std::thread::sleep(Duration::from_millis(100));
                hidden()
            }
        });
        running.signal(signal);
        let ended = running.0.wait().unwrap();
        assert_eq!((ended.code(), ended.signal()), (Some(status), None));
        assert_eq!(names(directory.path()), [""; 0]);
        let mut said = String::new();
        std::io::Read::read_to_string(&mut running.0.stderr.take().unwrap(), &mut said).unwrap();
        assert!(
            said.starts_with("bead: interrupted; nothing is left behind"),
            "{said}"
        );
        assert_eq!(said.lines().count(), 1, "{said}");
    }
}

/// Processes that `parent` started.
fn children(parent: u32) -> Vec<u32> {
    let below = |pid: &u32| {
        // It may have ended meanwhile.
        let stat = fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
        let rest = stat.rsplit(") ").next().unwrap_or_default();
        rest.split(' ').nth(1) == Some(&parent.to_string())
    };
    let all = fs::read_dir("/proc").unwrap();
    let pids = all.filter_map(|entry| entry.unwrap().file_name().to_str()?.parse().ok());
    pids.filter(below).collect()
}

/// Whether a process runs: not one that has ended and was not yet waited for.
fn runs(pid: u32) -> bool {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    stat.rsplit(") ")
        .next()
        .is_some_and(|rest| !rest.is_empty() && !rest.starts_with('Z'))
}

#[test]
fn an_emulated_run_that_is_interrupted_leaves_no_file_and_no_qemu() {
    for (signal, status) in [("INT", 130), ("TERM", 143), ("HUP", 129)] {
        let [directory, temporary] = [(); 2].map(|()| tempfile::tempdir().unwrap());
        let mut running = Running(
            Command::new(env!("CARGO_BIN_EXE_bead"))
                .current_dir(&directory)
                .env("TMPDIR", temporary.path())
                // Ten seconds of virtual time: there is time to interrupt it.
                .args([
                    "emulate",
                    SCENARIO,
                    "--bead",
                    "8",
                    "--strikes",
                    "100",
                    "--out",
                    "run",
                ])
                .stdout(Stdio::null())
                .stderr(Stdio::piped())
                .spawn()
                .unwrap(),
        );
        until("QEMU runs", || !children(running.0.id()).is_empty());
        let qemu = children(running.0.id());
        std::thread::sleep(Duration::from_millis(200));
        running.signal(signal);
        let ended = running.0.wait().unwrap();
        assert_eq!((ended.code(), ended.signal()), (Some(status), None));
        until("QEMU has ended", || !qemu.iter().any(|pid| runs(*pid)));
        until("the temporary folder is empty", || {
            names(temporary.path()).is_empty()
        });
        assert_eq!(names(directory.path()), [""; 0]);
        let mut said = String::new();
        std::io::Read::read_to_string(&mut running.0.stderr.take().unwrap(), &mut said).unwrap();
        assert!(
            said.starts_with("bead: interrupted; nothing is left behind"),
            "{said}"
        );
        assert_eq!(said.lines().count(), 1, "{said}");
    }
}

#[test]
fn ctrl_c_at_a_terminal_does_not_reach_qemu_and_the_run_leaves_nothing() {
    use std::os::unix::process::CommandExt;
    let (directory, temporary) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut running = Running(
        Command::new(env!("CARGO_BIN_EXE_bead"))
            .current_dir(&directory)
            .env("TMPDIR", temporary.path())
            // A minute of the bead's time, which takes ten seconds.
            .args([
                "emulate",
                SCENARIO,
                "--bead",
                "8",
                "--strikes",
                "600",
                "--out",
                "run",
            ])
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            // Like a shell: this program and what it starts are one group, unless it says otherwise.
            .process_group(0)
            .spawn()
            .unwrap(),
    );
    let started = || {
        let folders = fs::read_dir(temporary.path()).unwrap();
        let sends = |folder: fs::DirEntry| {
            fs::metadata(folder.path().join("sent0.bin")).is_ok_and(|sent| sent.len() > 0)
        };
        folders.flatten().any(sends)
    };
    until("the bead speaks", || started() || running.ended());
    if running.ended() {
        let mut said = String::new();
        std::io::Read::read_to_string(&mut running.0.stderr.take().unwrap(), &mut said).unwrap();
        // There is neither an image nor QEMU where only this crate is built.
        assert!(
            said.contains("cargo xtask build") || said.contains("qemu-system-arm"),
            "{said}"
        );
        return;
    }
    let group = format!("kill -INT -- -{}", running.0.id());
    assert!(
        Command::new("bash")
            .args(["-c", &group])
            .status()
            .unwrap()
            .success()
    );
    let ended = running.0.wait().unwrap();
    let mut said = String::new();
    std::io::Read::read_to_string(&mut running.0.stderr.take().unwrap(), &mut said).unwrap();
    assert_eq!((ended.code(), ended.signal()), (Some(130), None), "{said}");
    assert!(
        said.starts_with("bead: interrupted; nothing is left behind"),
        "{said}"
    );
    assert_eq!(names(directory.path()), [""; 0]);
    // QEMU ends with its host, and takes its files with it.
    until("nothing is left of the run", || {
        names(temporary.path()).is_empty()
    });
}

#[test]
fn a_search_that_is_interrupted_prints_the_best_so_far() {
    let mut running = Running(
        Command::new(env!("CARGO_BIN_EXE_bead"))
            // Five speeds and nine hosts: there is time to interrupt it.
            .args(["optimise", SCENARIO, "--hosts", "2-10", "--total-mass", "0.05"])
            .args(["--speeds", "0.1,0.2,0.5,1,2", "--format", "json"])
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap(),
    );
    std::thread::sleep(Duration::from_secs(2));
    running.signal("INT");
    let mut said = String::new();
    std::io::Read::read_to_string(&mut running.0.stdout.take().unwrap(), &mut said).unwrap();
    assert_eq!(running.0.wait().unwrap().code(), Some(0));
    let found: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert_eq!(found["optimum"]["stopped"], true);
    assert_eq!(found["optimum"]["settled"], false);
    let share = found["optimum"]["share"].as_f64().unwrap();
    assert!((0.1..0.99).contains(&share), "{share}");
}
