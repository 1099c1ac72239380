//! A live bead: its time passes as the host says, and it costs the same however long it has run.

use std::time::Duration;

use bead_bench::bridge::Bridge;
use bead_recording::frames::decode;
use bead_tests::paper;
use bead_wire::{ANY, MAX_REQUEST, Message, Outcome, Request, encode_request};
use stm32f405_qemu::{Inputs, Uart};

/// Lets the bead's time go on, with these bytes at its port, and returns the bytes that it sends.
fn pass(bridge: &mut Bridge, bytes: &[u8], time: Duration) -> Vec<u8> {
    let sent = bridge.pass(bytes, time);
    sent.unwrap_or_else(|failure| panic!("{failure}"))
}

/// Asks a live bead for its status at intervals of `every`, and returns the number of QEMU's calls of the
/// overlay for each request.
fn asked(times: u16, every: Duration) -> Vec<u64> {
    let run = paper(1, 0.1, Some(1));
    let mut bridge = Bridge::new(&run, None).unwrap_or_else(|failure| panic!("{failure}"));
    let mut received = pass(&mut bridge, &[], Duration::from_secs(1));
    let mut calls = Vec::new();
    let mut held = Vec::new();
    for number in 0..times {
        let mut buffer = [0; MAX_REQUEST];
        let request = encode_request(ANY, number, &Request::Status, &mut buffer)
            .unwrap_or_else(|error| panic!("{error}"));
        received.extend(pass(&mut bridge, request, every));
        let (frames, _) = decode(&received);
        let is_done = frames.iter().any(|frame| match &frame.message {
            Message::Reply(reply) => (reply.request, reply.outcome) == (number, Outcome::Done),
            _ => false,
        });
        assert!(is_done, "request {number}");
        // Bytes behind the last delimiter belong to the next frame.
        let end = received
            .iter()
            .rposition(|byte| *byte == 0)
            .map_or(0, |end| end + 1);
        received.drain(..end);
        calls.push(bridge.work.calls);
        held.push(bridge.work.held);
    }
    let most = held.iter().max().copied().unwrap_or(0);
    let second = (every.as_secs_f64() * 1e5) as usize;
    assert!(most <= second + 10, "{most} inputs and rows are kept");
    calls
}

#[test]
fn a_request_costs_a_live_bead_no_more_after_many_others() {
    let calls = asked(25, Duration::from_millis(500));
    // Some seconds have a status or a health report in them.
    let mean = |calls: &[u64]| calls.iter().sum::<u64>() as f64 / calls.len() as f64;
    let (first, last) = (mean(&calls[..10]), mean(&calls[15..]));
    assert!((last / first - 1.0).abs() < 0.02, "{first} {last} {calls:?}");
}

#[test]
fn a_live_bead_samples_by_its_own_crystal() {
    let samples = |ppm: f64| {
        let mut run = paper(1, 0.1, Some(1));
        run.truth.clock_ppm = ppm;
        let mut bridge = Bridge::new(&run, None).unwrap_or_else(|failure| panic!("{failure}"));
        let mut buffer = [0; MAX_REQUEST];
        let request =
            encode_request(ANY, 7, &Request::Status, &mut buffer).unwrap_or_else(|error| panic!("{error}"));
        let second = Duration::from_secs(1);
        let pieces = [&[][..], &[], &[], &[], &[], request];
        let received = pieces.map(|bytes| pass(&mut bridge, bytes, second));
        let (frames, _) = decode(&received.concat());
        let mut replies = frames
            .iter()
            .filter(|frame| matches!(frame.message, Message::Reply(_)));
        replies.next().expect("a reply").header.sample_index as f64
    };
    // 5 s of 100 kHz. An index moves by blocks of 200 samples.
    let [slow, right, fast] = [-900.0, 0.0, 900.0].map(samples);
    assert!((right - 5e5).abs() < 4000.0, "{right}");
    for (index, expected) in [(slow, -450.0), (fast, 450.0)] {
        assert!((index - right - expected).abs() < 210.0, "{index} {right}");
    }
}

#[test]
fn a_live_bead_says_what_it_says_in_a_run_at_once_to_the_nanosecond() {
    let run = paper(1, 0.1, Some(1));
    let mut machine = run.machine();
    let whole = machine.execute().unwrap_or_else(|failure| panic!("{failure}"));
    let rows = std::mem::take(&mut machine.stimulus);
    let mut live = machine.start().unwrap_or_else(|failure| panic!("{failure}"));
    let mut said = Uart::default();
    // Stops that are not at block boundaries, more of them while the strike is measured.
    let mut rows = rows.chunks(8192);
    while live.now_ns() < whole.virtual_ns {
        let step = if live.now_ns() < 60_000_000 {
            777_777
        } else {
            33_333_333
        };
        let inputs = Inputs {
            codes: rows.next().unwrap_or_default().to_vec(),
            ..Inputs::default()
        };
        let to = whole.virtual_ns.min(live.now_ns() + step);
        let passed = live
            .advance(to, inputs)
            .unwrap_or_else(|failure| panic!("{failure}"));
        for uart in passed.uarts {
            said.bytes.extend(uart.bytes);
            said.ns.extend(uart.ns);
        }
    }
    assert_eq!((said.bytes, said.ns), (whole.uart, whole.uart_ns));
    let outcome = live.finish().unwrap_or_else(|failure| panic!("{failure}"));
    assert_eq!(outcome.instructions, whole.instructions);
}
