//! Commands that are interrupted: what they leave behind, and how they end.

use std::fs;
use std::io::Read;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::program;

const SCENARIO: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../docs/scenarios/paper-strike.toml"
);

/// A child that is killed if the test fails before it ends.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Running {
    /// `bead` in a directory, with another one for its temporary files. Like in a shell, it and what it
    /// starts are one group, unless it says otherwise.
    fn start(directory: &Path, temporary: &Path, arguments: &[&str]) -> Self {
        let mut command = program::interruptible(directory);
        command
            .env("TMPDIR", temporary)
            .args(arguments)
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .process_group(0);
        Self(command.spawn().unwrap())
    }

    fn ended(&self) -> bool {
        !runs(self.0.id())
    }

    fn signal(&self, name: &str) {
        kill(&format!("-{name} {}", self.0.id()));
    }

    fn said(&mut self) -> String {
        let mut said = String::new();
        self.0.stderr.take().unwrap().read_to_string(&mut said).unwrap();
        said
    }

    /// It has been interrupted, ends with this status, says so in a line, and leaves nothing in its
    /// directory.
    fn leaves_nothing(&mut self, status: i32, directory: &Path) {
        let ended = self.0.wait().unwrap();
        let said = self.said();
        assert_eq!((ended.code(), ended.signal()), (Some(status), None), "{said}");
        assert!(
            said.starts_with("bead: interrupted; nothing is left behind"),
            "{said}"
        );
        assert_eq!(said.lines().count(), 1, "{said}");
        assert_eq!(names(directory), [""; 0]);
    }
}

/// Each signal that interrupts, and the exit status after it.
const SIGNALS: [(&str, i32); 3] = [("INT", 130), ("TERM", 143), ("HUP", 129)];

fn kill(whom: &str) {
    let kill = format!("kill {whom}");
    assert!(
        Command::new("bash")
            .args(["-c", &kill])
            .status()
            .unwrap()
            .success()
    );
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
    for (signal, status) in SIGNALS {
        let directory = tempfile::tempdir().unwrap();
        // Half a gigabyte of rows: there is time to interrupt it.
        let long = ["simulate", SCENARIO, "--out", "a.parquet", "--rate", "1e8"];
        let mut running = Running::start(directory.path(), directory.path(), &long);
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
        running.leaves_nothing(status, directory.path());
    }
}

#[test]
fn a_signal_ends_a_command_whose_standard_error_is_closed() {
    let directory = tempfile::tempdir().unwrap();
    let long = ["simulate", SCENARIO, "--out", "a.parquet", "--rate", "1e8"];
    let mut running = Running::start(directory.path(), directory.path(), &long);
    until("it runs", || !names(directory.path()).is_empty());
    drop(running.0.stderr.take());
    running.signal("TERM");
    until("it has ended", || running.ended());
    assert_eq!(running.0.wait().unwrap().code(), Some(143));
    assert_eq!(names(directory.path()), [""; 0]);
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

/// Returns `true` if a process runs: not one that has ended and was not yet waited for.
fn runs(pid: u32) -> bool {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    stat.rsplit(") ")
        .next()
        .is_some_and(|rest| !rest.is_empty() && !rest.starts_with('Z'))
}

/// A run of the image that takes so many strikes.
fn emulate(strikes: &str) -> [&str; 8] {
    [
        "emulate",
        SCENARIO,
        "--bead",
        "8",
        "--strikes",
        strikes,
        "--out",
        "run",
    ]
}

#[test]
fn an_emulated_run_that_is_interrupted_leaves_no_file_and_no_qemu() {
    for (signal, status) in SIGNALS {
        let [directory, temporary] = [(); 2].map(|()| tempfile::tempdir().unwrap());
        // Ten seconds of the bead's time: there is time to interrupt it.
        let mut running = Running::start(directory.path(), temporary.path(), &emulate("100"));
        until("QEMU runs", || !children(running.0.id()).is_empty());
        let qemu = children(running.0.id());
        std::thread::sleep(Duration::from_millis(200));
        running.signal(signal);
        running.leaves_nothing(status, directory.path());
        until("QEMU has ended", || !qemu.iter().any(|pid| runs(*pid)));
        until("the temporary folder is empty", || {
            names(temporary.path()).is_empty()
        });
    }
}

#[test]
fn ctrl_c_at_a_terminal_does_not_reach_qemu_and_the_run_leaves_nothing() {
    let [directory, temporary] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let mut running = Running::start(directory.path(), temporary.path(), &emulate("300"));
    let started = || {
        let folders = fs::read_dir(temporary.path()).unwrap();
        let sends = |folder: fs::DirEntry| {
            fs::metadata(folder.path().join("sent0.bin")).is_ok_and(|sent| sent.len() > 0)
        };
        folders.flatten().any(sends)
    };
    until("the bead speaks", || started() || running.ended());
    if running.ended() {
        let said = running.said();
        // There is neither an image nor QEMU where only this crate is built.
        assert!(
            said.contains("cargo xtask build") || said.contains("qemu-system-arm"),
            "{said}"
        );
        return;
    }
    kill(&format!("-INT -- -{}", running.0.id()));
    running.leaves_nothing(130, directory.path());
    // QEMU ends with its host, and takes its files with it.
    until("nothing is left of the run", || {
        names(temporary.path()).is_empty()
    });
}

#[test]
fn a_search_that_is_interrupted_prints_the_best_so_far() {
    let mut running = Running(
        program::interruptible(Path::new(env!("CARGO_MANIFEST_DIR")))
            // Five speeds and nine hosts: there is time to interrupt it.
            .args(["optimise", SCENARIO, "--bead", "2-10", "--total-mass", "0.05"])
            .args(["--velocity", "0.1,0.2,0.5,1,2", "--format", "json"])
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap(),
    );
    std::thread::sleep(Duration::from_secs(2));
    running.signal("INT");
    let mut said = String::new();
    running
        .0
        .stdout
        .take()
        .unwrap()
        .read_to_string(&mut said)
        .unwrap();
    assert_eq!(running.0.wait().unwrap().code(), Some(0));
    let found: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert_eq!(found["optimum"]["stopped"], true);
    assert_eq!(found["optimum"]["settled"], false);
    let share = found["optimum"]["share"].as_f64().unwrap();
    assert!((0.1..0.99).contains(&share), "{share}");
}
