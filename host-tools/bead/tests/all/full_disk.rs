//! Results that meet a full disk, or one that is read-only: one line, the exit status, and nothing
//! half-written.
//!
//! # Design
//! A small file system in memory is mounted where a user may (in a namespace of its own, without root's
//! rights). It ends with the shell that made it, so that shell says what is left on it. Where mounting is not
//! allowed, the tests are skipped and say so.

use std::fs;
use std::io::Write;
use std::os::unix::net::UnixListener;
use std::path::Path;
use std::process::{Command, Output};
use std::thread;

use crate::program::{DATA, PROGRAM, SCENARIO, TestFolder, refused, said, short_scenario};

/// Every command that writes a file, with the name of the file.
const WRITERS: [(&str, &str); 11] = [
    ("simulate s.toml --out disk/a.parquet", "a.parquet"),
    ("emulate s.toml --bead 8 --out disk", "bead-8.mcap"),
    ("recover x.mcap --out disk/a.mcap", "a.mcap"),
    ("export x.mcap --out disk", "samples.parquet"),
    ("export x.mcap --format csv --out disk", "samples.csv"),
    ("compare x.mcap --report disk/a.html", "a.html"),
    ("compare x.mcap --figures disk", "strike.svg"),
    ("settings make --template disk/bead.toml", "bead.toml"),
    ("settings make b.toml --out disk/a.settings", "a.settings"),
    (SEARCH, "best.toml"),
    ("sweep sweep.toml --out disk/a.parquet", "a.parquet"),
];
const SEARCH: &str = "optimise short.toml --bead 7 --total-mass 0.01 --evaluations 400 --out disk/best.toml";

/// Fills the disk.
const FILL: &str = "head -c 100000 /dev/zero > disk/fill 2> /dev/null";

/// Runs a script in a shell with a file system of 64 kB at `disk`, in a folder with some inputs. None where
/// mounting is not allowed.
fn with_disk(folder: &Path, script: &str) -> Option<Output> {
    let shell = |script: &str| {
        let mut command = Command::new("unshare");
        command.args(["--user", "--map-root-user", "--mount", "sh", "-c", script]);
        command.current_dir(folder).env("BEAD", PROGRAM).output()
    };
    let _ = fs::create_dir(folder.join("disk"));
    let mount = "mount -t tmpfs -o size=64k tmpfs disk";
    if !shell(mount).is_ok_and(|output| output.status.success()) {
        eprintln!("SKIPPED: this user may not mount a file system in a namespace (unshare --user --mount)");
        return None;
    }
    Some(shell(&format!("{mount} && {script}")).unwrap())
}

fn folder() -> TestFolder {
    let folder = TestFolder::new();
    fs::copy(SCENARIO, folder.join("s.toml")).unwrap();
    fs::copy(format!("{DATA}/recording-v1.mcap"), folder.join("x.mcap")).unwrap();
    folder.write("short.toml", short_scenario());
    let sweep = "scenario = \"short.toml\"\n[[axis]]\nkey = \"striker.velocity\"\nvalues = [0.3, 0.4]\n";
    folder.write("sweep.toml", sweep);
    folder.done("settings make --template b.toml");
    folder
}

/// Runs each command after `spoil`, which makes writing fail, and asserts that the disk is unchanged.
fn refuses_each(spoil: &str, reason: &str) {
    let folder = folder();
    for (command, name) in WRITERS {
        let script = format!(
            "printf '' > disk/{name}; {spoil}; ls -A disk > before; $BEAD {command} --overwrite > /dev/null; status=$?; \
             ls -A disk > after; cmp before after && test ! -s disk/{name} && exit $status; exit 99"
        );
        let Some(output) = with_disk(&folder, &script) else {
            return;
        };
        println!("{command}");
        refused(&output, 2, reason);
    }
}

#[test]
fn a_full_disk_is_told_in_one_line_and_what_was_there_stays() {
    refuses_each(FILL, "No space left on device");
}

#[test]
fn a_read_only_disk_is_told_in_one_line_before_the_work() {
    refuses_each("mount -o remount,ro disk", "Read-only file system");
}

#[test]
fn a_result_that_fits_only_in_part_is_removed_and_a_full_temporary_folder_is_told() {
    let folder = folder();
    let fill = format!("{FILL}; TMPDIR=$PWD/disk");
    for (fill, command) in [
        ("", "simulate s.toml --out disk/a.parquet"),
        ("", "compare x.mcap --report disk/report.html"),
        (&fill, "emulate s.toml --bead 8"),
    ] {
        let script = format!(
            "{fill} $BEAD {command} > /dev/null; status=$?; rm -f disk/fill; ls -A disk >&2; exit $status"
        );
        let Some(output) = with_disk(&folder, &script) else {
            return;
        };
        println!("{command}");
        // A failure within QEMU has status 3.
        let status = output.status.code().unwrap().clamp(2, 3);
        refused(&output, status, "No space left on device");
    }
}

#[test]
fn a_recording_on_a_disk_that_becomes_full_keeps_what_came_before() {
    let folder = TestFolder::new();
    let listener = UnixListener::bind(folder.join("bead.sock")).unwrap();
    let sending = thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let frames = fs::read(format!("{DATA}/frame-of-the-future.bin")).unwrap();
        while stream.write_all(&frames).is_ok() {}
    });
    let script = "$BEAD record --port unix:bead.sock --out disk/a.mcap > /dev/null; status=$?; ls -A disk >&2; \
                  $BEAD recover disk/a.mcap.partial --out whole.mcap --format json; exit $status";
    let Some(output) = with_disk(&folder, script) else {
        return;
    };
    sending.join().unwrap();
    let said = said(&output);
    let lines: Vec<_> = said.lines().collect();
    assert_eq!((output.status.code(), lines.len()), (Some(2), 2), "{said}");
    assert!(lines[0].contains("No space left on device"), "{said}");
    let advice = "the recording up to then is kept in disk/a.mcap.partial, for `bead recover`";
    assert!(lines[0].ends_with(advice), "{said}");
    assert_eq!(lines[1], "a.mcap.partial");
    let recovered: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(recovered["frames"].as_u64().unwrap() > 100, "{recovered}");
}
