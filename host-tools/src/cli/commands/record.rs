//! `bead record`: what a bead sends, to a recording.
//!
//! # Design
//! One thread only reads the port. A slow disk, or a paused reader of standard output, therefore costs memory
//! and never bytes. The thread ends at `--duration`, at a signal, or when the port goes away. In each case
//! all that it read is recorded.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use std::{panic, thread};

use anyhow::ensure;
use bead_wire::{Arrival, Counters, Fault, Message, Strike};
use chrono::{DateTime, Utc};
use clap::Args;
use indicatif::ProgressBar;

use super::clock::drift;
use crate::cli::failure::{Blame, Failure};
use crate::cli::output::{self, Format};
use crate::line::port::{Address, Port};
use crate::recording::clock::{Segment, Tracker};
use crate::recording::file::{About, RecordingError, Writer};
use crate::recording::frames::{Frame, Item};

const AFTER_HELP: &str = "\
Ends at Ctrl-C or after --duration with exit status 0, and with 3 when the port goes away. The recording is complete in
each case. It keeps every byte as received, corrupt frames included, with the time of receipt. Each strike is printed as
it comes. The last line says how fast the bead's clock is against this host's, if the recording is long enough; see
`bead clock`.

Examples:
  bead record --port /dev/ttyUSB0
  bead record --port /dev/ttyUSB0 --out strikes.mcap --duration 60
  bead record --port tcp:192.168.1.7:4000 --format json | jq .absorbed_measured_j";

/// Arguments of `bead record`.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    /// A serial port or pty, tcp:HOST:PORT or unix:PATH.
    #[arg(long, value_name = "P")]
    port: Address,
    /// The recording [default: bead-DATE-TIME.mcap, in UTC].
    #[arg(long, value_name = "F.mcap")]
    out: Option<PathBuf>,
    /// Replace the recording if there is one.
    #[arg(long)]
    force: bool,
    /// Bits a second of a serial port.
    #[arg(long, default_value_t = 2_000_000, value_parser = clap::value_parser!(u32).range(1..))]
    baud: u32,
    /// Stop after this time, s.
    #[arg(long, value_name = "SECONDS", value_parser = output::seconds)]
    duration: Option<Duration>,
    /// How to print the strikes; as JSON, one object a line, as `bead decode` does.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// Received bytes go to the system at least this often.
const FLUSH_EVERY: Duration = Duration::from_secs(1);

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let started = DateTime::<Utc>::from(SystemTime::now());
    let out = arguments.recording(started).map_err(Failure::Input)?;
    let mut port = arguments.port.open(arguments.baud).map_err(Failure::device)?;
    let stop = output::stop_at_signals().or_input(|| "cannot listen for Ctrl-C")?;
    let mut recorder = Recorder::new(arguments, &out, started)?;
    let deadline = arguments
        .duration
        .and_then(|duration| recorder.opened.checked_add(duration));
    let (heard, kept) = thread::scope(|scope| {
        let (sender, receiver) = mpsc::channel();
        let listener = scope.spawn(|| listen(&mut port, &stop, deadline, sender));
        let kept = recorder.keep(&receiver);
        drop(receiver);
        stop.store(true, Ordering::Relaxed);
        let heard = listener
            .join()
            .unwrap_or_else(|cause| panic::resume_unwind(cause));
        (heard, kept)
    });
    recorder.progress.finish_and_clear();
    let seconds = recorder.opened.elapsed().as_secs_f64();
    let partial = recorder.writer.partial_path().display().to_string();
    let kept = kept.and_then(|()| recorder.writer.finish());
    let counters =
        kept.map_err(|error| Failure::input(format!("{error}; what came before is kept in {partial}")))?;

    let result = format!(
        "{}: {}",
        out.display(),
        summary(&counters, recorder.strikes, seconds)
    );
    if let Err(reason) = heard {
        return Err(Failure::device(format!(
            "{} went away ({reason}): all that came before is in {result}; plug it in or start it again, and record \
             to another file",
            arguments.port
        )));
    }
    let lines = [
        Some(result),
        Some(clock_lines(&recorder.tracker)).filter(|lines| !lines.is_empty()),
        advice(&counters).map(str::to_owned),
        recorder.from_the_future,
    ];
    for line in lines.into_iter().flatten() {
        eprintln!("bead: {line}");
    }
    recorder.printed
}

impl Arguments {
    /// The name of the recording. No other file has it, unless it may be replaced.
    fn recording(&self, started: DateTime<Utc>) -> anyhow::Result<PathBuf> {
        let named = || started.format("bead-%Y%m%d-%H%M%S.mcap").to_string().into();
        let out = self.out.clone().unwrap_or_else(named);
        let name = out.display();
        ensure!(!out.is_dir(), "{name} is a directory; give --out a file's name");
        ensure!(
            self.force || !out.exists(),
            "{name} is there already; give another --out, or --force to replace it"
        );
        Ok(out)
    }
}

/// Reads the port until it is told to stop, at least once. An error means that the port went away.
fn listen(
    port: &mut Port,
    stop: &AtomicBool,
    deadline: Option<Instant>,
    sender: Sender<(Instant, Vec<u8>)>,
) -> io::Result<()> {
    let mut buffer = vec![0; 64 * 1024];
    loop {
        let length = port.read(&mut buffer)?;
        // The time is taken here and not at the writer, where the disk would delay it.
        let now = Instant::now();
        let wanted = length == 0 || sender.send((now, buffer[..length].to_vec())).is_ok();
        let late = deadline.is_some_and(|deadline| Instant::now() >= deadline);
        if late || !wanted || stop.load(Ordering::Relaxed) {
            return Ok(());
        }
    }
}

struct Recorder {
    writer: Writer,
    tracker: Tracker,
    opened: Instant,
    /// The same in ns since 1970.
    opened_ns: u64,
    strikes: u64,
    /// See [`Frame::from_the_future`].
    from_the_future: Option<String>,
    format: Format,
    /// What printing gave. If standard output fails, the recording goes on.
    printed: Result<(), Failure>,
    progress: ProgressBar,
}

impl Recorder {
    /// A recorder of a port that was opened just now.
    fn new(arguments: &Arguments, out: &Path, started: DateTime<Utc>) -> Result<Self, Failure> {
        let opened = Instant::now();
        // From here on the monotonic clock counts, so that a step of the host's time is not taken for the
        // bead's drift.
        let opened_ns = SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .map_or(0, |since| since.as_nanos() as u64);
        let mut notes = BTreeMap::from([("started".into(), started.to_rfc3339())]);
        if let Address::Serial(_) = arguments.port {
            notes.insert("baud".into(), arguments.baud.to_string());
        }
        let about = About {
            source: arguments.port.to_string(),
            notes,
            ..About::default()
        };
        Ok(Self {
            writer: Writer::create(out, &about)?,
            tracker: Tracker::default(),
            opened,
            opened_ns,
            strikes: 0,
            from_the_future: None,
            format: arguments.format,
            printed: Ok(()),
            progress: output::spinner(format!("listening to {}", arguments.port)),
        })
    }

    /// Records what comes until the sender is gone.
    fn keep(&mut self, receiver: &Receiver<(Instant, Vec<u8>)>) -> Result<(), RecordingError> {
        loop {
            match receiver.recv_timeout(FLUSH_EVERY) {
                Ok((received, bytes)) => {
                    let since = received.duration_since(self.opened);
                    let received_ns = self.opened_ns + since.as_nanos() as u64;
                    self.keep_piece(&bytes, received_ns)?;
                }
                Err(RecvTimeoutError::Timeout) => self.writer.flush()?,
                Err(RecvTimeoutError::Disconnected) => return Ok(()),
            }
        }
    }

    fn keep_piece(&mut self, bytes: &[u8], received_ns: u64) -> Result<(), RecordingError> {
        let Self {
            writer,
            tracker,
            strikes,
            from_the_future,
            format,
            printed,
            progress,
            ..
        } = self;
        writer.write(bytes, Some(received_ns), |item| {
            let Item::Frame(frame) = item else { return };
            tracker.push(&frame);
            *from_the_future = frame.from_the_future().or(from_the_future.take());
            if frame.arrival == Arrival::Duplicate {
                return;
            }
            let line = match &frame.message {
                Message::Strike(strike) => {
                    *strikes += 1;
                    strike_line(&frame, strike)
                }
                Message::Fault(fault) => fault_line(fault),
                _ => return,
            };
            if printed.is_ok() {
                let line = match format {
                    Format::Json => frame.json().to_string(),
                    Format::Table => line,
                };
                *printed = progress.suspend(|| output::print_line(&line));
            }
        })?;
        let counters = writer.counters();
        progress.set_message(format!(
            "{} frames, {} lost, {} corrupt, {strikes} strikes",
            counters.frames,
            counters.lost,
            counters.rejected.total()
        ));
        Ok(())
    }
}

fn strike_line(frame: &Frame, strike: &Strike) -> String {
    let at = match frame.seconds(strike.trigger_index as f64) {
        Some(seconds) => format!("at {seconds:.5} s"),
        None => format!("at sample {}", strike.trigger_index),
    };
    let mut line = format!(
        "strike {} {at}: {:.3} N, {:+.1} to {:+.1} m/s², absorbed {:.2} nJ measured, {:.2} nJ predicted",
        strike.strike,
        strike.peak_force.newtons(),
        strike.acceleration_min.metres_per_second_squared(),
        strike.acceleration_max.metres_per_second_squared(),
        strike.absorbed_measured.joules() * 1e9,
        strike.absorbed_predicted.joules() * 1e9,
    );
    line.extend(strike.flags.names().flat_map(|name| [", ", name]));
    line
}

fn fault_line(fault: &Fault) -> String {
    let detail = fault.detail.as_str();
    let separator = if detail.is_empty() { "" } else { ", " };
    format!("fault in boot {}: {}{separator}{detail}", fault.boot, fault.cause)
}

fn summary(counters: &Counters, strikes: u64, seconds: f64) -> String {
    format!(
        "{strikes} strikes, {} frames in {} bytes and {seconds:.1} s; {} lost, {} corrupt, {} restarts",
        counters.frames,
        counters.bytes,
        counters.lost,
        counters.rejected.total(),
        counters.restarts
    )
}

/// How each bead's clock runs since its last restart, a line each, where the recording is long enough to tell.
fn clock_lines(tracker: &Tracker) -> String {
    let line = |segment: &Segment| {
        let fit = segment.fit()?;
        let [ppm, within] = drift(fit.drift_ppm, Some(fit.uncertainty_ppm?));
        let (address, seconds) = (segment.address, fit.span);
        Some(format!(
            "the clock of the bead at address {address} is {ppm} ± {within} ppm fast against this host's, by \
             {seconds:.0} s"
        ))
    };
    tracker
        .current()
        .filter_map(line)
        .collect::<Vec<_>>()
        .join("\nbead: ")
}

/// What to check when no frame came.
fn advice(counters: &Counters) -> Option<&'static str> {
    match counters {
        Counters { frames: 1.., .. } => None,
        Counters { bytes: 0, .. } => {
            Some("nothing came: is the bead powered, and its PA9 wired to the adapter's receive pin?")
        }
        _ => Some("bytes came, but no frame among them: does --baud match, and is it a bead that sends?"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_is_a_line_with_its_cause_and_what_the_bead_said_of_it() {
        let fault = |cause, detail: &str| Fault {
            cause,
            boot: 3,
            pc: 0,
            detail: detail.into(),
        };
        assert_eq!(
            fault_line(&fault(bead_wire::FaultCause::Recovered, "force_stuck")),
            "fault in boot 3: recovered, force_stuck"
        );
        assert_eq!(
            fault_line(&fault(bead_wire::FaultCause::Watchdog, "")),
            "fault in boot 3: watchdog"
        );
    }

    #[test]
    fn the_clock_is_told_as_soon_as_it_can_be() {
        let mut tracker = Tracker::default();
        let mut sent = |second: u64| {
            let identity = bead_wire::Identity {
                firmware: "".into(),
                git: "".into(),
                uid: [0; 12],
                boot: 0,
                reset_cause: bead_wire::ResetCauses::NONE,
                sample_rate_hz: 100_000,
                channels: 2,
            };
            let frame = Frame {
                version: bead_wire::VERSION,
                header: bead_wire::Header {
                    address: 0,
                    boot: 0,
                    sequence: second as u32,
                    sample_index: 100_000 * second,
                },
                arrival: Arrival::Next { lost: 0 },
                sample_rate_hz: Some(100_000),
                // A bead that is fast by 50 ppm, and frames up to 30 us late.
                received_ns: Some(second * 999_950_002 + second * 7919 % 30_011),
                message: identity.into(),
            };
            tracker.push(&frame);
            clock_lines(&tracker)
        };
        assert_eq!(sent(0), "");
        let lines: Vec<_> = (1..=60).map(&mut sent).collect();
        assert!(lines[..2].iter().all(String::is_empty), "{lines:?}");
        let last = &lines[59];
        let numbers: Vec<f64> = last.split(' ').filter_map(|word| word.parse().ok()).collect();
        let [0.0, ppm, within, 59.0] = numbers[..] else {
            panic!("address, drift, uncertainty and time: {last}")
        };
        assert!((ppm - 50.0).abs() < within && within < 1.0, "{last}");
        assert!(last.ends_with(" ppm fast against this host's, by 59 s"), "{last}");
    }
}
