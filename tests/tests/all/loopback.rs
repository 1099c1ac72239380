//! `bead bench` against the emulator: all checks pass, and each fault fails the one check that is for it.

use std::fs;
use std::io::{Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use bead_bench::bridge::{Bridge, Door, serve};
use bead_bench::image::flash_bytes;
use bead_bench::loopback::{self, BenchReport, CheckVerdict, Given};
use bead_line::conversation::Conversation;
use bead_line::port::Address;
use bead_tests::{Requests, image, paper, workspace};
use bead_wire::{
    Decoder, Energy, MAX_FRAME, Message, Outcome, Request, RequestDecoder, ResetCauses, Strike, StrikeFlags,
    encode,
};
use rayon::ThreadPoolBuilder;
use rayon::prelude::*;
use serde_json::Value;
use stm32f405_qemu::{AnalogWire, Fault, FaultKind, Poke, Run};

/// Address of the bead. Without one, every request that changes its state would wait for other beads.
const BEAD: u8 = 0;
/// Noise of an input, codes rms, as `bead emulate` has it at the end of a wire.
const NOISE: f64 = 0.4;

/// A fault of the line between host and bead.
#[derive(Clone, Copy, PartialEq, Eq)]
enum LineFault {
    None,
    /// Bytes that are no request come before the first request for kept strikes.
    Noise,
    /// The first request for kept strikes gets lost.
    Swallowed,
    /// The bead's energy differs in its last bit.
    OtherBit,
    /// The bead says that it was reset by its pin, where its watchdog did it.
    OtherCause,
}

/// A bead on a bench.
struct Setup {
    wires: Vec<AnalogWire>,
    change: Box<dyn Fn(&mut Run) + Send + Sync>,
    shift: Option<u8>,
    line: LineFault,
    requests: u32,
    resets: bool,
    /// Time-out of a reply: more than a busy computer takes, where none is lost.
    patience_s: u64,
}

pub(crate) fn wires(pairs: &[(&str, &str)]) -> Vec<AnalogWire> {
    let wire = |(from, to): &(&str, &str)| {
        let mut wire = AnalogWire::new(*from, *to);
        wire.noise = NOISE;
        wire
    };
    pairs.iter().map(wire).collect()
}

impl Setup {
    fn right() -> Self {
        Self {
            wires: wires(&[("PA4", "PA0"), ("PA5", "PA2")]),
            change: Box::new(|_| {}),
            shift: None,
            line: LineFault::None,
            requests: 12,
            resets: true,
            patience_s: 20,
        }
    }

    /// A setup with a change in the wire to the force, or to the acceleration.
    fn wired(to: usize, change: impl FnOnce(&mut AnalogWire)) -> Self {
        let mut setup = Self::right();
        change(&mut setup.wires[to]);
        setup
    }

    fn on_line(line: LineFault) -> Self {
        Self {
            line,
            ..Self::right()
        }
    }

    fn changed(change: impl Fn(&mut Run) + Send + Sync + 'static) -> Self {
        Self {
            change: Box::new(change),
            ..Self::right()
        }
    }

    fn report(self) -> BenchReport {
        let folder = tempfile::tempdir().expect("a folder");
        let [ours, its] = ["line.sock", "bead.sock"].map(|name| folder.path().join(name));
        let mut emulation = paper(0, 0.1, Some(1));
        emulation.wires.clone_from(&self.wires);
        emulation.shift = self.shift;
        let stop = AtomicBool::new(false);
        let door = Door::open(&Address::Unix(its.clone())).expect("a socket");
        let listener = UnixListener::bind(&ours).expect("a socket");
        let image = image();
        thread::scope(|scope| {
            scope.spawn(|| {
                let mut bridge = Bridge::with(&emulation, None, |run| (self.change)(run))
                    .unwrap_or_else(|failure| panic!("{failure}"));
                serve(&mut bridge, &door, &stop).unwrap_or_else(|failure| panic!("{failure}"));
            });
            scope.spawn(|| {
                let (host, _) = listener.accept().expect("the host connects");
                pass_on(host, &its, self.line);
            });
            let patience = Duration::from_secs(self.patience_s);
            let mut bead = Conversation::open(&Address::Unix(ours), 0, BEAD, patience).expect("it opens");
            let given = Given {
                requests: self.requests,
                resets: self.resets,
                flash: &|address, bytes| flash_bytes(&image, address, bytes),
                shares_time: false,
                date: "2026-01-01T00:00:00Z".to_owned(),
                stop: &|| false,
            };
            let report = loopback::run(&mut bead, &given, |_| {});
            stop.store(true, Ordering::Relaxed);
            let (report, ended) = report.unwrap_or_else(|failure| panic!("{failure}"));
            ended.unwrap_or_else(|failure| panic!("{failure}"));
            report
        })
    }
}

/// The line: bytes both ways, until either end hangs up.
fn pass_on(host: UnixStream, its: &Path, fault: LineFault) {
    let bead = UnixStream::connect(its).expect("the bead is there");
    let [mut from_host, mut to_host] = [host.try_clone().expect("two ends"), host];
    let [mut from_bead, mut to_bead] = [bead.try_clone().expect("two ends"), bead];
    thread::scope(|scope| {
        scope.spawn(move || {
            let (mut buffer, mut decoder, mut done) =
                ([0; 4096], RequestDecoder::new(), fault == LineFault::None);
            while let Ok(length @ 1..) = from_host.read(&mut buffer) {
                let bytes = &buffer[..length];
                let heard = bytes.iter().filter_map(|byte| decoder.push(*byte)?.ok()).last();
                let is_it = heard.is_some_and(|heard| heard.request == Ok(Request::ListKept));
                let first = is_it && !done;
                done |= is_it;
                match fault {
                    LineFault::Swallowed if first => continue,
                    LineFault::Noise if first => drop(to_bead.write_all(b"\0noise\0")),
                    _ => {}
                }
                if to_bead.write_all(bytes).is_err() {
                    break;
                }
            }
            // The other direction ends with this one.
            let _ = to_bead.shutdown(std::net::Shutdown::Both);
        });
        let (mut buffer, mut decoder, mut run) = ([0; 4096], Decoder::new(), Vec::new());
        while let Ok(length @ 1..) = from_bead.read(&mut buffer) {
            let mut said = Vec::new();
            for &byte in &buffer[..length] {
                run.push(byte);
                let frame = decoder.push(byte);
                if byte == 0 {
                    said.append(&mut changed(
                        frame.and_then(Result::ok),
                        std::mem::take(&mut run),
                        fault,
                    ));
                }
            }
            if to_host.write_all(&said).is_err() {
                break;
            }
        }
        let _ = to_host.shutdown(std::net::Shutdown::Both);
    });
}

/// The bytes of a frame, or those that the fault makes of it.
fn changed(frame: Option<bead_wire::Frame>, bytes: Vec<u8>, fault: LineFault) -> Vec<u8> {
    let Some(bead_wire::Frame { header, message, .. }) = frame else {
        return bytes;
    };
    let message = match (message, fault) {
        (Message::Strike(mut strike), LineFault::OtherBit) => {
            let bits = strike.absorbed_measured.bits() ^ 1;
            strike.absorbed_measured = Energy::from_bits(bits);
            Message::Strike(strike)
        }
        (Message::Identity(mut identity), LineFault::OtherCause)
            if identity.reset_cause.has(ResetCauses::INDEPENDENT_WATCHDOG) =>
        {
            identity.reset_cause = ResetCauses::PIN;
            Message::Identity(identity)
        }
        _ => return bytes,
    };
    let mut buffer = [0; MAX_FRAME];
    encode(&header, &message, &mut buffer).expect("it fits").to_vec()
}

fn verdicts(report: &BenchReport, verdict: CheckVerdict) -> Vec<&str> {
    let rows = report.checks.iter().filter(|row| row.verdict == verdict);
    rows.map(|row| &*row.check).collect()
}

/// A fault at this time since power-up, s.
fn fault(at: f64, kind: FaultKind) -> Setup {
    Setup::changed(move |run| run.faults.push(Fault::after_power_up((at * 1e9) as u64, kind)))
}

/// Each fault with the check that it fails. Those that several checks of one kind share are tried on one.
fn faults() -> Vec<(&'static str, Setup)> {
    /// A word of the vector table that the processor does not use (RM0090 table 61).
    const RESERVED: u32 = 0x0802_001c;
    vec![
        (
            "image",
            Setup::changed(|run| {
                run.pokes.push(Poke {
                    at_ns: 0,
                    address: RESERVED,
                    bytes: vec![1],
                });
            }),
        ),
        ("force, level", Setup::wired(0, |wire| wire.gain = 0.97)),
        ("acceleration, level", Setup::wired(1, |wire| wire.offset = 30.0)),
        ("force, linearity", Setup::wired(0, |wire| wire.bend = 26.0)),
        (
            "acceleration, linearity",
            Setup::wired(1, |wire| wire.bend = 26.0),
        ),
        ("force, noise", Setup::wired(0, |wire| wire.noise = 1.2)),
        ("acceleration, noise", Setup::wired(1, |wire| wire.noise = 1.2)),
        ("force, cross-talk", Setup::wired(0, |wire| wire.cross_talk = 1.0)),
        (
            "acceleration, cross-talk",
            Setup::wired(1, |wire| wire.cross_talk = 1.0),
        ),
        ("strike, trigger", {
            let mut setup = Setup::right();
            setup.wires.iter_mut().for_each(|wire| wire.delay_ns = 10_000);
            setup
        }),
        ("strike, replay", Setup::on_line(LineFault::OtherBit)),
        ("strike, values", Setup::wired(1, |wire| wire.lag_ns = 60_000)),
        // Misses in the second strike of the train: the first one ends at trigger 350 or so.
        (
            "train",
            Setup::changed(|run| run.dac_misses = (362..382).collect()),
        ),
        (
            "budget",
            Setup {
                shift: Some(4),
                ..Setup::right()
            },
        ),
        ("self-test", fault(0.0, FaultKind::Supply { millivolts: 3700 })),
        (
            "requests",
            Setup {
                patience_s: 3,
                ..Setup::on_line(LineFault::Swallowed)
            },
        ),
        (
            "acquisition",
            Setup {
                requests: 250,
                ..fault(12.0, FaultKind::AdcOverrun)
            },
        ),
        ("line", Setup::on_line(LineFault::Noise)),
        (
            "settings",
            Setup {
                patience_s: 3,
                ..fault(
                    2.0,
                    FaultKind::PowerCutInFlash {
                        after: 0,
                        percent: 50,
                    },
                )
            },
        ),
        ("watchdog", Setup::on_line(LineFault::OtherCause)),
    ]
}

#[test]
fn each_fault_fails_the_check_that_is_for_it_and_no_other() {
    // Those that the emulator gives, as `the_kept_capture_is_what_the_emulator_gives` finds.
    let all = kept_capture();
    let all = all["checks"].as_array().expect("a list").iter();
    let all = all.map(|row| row["check"].as_str().expect("a name"));
    let faults = faults();
    let tried: Vec<_> = faults.iter().map(|(check, _)| *check).collect();
    let untried: Vec<_> = all.filter(|check| !tried.contains(check)).collect();
    assert_eq!(
        untried,
        ["wires", "open inputs"],
        "the former has a test of its own, the latter no bound"
    );
    let wrong = |(check, mut setup): (&str, Setup)| {
        // The resets take half of the time, and no earlier fault affects them.
        setup.resets = ["settings", "watchdog"].contains(&check);
        let report = setup.report();
        let failed = verdicts(&report, CheckVerdict::Failed);
        let rows = report.checks.iter().filter(|row| failed.contains(&&*row.check));
        let rows: Vec<_> = rows.map(|row| format!("{}: {}", row.check, row.seen)).collect();
        (failed != [check]).then(|| format!("the fault for {check} fails {rows:#?}"))
    };
    // The bridge waits for the host for two thirds of the time.
    let pool = ThreadPoolBuilder::new().num_threads(3 * rayon::current_num_threads());
    let pool = pool.build().expect("threads");
    let wrong: Vec<String> = pool.install(|| faults.into_par_iter().filter_map(wrong).collect());
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn wires_that_are_missing_or_exchanged_are_named_and_what_needs_none_is_checked_all_the_same() {
    for (pairs, why) in [
        (&[][..], "no wire: "),
        (&[("PA5", "PA0"), ("PA4", "PA2")], "the wires are exchanged: "),
        (&[("PA4", "PA0")], "the wire from PA5 to PA2 is missing: "),
        (&[("PA5", "PA2")], "the wire from PA4 to PA0 is missing: "),
        (&[("PA4", "PA0"), ("PA4", "PA2")], "PA2 follows PA4"),
    ] {
        let mut setup = Setup::right();
        // A wire to an unused pin, so that there are no sensors.
        setup.wires = wires(&[pairs, &[("PA4", "PC0")]].concat());
        setup.resets = false;
        let report = setup.report();
        assert_eq!(verdicts(&report, CheckVerdict::Failed), ["wires"]);
        let mut rows = report.checks.iter();
        let row = rows.find(|row| row.check == "wires").expect("it is there");
        assert!(row.seen.contains(why), "{}", row.seen);
        assert_eq!(verdicts(&report, CheckVerdict::NotDone).len(), 16);
        assert_eq!(verdicts(&report, CheckVerdict::Passed).len(), 5);
    }
}

#[test]
fn what_is_played_has_settled_when_it_is_converted_and_no_register_is_touched_that_no_model_has() {
    let mut emulation = paper(0, 0.1, Some(1));
    emulation.wires = wires(&[("PA4", "PA0"), ("PA5", "PA2")]);
    let mut requests = Requests::new(&emulation);
    let play = Request::Play {
        strikes: 2,
        interval_ms: 50,
    };
    let play = requests.request(0.3, &play);
    let run = requests.run();
    assert_eq!(run.received.answer(play).0, Outcome::Done);
    let strikes = run.received.all::<Strike>();
    let played = strikes.map(|strike| strike.flags.has(StrikeFlags::PLAYED));
    assert_eq!(played.collect::<Vec<_>>(), [true, true]);
    assert_eq!(run.received.causes(), []);
    let outcome = &run.outcome;
    assert_eq!((outcome.overruns, &outcome.unknown_registers[..]), (0, &[][..]));
    let mut notes = outcome.unmodelled.iter();
    let of_dac = notes.find(|note| note.starts_with("DAC") || note.starts_with("DMA"));
    assert_eq!(of_dac, None);
}

/// Returns `true` if a run of another build repeats a number: within a relative difference, or an absolute
/// one near 0. `error` is the standard error that a row states of it.
fn agrees(one: f64, other: f64, error: f64) -> bool {
    (one - other).abs() <= 0.05 + 0.05 * one.abs().max(other.abs()) + 7.0 * error
}

const HOW: &str = "docs/bench.md says how: bead bench --out docs/captures/emulator.json --overwrite";

fn kept_capture() -> Value {
    let kept = workspace().join("docs/captures/emulator.json");
    serde_json::from_slice(&fs::read(kept).expect(HOW)).expect(HOW)
}

#[test]
fn the_kept_capture_is_what_the_emulator_gives() {
    let kept = kept_capture();
    let report = Setup::right().report();
    let now = serde_json::to_value(&report).expect("it has a JSON form");
    assert_eq!(verdicts(&report, CheckVerdict::Failed), [""; 0]);
    let [kept, now] = [&kept, &now].map(|report| report["checks"].as_array().expect("a list"));
    let names = |rows: &[Value]| rows.iter().map(|row| row["check"].clone()).collect::<Vec<_>>();
    assert_eq!(names(kept), names(now), "{HOW}");
    for (kept, now) in kept.iter().zip(now) {
        assert_eq!(kept["verdict"], now["verdict"], "{kept} {now}");
        // Cycles and the image's length move with every build, and the requests are others.
        if ["image", "budget", "requests"].contains(&kept["check"].as_str().unwrap_or_default()) {
            continue;
        }
        let [kept, now] = [kept, now].map(|row| row["numbers"].as_object().expect("numbers"));
        let error = kept.get("u_codes").and_then(Value::as_f64).unwrap_or_default();
        for (name, value) in kept {
            let [kept, now] = [value, &now[name]].map(|value| value.as_f64().expect("a number"));
            assert!(agrees(kept, now, error), "{name}: {kept} {now}");
        }
    }
}
