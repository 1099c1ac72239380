//! `bead record` as its users run it: over pseudo-terminals and sockets, interrupted, unplugged, refused.

use std::fs::{self, File};
use std::io::{self, Write};
use std::iter;
use std::net::TcpStream;
use std::os::unix::net::UnixListener;
use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use crate::program::{
    self, PROGRAM, RunningProgram, TestFolder, assert_says, interruptible, names, refused, tcp,
};
use bead_recording::file::{Recording, State};
use bead_testing::Speaker;
use bead_wire::{Acceleration, Body, Codes, Energy, Force, Message, Strike, StrikeFlags, Waveform};
use rustix::{pty, termios};

/// A bead in its second boot, about to send the frame with this number.
fn speaker(sequence: u32) -> Speaker {
    Speaker {
        boot: 1,
        sequence,
        ..Speaker::at(0)
    }
}

fn frame(sequence: u32, message: impl Into<Message>) -> Vec<u8> {
    speaker(sequence).frame(100 * u64::from(sequence), &message.into())
}

fn identity(sequence: u32) -> Vec<u8> {
    frame(sequence, speaker(0).identity())
}

fn waveform(sequence: u32) -> Vec<u8> {
    let waveform = Waveform {
        strike: 1,
        first_index: 1000,
        codes: Codes::pack((0..32).map(|code| [code, 4095 - code])).unwrap(),
        ..Waveform::draw(&mut || 0)
    };
    frame(sequence, waveform)
}

fn strike(sequence: u32) -> Vec<u8> {
    let strike = Strike {
        strike: 1,
        first_index: 1000,
        trigger_index: 1032,
        samples: 32,
        peak_force: Force::from_bits(3 << 15),
        acceleration_max: Acceleration::from_bits(5 << 16),
        acceleration_min: Acceleration::from_bits(-(1 << 16)),
        absorbed_measured: Energy::from_bits(830 << 24),
        absorbed_predicted: Energy::from_bits(812 << 24),
        flags: StrikeFlags::from_bits(0b10),
        ..Strike::draw(&mut || 0)
    };
    frame(sequence, strike)
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

/// Starts a recorder to `a.mcap` in a folder. It ends after a minute, so that a test does not wait in vain.
fn record(port: &str, more: &str) -> (TestFolder, RunningProgram) {
    let folder = TestFolder::new();
    let record = format!("record --port {port} --out a.mcap --duration 60 {more}");
    let recorder = folder.start(&record);
    (folder, recorder)
}

/// Sends [`stream`] to a recorder and waits until the strike is printed, as all of it has then been received.
fn strike_is_printed(bead: &mut impl Write, recorder: &mut RunningProgram) {
    bead.write_all(&stream()).unwrap();
    let line = recorder.line();
    assert!(line.starts_with("strike 1 "), "{line}");
}

/// Asserts that `a.mcap` is whole and holds the bytes sent between delimiters. Returns the recording.
fn assert_holds(folder: &TestFolder, sent: &[u8]) -> Recording {
    let recording = Recording::open(&folder.join("a.mcap")).unwrap();
    assert_eq!(recording.state, State::Whole);
    let sent = sent.split(|&byte| byte == 0).filter(|run| !run.is_empty());
    let kept = recording.pieces().unwrap().map(|piece| piece.bytes);
    assert!(kept.eq(sent.map(|run| [run, &[0]].concat())));
    recording
}

#[test]
fn a_recording_over_a_pty_holds_every_byte_sent_corrupt_ones_included() {
    let (mut bead, port) = line();
    let (folder, mut recorder) = record(&port, "");
    bead.write_all(&stream()).unwrap();
    assert_eq!(
        recorder.line(),
        "strike 1 at 0.01032 s: 1.500 N, -1.0 to +5.0 m/s², absorbed 830.00 nJ measured, 812.00 nJ predicted, \
         acceleration_railed\n"
    );
    // A frame cut by the end of the recording is kept too.
    let tail = &waveform(5)[..50];
    bead.write_all(tail).unwrap();
    thread::sleep(Duration::from_millis(500));
    let said = recorder.interrupt(0);
    let begin = "bead: a.mcap: 1 strikes, 3 frames in ";
    assert!(said.starts_with(begin), "{said}");
    assert_says(&said, "; 2 lost, 1 corrupt, 0 restarts");

    assert_eq!(folder.names(), "a.mcap");
    let recording = assert_holds(&folder, &[&stream(), tail].concat());
    // Every run has the time of its receipt.
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_nanos() as u64;
    for run in recording.pieces().unwrap() {
        assert!(now - run.received_ns.unwrap() < 60_000_000_000);
    }
    assert_eq!(recording.about.source, port);
    assert_eq!(recording.about.notes["baud"], "2000000");
    assert!(recording.about.notes["started"].ends_with("+00:00"));
}

#[test]
fn a_megabyte_over_tcp_is_recorded_to_the_last_byte_before_the_server_closes() {
    let (listener, port) = tcp();
    let (folder, recorder) = record(&port, "--wait 0");
    let (mut bead, _) = listener.accept().unwrap();
    let sent: Vec<u8> = (0..9000).flat_map(waveform).collect();
    assert!(sent.len() > 1 << 20);
    bead.write_all(&sent).unwrap();
    drop(bead);
    recorder.end(3);
    let recording = assert_holds(&folder, &sent);
    assert_eq!(recording.about.source, port);
    assert_eq!(recording.about.notes.get("baud"), None);
}

#[test]
fn a_duration_ends_a_recording_with_status_0_and_a_dated_name() {
    let (mut bead, port) = line();
    let folder = TestFolder::new();
    bead.write_all(&identity(0)).unwrap();
    let started = Instant::now();
    let record = format!("record --port {port} --duration 0.7");
    folder.done(&record);
    assert!(started.elapsed() >= Duration::from_millis(700));
    let name = folder.names();
    let digit = |letter: char| if letter.is_ascii_digit() { '0' } else { letter };
    let shape: String = name.chars().map(digit).collect();
    assert_eq!(shape, "bead-00000000-000000.mcap");
    fs::rename(folder.join(name), folder.join("a.mcap")).unwrap();
    assert_holds(&folder, &identity(0));
}

#[test]
fn a_long_recording_goes_on_in_further_files_of_which_each_is_whole() {
    let (mut bead, port) = line();
    let (folder, recorder) = record(&port, "--split 1");
    for second in 0..3 {
        bead.write_all(&identity(second)).unwrap();
        thread::sleep(Duration::from_millis(1100));
    }
    let said = recorder.interrupt(0);
    assert_says(&said, "bead: a.mcap is complete; the recording goes on");
    assert_says(&said, "bead: a.mcap, a-2.mcap, ");
    assert_says(&said, " 3 frames in ");
    let mut frames = 0;
    for name in names(&folder) {
        let recording = Recording::open(&folder.join(name)).unwrap();
        assert_eq!(recording.state, State::Whole);
        frames += recording.runs;
    }
    assert_eq!(frames, 3);
}

#[test]
fn standard_output_that_is_full_costs_no_recording() {
    let (mut bead, port) = line();
    let folder = TestFolder::new();
    let sent = [stream(), identity(5)].concat();
    bead.write_all(&sent).unwrap();
    let record = format!("record --port {port} --out a.mcap --duration 0.5");
    let full = File::options().write(true).open("/dev/full").unwrap();
    let mut recorder = interruptible(&folder, &record);
    let output = recorder.stdout(full).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    let said = program::said(&output);
    assert_says(&said, "cannot write to standard output");
    assert_holds(&folder, &sent);
}

#[test]
fn a_port_or_a_name_that_is_in_use_is_refused_and_what_uses_it_goes_on() {
    let [(mut bead, port), (_other_bead, other)] = [line(), line()];
    let (folder, mut recorder) = record(&port, "");
    strike_is_printed(&mut bead, &mut recorder);
    let busy = folder.run(&format!("record --port {port} --out b.mcap"));
    refused(&busy, 3, &format!("bead: {port} is in use by another program"));
    let watched = folder.run(&format!("monitor --port {port} --udp 127.0.0.1:9 --out b.mcap"));
    refused(&watched, 3, &format!("bead: {port} is in use by another program"));
    for overwrite in ["", "--overwrite"] {
        let taken = folder.run(&format!("record --port {other} --out a.mcap {overwrite}"));
        refused(&taken, 2, "another program is recording to a.mcap");
    }
    recorder.signal("TERM");
    recorder.end(0);
    assert_eq!(folder.names(), "a.mcap");
    assert_holds(&folder, &stream());
    let again = format!("record --port {port} --out a.mcap --overwrite --duration 0.1");
    assert_eq!(folder.run(&again).status.code(), Some(3));
    assert_holds(&folder, &[]);
}

#[test]
fn a_terminal_that_goes_away_ends_a_recording_as_ctrl_c_does_and_nohup_keeps_it() {
    // A program started by `nohup` inherits that the signal is ignored.
    for (begin, signals) in [("", "INT,TERM,HUP"), ("trap '' HUP;", "INT,TERM")] {
        let (mut bead, port) = line();
        let folder = TestFolder::new();
        let record = format!("{PROGRAM} record --port {port} --out a.mcap --duration 60");
        let script = format!("{begin} exec env --default-signal={signals} {record}");
        let mut command = Command::new("sh");
        let mut recorder = RunningProgram::spawn(command.args(["-c", &script]).current_dir(&*folder));
        strike_is_printed(&mut bead, &mut recorder);
        recorder.signal("HUP");
        if !begin.is_empty() {
            thread::sleep(Duration::from_millis(300));
            assert!(!recorder.has_ended());
            recorder.signal("TERM");
        }
        recorder.end(0);
        assert_holds(&folder, &stream());
    }
}

#[test]
fn a_reader_of_standard_output_that_pauses_holds_nothing_up() {
    let (listener, port) = tcp();
    // Nobody reads what it prints.
    let (folder, recorder) = record(&port, "");
    let (mut bead, _) = listener.accept().unwrap();
    let sent: Vec<u8> = (0..20_000).flat_map(strike).collect();
    bead.write_all(&sent).unwrap();
    thread::sleep(Duration::from_millis(500));
    let signalled = Instant::now();
    let said = recorder.interrupt(0);
    assert!(signalled.elapsed() < Duration::from_secs(5));

    assert_says(&said, "lines are missing there");
    assert_holds(&folder, &sent);
}

#[test]
fn standard_error_that_is_closed_costs_no_recording() {
    let (mut bead, port) = line();
    let folder = TestFolder::new();
    bead.write_all(&identity(0)).unwrap();
    let (reader, closed) = io::pipe().unwrap();
    drop(reader);
    // The recorder ends between two splits of the recording.
    let record = format!("record --port {port} --out a.mcap --split 1 --duration 1.5");
    let mut command = interruptible(&folder, &record);
    let mut recorder = command.stdout(Stdio::null()).stderr(closed).spawn().unwrap();
    let started = Instant::now();
    while recorder.try_wait().unwrap().is_none() && started.elapsed() < Duration::from_secs(30) {
        thread::sleep(Duration::from_millis(20));
    }
    // A recorder that still runs has failed the test.
    let _ = recorder.kill();
    assert_eq!(recorder.wait().unwrap().code(), Some(0));
    assert_eq!(folder.names(), "a-2.mcap a.mcap");
}

#[test]
fn a_server_that_takes_each_connection_and_closes_it_is_given_up_after_wait() {
    let (listener, port) = tcp();
    thread::spawn(move || {
        let (mut first, _) = listener.accept().unwrap();
        first.write_all(&identity(0)).unwrap();
        drop(first);
        // Later connections get nothing. The thread ends with the test.
        listener.incoming().for_each(drop);
    });
    let (folder, recorder) = record(&port, "--wait 0.7");
    let said = recorder.end(3);
    assert_eq!(said.lines().count(), 2, "{said}");
    assert_says(&said, "the recording goes on when it is back");
    assert_says(&said, "all that came before is in a.mcap");
    assert_holds(&folder, &identity(0));
}

#[test]
fn a_recording_that_is_interrupted_while_a_server_does_not_answer_ends_at_once() {
    let (listener, port) = tcp();
    let (folder, mut recorder) = record(&port, "");
    let (mut bead, _) = listener.accept().unwrap();
    bead.write_all(&identity(0)).unwrap();
    // Fill the backlog of the listener: the system then leaves further connections without an answer.
    let address = listener.local_addr().unwrap();
    let connect = || TcpStream::connect_timeout(&address, Duration::from_millis(300));
    let _waiting: Vec<TcpStream> = iter::from_fn(|| connect().ok()).collect();
    drop(bead);
    let line = recorder.error_line();
    assert_says(&line, &format!("{port} went away"));
    // The recorder tries to connect meanwhile.
    thread::sleep(Duration::from_millis(400));
    let signalled = Instant::now();
    let said = recorder.interrupt(0);
    assert!(signalled.elapsed() < Duration::from_secs(3));

    assert_says(&said, "was not back at the end");
    assert_holds(&folder, &identity(0));
}

#[test]
fn one_of_two_ports_that_goes_away_ends_the_recording_without_wait() {
    let folder = TestFolder::new();
    let [one, other] = ["one", "other"].map(|name| UnixListener::bind(folder.join(name)).unwrap());
    let ports = "--port unix:one --port unix:other";
    let record = format!("record {ports} --out a.mcap --duration 60 --wait 0");
    let mut recorder = folder.start(&record);
    let (mut bead, _) = one.accept().unwrap();
    let _silent = other.accept().unwrap();
    bead.write_all(&stream()).unwrap();
    assert!(recorder.line().starts_with("bead 0: strike 1 "));
    drop((bead, one));
    let said = recorder.end(3);
    assert_says(&said, "bead: unix:one went away (");
    assert_says(&said, "all that came before is in");
}
