//! Tests of the model, fed with the frames of stand-in beads.

use std::net::TcpStream;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::time::Duration;

use bead_recording::file::Note;
use bead_recording::frames::FrameReader;
use bead_testing::{Speaker, block_of, one_sample_strike, paper_settings};
use bead_wire::{
    Body, Energy, Fault, FaultCause, Force, Health, Message, Outcome, REORDER, Request, Standing, Status,
    Strike, StrikeFlags, Sync,
};

use serde_json::{Value, json};
use tungstenite::client::IntoClientRequest;

use crate::model::HISTORY;
use crate::{Control, Feed, Monitor, SharedMonitor, follow};
use bead_line::recorder::RecorderOrder;

/// A monitor of one port, and the reader of its line.
struct Bench {
    monitor: SharedMonitor,
    reader: FrameReader,
}

impl Bench {
    fn new() -> Self {
        Self {
            monitor: SharedMonitor::new(Monitor::new(vec!["port".to_owned()], "a.mcap".to_owned())),
            reader: FrameReader::default(),
        }
    }

    /// Feeds the bytes that a bead has sent since the last call.
    fn feed(&mut self, bead: &mut Speaker) {
        let mut monitor = self.monitor.lock();
        let bytes = std::mem::take(&mut bead.bytes);
        self.reader
            .feed(&bytes, Some(1_000_000_000), |item| monitor.push(0, &item));
    }
}

/// A bead that has sent its identity and its settings, for which its strikes wait.
fn known_bead() -> Speaker {
    let mut bead = Speaker::at(7);
    let identity = bead.identity();
    bead.say(0, identity);
    bead.say(0, block_of(&paper_settings()));
    bead
}

/// Sends the frames of a strike that is triggered by its only sample.
fn strike(bead: &mut Speaker, number: u32) {
    let first_index = 1000 * u64::from(number);
    for message in one_sample_strike(number, first_index) {
        let message = match message {
            Message::Strike(strike) => Message::Strike(Strike {
                trigger_index: first_index,
                peak_force: Force::from_bits(3 << 15),
                absorbed_measured: Energy::from_bits(830 << 24),
                flags: StrikeFlags::NOT_AT_REST,
                ..strike
            }),
            other => other,
        };
        bead.say(first_index, message);
    }
}

#[test]
fn a_strike_is_shown_with_the_numbers_of_its_frame_and_losses_stand_by_their_causes() {
    let (mut bench, mut bead) = (Bench::new(), known_bead());
    let status = Status {
        frames_dropped_queue_full: 4,
        ..Status::draw(&mut || 0)
    };
    bead.say(0, status);
    bead.say(
        0,
        Health {
            supply_mv: 3301,
            standing: Standing::from_bits(1),
            ..Health::default()
        },
    );
    // Two frames get lost, and one arrives damaged.
    bead.sequence += 2;
    strike(&mut bead, 1);
    bead.bytes.extend([1, 2, 3, 0]);
    // Missing frames may still be late until `REORDER` more have come.
    for _ in 0..REORDER {
        bead.say(2000, status);
    }
    bench.feed(&mut bead);

    let mut monitor = bench.monitor.lock();
    let view = monitor.view();
    let [shown] = &view.beads[..] else {
        panic!("{view:?}")
    };
    assert_eq!((shown.bead, shown.strikes, shown.armed), (7, 1, Some(false)));
    assert_eq!(shown.supply_v, Some(3.301));
    assert_eq!(shown.standing.len(), 1);
    let losses: Vec<_> = shown
        .losses
        .iter()
        .map(|loss| (loss.cause.as_str(), loss.count))
        .collect();
    assert_eq!(
        losses[..2],
        [("frames lost on the way", 2), ("frames dropped: queue full", 4)]
    );
    assert!(
        losses[2].0.starts_with("corrupt: ") && losses[2].1 == 1,
        "{losses:?}"
    );
    let strikes = monitor.strikes_of(7);
    assert_eq!(strikes.len(), 1);
    assert_eq!(strikes[0].peak_force_n, 1.5);
    assert!((strikes[0].absorbed_measured_nj - 830.0).abs() < 1e-9);
    assert_eq!(
        (strikes[0].flags.join(" "), strikes[0].missing),
        ("not at rest".to_owned(), 0)
    );
    assert!(monitor.strikes_of(8).is_empty());
}

#[test]
fn a_strike_has_its_time_after_the_last_edge_before_it() {
    let (mut bench, mut bead) = (Bench::new(), known_bead());
    for (edge, clocks) in (0..4).zip([300_000, 720_000, 1_140_000, 9_000_000]) {
        bead.say(0, Sync::at(edge, clocks, 840, 0));
    }
    strike(&mut bead, 2);
    bench.feed(&mut bead);
    let strikes = bench.monitor.lock().strikes_of(7);
    let trigger = strikes[0].at_s.unwrap();
    let [since, period] = strikes[0].since_edge_s.unwrap();
    // Edges every 420000 clocks of 84 MHz; the third is at 1140000.
    assert!((period - 5e-3).abs() < 1e-12, "{period}");
    assert!(
        (trigger - since - 1_140_000.0 / 84e6).abs() < 1e-12,
        "{since} {trigger}"
    );
}

#[test]
fn text_of_a_bead_cannot_reach_a_terminal_as_a_sequence() {
    let (mut bench, mut bead) = (Bench::new(), Speaker::at(7));
    let fault = Fault {
        cause: FaultCause::Panic,
        boot: 0,
        pc: 0,
        detail: "\u{1b}[2J\nstrike".into(),
    };
    bead.say(0, fault);
    bench.feed(&mut bead);
    let view = bench.monitor.lock().view();
    let text = format!("{:?}{:?}", view.messages, view.beads[0].last_fault);
    assert!(!view.messages[0].chars().any(char::is_control), "{text}");
    assert!(view.messages[0].contains("\\u001b[2J\\u000astrike"), "{text}");
    let shown = view.beads[0].last_fault.as_ref().unwrap();
    assert!(!shown.chars().any(char::is_control), "{text}");
}

#[test]
fn a_reader_that_is_too_slow_learns_how_many_strikes_it_missed() {
    let (mut bench, mut bead) = (Bench::new(), known_bead());
    let mut feed = Feed::default();
    strike(&mut bead, 0);
    bench.feed(&mut bead);
    assert_eq!((feed.take(&bench.monitor, 10).len(), feed.missed), (1, 0));
    assert_eq!((feed.take(&bench.monitor, 10).len(), feed.missed), (0, 0));
    let more = HISTORY as u32 + 100;
    for number in 1..=more {
        strike(&mut bead, number);
    }
    bench.feed(&mut bead);
    let taken = feed.take(&bench.monitor, 10);
    assert_eq!(taken.len(), 10);
    assert_eq!(taken[9].strike, more);
    assert_eq!(feed.missed, u64::from(more) - 10);
    assert_eq!(bench.monitor.lock().strikes_of(7).len(), HISTORY);
    assert_eq!(bench.monitor.lock().view().strikes, u64::from(more) + 1);
}

#[test]
fn an_order_goes_to_the_bead_and_its_reply_becomes_a_message() {
    let (mut bench, mut bead) = (Bench::new(), Speaker::at(7));
    let (orders, ordered) = mpsc::channel();
    let control = Control::new(orders, None, Box::new(Note::parse));
    let unknown = control.arm(&mut bench.monitor.lock(), 7, true);
    assert_eq!(unknown, Err("nothing came from bead 7 yet".to_owned()));
    let identity = bead.identity();
    bead.say(0, identity);
    bench.feed(&mut bead);
    control.arm(&mut bench.monitor.lock(), 7, false).unwrap();
    let Ok(RecorderOrder::Send { bead: 7, bytes }) = ordered.try_recv() else {
        panic!("no order")
    };
    bead.bytes = bead.answer(&bytes, |bead, asked| {
        assert_eq!(asked.request, Ok(Request::Disarm));
        bead.reply(asked.number, Outcome::Done);
    });
    bench.feed(&mut bead);
    let messages = bench.monitor.lock().view().messages;
    assert_eq!(messages, ["bead 7: disarm: done"]);
    assert!(control.note("no note").unwrap_err().contains("KEY=VALUE"));
    control.note("operator=Ana").unwrap();
    assert!(matches!(ordered.try_recv(), Ok(RecorderOrder::Note(note)) if note.value == "Ana"));
    drop(ordered);
    assert!(control.note("operator=Ana").unwrap_err().contains("has ended"));
}

/// The next message of a client, as text or as the payload of a channel's message.
fn next(client: &mut tungstenite::WebSocket<TcpStream>) -> Value {
    use tungstenite::Message::{Binary, Text};
    loop {
        return match client.read().unwrap() {
            Text(text) => serde_json::from_str(&text).unwrap(),
            // Operation, subscription and time precede the message.
            Binary(bytes) => serde_json::from_slice(&bytes[13..]).unwrap(),
            _ => continue,
        };
    }
}

/// Stops threads when it is dropped, even after a failed assertion.
struct StopAtEnd<'a>(&'a AtomicBool);

impl Drop for StopAtEnd<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

#[test]
fn a_client_of_foxglove_that_comes_late_gets_the_last_strike_with_its_curves_and_their_schema() {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../../tests/data/recording-v1.mcap"
    );
    let follower = bead_recording::file::Follower::open(Path::new(path)).unwrap();
    let monitor = Bench::new().monitor;
    let server = crate::foxglove::FoxgloveServer::open(([127, 0, 0, 1], 0).into()).unwrap();
    let (port, stop) = (server.port(), AtomicBool::new(false));
    std::thread::scope(|scope| {
        let _stop = StopAtEnd(&stop);
        scope.spawn(|| follow(&monitor, follower, &stop).unwrap());
        scope.spawn(|| server.serve(&monitor, &stop));
        let mut request = format!("ws://127.0.0.1:{port}").into_client_request().unwrap();
        let protocol = "foxglove.sdk.v1".parse().unwrap();
        request.headers_mut().insert("Sec-WebSocket-Protocol", protocol);
        let stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        let (mut client, _) = tungstenite::client(request, stream).unwrap();
        let channel = loop {
            let message = next(&mut client);
            let channels = message["channels"].as_array().cloned().unwrap_or_default();
            if let Some(channel) = channels.into_iter().find(|one| one["topic"] == "/bead_0/strike") {
                break channel;
            }
        };
        assert!(
            channel["schema"]
                .as_str()
                .unwrap()
                .contains("absorbed_measured_nj")
        );
        // The strikes are over by now.
        std::thread::sleep(Duration::from_millis(500));
        let subscribe =
            json!({ "op": "subscribe", "subscriptions": [{ "id": 1, "channelId": channel["id"] }] });
        client
            .send(tungstenite::Message::text(subscribe.to_string()))
            .unwrap();
        let strike = loop {
            // The other channel may be announced only now.
            let message = next(&mut client);
            if message["op"].is_null() {
                break message;
            }
        };
        let last = monitor.lock().strikes_of(0)[0].strike;
        assert_eq!(strike["strike"], last, "{strike}");
        let force = strike["curves"]["force_n"].as_array().unwrap();
        assert_eq!(strike["time_ms"].as_array().unwrap().len(), force.len());
        let peak = force.iter().filter_map(Value::as_f64).fold(0.0, f64::max);
        assert!(
            (peak / strike["peak_force_n"].as_f64().unwrap() - 1.0).abs() < 0.01,
            "{peak}"
        );
    });
}
