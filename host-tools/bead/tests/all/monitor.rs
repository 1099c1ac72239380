//! `bead monitor` as its users run it: in a terminal that tmux stands in for, with two emulated beads.
//!
//! Where tmux or QEMU is missing, the tests are skipped and say so. `PICTURES=overwrite` draws the pictures
//! of the book anew.

use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::Command;
use std::thread;
use std::time::{Duration, Instant};

use crate::pane::svg;
use crate::program::{PROGRAM, ROOT, TestFolder, assert_says, tcp, until};
use bead_recording::file::{Recording, State};
use bead_testing::{Speaker, block_of, one_sample_strike, paper_settings};

/// A terminal in which a program runs.
struct Terminal {
    folder: TestFolder,
}

impl Terminal {
    /// Starts `bead` with these words in a terminal of 80 x 24; `None` where that cannot be.
    fn start(arguments: &str) -> Option<Self> {
        for program in ["tmux -V", "qemu-system-arm --version"] {
            let output = Command::new("sh").args(["-c", program]).output();
            if !output.unwrap().status.success() {
                eprintln!("skipped: `{program}` does not run here");
                return None;
            }
        }
        let terminal = Self {
            folder: TestFolder::new(),
        };
        // The shell keeps the exit status: tmux 3.3 now and then misses the end of its child.
        let run = format!("env --default-signal=INT,TERM,HUP {PROGRAM} {arguments} 2>said; echo $? >status");
        terminal.tmux("-f /dev/null new-session -d -x 80 -y 24", &["exec cat"]);
        terminal.tmux("set-option -g remain-on-exit on", &[]);
        terminal.tmux("respawn-pane -k", &[&run]);
        Some(terminal)
    }

    /// Runs tmux with the words of a line, and more of them; returns what it printed.
    fn tmux(&self, line: &str, more: &[&str]) -> String {
        let mut tmux = Command::new("tmux");
        tmux.current_dir(&*self.folder)
            .env_remove("TMUX")
            .env_remove("NO_COLOR");
        tmux.args(["-u", "-S", "socket"]).args(line.split(' ')).args(more);
        String::from_utf8(tmux.output().unwrap().stdout).unwrap()
    }

    fn keys(&self, keys: &str) {
        self.tmux(&format!("send-keys {keys}"), &[]);
    }

    /// The cells, with escape sequences of their attributes.
    fn cells(&self) -> String {
        self.tmux("capture-pane -p -e", &[])
    }

    fn text(&self) -> String {
        self.tmux("capture-pane -p", &[])
    }

    /// Waits until the page has a text.
    fn until(&self, part: &str) -> String {
        let mut text = String::new();
        let started = Instant::now();
        while !text.contains(part) {
            let is_late = started.elapsed() > Duration::from_secs(60);
            assert!(!is_late, "never: {part} on the page\n{text}");
            thread::sleep(Duration::from_millis(50));
            text = self.text();
        }
        text
    }

    /// Waits for the end, and returns the exit status.
    fn ended(&self) -> String {
        let status = self.folder.join("status");
        let status = || fs::read_to_string(&status).unwrap_or_default();
        until("the program ends", || status().ends_with('\n'));
        status().trim().to_owned()
    }

    fn recording(&self) -> Recording {
        let recording = Recording::open(&self.folder.join("a.mcap")).unwrap();
        assert_eq!(recording.state, State::Whole);
        recording
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        self.tmux("kill-server", &[]);
    }
}

fn two_beads() -> String {
    let scenarios = format!("{ROOT}/docs/scenarios");
    format!(
        "monitor --emulate {scenarios}/ten-intruders.toml --bead 7,8 --uncertainty {scenarios}/paper-bead.toml --out a.mcap"
    )
}

/// True if the pictures of the book are to be drawn anew.
pub(crate) fn draws_pictures() -> bool {
    std::env::var_os("PICTURES").is_some_and(|value| value == "overwrite")
}

#[test]
fn two_emulated_beads_are_shown_noted_disarmed_and_recorded_and_the_window_may_shrink() {
    let Some(terminal) = Terminal::start(&two_beads()) else {
        return;
    };
    let page = terminal.until("strike 3 of bead 7");
    for part in [
        "bead monitor  a.mcap",
        " ± ",
        "no flags",
        "losses of bead 7: none",
        "q quit",
    ] {
        assert_says(&page, part);
    }
    if draws_pictures() {
        let picture = svg(&terminal.cells(), 80, "bead monitor with two emulated beads");
        fs::write(format!("{ROOT}/docs/images/monitor.svg"), picture).unwrap();
    }
    terminal.keys("n");
    terminal.keys("-l specimen=A12");
    terminal.until("note KEY=VALUE: specimen=A12_");
    terminal.keys("Enter");
    terminal.until("noted: specimen=A12");
    terminal.keys("d");
    terminal.until("bead 7: disarm: done");
    terminal.until("7 disarmed");
    terminal.keys("Right");
    terminal.until("losses of bead 8");
    terminal.tmux("resize-window -x 20 -y 10", &[]);
    assert_says(&terminal.until("widen: 80x24"), "bead 8, armed");
    terminal.tmux("resize-window -x 80 -y 24", &[]);
    terminal.until("8 armed");
    terminal.keys("q");
    assert_eq!(terminal.ended(), "0");
    let said = terminal.folder.text("said");
    assert_says(&said, "a.mcap: ");
    assert_says(&said, "0 lost, 0 corrupt, 0 restarts");
    let notes = &terminal.recording().about.remarks;
    assert!(notes[0].key == "specimen" && notes[0].value == "A12");
    assert!(terminal.folder.run("replay a.mcap").status.success());
}

#[test]
fn a_port_that_goes_away_under_the_page_goes_on_in_the_same_recording() {
    let (listener, port) = tcp();
    let Some(terminal) = Terminal::start(&format!("monitor --port {port} --out a.mcap")) else {
        return;
    };
    let mut bead = Speaker::at(7);
    for number in [1, 2] {
        let (mut line, _) = listener.accept().unwrap();
        let identity = bead.identity();
        bead.say(0, identity);
        bead.say(0, block_of(&paper_settings()));
        let index = 1000 * u64::from(number);
        for message in one_sample_strike(number, index) {
            bead.say(index, message);
        }
        line.write_all(&std::mem::take(&mut bead.bytes)).unwrap();
        terminal.until(&format!("strike {number} of bead 7"));
        drop(line);
        terminal.until("went away");
    }
    let (_line, _) = listener.accept().unwrap();
    terminal.keys("q");
    assert_eq!(terminal.ended(), "0");
    let recording = terminal.recording();
    let strikes = recording.strikes().unwrap();
    assert!(strikes.map(|strike| strike.said.strike).eq([1, 2]));
}

#[test]
fn a_signal_gives_the_terminal_back_and_a_terminal_that_closes_completes_the_recording() {
    for closes in [false, true] {
        let Some(terminal) = Terminal::start(&two_beads()) else {
            return;
        };
        terminal.until("strike 0 of bead 7");
        if closes {
            terminal.tmux("kill-server", &[]);
            let is_complete = || terminal.folder.join("a.mcap").exists();
            until("the recording is complete", is_complete);
        } else {
            let shell = terminal.tmux("display-message -p #{pane_pid}", &[]);
            let children = format!("/proc/{0}/task/{0}/children", shell.trim());
            crate::program::signal("TERM", fs::read_to_string(children).unwrap().trim());
            assert_eq!(terminal.ended(), "0");
            // The page was on the alternate screen.
            assert!(!terminal.text().contains("q quit"), "{}", terminal.text());
        }
        // The shown strike is in the recording, with its samples.
        let recording = terminal.recording();
        let strike = recording.strikes().unwrap().find(|strike| strike.address == 7);
        assert!(strike.is_some_and(|strike| strike.missing() == 0));
        assert!(!Path::new(&terminal.folder.join("a.mcap.partial")).exists());
    }
}
