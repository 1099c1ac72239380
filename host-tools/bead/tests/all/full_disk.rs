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

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");

/// Every command that writes a file, with what it writes.
const WRITERS: [(&str, &str); 10] = [
    ("simulate s.toml --overwrite --out", "a.parquet"),
    ("emulate s.toml --bead 8 --overwrite --out disk #", "bead-8.mcap"),
    ("recover x.mcap --overwrite --out", "a.mcap"),
    ("export x.mcap --overwrite --out disk #", "samples.parquet"),
    (
        "export x.mcap --format csv --overwrite --out disk #",
        "samples.csv",
    ),
    (
        "compare x.mcap --scenario s.toml --overwrite --report",
        "report.html",
    ),
    (
        "compare x.mcap --scenario s.toml --overwrite --figures disk #",
        "strike.svg",
    ),
    ("settings make --template --overwrite", "bead.toml"),
    ("settings make bead.settings.toml --overwrite --out", "a.settings"),
    (
        "optimise short.toml --bead 7 --total-mass 0.01 --evaluations 400 --overwrite --out",
        "best.toml",
    ),
];

/// A shell with a file system of 64 kB at `disk`, in a folder with some inputs. None where mounting is not
/// allowed.
fn with_disk(folder: &Path, script: &str) -> Option<Output> {
    let shell = |script: &str| {
        Command::new("unshare")
            .args(["--user", "--map-root-user", "--mount", "sh", "-c", script])
            .current_dir(folder)
            .env("BEAD", env!("CARGO_BIN_EXE_bead"))
            .output()
    };
    let _ = fs::create_dir(folder.join("disk"));
    let mount = "mount -t tmpfs -o size=64k tmpfs disk";
    let allowed = shell(mount).is_ok_and(|output| output.status.success());
    if !allowed {
        eprintln!(
            "SKIPPED: this user may not mount a file system in a namespace of its own (unshare --user --mount)"
        );
        return None;
    }
    Some(shell(&format!("{mount} && {script}")).unwrap())
}

fn inputs(folder: &Path) {
    let copy = |name: &str, of: &str| fs::copy(format!("{ROOT}/{of}"), folder.join(name)).unwrap();
    copy("s.toml", "docs/scenarios/paper-strike.toml");
    copy("x.mcap", "tests/data/recording-v1.mcap");
    let text = fs::read_to_string(folder.join("s.toml")).unwrap();
    let short = text
        .replace("beads = 16", "beads = 12")
        .replace("= 0.006", "= 0.003");
    fs::write(folder.join("short.toml"), short).unwrap();
    let made = Command::new(env!("CARGO_BIN_EXE_bead"))
        .args(["settings", "make", "--template", "bead.settings.toml"])
        .current_dir(folder)
        .status();
    assert!(made.unwrap().success());
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Runs a command whose result cannot be written, after `spoil`: what was there stays, nothing else is left.
fn refused(spoil: &str, reason: &str) {
    let folder = tempfile::tempdir().unwrap();
    inputs(folder.path());
    for (command, name) in WRITERS {
        let (command, _) = command.split_once(" #").unwrap_or((command, ""));
        let output = if command.ends_with("disk") {
            String::new()
        } else {
            format!("disk/{name}")
        };
        let script = format!(
            "printf '' > disk/{name}; {spoil}; ls -A disk > before; $BEAD {command} {output} > /dev/null; status=$?; \
             ls -A disk > after; cmp before after && test ! -s disk/{name} && exit $status; exit 99"
        );
        let Some(output) = with_disk(folder.path(), &script) else {
            return;
        };
        let said = text(&output.stderr);
        assert_eq!(
            output.status.code(),
            Some(2),
            "{command}: {said}{}",
            text(&output.stdout)
        );
        assert_eq!(said.lines().count(), 1, "{command}: {said}");
        assert!(said.contains(reason), "{command}: {said}");
    }
}

#[test]
fn a_full_disk_is_told_in_one_line_and_what_was_there_stays() {
    refused(
        "head -c 100000 /dev/zero > disk/fill 2> /dev/null",
        "No space left on device",
    );
}

#[test]
fn a_read_only_disk_is_told_in_one_line_before_the_work() {
    refused("mount -o remount,ro disk", "Read-only file system");
}

#[test]
fn a_result_that_fits_only_in_part_is_removed() {
    let folder = tempfile::tempdir().unwrap();
    inputs(folder.path());
    for command in [
        "simulate s.toml --out disk/a.parquet",
        "compare x.mcap --scenario s.toml --report disk/report.html",
    ] {
        let script = format!("$BEAD {command} > /dev/null; status=$?; ls -A disk >&2; exit $status");
        let Some(output) = with_disk(folder.path(), &script) else {
            return;
        };
        let said = text(&output.stderr);
        assert_eq!(
            (output.status.code(), said.lines().count()),
            (Some(2), 1),
            "{command}: {said}"
        );
        assert!(said.contains("No space left on device"), "{said}");
    }
}

#[test]
fn a_run_whose_temporary_folder_is_full_says_so() {
    let folder = tempfile::tempdir().unwrap();
    inputs(folder.path());
    let script = "head -c 100000 /dev/zero > disk/fill 2> /dev/null; TMPDIR=$PWD/disk $BEAD emulate s.toml --bead 8 > /dev/null; \
                  status=$?; rm disk/fill; ls -A disk >&2; exit $status";
    let Some(output) = with_disk(folder.path(), script) else {
        return;
    };
    let said = text(&output.stderr);
    assert!(
        output.status.code().is_some_and(|code| code == 2 || code == 3),
        "{said}"
    );
    assert_eq!(said.lines().count(), 1, "{said}");
    assert!(said.contains("No space left on device"), "{said}");
}

#[test]
fn a_recording_on_a_disk_that_becomes_full_keeps_what_came_before() {
    let folder = tempfile::tempdir().unwrap();
    let listener = UnixListener::bind(folder.path().join("bead.sock")).unwrap();
    let sending = thread::spawn(move || {
        // A second connection ends it, if the first one never comes.
        let Ok((mut stream, _)) = listener.accept() else {
            return;
        };
        let frames = fs::read(format!("{ROOT}/tests/data/frame-of-the-future.bin")).unwrap();
        while stream.write_all(&frames).is_ok() {}
    });
    let script = "$BEAD record --port unix:bead.sock --out disk/a.mcap > /dev/null; status=$?; ls -A disk >&2; \
                  $BEAD recover disk/a.mcap.partial --out whole.mcap --format json; exit $status";
    let Some(output) = with_disk(folder.path(), script) else {
        return;
    };
    sending.join().unwrap();
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    let lines: Vec<_> = said.lines().collect();
    assert_eq!((lines.len(), lines[1]), (2, "a.mcap.partial"), "{said}");
    assert!(lines[0].contains("No space left on device"), "{said}");
    assert!(
        lines[0].ends_with("what came before is kept in disk/a.mcap.partial, for `bead recover`"),
        "{said}"
    );
    let recovered: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(recovered["frames"].as_u64().unwrap() > 100, "{recovered}");
}
