//! `bead record` as its users run it: over pseudo-terminals and sockets, interrupted, unplugged, refused.

use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, Read, Write};
use std::iter;
use std::net::{TcpListener, TcpStream};
use std::os::unix::net::UnixListener;
use std::path::Path;
use std::process::{Child, ChildStderr, ChildStdout, Command, Output, Stdio};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use crate::kept::content;
use crate::program;
use bead_recording::file::{Recording, State};
use bead_recording::frames;
use bead_wire::{
    Acceleration, Block, Codes, Energy, Fetched, Force, Fraction, Header, Identity, Kind, MAX_FRAME, Message,
    ResetCauses, Settings, Shape, Strike, StrikeFlags, Waveform, encode,
};
use rustix::{pty, termios};
use tempfile::TempDir;

fn frame(sequence: u32, message: &bead_wire::Message) -> Vec<u8> {
    let header = Header {
        address: 0,
        boot: 1,
        sequence,
        sample_index: 100 * u64::from(sequence),
    };
    encode(&header, message, &mut [0; MAX_FRAME]).unwrap().to_vec()
}

fn identity(sequence: u32) -> Vec<u8> {
    frame(
        sequence,
        &Message::Identity(Identity {
            firmware: "0.1.0".into(),
            git: "abc".into(),
            uid: [7; 12],
            boot: 1,
            reset_cause: ResetCauses::from_bits(0b0000_1100),
            sample_rate_hz: 100_000,
            channels: 4,
        }),
    )
}

fn waveform(sequence: u32) -> Vec<u8> {
    let codes = Codes::pack((0..32).map(|code| [code, 4095 - code])).unwrap();
    frame(
        sequence,
        &Message::Waveform(Waveform {
            strike: 1,
            first_index: 1000,
            codes,
            wide: Codes::default(),
            absorbed_measured: Energy::from_bits(1),
            absorbed_predicted: Energy::from_bits(2),
        }),
    )
}

fn strike(sequence: u32) -> Vec<u8> {
    frame(
        sequence,
        &Message::Strike(Strike {
            strike: 1,
            first_index: 1000,
            trigger_index: 1032,
            samples: 32,
            peak_force: Force::from_bits(3 << 15),
            peak_index: 1040,
            acceleration_max: Acceleration::from_bits(5 << 16),
            acceleration_min: Acceleration::from_bits(-(1 << 16)),
            absorbed_measured: Energy::from_bits(830 << 24),
            absorbed_predicted: Energy::from_bits(812 << 24),
            incident_energy: Energy::from_bits(2000 << 24),
            absorbed_fraction: Fraction::from_bits(27_197),
            noise_energy: Energy::from_bits(0),
            force_noise: Force::from_bits(328),
            flags: StrikeFlags::from_bits(0b10),
        }),
    )
}

/// A strike over a bad line: one frame is damaged, another never comes.
fn stream() -> Vec<u8> {
    let mut damaged = waveform(1);
    let middle = damaged.len() / 2;
    damaged[middle] ^= 0x55;
    assert_ne!(damaged[middle], 0, "the damage must not be a delimiter");
    [identity(0), damaged, waveform(3), strike(4)].concat()
}

/// A pseudo-terminal in place of a serial line: the bead's end of it, and the path of the computer's.
///
/// serialport's own pair does not serve: every recorder inherits the bead's end, which is then never closed.
fn line() -> (File, String) {
    use pty::OpenptFlags;
    let bead = pty::openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
    pty::grantpt(&bead).unwrap();
    pty::unlockpt(&bead).unwrap();
    let mut settings = termios::tcgetattr(&bead).unwrap();
    settings.make_raw();
    termios::tcsetattr(&bead, termios::OptionalActions::Now, &settings).unwrap();
    let port = pty::ptsname(&bead, Vec::new()).unwrap().into_string().unwrap();
    (bead.into(), port)
}

fn bead(directory: &TempDir, arguments: &[&str]) -> Command {
    let mut command = program::interruptible(directory.path());
    command.arg("record").args(arguments).stdin(Stdio::null());
    command
}

/// Runs a recorder that ends by itself: exit status and standard error.
fn run(directory: &TempDir, arguments: &[&str]) -> (i32, String) {
    let Output { status, stderr, .. } = bead(directory, arguments).output().unwrap();
    (status.code().unwrap(), String::from_utf8(stderr).unwrap())
}

/// A running recorder. If a failing test drops it before it ends, it is killed.
struct Running {
    child: Child,
    stdout: BufReader<ChildStdout>,
    stderr: ChildStderr,
}

impl Running {
    fn start(directory: &TempDir, arguments: &[&str]) -> Self {
        let mut child = bead(directory, arguments)
            .args(["--duration", "60"]) // a test that waits in vain fails
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        Self {
            stdout: BufReader::new(child.stdout.take().unwrap()),
            stderr: child.stderr.take().unwrap(),
            child,
        }
    }

    /// Waits for a strike's line, or for the recorder's end. All that was sent before has then been received.
    fn line(&mut self) -> String {
        let mut line = String::new();
        self.stdout.read_line(&mut line).unwrap();
        line
    }

    /// Waits for a line on standard error.
    fn told(&mut self) -> String {
        let mut line = String::new();
        BufReader::new(&mut self.stderr).read_line(&mut line).unwrap();
        line
    }

    fn signal(&self, name: &str) {
        let kill = format!("kill -{name} {}", self.child.id());
        assert!(Command::new("sh").args(["-c", &kill]).status().unwrap().success());
    }

    /// Exit status and standard error.
    fn end(mut self) -> (i32, String) {
        let mut text = String::new();
        self.stderr.read_to_string(&mut text).unwrap();
        (self.child.wait().unwrap().code().unwrap(), text)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended already. If it cannot be killed, nothing better can be done.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The content of a whole recording.
fn recorded(path: &Path) -> Recording {
    let recording = Recording::open(path).unwrap();
    assert_eq!(recording.state, State::Whole);
    recording
}

/// Compares a recording with the bytes that were sent: it keeps what stood between the delimiters.
fn assert_holds(recording: &Recording, sent: &[u8]) {
    let sent: Vec<&[u8]> = sent
        .split(|&byte| byte == 0)
        .filter(|run| !run.is_empty())
        .collect();
    let kept: Vec<Vec<u8>> = recording.pieces().unwrap().map(|piece| piece.bytes).collect();
    assert_eq!(kept.len(), sent.len());
    for (kept, sent) in kept.iter().zip(sent) {
        assert_eq!(kept.split_last().unwrap(), (&0, sent));
    }
}

fn files(directory: &TempDir) -> Vec<String> {
    let names = fs::read_dir(directory).unwrap();
    names
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect()
}

/// A refusal: its exit status, one line on standard error, and no other output.
fn refusal(directory: &TempDir, arguments: &[&str]) -> (i32, String) {
    let before = files(directory);
    let Output {
        status,
        stdout,
        stderr,
    } = bead(directory, arguments).output().unwrap();
    let stderr = String::from_utf8(stderr).unwrap();
    assert_eq!(stderr.trim_end().lines().count(), 1, "{stderr}");
    assert_eq!(String::from_utf8(stdout).unwrap(), "");
    assert_eq!(files(directory), before);
    (status.code().unwrap(), stderr)
}

#[test]
fn a_recording_over_a_pty_holds_every_byte_sent_corrupt_ones_included() {
    let (mut bead, port) = line();
    let directory = tempfile::tempdir().unwrap();
    let mut running = Running::start(&directory, &["--port", &port, "--out", "a.mcap"]);
    bead.write_all(&stream()).unwrap();
    assert_eq!(
        running.line(),
        "strike 1 at 0.01032 s: 1.500 N, -1.0 to +5.0 m/s², absorbed 830.00 nJ measured, 812.00 nJ predicted, \
         acceleration_railed\n"
    );
    // A frame that the end of the recording cuts short is kept too.
    let tail = &waveform(5)[..50];
    bead.write_all(tail).unwrap();
    std::thread::sleep(Duration::from_millis(500));
    running.signal("INT");
    let (status, stderr) = running.end();
    assert_eq!(status, 0, "{stderr}");
    assert!(
        stderr.starts_with("bead: a.mcap: 1 strikes, 3 frames in "),
        "{stderr}"
    );
    assert!(stderr.contains("; 2 lost, 1 corrupt, 0 restarts"), "{stderr}");

    assert_eq!(files(&directory), ["a.mcap"]);
    let recording = recorded(&directory.path().join("a.mcap"));
    assert_holds(&recording, &[&stream(), tail].concat());
    // Every run has its time, to the second that this test takes.
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_nanos() as u64;
    for run in recording.pieces().unwrap() {
        let age = now - run.received_ns.unwrap();
        assert!(age < 60_000_000_000, "{age} ns ago");
    }
    assert_eq!(recording.about.source, port);
    assert_eq!(recording.about.notes["baud"], "2000000");
    assert!(
        recording.about.notes["started"].ends_with("+00:00"),
        "{:?}",
        recording.about.notes
    );
}

#[test]
fn an_unplugged_port_ends_with_status_3_and_a_whole_recording() {
    let (mut bead, port) = line();
    let directory = tempfile::tempdir().unwrap();
    let mut running = Running::start(&directory, &["--port", &port, "--out", "a.mcap", "--wait", "0"]);
    bead.write_all(&stream()).unwrap();
    assert!(running.line().starts_with("strike 1 "));
    drop(bead);
    let (status, stderr) = running.end();
    assert_eq!(status, 3);
    assert_eq!(stderr.trim_end().lines().count(), 1, "{stderr}");
    assert!(
        stderr.starts_with(&format!(
            "bead: {port} went away (unplugged, or closed at the other end): "
        )),
        "{stderr}"
    );
    assert!(stderr.contains("in a.mcap: 1 strikes, 3 frames"), "{stderr}");
    assert_eq!(files(&directory), ["a.mcap"]);
    assert_holds(&recorded(&directory.path().join("a.mcap")), &stream());
}

#[test]
fn a_megabyte_over_tcp_is_recorded_to_the_last_byte_before_the_server_closes() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let directory = tempfile::tempdir().unwrap();
    let port = format!("tcp:{}", listener.local_addr().unwrap());
    let running = Running::start(&directory, &["--port", &port, "--out", "a.mcap", "--wait", "0"]);
    let (mut bead, _) = listener.accept().unwrap();
    let sent: Vec<u8> = (0..9000).flat_map(waveform).collect();
    assert!(sent.len() > 1 << 20);
    bead.write_all(&sent).unwrap();
    drop(bead);
    let (status, stderr) = running.end();
    assert_eq!(status, 3, "{stderr}");
    let recording = recorded(&directory.path().join("a.mcap"));
    assert_holds(&recording, &sent);
    assert_eq!(recording.about.source, port);
    assert_eq!(recording.about.notes.get("baud"), None);
}

#[test]
fn strikes_over_a_unix_socket_are_printed_as_json_objects_while_it_runs() {
    let directory = tempfile::tempdir().unwrap();
    let listener = UnixListener::bind(directory.path().join("bead.sock")).unwrap();
    let arguments = ["--port", "unix:bead.sock", "--out", "a.mcap", "--format", "json"];
    let mut running = Running::start(&directory, &arguments);
    let (mut bead, _) = listener.accept().unwrap();
    bead.write_all(&stream()).unwrap();
    let printed: serde_json::Value = serde_json::from_str(&running.line()).unwrap();
    let (frames, _) = frames::decode(&stream());
    assert!(matches!(frames[2].message, Message::Strike(_)));
    // As `bead decode` has it, with the time of receipt.
    let mut expected = frames[2].json();
    assert!(printed["received"].as_str().unwrap().ends_with('Z'), "{printed}");
    expected["received"] = printed["received"].clone();
    assert_eq!(printed, expected);
    running.signal("TERM");
    assert_eq!(running.end().0, 0);
    assert_holds(&recorded(&directory.path().join("a.mcap")), &stream());
}

#[test]
fn a_duration_ends_a_recording_with_status_0_and_a_dated_name() {
    let (mut bead, port) = line();
    let directory = tempfile::tempdir().unwrap();
    bead.write_all(&identity(0)).unwrap();
    let started = Instant::now();
    let (status, stderr) = run(&directory, &["--port", &port, "--duration", "0.7"]);
    let took = started.elapsed();
    assert_eq!(status, 0, "{stderr}");
    assert!(took >= Duration::from_millis(700), "{took:?}");
    let names = files(&directory);
    let [name] = &names[..] else { panic!("{names:?}") };
    let shape: String = name
        .chars()
        .map(|letter| if letter.is_ascii_digit() { '0' } else { letter })
        .collect();
    assert_eq!(shape, "bead-00000000-000000.mcap");
    assert_holds(&recorded(&directory.path().join(name)), &identity(0));
}

#[test]
fn a_long_recording_goes_on_in_further_files_of_which_each_is_whole() {
    let (mut bead, port) = line();
    let directory = tempfile::tempdir().unwrap();
    let arguments = ["--port", &port, "--out", "a.mcap", "--split", "1"];
    let running = Running::start(&directory, &arguments);
    for second in 0..3 {
        bead.write_all(&identity(second)).unwrap();
        std::thread::sleep(Duration::from_millis(1100));
    }
    running.signal("INT");
    let (status, stderr) = running.end();
    assert_eq!(status, 0, "{stderr}");
    assert!(
        stderr.contains("bead: a.mcap is complete; the recording goes on"),
        "{stderr}"
    );
    assert!(stderr.contains("bead: a.mcap, a-2.mcap, "), "{stderr}");
    assert!(stderr.contains(" 3 frames in "), "{stderr}");
    let frames: u64 = files(&directory)
        .iter()
        .map(|name| recorded(&directory.path().join(name)).runs)
        .sum();
    assert_eq!(frames, 3);
    for wrong in ["0", "86401", "a day"] {
        let (status, stderr) = run(&directory, &["--port", &port, "--split", wrong]);
        assert_eq!(status, 2, "{stderr}");
        assert!(stderr.contains("--split"), "{stderr}");
    }
}

#[test]
fn silence_and_noise_are_told_apart_at_the_end() {
    for (sent, advice) in [
        (&b""[..], "bead: nothing came: "),
        (b"no\0frames\0", "bead: bytes came, but no frame"),
    ] {
        let (mut bead, port) = line();
        let directory = tempfile::tempdir().unwrap();
        bead.write_all(sent).unwrap();
        let arguments = ["--port", &port, "--duration", "0.3"];
        let (status, stderr) = run(&directory, &arguments);
        assert_eq!(status, 3, "{stderr}");
        assert_eq!(files(&directory).len(), 1, "the recording is whole all the same");
        assert!(stderr.lines().last().unwrap().starts_with(advice), "{stderr}");
    }
}

#[test]
fn standard_output_that_is_full_costs_no_recording() {
    let (mut bead_end, port) = line();
    let directory = tempfile::tempdir().unwrap();
    bead_end.write_all(&[stream(), identity(5)].concat()).unwrap();
    let arguments = ["--port", &port, "--out", "a.mcap", "--duration", "0.5"];
    let full = File::options().write(true).open("/dev/full").unwrap();
    let output = bead(&directory, &arguments).stdout(full).output().unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    assert!(stderr.contains("cannot write to standard output"), "{stderr}");
    assert_holds(
        &recorded(&directory.path().join("a.mcap")),
        &[stream(), identity(5)].concat(),
    );
}

#[test]
fn a_recorder_that_is_killed_in_a_silence_leaves_all_that_it_received() {
    let (mut bead, port) = line();
    let directory = tempfile::tempdir().unwrap();
    let mut running = Running::start(&directory, &["--port", &port, "--out", "a.mcap"]);
    bead.write_all(&stream()).unwrap();
    assert!(running.line().starts_with("strike 1 "));
    // Silence follows. What came must not wait for more.
    let partial = directory.path().join("a.mcap.partial");
    let started = Instant::now();
    while Recording::open(&partial).unwrap().runs == 0 && started.elapsed() < Duration::from_secs(30) {
        std::thread::sleep(Duration::from_millis(100));
    }
    running.signal("KILL");
    running.child.wait().unwrap();
    assert_eq!(files(&directory), ["a.mcap.partial"]);
    let recording = Recording::open(&partial).unwrap();
    assert_holds(&recording, &stream());
}

#[test]
fn a_port_in_use_is_refused_with_status_3() {
    let (_bead, port) = line();
    let _other = serialport::new(&port, 2_000_000).open().unwrap();
    let directory = tempfile::tempdir().unwrap();
    let (status, stderr) = refusal(&directory, &["--port", &port, "--out", "a.mcap"]);
    assert_eq!(status, 3);
    assert!(
        stderr.starts_with(&format!("bead: {port} is in use by another program")),
        "{stderr}"
    );
}

#[test]
fn a_recording_that_is_there_is_replaced_only_with_overwrite() {
    let (mut bead, port) = line();
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.mcap");
    fs::write(&path, "precious").unwrap();
    bead.write_all(&identity(0)).unwrap();
    let arguments = [
        "--port",
        &port,
        "--out",
        "a.mcap",
        "--duration",
        "0.3",
        "--overwrite",
    ];
    let (status, stderr) = refusal(&directory, &arguments[..6]);
    assert_eq!(status, 2);
    assert!(
        stderr.contains("a.mcap is there already") && stderr.contains("--overwrite"),
        "{stderr}"
    );
    assert_eq!(fs::read_to_string(&path).unwrap(), "precious");
    assert_eq!(run(&directory, &arguments).0, 0);
    assert_holds(&recorded(&path), &identity(0));
}

#[test]
fn two_recorders_in_one_second_and_with_one_name_lose_nothing() {
    let directory = tempfile::tempdir().unwrap();
    // Without a name, each finds its own.
    let lines: Vec<(File, String)> = (0..4).map(|_| line()).collect();
    let running: Vec<Running> = lines
        .iter()
        .map(|(_, port)| Running::start(&directory, &["--port", port]))
        .collect();
    for ((bead, _), running) in lines.iter().zip(running) {
        let (mut bead, mut running) = (bead, running);
        bead.write_all(&stream()).unwrap();
        assert!(running.line().starts_with("strike 1 "));
        running.signal("INT");
        let (status, stderr) = running.end();
        assert_eq!(status, 0, "{stderr}");
        let name = stderr.trim_start_matches("bead: ").split(": ").next().unwrap();
        assert_holds(&recorded(&directory.path().join(name)), &stream());
    }
    assert_eq!(files(&directory).len(), 4);
    // With one name, the second is refused before it begins.
    let (mut bead, port) = line();
    let mut first = Running::start(&directory, &["--port", &port, "--out", "a.mcap"]);
    bead.write_all(&stream()).unwrap();
    assert!(first.line().starts_with("strike 1 "));
    let (_other, other) = line();
    for overwrite in [&[][..], &["--overwrite"]] {
        let arguments = [&["--port", &other, "--out", "a.mcap"], overwrite].concat();
        let (status, stderr) = refusal(&directory, &arguments);
        assert_eq!(status, 2);
        assert!(
            stderr.contains("another program is recording to a.mcap"),
            "{stderr}"
        );
    }
    first.signal("TERM");
    assert_eq!(first.end().0, 0);
    assert_holds(&recorded(&directory.path().join("a.mcap")), &stream());
}

#[test]
fn a_terminal_that_goes_away_ends_a_recording_as_ctrl_c_does_and_nohup_keeps_it() {
    for (wrapped, ended) in [(false, true), (true, false)] {
        let (mut bead_end, port) = line();
        let directory = tempfile::tempdir().unwrap();
        let record = format!(
            "{} record --port {port} --out a.mcap --duration 60",
            env!("CARGO_BIN_EXE_bead")
        );
        // `nohup` does this: what ignores a signal hands that on to what it runs.
        let script = if wrapped {
            format!("trap '' HUP; exec env --default-signal=INT,TERM {record}")
        } else {
            format!("exec env --default-signal=INT,TERM,HUP {record}")
        };
        let mut child = Command::new("sh")
            .args(["-c", &script])
            .current_dir(&directory)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut running = Running {
            stdout: BufReader::new(child.stdout.take().unwrap()),
            stderr: child.stderr.take().unwrap(),
            child,
        };
        bead_end.write_all(&stream()).unwrap();
        assert!(running.line().starts_with("strike 1 "));
        running.signal("HUP");
        if !ended {
            std::thread::sleep(Duration::from_millis(300));
            assert!(running.child.try_wait().unwrap().is_none(), "it goes on");
            running.signal("TERM");
        }
        assert_eq!(running.end().0, 0);
        assert_holds(&recorded(&directory.path().join("a.mcap")), &stream());
    }
}

#[test]
fn a_reader_of_standard_output_that_pauses_holds_nothing_up() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let directory = tempfile::tempdir().unwrap();
    let port = format!("tcp:{}", listener.local_addr().unwrap());
    // Nobody reads what it prints.
    let running = Running::start(&directory, &["--port", &port, "--out", "a.mcap"]);
    let (mut bead, _) = listener.accept().unwrap();
    let sent: Vec<u8> = (0..20_000).flat_map(strike).collect();
    bead.write_all(&sent).unwrap();
    std::thread::sleep(Duration::from_millis(500));
    let asked = Instant::now();
    running.signal("INT");
    let (status, stderr) = running.end();
    assert!(asked.elapsed() < Duration::from_secs(5), "{:?}", asked.elapsed());
    assert_eq!(status, 0, "{stderr}");
    assert!(stderr.contains("lines are missing there"), "{stderr}");
    assert_holds(&recorded(&directory.path().join("a.mcap")), &sent);
}

#[test]
fn standard_error_that_is_closed_costs_no_recording() {
    let (mut bead_end, port) = line();
    let directory = tempfile::tempdir().unwrap();
    bead_end.write_all(&identity(0)).unwrap();
    let (reader, closed) = io::pipe().unwrap();
    drop(reader);
    let arguments = [
        "--port",
        &port,
        "--out",
        "a.mcap",
        "--split",
        "1",
        "--duration",
        // Between two ends of a file.
        "1.5",
    ];
    let mut child = bead(&directory, &arguments)
        .stdout(Stdio::null())
        .stderr(closed)
        .spawn()
        .unwrap();
    let started = Instant::now();
    let status = iter::repeat_with(|| {
        std::thread::sleep(Duration::from_millis(20));
        child.try_wait().unwrap()
    })
    .find(|status| status.is_some() || started.elapsed() > Duration::from_secs(30))
    .flatten();
    // If it is still there, the test has failed, and it is to end.
    let _ = child.kill();
    assert_eq!(status.and_then(|status| status.code()), Some(0));
    let mut names = files(&directory);
    names.sort_unstable();
    assert_eq!(names, ["a-2.mcap", "a.mcap"]);
}

#[test]
fn a_strike_that_is_fetched_after_a_power_cycle_is_printed_although_its_name_was_there_before() {
    let directory = tempfile::tempdir().unwrap();
    let listener = UnixListener::bind(directory.path().join("bead.sock")).unwrap();
    let mut running = Running::start(&directory, &["--port", "unix:bead.sock", "--out", "a.mcap"]);
    let (mut bead, _) = listener.accept().unwrap();
    bead.write_all(&stream()).unwrap();
    assert!(running.line().starts_with("strike 1 "));
    // The sequence begins anew.
    bead.write_all(&identity(0)).unwrap();
    let block = Block::try_from(&b"any"[..]).unwrap();
    let Message::Shape(shape) = Message::draw(Kind::Shape, &mut || 0) else {
        panic!("a shape");
    };
    let (said, _) = frames::decode(&[waveform(0), strike(1)].concat());
    let parts = [
        Settings { block }.into(),
        said[0].message.clone(),
        said[1].message.clone(),
        Shape { strike: 1, ..shape }.into(),
    ];
    for (part, message) in (0..).zip(&parts) {
        let (frame_kind, body) = content(message);
        let fetched = Fetched {
            boot: 1,
            strike: 1,
            part,
            parts: 4,
            frame_kind,
            body,
        };
        let sequence = 1 + u32::from(part);
        bead.write_all(&frame(sequence, &fetched.into())).unwrap();
    }
    let line = running.line();
    assert!(
        line.starts_with("strike 1 ") && line.ends_with(", fetched\n"),
        "{line}"
    );
    running.signal("INT");
    let (status, stderr) = running.end();
    assert_eq!(status, 0, "{stderr}");
    assert!(stderr.contains("a.mcap: 2 strikes"), "{stderr}");
}

#[test]
fn a_server_that_takes_each_connection_and_closes_it_is_given_up_after_wait() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = format!("tcp:{}", listener.local_addr().unwrap());
    std::thread::spawn(move || {
        let (mut first, _) = listener.accept().unwrap();
        first.write_all(&identity(0)).unwrap();
        drop(first);
        // The others hear nothing. It ends with the test.
        listener.incoming().for_each(drop);
    });
    let directory = tempfile::tempdir().unwrap();
    let running = Running::start(&directory, &["--port", &port, "--out", "a.mcap", "--wait", "0.7"]);
    let (status, stderr) = running.end();
    assert_eq!(status, 3, "{stderr}");
    let lines: Vec<_> = stderr.lines().collect();
    let [first, last] = lines[..] else {
        panic!("that it went away, and the end: {stderr}")
    };
    assert!(
        first.contains("the recording goes on when it is back"),
        "{stderr}"
    );
    assert!(last.contains("all that came before is in a.mcap"), "{stderr}");
    assert_holds(&recorded(&directory.path().join("a.mcap")), &identity(0));
}

#[test]
fn a_recording_that_is_interrupted_while_a_server_does_not_answer_ends_at_once() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let directory = tempfile::tempdir().unwrap();
    let port = format!("tcp:{address}");
    let mut running = Running::start(&directory, &["--port", &port, "--out", "a.mcap"]);
    let (mut bead, _) = listener.accept().unwrap();
    bead.write_all(&identity(0)).unwrap();
    // As many as wait to be accepted: after that the system leaves who connects without an answer.
    let connect = || TcpStream::connect_timeout(&address, Duration::from_millis(300));
    let _waiting: Vec<TcpStream> = iter::from_fn(|| connect().ok()).collect();
    drop(bead);
    let told = running.told();
    // By then it has asked the server.
    std::thread::sleep(Duration::from_millis(400));
    let asked = Instant::now();
    running.signal("INT");
    let (status, stderr) = running.end();
    assert!(asked.elapsed() < Duration::from_secs(3), "{:?}", asked.elapsed());
    assert_eq!(status, 0, "{stderr}");
    assert!(told.contains(&format!("{port} went away")), "{told}");
    assert!(stderr.contains("was not back at the end"), "{stderr}");
    assert_holds(&recorded(&directory.path().join("a.mcap")), &identity(0));
}

#[test]
fn one_of_two_ports_that_goes_away_is_told_and_without_wait_it_ends_the_recording() {
    for (wait, ended, end) in [
        ("0", 3, "all that came before is in"),
        ("60", 0, "was not back at the end"),
    ] {
        let directory = tempfile::tempdir().unwrap();
        let [one, other] =
            ["one", "other"].map(|name| UnixListener::bind(directory.path().join(name)).unwrap());
        let ports = ["--port", "unix:one", "--port", "unix:other"];
        let arguments = [&ports[..], &["--out", "a.mcap", "--wait", wait]].concat();
        let mut running = Running::start(&directory, &arguments);
        let (mut bead, _) = one.accept().unwrap();
        let _silent = other.accept().unwrap();
        bead.write_all(&stream()).unwrap();
        assert!(running.line().starts_with("bead 0: strike 1 "));
        drop((bead, one));
        if ended == 0 {
            running.told();
            running.signal("INT");
        }
        let (status, stderr) = running.end();
        assert_eq!(status, ended, "{stderr}");
        let told = |line: &str| line.starts_with("bead: unix:one went away (") && line.contains(end);
        assert!(stderr.lines().any(told), "{stderr}");
    }
}
