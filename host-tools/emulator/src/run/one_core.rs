//! QEMU on one core of the host, where one is free.
//!
//! # Design
//! QEMU's two threads wake one another some thousand times a second. From core to core that costs more than two
//! cores gain: on a virtual machine with two, 21 s of a bead's time take 7.6 s, and 4.5 s on one core. Where no
//! core is free, the system shares them out better than a fixed place would. What the image does is the same.

use std::fs;
use std::process::{self, Child, Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

/// The runs of this process so far: runs beside one another get cores of their own.
static RUNS: AtomicUsize = AtomicUsize::new(0);

/// Keeps all threads of a process on one core, if the system has one free and can do that.
pub(super) fn keep(child: &Child) {
    let running = fs::read_to_string("/proc/loadavg").ok();
    let running = running.as_deref().and_then(running_of);
    let cores = thread::available_parallelism().map_or(1, usize::from);
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let allowed = allowed_of(&status);
    if allowed.len() < 2 || running.is_none_or(|running| running > cores) {
        return;
    }
    let place = (process::id() as usize).wrapping_add(RUNS.fetch_add(1, Ordering::Relaxed));
    let core = allowed[place % allowed.len()].to_string();
    // Of util-linux, which nearly every Linux has. Without it the run is slower.
    let _ = Command::new("taskset")
        .args([
            "--all-tasks",
            "--cpu-list",
            "--pid",
            &core,
            &child.id().to_string(),
        ])
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status();
}

/// How many threads run, this one among them, by `/proc/loadavg`.
fn running_of(loadavg: &str) -> Option<usize> {
    let (running, _) = loadavg.split(' ').nth(3)?.split_once('/')?;
    running.parse().ok()
}

/// The cores that this process may use, by `/proc/self/status`.
fn allowed_of(status: &str) -> Vec<usize> {
    let list = status
        .lines()
        .find_map(|line| line.strip_prefix("Cpus_allowed_list:"))
        .unwrap_or_default();
    let range = |part: &str| -> Option<std::ops::RangeInclusive<usize>> {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        Some(first.parse().ok()?..=last.parse().ok()?)
    };
    list.trim().split(',').filter_map(range).flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn running_threads_and_allowed_cores_are_read_as_linux_writes_them() {
        assert_eq!(running_of("0.32 0.20 0.11 3/412 11532\n"), Some(3));
        assert_eq!(running_of(""), None);
        let status = "Name:\tbead\nCpus_allowed:\t3d\nCpus_allowed_list:\t0,2-5\nMems_allowed_list:\t0\n";
        assert_eq!(allowed_of(status), [0, 2, 3, 4, 5]);
        assert!(allowed_of("").is_empty());
    }
}
