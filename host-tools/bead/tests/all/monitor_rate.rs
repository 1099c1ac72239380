//! Recorder and monitor together at a high rate: what comes is what was sent.

use std::fs;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::thread;
use std::time::{Duration, Instant};

use crate::program::{RunningProgram, TestFolder, assert_says, tcp};
use bead_recording::frames::decode;
use bead_testing::{Speaker, paper_settings, struck_codes};
use bead_wire::Message;

/// Ten beads that are struck without a pause, 1 MB/s in all, each at a port: what the monitor counts is what
/// they sent. `cargo xtask bench monitor` does it for ten minutes, and prints the time that it takes of a
/// core.
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
    // A busy computer may send less in a test, but a benchmark must reach its rate.
    let is_benchmark = std::env::var_os("BEAD_MONITOR_SECONDS").is_some();
    assert!(
        !is_benchmark || bytes as f64 > 0.8 * 10.0 * RATE * seconds,
        "the beads were too slow: {bytes} bytes"
    );
}

/// Sends strikes of a bead to the program that connects, at this many bytes a second. Returns the numbers
/// of frames and bytes.
fn strike_at_rate(listener: &TcpListener, address: u8, rate: f64, seconds: f64) -> (u64, u64) {
    let (mut stream, _) = listener.accept().unwrap();
    let mut bead = Speaker::at(address);
    bead.measure(&paper_settings(), struck_codes());
    let (one, _) = decode(&bead.bytes);
    let (mut frames, mut bytes) = (0, 0);
    let mut say = |stream: &mut TcpStream, bead: &mut Speaker, index: u64, message: Message| {
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
