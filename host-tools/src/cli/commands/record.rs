//! `bead record`: what a bead sends, to a recording.
//!
//! # Design
//! One thread only reads the port. A slow disk therefore costs memory, up to [`QUEUE`] bytes, before it costs a
//! byte; a paused reader of standard output costs lines there and nothing else. The thread ends at
//! `--duration`, at a signal, or when the port goes away. In each case all that it read is recorded.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use std::{iter, panic, thread};

use bead_wire::{Arrival, Counters, Fault, Message, Strike};
use chrono::{DateTime, Utc};
use clap::Args;

use super::clock::{drift, rfc3339};
use crate::cli::failure::Failure;
use crate::cli::interrupt;
use crate::cli::output::{self, Format};
use crate::cli::place::{self, Force, Kind};
use crate::cli::printer::Printer;
use crate::line::port::{Address, Port};
use crate::line::queue::{Closed, Queue};
use crate::recording::clock::{Live, Segment};
use crate::recording::file::{About, RecordingError, Writer};
use crate::recording::frames::{Frame, Item};
use crate::recording::whole::Target;

const AFTER_HELP: &str = "\
Ends at Ctrl-C or after --duration with exit status 0, and with 3 when the port goes away or no frame came. The recording
is complete in each case. At Ctrl-C, SIGTERM or SIGHUP that takes less than 5 seconds. Killed, it leaves F.mcap.partial,
in which at most the last two seconds are missing; `bead recover` makes a whole recording of it. It takes at most 128 MB
of memory, and 55 MB more for each GB received, which the file's index takes. It keeps every byte as received, corrupt frames included,
with the time of receipt. Each strike is printed as it comes. The last line says how fast the bead's clock is against
this host's, if the recording is long enough; see `bead clock`.

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
    #[command(flatten)]
    force: Force,
    /// Bits a second of a serial port.
    #[arg(long, default_value_t = 2_000_000, value_parser = clap::value_parser!(u32).range(1..))]
    baud: u32,
    /// Stop after this time, s.
    #[arg(long, value_name = "SECONDS", value_parser = output::seconds)]
    duration: Option<Duration>,
    /// How to print the strikes; as JSON, one object a line, as `bead decode` does, with the time of
    /// receipt.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// Received bytes go to the system at least this often.
const FLUSH_EVERY: Duration = Duration::from_secs(1);
/// Received bytes that may wait for the disk: minutes of a serial line.
const QUEUE: usize = 32 << 20;

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let started = DateTime::<Utc>::from(SystemTime::now());
    let mut target = arguments.target(started)?;
    let mut port = arguments.port.open(arguments.baud).map_err(Failure::device)?;
    let mut recorder = loop {
        match Recorder::new(arguments, &target, started) {
            // Another program began a recording in the same second.
            Err(RecordingError::Busy(_)) if arguments.out.is_none() => target = arguments.target(started)?,
            recorder => break recorder?,
        }
    };
    let partial = recorder.writer.partial_path().display().to_string();
    let stop = interrupt::orderly(format!(
        "the disk was too slow to complete the recording; what came is in {partial}, for `bead recover`"
    ));
    let deadline = arguments
        .duration
        .and_then(|duration| recorder.opened.checked_add(duration));
    let queue = Queue::new(QUEUE);
    let (heard, kept) = thread::scope(|scope| {
        let listener = scope.spawn(|| {
            let heard = listen(&mut port, &stop, deadline, &queue);
            queue.close();
            heard
        });
        let kept = recorder.keep(&queue);
        queue.close();
        stop.store(true, Ordering::Relaxed);
        let heard = listener
            .join()
            .unwrap_or_else(|cause| panic::resume_unwind(cause));
        (heard, kept)
    });
    let seconds = recorder.opened.elapsed().as_secs_f64();
    let kept = kept.and_then(|()| recorder.writer.finish());
    let finished = kept.map_err(|error| {
        Failure::input(format!(
            "{error}; what came before is kept in {partial}, for `bead recover`"
        ))
    })?;
    let counters = finished.counters;
    let printed = recorder.printer.finish();

    let result = format!(
        "{}: {}",
        finished.path.display(),
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
        Some(clock_lines(&recorder.live)).filter(|lines| !lines.is_empty()),
        recorder.from_the_future,
    ];
    for line in lines.into_iter().flatten() {
        output::note(format_args!("{line}"));
    }
    printed?;
    advice(&counters).map_or(Ok(()), |advice| Err(Failure::device(advice)))
}

impl Arguments {
    /// Where the recording goes. A name of the date is one that no file has yet, finished or not.
    fn target(&self, started: DateTime<Utc>) -> Result<Target, Failure> {
        let given = |out: &Path| place::target(out, Kind::Recording, &[], self.force);
        if let Some(out) = &self.out {
            return given(out);
        }
        let date = started.format("bead-%Y%m%d-%H%M%S");
        let numbers = iter::once(String::new()).chain((2..).map(|number| format!("-{number}")));
        let mut names = numbers.map(|number| PathBuf::from(format!("{date}{number}.mcap")));
        let is_free = |name: &PathBuf| !name.exists() && !name.with_extension("mcap.partial").exists();
        let free = names.find(is_free).expect("the numbers do not end");
        given(&free)
    }
}

/// Reads the port until it is told to stop, at least once. An error means that the port went away.
fn listen(port: &mut Port, stop: &AtomicBool, deadline: Option<Instant>, queue: &Queue) -> io::Result<()> {
    let mut buffer = vec![0; 64 * 1024];
    loop {
        let length = port.read(&mut buffer)?;
        // The time is taken here and not at the writer, where the disk would delay it.
        let now = Instant::now();
        let wanted = length == 0 || queue.push((now, buffer[..length].to_vec()));
        let late = deadline.is_some_and(|deadline| Instant::now() >= deadline);
        if late || !wanted || stop.load(Ordering::Relaxed) {
            return Ok(());
        }
    }
}

struct Recorder {
    writer: Writer,
    live: Live,
    opened: Instant,
    /// The same in ns since 1970.
    opened_ns: u64,
    strikes: u64,
    /// See [`Frame::from_the_future`].
    from_the_future: Option<String>,
    format: Format,
    /// If standard output fails or pauses, the recording goes on.
    printer: Printer,
}

impl Recorder {
    /// A recorder of a port that was opened just now.
    fn new(arguments: &Arguments, target: &Target, started: DateTime<Utc>) -> Result<Self, RecordingError> {
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
            writer: Writer::create(target, &about)?,
            live: Live::default(),
            opened,
            opened_ns,
            strikes: 0,
            from_the_future: None,
            format: arguments.format,
            printer: Printer::new(format!("listening to {}", arguments.port)),
        })
    }

    /// Records what comes until the queue is closed.
    fn keep(&mut self, queue: &Queue) -> Result<(), RecordingError> {
        loop {
            match queue.pop(FLUSH_EVERY) {
                Ok(Some((received, bytes))) => {
                    let since = received.duration_since(self.opened);
                    let received_ns = self.opened_ns + since.as_nanos() as u64;
                    self.keep_piece(&bytes, received_ns)?;
                }
                Ok(None) => self.writer.flush()?,
                Err(Closed) => return Ok(()),
            }
        }
    }

    fn keep_piece(&mut self, bytes: &[u8], received_ns: u64) -> Result<(), RecordingError> {
        let Self {
            writer,
            live,
            strikes,
            from_the_future,
            format,
            printer,
            ..
        } = self;
        writer.write(bytes, Some(received_ns), |item| {
            let Item::Frame(frame) = item else { return };
            live.push(&frame);
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
            printer.line(match format {
                Format::Json => {
                    let mut json = frame.json();
                    json["received"] = rfc3339(received_ns as i64).into();
                    json.to_string()
                }
                Format::Table => line,
            });
        })?;
        let counters = writer.counters();
        printer.status(|| {
            format!(
                "{} frames, {} lost, {} corrupt, {strikes} strikes",
                counters.frames,
                counters.lost,
                counters.rejected.total()
            )
        });
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
fn clock_lines(live: &Live) -> String {
    let line = |segment: &Segment| {
        let fit = segment.fit()?;
        let [ppm, within] = drift(fit.drift_ppm, Some(fit.uncertainty_ppm?));
        let (address, seconds) = (segment.address, fit.span);
        Some(format!(
            "the clock of the bead at address {address} is {ppm} ± {within} ppm fast against this host's, by \
             {seconds:.0} s"
        ))
    };
    live.segments()
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
        let mut live = Live::default();
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
            live.push(&frame);
            clock_lines(&live)
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
