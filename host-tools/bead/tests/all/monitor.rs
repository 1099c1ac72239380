//! `bead monitor`: driven through tmux, closed, interrupted, on a recording that grows, without a terminal.

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use crate::program::{self, PROGRAM, ROOT, TestFolder, assert_says, done, interruptible, tcp};
use crate::terminal_picture::svg;
use bead_recording::file::{Recording, State};
use bead_testing::Speaker;

/// A program in a tmux of its own, 80 by 24.
struct Tmux {
    socket: PathBuf,
    folder: PathBuf,
}

impl Tmux {
    /// `None` where there is no tmux.
    fn start(folder: &TestFolder, columns: usize, line: &str) -> Option<Self> {
        let is_there = Command::new("tmux").arg("-V").output().is_ok();
        if !is_there {
            eprintln!("SKIPPED: no tmux here (Debian: apt-get install tmux)");
            return None;
        }
        let tmux = Self {
            socket: folder.join("tmux"),
            folder: folder.to_path_buf(),
        };
        // The first shell tells the number of the process that it becomes.
        let program = format!("echo $$ > pid; exec {PROGRAM} {line} 2>said");
        let command = format!("sh -c '{program}'; echo status $? >> said; sleep 60");
        let size = ["-x", &columns.to_string(), "-y", "24"].map(str::to_owned);
        tmux.run(
            &[
                &["-f", "/dev/null", "new-session", "-d"][..],
                &size.each_ref().map(String::as_str),
                &["sh", "-c", &command],
            ]
            .concat(),
        );
        Some(tmux)
    }

    fn run(&self, words: &[&str]) -> String {
        let mut command = Command::new("tmux");
        command.arg("-S").arg(&self.socket).current_dir(&self.folder);
        done(
            command
                .args(["-u"])
                .args(words)
                .env("LANG", "C.UTF-8")
                .output()
                .unwrap(),
        )
    }

    fn press(&self, keys: &[&str]) {
        self.run(&[&["send-keys"], keys].concat());
    }

    fn pane(&self) -> String {
        self.run(&["capture-pane", "-p"])
    }

    /// Waits for a part of the page.
    fn wait_for(&self, what: &str, is_there: impl Fn(&str) -> bool) -> String {
        let started = Instant::now();
        loop {
            let pane = self.pane();
            if is_there(&pane) {
                return pane;
            }
            let said = fs::read_to_string(self.folder.join("said")).unwrap_or_default();
            assert!(
                started.elapsed() < Duration::from_secs(90),
                "never {what}:\n{pane}\n{said}"
            );
            thread::sleep(Duration::from_millis(100));
        }
    }

    /// Waits for the end of the program; gives what it said on standard error, and its status.
    fn ended(&self) -> String {
        self.wait_for("the end", |_| {
            fs::read_to_string(self.folder.join("said")).is_ok_and(|said| said.contains("status "))
        });
        fs::read_to_string(self.folder.join("said")).unwrap()
    }
}

impl Drop for Tmux {
    fn drop(&mut self) {
        // It may have ended.
        let _ = Command::new("tmux")
            .arg("-S")
            .arg(&self.socket)
            .arg("kill-server")
            .output();
    }
}

/// Two emulated beads, as the docs show them. Set `PICTURES=overwrite` to draw the pictures of the docs anew.
#[test]
fn two_emulated_beads_are_shown_armed_noted_and_recorded_in_a_terminal() {
    let folder = TestFolder::new();
    let scenario = format!("{ROOT}/docs/scenarios/ten-intruders.toml");
    let line = format!("monitor --emulate {scenario} --bead 7-8 --out two.mcap");
    let Some(tmux) = Tmux::start(&folder, 100, &line) else {
        return;
    };
    let has_struck = |pane: &str| pane.contains("Strike 1") && pane.contains("N  A") && pane.contains("ppm");
    let page = tmux.wait_for("a second strike", has_struck);
    for part in [
        "recording",
        "A ",
        " nJ",
        "residual",
        "force, N",
        "supply",
        "armed",
        "q quit",
        "3.300 V",
    ] {
        assert_says(&page, part);
    }
    if std::env::var("PICTURES").is_ok_and(|what| what == "overwrite") {
        // With some history.
        thread::sleep(Duration::from_secs(20));
        let pane = tmux.run(&["capture-pane", "-p", "-e"]);
        fs::write(format!("{ROOT}/docs/images/monitor.svg"), svg(&pane, 100)).unwrap();
    }
    tmux.press(&["Down"]);
    tmux.wait_for("the other bead", |pane| pane.contains("> 8"));
    tmux.press(&["d"]);
    tmux.wait_for("disarmed", |pane| {
        pane.contains("bead 8: disarm: done") && pane.contains("disarmed")
    });
    tmux.press(&["a"]);
    tmux.wait_for("armed again", |pane| pane.contains("bead 8: arm: done"));
    tmux.press(&["n"]);
    tmux.press(&["-l", "specimen=A12"]);
    tmux.press(&["Enter"]);
    tmux.wait_for("the note", |pane| pane.contains("noted: specimen=A12"));
    tmux.press(&["n"]);
    tmux.press(&["-l", "nonsense"]);
    tmux.press(&["Enter"]);
    tmux.wait_for("a refusal", |pane| pane.contains("is no note; give KEY=VALUE"));
    tmux.press(&["q"]);
    let said = tmux.ended();
    assert_says(&said, "status 0");
    assert_says(&said, "two.mcap: ");
    let recording = Recording::open(&folder.join("two.mcap")).unwrap();
    assert_eq!(
        (recording.state.clone(), recording.beads.len()),
        (State::Whole, 2)
    );
    let notes: Vec<_> = recording
        .about
        .remarks
        .iter()
        .map(|note| (&*note.key, &*note.value))
        .collect();
    assert_eq!(notes, [("specimen", "A12")]);
    assert!(recording.strikes().unwrap().count() >= 2);
    // The terminal is as before.
    assert!(!tmux.pane().contains("q quit"));
}

/// Frames of a bead that says who it is each few milliseconds, until the program hangs up.
fn speaking(listener: std::net::TcpListener) -> thread::JoinHandle<()> {
    thread::spawn(move || {
        use std::io::Write;
        let (mut stream, _) = listener.accept().unwrap();
        let mut bead = Speaker::at(3);
        for index in 1.. {
            let identity = bead.identity();
            let frame = bead.frame(500 * index, &identity.into());
            if stream.write_all(&frame).is_err() {
                return;
            }
            thread::sleep(Duration::from_millis(5));
        }
    })
}

#[test]
fn a_terminal_of_20_columns_a_closed_one_and_a_signal_lose_nothing() {
    let folder = TestFolder::new();
    for (name, end) in [
        ("closed.mcap", None),
        ("term.mcap", Some("TERM")),
        ("hup.mcap", Some("HUP")),
    ] {
        let (listener, port) = tcp();
        let bead = speaking(listener);
        let Some(tmux) = Tmux::start(&folder, 20, &format!("monitor --port {port} --out {name}")) else {
            // The bead waits for its program.
            drop(std::net::TcpStream::connect(port.trim_start_matches("tcp:")));
            return;
        };
        let page = tmux.wait_for("the bead", |pane| pane.contains(">3 good"));
        assert_says(&page, "q quits");
        match end {
            None => _ = tmux.run(&["kill-server"]),
            Some(signal) => {
                program::signal(signal, folder.text("pid").trim());
                assert_says(&tmux.ended(), "status 0");
            }
        }
        let started = Instant::now();
        while !folder.join(name).exists() {
            assert!(
                started.elapsed() < Duration::from_secs(10),
                "{name} is not complete"
            );
            thread::sleep(Duration::from_millis(20));
        }
        bead.join().unwrap();
        let recording = Recording::open(&folder.join(name)).unwrap();
        assert_eq!(recording.state, State::Whole, "{name}");
        assert!(recording.runs > 10);
        let _ = fs::remove_file(folder.join("said"));
        drop(tmux);
    }
}

#[test]
fn without_a_terminal_a_page_for_a_browser_runs_and_its_counts_are_those_of_the_recording() {
    let folder = TestFolder::new();
    let (listener, port) = tcp();
    let bead = speaking(listener);
    let mut command = interruptible(
        &folder,
        &format!("monitor --port {port} --out x.mcap --web --duration 3"),
    );
    let output = command
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .output()
        .unwrap();
    bead.join().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert_says(&said, "the page is at http://127.0.0.1:");
    assert_says(&said, "0 lost, 0 corrupt");
    let recording = Recording::open(&folder.join("x.mcap")).unwrap();
    assert_eq!(recording.state, State::Whole);
    let frames = recording.frames().unwrap().count();
    assert_says(&said, &format!(" {frames} frames"));
}

#[test]
fn a_recording_that_another_program_writes_is_followed() {
    let folder = TestFolder::new();
    let (listener, port) = tcp();
    let bead = speaking(listener);
    let recorder = folder.start(&format!("record --port {port} --out x.mcap"));
    let started = Instant::now();
    while !folder.join("x.mcap.partial").exists() {
        assert!(started.elapsed() < Duration::from_secs(30));
        thread::sleep(Duration::from_millis(20));
    }
    if let Some(tmux) = Tmux::start(&folder, 80, "monitor x.mcap.partial") {
        tmux.wait_for("the bead", |pane| {
            pane.contains("> 3") && pane.contains("follows x.mcap.partial")
        });
        let said = recorder.interrupt(0);
        assert_says(&said, "x.mcap");
        tmux.wait_for("its end", |pane| pane.contains("the recording is complete"));
        tmux.press(&["q"]);
        assert_says(&tmux.ended(), "status 0");
    } else {
        recorder.interrupt(0);
    }
    bead.join().unwrap();
}
