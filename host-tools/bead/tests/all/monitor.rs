//! `bead monitor`: driven through tmux, closed, interrupted, on a recording that grows, without a terminal.

use std::fs::{self, File};
use std::io::{BufRead, BufReader, Read, Write};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use crate::program::{
    self, PROGRAM, ROOT, RunningProgram, TestFolder, assert_says, done, interruptible, tcp,
};
use crate::terminal_picture::svg;
use bead_recording::file::{Recording, State};
use bead_recording::frames::decode;
use bead_testing::{Speaker, paper_settings, struck_codes};
use bead_wire::Message;
use serde_json::{Value, json};

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
                .env_remove("NO_COLOR")
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
    let line = format!(
        "monitor --emulate {scenario} --bead 7-8 --uncertainty {ROOT}/docs/scenarios/paper-bead.toml --out two.mcap"
    );
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
        let pane = tmux.run(&["capture-pane", "-p", "-e", "-N"]);
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

/// Ten beads that are struck without a pause, 1 MB/s in all, each at a port: what the monitor counts is what they
/// sent. `cargo xtask bench monitor` does it for ten minutes, and prints the time that it takes of a core.
#[test]
fn ten_beads_at_a_megabyte_a_second_lose_nothing() {
    const RATE: f64 = 100_000.0;
    let seconds = std::env::var("BEAD_MONITOR_SECONDS").map_or(3.0, |text| text.parse().unwrap());
    let folder = TestFolder::new();
    let mut ports = String::new();
    let beads: Vec<_> = (0..10)
        .map(|address| {
            let (listener, port) = tcp();
            ports += &format!(" --port {port}");
            thread::spawn(move || strike_at_rate(&listener, address, RATE, seconds))
        })
        .collect();
    let mut program = folder.start(&format!("monitor{ports} --out ten.mcap --web"));
    assert_says(&program.error_line(), "the page is at");
    let started = Instant::now();
    // The time of both modes so far, in ticks of 10 ms (proc(5), fields 14 and 15).
    let ticks = |program: &RunningProgram| {
        let stat = fs::read_to_string(format!("/proc/{}/stat", program.child.id())).unwrap();
        let fields: Vec<_> = stat.rsplit(')').next().unwrap().split_whitespace().collect();
        fields[11].parse::<f64>().unwrap() + fields[12].parse::<f64>().unwrap()
    };
    while started.elapsed().as_secs_f64() < seconds {
        thread::sleep(Duration::from_millis(50));
    }
    let part = ticks(&program) / started.elapsed().as_secs_f64();
    thread::sleep(Duration::from_secs(1));
    let said = program.interrupt(0);
    let sent: Vec<(u64, u64)> = beads.into_iter().map(|bead| bead.join().unwrap()).collect();
    let (frames, bytes) = sent
        .iter()
        .fold((0, 0), |sum, one| (sum.0 + one.0, sum.1 + one.1));
    println!(
        "{:.3} MB/s of ten beads: {part:.1} % of a core",
        bytes as f64 * 1e-6 / seconds
    );
    assert_says(&said, &format!(" {frames} frames in {bytes} bytes"));
    assert_says(&said, "; 0 lost, 0 corrupt, 0 restarts");
    assert!(
        bytes as f64 > 0.8 * 10.0 * RATE * seconds,
        "the beads were too slow: {bytes} bytes"
    );
}

/// Says strikes of a bead to the program that connects, at so many bytes a second. Gives the numbers of frames and
/// bytes.
fn strike_at_rate(listener: &std::net::TcpListener, address: u8, rate: f64, seconds: f64) -> (u64, u64) {
    let (mut stream, _) = listener.accept().unwrap();
    let mut bead = Speaker::at(address);
    bead.measure(&paper_settings(), struck_codes());
    let (one, _) = decode(&bead.bytes);
    let (mut frames, mut bytes) = (0, 0);
    let mut say = |stream: &mut std::net::TcpStream, bead: &mut Speaker, index: u64, message: Message| {
        let frame = bead.frame(index, &message);
        stream.write_all(&frame).unwrap();
        (frames, bytes) = (frames + 1, bytes + frame.len() as u64);
        bytes
    };
    let started = Instant::now();
    let mut bead = Speaker::at(address);
    for number in 0.. {
        if started.elapsed().as_secs_f64() > seconds {
            break;
        }
        let mut sent = 0;
        for frame in &one {
            let (mut message, later) = (frame.message.clone(), 1000 * u64::from(number));
            match &mut message {
                Message::Waveform(waveform) => {
                    (waveform.strike, waveform.first_index) = (number, waveform.first_index + later)
                }
                Message::Shape(shape) => {
                    (shape.strike, shape.first_index) = (number, shape.first_index + later)
                }
                Message::Strike(strike) => {
                    strike.strike = number;
                    for index in [
                        &mut strike.first_index,
                        &mut strike.trigger_index,
                        &mut strike.peak_index,
                    ] {
                        *index += later;
                    }
                }
                _ => {}
            }
            sent = say(&mut stream, &mut bead, later + frame.header.sample_index, message);
        }
        let due = Duration::from_secs_f64(sent as f64 / rate);
        thread::sleep(due.saturating_sub(started.elapsed()));
    }
    // Until the program hangs up.
    let _ = stream.read(&mut [0; 1]);
    (frames, bytes)
}

/// The page in a browser shows the strike, its curves and the row, and does so again when it is loaded again.
#[test]
fn a_browser_shows_the_strikes_of_a_row_of_ten() {
    let browser = ["chromium", "chromium-browser", "google-chrome"]
        .into_iter()
        .find(|name| {
            Command::new(name)
                .arg("--version")
                .output()
                .is_ok_and(|output| output.status.success())
        });
    let Some(browser) = browser else {
        eprintln!("SKIPPED: no Chromium here (Debian: apt-get install chromium)");
        return;
    };
    let folder = TestFolder::new();
    // Slow enough that all ten keep pace on a busy computer.
    let scenario = fs::read_to_string(format!("{ROOT}/docs/scenarios/ten-intruders.toml")).unwrap();
    folder.write("row.toml", scenario + "\npace = 0.2\n");
    let uncertainty = format!("--uncertainty {ROOT}/docs/scenarios/paper-bead.toml");
    let mut program = folder.start(&format!(
        "monitor --emulate row.toml {uncertainty} --interval 1 --out row.mcap --web"
    ));
    let line = program.error_line();
    let url = line.trim().split(' ').next_back().unwrap().to_owned();
    let mut browser = Browser::open(browser, &folder, &url);
    let shown = "document.body.innerText";
    let page = browser.wait_for(shown, |text| {
        text.contains("ms after bead 7 was struck") && text.contains("Bead 7, strike ")
    });
    for part in ["N\n", "A, measured ", " ± ", "armed", "row.mcap", "download"] {
        assert_says(&page, part);
    }
    browser.wait_for("document.querySelectorAll('.u-wrap').length", |plots| {
        plots == "3"
    });
    browser.wait_for("document.querySelectorAll('#beads tbody tr').length", |beads| {
        beads == "10"
    });
    // A reload is a browser that connects again: it gets the strikes of before.
    let strikes = "document.body.dataset.strikes";
    browser.wait_for(strikes, |count| count.parse().is_ok_and(|count: u32| count >= 10));
    browser.evaluate("location.reload()");
    browser.wait_for(strikes, |count| count.parse().is_ok_and(|count: u32| count >= 10));
    browser.wait_for(shown, |text| text.contains("ms after bead 7 was struck"));
    if std::env::var("PICTURES").is_ok_and(|what| what == "overwrite") {
        browser.picture(&format!("{ROOT}/docs/images/monitor-web.png"));
    }
    drop(browser);
    let said = program.interrupt(0);
    assert_says(&said, "row.mcap: ");
}

/// A browser without a window, asked over a pair of pipes (the DevTools protocol, JSON between zero bytes).
struct Browser {
    child: Child,
    to: File,
    from: BufReader<File>,
    session: Value,
    number: u64,
}

impl Browser {
    fn open(name: &str, folder: &TestFolder, url: &str) -> Self {
        let (to, from) = (folder.join("to"), folder.join("from"));
        done(Command::new("mkfifo").args([&to, &from]).output().unwrap());
        let options = "--headless --no-sandbox --disable-gpu --window-size=1280,960 --remote-debugging-pipe";
        let line = format!("exec {name} {options} --user-data-dir=browser 3<to 4>from 2>browser-said");
        let child = Command::new("sh")
            .args(["-c", &line])
            .current_dir(&**folder)
            .spawn()
            .unwrap();
        let mut browser = Self {
            child,
            to: File::options().write(true).open(to).unwrap(),
            from: BufReader::new(File::open(from).unwrap()),
            session: Value::Null,
            number: 0,
        };
        let target = browser.ask("Target.createTarget", json!({"url": url}));
        let to = json!({"targetId": target["targetId"], "flatten": true});
        browser.session = browser.ask("Target.attachToTarget", to)["sessionId"].clone();
        browser
    }

    fn ask(&mut self, method: &str, parameters: Value) -> Value {
        self.number += 1;
        let mut request = json!({"id": self.number, "method": method, "params": parameters});
        if !self.session.is_null() {
            request["sessionId"] = self.session.clone();
        }
        self.to.write_all(format!("{request}\0").as_bytes()).unwrap();
        loop {
            let mut answer = Vec::new();
            self.from.read_until(0, &mut answer).unwrap();
            answer.pop();
            let answer: Value = serde_json::from_slice(&answer).unwrap();
            if answer["id"] == self.number {
                assert!(answer["error"].is_null(), "{method}: {answer}");
                return answer["result"].clone();
            }
        }
    }

    /// The value of an expression of the page, as text.
    fn evaluate(&mut self, expression: &str) -> String {
        let result = self.ask(
            "Runtime.evaluate",
            json!({"expression": format!("String({expression})")}),
        );
        result["result"]["value"].as_str().unwrap_or_default().to_owned()
    }

    fn wait_for(&mut self, expression: &str, holds: impl Fn(&str) -> bool) -> String {
        let started = Instant::now();
        loop {
            let value = self.evaluate(expression);
            if holds(&value) {
                return value;
            }
            assert!(
                started.elapsed() < Duration::from_secs(120),
                "{expression} stays {value}"
            );
            thread::sleep(Duration::from_millis(100));
        }
    }

    fn picture(&mut self, path: &str) {
        let picture = self.ask("Page.captureScreenshot", json!({}));
        let mut decode = Command::new("base64")
            .arg("-d")
            .stdin(Stdio::piped())
            .stdout(File::create(path).unwrap())
            .spawn()
            .unwrap();
        decode
            .stdin
            .take()
            .unwrap()
            .write_all(picture["data"].as_str().unwrap().as_bytes())
            .unwrap();
        assert!(decode.wait().unwrap().success());
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        // It may have ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
