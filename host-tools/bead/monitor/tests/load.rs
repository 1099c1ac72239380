//! Recorder, model and a page together, on ten beads that send as fast as lines go.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

use std::fs;
use std::io::{Read, Write};
use std::os::unix::net::UnixListener;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use bead_line::port::{Address, open_all};
use bead_line::recorder::{Recorder, RecorderOptions};
use bead_monitor::{Feed, Monitor, SharedMonitor};
use bead_recording::file::{About, Recording};
use bead_recording::frames::{Frames, decode};
use bead_tables::whole::Target;
use bead_testing::{Speaker, paper_settings};
use bead_wire::Message;

const BEADS: u8 = 10;
/// Bytes a second, of all beads.
const RATE: f64 = 1e6;
/// Time between two pieces of bytes of a bead.
const BEAT: Duration = Duration::from_millis(20);

/// The frames of a strike, as the code of the bead makes them.
fn strike_messages() -> Vec<Message> {
    let mut bead = Speaker::at(1);
    let codes = (0..3000).map(|sample| {
        let at = f64::from(sample) - 2000.0;
        let force = 128.0 + 6.0 * 256.0 * (-(at / 20.0).powi(2)).exp();
        [force as u16, 128, 2048, 2048].map(|code: u16| code + (sample % 2) as u16)
    });
    assert_eq!(bead.measure(&paper_settings(), codes), 1);
    decode(&bead.bytes)
        .0
        .into_iter()
        .map(|frame| frame.message)
        .collect()
}

/// The same strike with another number, so much later.
fn again(messages: &[Message], number: u32, later: u64) -> impl Iterator<Item = Message> {
    messages.iter().cloned().map(move |mut message| {
        match &mut message {
            Message::Waveform(waveform) => {
                (waveform.strike, waveform.first_index) = (number, waveform.first_index + later)
            }
            Message::Shape(shape) => (shape.strike, shape.first_index) = (number, shape.first_index + later),
            Message::Strike(strike) => {
                strike.strike = number;
                strike.first_index += later;
                strike.trigger_index += later;
            }
            _ => {}
        }
        message
    })
}

/// Sends strikes of a bead to the first program that connects, for so long, and gives the number of frames
/// and of strikes.
fn feed(address: u8, listener: &UnixListener, lasting: Duration) -> (u64, u64) {
    let (mut line, _) = listener.accept().unwrap();
    let messages = strike_messages();
    let (mut bead, begun) = (Speaker::at(address), Instant::now());
    let (mut sent, mut strikes) = (0, 0);
    while begun.elapsed() < lasting {
        let due = begun.elapsed().as_secs_f64() * RATE / f64::from(BEADS);
        while (sent as f64) < due {
            let index = 5000 * u64::from(strikes);
            again(&messages, strikes, index).for_each(|message| bead.say(index, message));
            strikes += 1;
            line.write_all(&bead.bytes).unwrap();
            sent += bead.bytes.len();
            bead.bytes.clear();
        }
        thread::sleep(BEAT);
    }
    // The recorder hangs up when it has all; until then the line stays, as a real one does.
    let _ = line.read(&mut [0]);
    (bead.sequence.into(), strikes.into())
}

/// Processor time of the threads of this process but for those that feed, s.
fn processor_time() -> f64 {
    let tasks = fs::read_dir("/proc/self/task").unwrap();
    let ticks = tasks.filter_map(|task| {
        let stat = fs::read_to_string(task.ok()?.path().join("stat")).ok()?;
        let (name, rest) = stat.split_once(") ")?;
        let field = |place: usize| rest.split(' ').nth(place)?.parse::<u64>().ok();
        // proc(5): utime and stime are fields 14 and 15, in hundredths of a second on Linux.
        (!name.contains("feeder")).then_some(field(11)? + field(12)?)
    });
    ticks.sum::<u64>() as f64 / 100.0
}

/// Looks at a monitor as a terminal and a browser do, until `stop`. Gives the strikes it was shown and missed.
fn look(monitor: &SharedMonitor, stop: &AtomicBool) -> (u64, u64) {
    let (mut feed, mut shown) = (Feed::default(), 0);
    while !stop.load(Ordering::Relaxed) {
        thread::sleep(Duration::from_millis(200));
        let strikes = feed.take(monitor, 32);
        shown += strikes.len() as u64;
        let curves = strikes
            .iter()
            .map(|strike| serde_json::to_string(&strike.curves()).unwrap().len());
        let view = monitor.lock().view();
        assert!(curves.sum::<usize>() < usize::MAX && view.beads.len() <= usize::from(BEADS));
    }
    (shown, feed.missed)
}

/// Records ten beads for so long. Asserts that the counts of what was sent, shown and recorded are equal, and
/// gives the bytes a second and the part of one core.
fn run(lasting: Duration, folder: &Path) -> [f64; 2] {
    let addresses: Vec<_> = (1..=BEADS)
        .map(|bead| Address::Unix(folder.join(format!("{bead}.sock"))))
        .collect();
    let listeners: Vec<_> = (1..=BEADS)
        .map(|bead| UnixListener::bind(folder.join(format!("{bead}.sock"))).unwrap())
        .collect();
    let target = Target::new(folder.join("a.mcap"));
    let monitor = SharedMonitor::new(Monitor::new(
        vec![String::new(); usize::from(BEADS)],
        String::new(),
    ));
    let options = RecorderOptions {
        baud: 2_000_000,
        duration: Some(lasting + Duration::from_millis(500)),
        split: Duration::from_secs(86_400),
        wait: Duration::MAX,
        fetch: true,
    };
    let (stop, begun) = (AtomicBool::new(false), Instant::now());
    let (sent, cost) = thread::scope(|scope| {
        let feeders: Vec<_> = (1..=BEADS)
            .zip(&listeners)
            .map(|(bead, listener)| {
                let builder = thread::Builder::new().name("feeder".to_owned());
                builder
                    .spawn_scoped(scope, move || feed(bead, listener, lasting))
                    .unwrap()
            })
            .collect();
        let wanted: Vec<_> = addresses.iter().cloned().map(Some).collect();
        let (named, ports): (Vec<_>, Vec<_>) =
            open_all(&wanted, 2_000_000, |_| {}).unwrap().into_iter().unzip();
        let (mut observer, note) = (monitor.clone(), |line: String| panic!("{line}"));
        let recorder =
            Recorder::new(&target, &named, options, About::default(), &mut observer, &note).unwrap();
        let looking = scope.spawn(|| look(&monitor, &stop));
        let measuring = scope.spawn(|| {
            thread::sleep(lasting.mul_f64(0.1));
            let (from, since) = (processor_time(), Instant::now());
            thread::sleep(lasting.mul_f64(0.8));
            (processor_time() - from) / since.elapsed().as_secs_f64()
        });
        let recorded = recorder.run(ports, &stop).unwrap();
        let cost = measuring.join().unwrap();
        let (shown, missed) = looking.join().unwrap();
        println!("{shown} strikes shown with curves, {missed} missed by the page");
        assert_eq!(
            (recorded.counters.lost, recorded.counters.rejected.total()),
            (0, 0)
        );
        (
            feeders
                .into_iter()
                .map(|feeder| feeder.join().unwrap())
                .collect::<Vec<_>>(),
            cost,
        )
    });
    let view = monitor.lock().view();
    for (bead, (frames, strikes)) in view.beads.iter().zip(&sent) {
        assert_eq!(
            (bead.frames, bead.strikes),
            (*frames, *strikes),
            "bead {}",
            bead.bead
        );
        assert!(bead.losses.is_empty(), "{:?}", bead.losses);
    }
    let recording = Recording::open(target.path()).unwrap();
    let (mut frames, mut bytes) = (Frames::new(recording.pieces().unwrap()), 0);
    let came = frames.by_ref().filter_map(|item| item.frame()).count() as u64;
    assert_eq!(came, sent.iter().map(|(frames, _)| frames).sum::<u64>());
    bytes += frames.counters().bytes;
    println!(
        "{came} frames of {BEADS} beads sent, shown and recorded; 0 lost, 0 corrupt, in {:.0?}",
        begun.elapsed()
    );
    [bytes as f64 / lasting.as_secs_f64(), cost]
}

#[test]
fn what_ten_beads_send_at_a_megabyte_a_second_is_shown_and_recorded_frame_by_frame() {
    let folder = tempfile::tempdir().unwrap();
    let [rate, _] = run(Duration::from_secs(3), folder.path());
    // No computer of ours is too slow for it; one that is would be a reason to say so.
    assert!(rate > 0.5 * RATE, "{rate} B/s");
}

/// `cargo xtask bench monitor`.
#[test]
#[ignore = "a benchmark of ten minutes: its time depends on the computer"]
fn ten_minutes() {
    let seconds = std::env::var("BENCH_SECONDS")
        .ok()
        .and_then(|text| text.parse().ok())
        .unwrap_or(600);
    let folder = tempfile::tempdir().unwrap();
    let [rate, core] = run(Duration::from_secs(seconds), folder.path());
    println!(
        "{:.3} MB/s, {:.1} % of one core; target 25 %",
        1e-6 * rate,
        100.0 * core
    );
    assert!(core < 0.25, "{core} of one core");
}
