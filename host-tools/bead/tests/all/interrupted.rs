//! Interrupted commands: exit status, message, and files left behind.

use std::fs;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::thread;
use std::time::Duration;

use crate::program::{ROOT, RunningProgram, SCENARIO, TestFolder, interruptible, json, signal, until};

/// Each signal that interrupts, and the exit status after it.
const SIGNALS: [(&str, i32); 3] = [("INT", 130), ("TERM", 143), ("HUP", 129)];

/// Starts `bead` in a directory, with another one for its temporary files, in a process group of its own.
fn start(directory: &Path, temporary: &Path, arguments: &str) -> RunningProgram {
    let mut command = interruptible(directory, arguments);
    RunningProgram::spawn(command.env("TMPDIR", temporary).process_group(0))
}

/// Asserts that an interrupted command ends with this status and one line, and leaves its directory empty.
fn leaves_nothing(interrupted: RunningProgram, status: i32, directory: &TestFolder) {
    let said = interrupted.end(status);
    assert_eq!(said.lines().count(), 1, "{said}");
    let begin = "bead: interrupted; nothing is left behind";
    assert!(said.starts_with(begin), "{said}");
    assert!(directory.names().is_empty());
}

/// Starts to write a result of half a gigabyte of rows: there is time to interrupt it.
fn write_long(directory: &TestFolder) -> RunningProgram {
    let long = format!("simulate {SCENARIO} --out a.parquet --rate 1e8");
    let running = start(directory, directory, &long);
    let is_hidden = || directory.names().contains(".bead-");
    // The first such file only shows that the directory can be written to.
    until("the result is being written", || {
        is_hidden() && {
            thread::sleep(Duration::from_millis(100));
            is_hidden()
        }
    });
    running
}

#[test]
fn a_result_that_is_interrupted_leaves_no_part_of_it() {
    for (name, status) in SIGNALS {
        let directory = TestFolder::new();
        let running = write_long(&directory);
        running.signal(name);
        leaves_nothing(running, status, &directory);
    }
}

#[test]
fn a_signal_ends_a_command_whose_standard_error_is_closed() {
    let directory = TestFolder::new();
    let mut running = write_long(&directory);
    drop(running.stderr.take());
    running.signal("TERM");
    until("it has ended", || running.has_ended());
    assert_eq!(running.child.wait().unwrap().code(), Some(143));
    assert!(directory.names().is_empty());
}

/// Parent of a process. `None` if the process has ended, waited for or not.
fn running(pid: u32) -> Option<u32> {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    let (state, rest) = stat.rsplit_once(") ")?.1.split_once(' ')?;
    rest.split(' ').next()?.parse().ok().filter(|_| state != "Z")
}

/// Processes that `parent` started.
fn children(parent: u32) -> Vec<u32> {
    let all = fs::read_dir("/proc").unwrap();
    let pids = all.filter_map(|entry| entry.unwrap().file_name().to_str()?.parse().ok());
    pids.filter(|pid| running(*pid) == Some(parent)).collect()
}

#[test]
fn an_emulated_run_that_is_interrupted_leaves_no_file_and_no_qemu() {
    // The last case is Ctrl-C at a terminal, which reaches the whole group.
    let cases = SIGNALS.map(|(name, status)| (name, status, false));
    for (name, status, is_group) in cases.into_iter().chain([("INT", 130, true)]) {
        let [directory, temporary] = [(); 2].map(|()| TestFolder::new());
        // Thirty seconds of the bead's time: there is time to interrupt it.
        let emulate = format!("emulate {SCENARIO} --bead 8 --strikes 300 --out run");
        let interrupted = start(&directory, &temporary, &emulate);
        let pid = interrupted.child.id();
        until("QEMU runs", || !children(pid).is_empty());
        let qemu = children(pid);
        thread::sleep(Duration::from_millis(200));
        let group = if is_group { "-- -" } else { "" };
        signal(name, &format!("{group}{pid}"));
        leaves_nothing(interrupted, status, &directory);
        let has_ended = || qemu.iter().all(|pid| running(*pid).is_none());
        until("QEMU has ended", has_ended);
        until("the temporary folder is empty", || temporary.names().is_empty());
    }
}

#[test]
fn a_search_that_is_interrupted_prints_the_best_so_far() {
    // Five speeds and nine hosts: there is time to interrupt it.
    let search =
        format!("optimise {SCENARIO} --bead 2-10 --total-mass 0.05 --velocity 0.1,0.2,0.5,1,2 --format json");
    let running = RunningProgram::start(Path::new(ROOT), &search);
    thread::sleep(Duration::from_secs(2));
    running.signal("INT");
    let found = json(running.finish());
    assert_eq!(found["optimum"]["stopped"], true);
    assert_eq!(found["optimum"]["settled"], false);
    let share = found["optimum"]["share"].as_f64().unwrap();
    assert!((0.1..0.99).contains(&share), "{share}");
}
