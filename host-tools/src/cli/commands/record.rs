//! `bead record`: what beads send, to one recording.
//!
//! # Design
//! One thread for each port only reads it. A slow disk therefore costs memory, up to [`QUEUE`] bytes, before
//! it costs a byte; a paused reader of standard output costs lines there and nothing else. The threads end at
//! `--duration`, at a signal, or when all ports have gone away for good. In each case all that they read is
//! recorded.
//!
//! A bead is asked for strikes that did not come whole ([`Gaps`]), through the thread of its port.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{self, Sender};
use std::thread::{self, ScopedJoinHandle};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use std::{iter, panic};

use bead_wire::{Arrival, Counters, Fault, Message, Strike};
use chrono::{DateTime, Utc};
use clap::Args;

use super::clock::{drift, rfc3339, times_as_fast};
use crate::cli::failure::Failure;
use crate::cli::interrupt;
use crate::cli::output::{self, Format};
use crate::cli::place::{self, Kind, Overwrite};
use crate::cli::printer::Printer;
use crate::line::gaps::Gaps;
use crate::line::listener::{End, Listener, Shared};
use crate::line::port::{Address, Port, all_serial};
use crate::line::queue::{Closed, Queue};
use crate::recording::assembly::Assembled;
use crate::recording::clock::{Live, Segment};
use crate::recording::file::{About, Lane, Origin, RecordingError, Writer};
use crate::recording::frames::{Frame, Item, Reader};
use crate::tables::printable::one_line;
use crate::tables::whole::Target;

const AFTER_HELP: &str = "\
Several beads go into one recording, on the host's time: --port for each, or --port all for every serial \
port here. A port that does not open, that has no bead, or whose bead has another one's address costs one \
line; the others go on. A port that goes away is opened again as soon as it is back, and goes on in the same \
recording.

No strike is lost with the cable: a bead keeps its last ten strikes and more. When one did not come whole, \
it is asked for, and stands in the recording once. --no-fetch only listens.

Ends at Ctrl-C or after --duration with exit status 0, and with 3 when no port is left for --wait, or no \
frame came. The recording is complete in each case. At Ctrl-C, SIGTERM or SIGHUP that takes less than 5 \
seconds. Killed, it leaves F.mcap.partial, in which at most the last two seconds are missing; `bead recover` \
makes a whole recording of it. It keeps every byte as received, corrupt frames included, with the time of \
receipt. After a day (sooner with many ports, or after 30 GB of a fast source) it goes on in F-2.mcap, between \
two strikes. So it can run for months, in at most 256 MB of memory. `bead export` takes many files. Each strike is printed as it comes. The last line says how fast the \
bead's clock is against this host's, if the recording is long enough; see `bead clock`.

Examples:
  bead record --port /dev/ttyUSB0
  bead record --port /dev/ttyUSB0 --out strikes.mcap --duration 60
  bead record --port /dev/ttyUSB0 --port /dev/ttyUSB1 --out chain.mcap
  bead record --port all --out chain.mcap
  bead record --port tcp:192.168.1.7:4000 --format json | \\
      jq .absorbed_measured_j";

/// Arguments of `bead record`.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    /// A serial port or pty, tcp:HOST:PORT or unix:PATH; again for each further bead. Or all: every serial
    /// port here.
    #[arg(long, value_name = "P", required = true)]
    port: Vec<Choice>,
    /// The recording [default: bead-DATE-TIME.mcap, in UTC].
    #[arg(long, value_name = "F.mcap")]
    out: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Bits a second of a serial port.
    #[arg(long, default_value_t = 2_000_000, value_parser = clap::value_parser!(u32).range(1..))]
    baud: u32,
    /// Stop after this time, s.
    #[arg(long, value_name = "SECONDS", value_parser = output::seconds)]
    duration: Option<Duration>,
    /// Go on in another file after this time, s, at most a day.
    #[arg(long, value_name = "SECONDS", default_value = "86400", value_parser = split)]
    split: Duration,
    /// How long to wait for the ports when all have gone away, s; 0 to end when one does.
    #[arg(long, value_name = "SECONDS", default_value = "10", value_parser = wait)]
    wait: Duration,
    /// Do not ask the bead for strikes that did not come whole: only listen.
    #[arg(long)]
    no_fetch: bool,
    /// How to print the strikes; as JSON, one object a line, as `bead decode` does, with the time of
    /// receipt.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// A time, s, that may be 0.
fn wait(text: &str) -> Result<Duration, String> {
    match text.parse() {
        Ok(0.0) => Ok(Duration::ZERO),
        _ => output::seconds(text),
    }
}

/// The longest time of a file: the memory that a recording takes grows with it.
const DAY: Duration = Duration::from_secs(86_400);

/// A time, s, of one second to a day.
fn split(text: &str) -> Result<Duration, String> {
    let time = output::seconds(text)?;
    match (Duration::from_secs(1)..=DAY).contains(&time) {
        true => Ok(time),
        false => Err("from 1 to 86400 s, a day".to_owned()),
    }
}

/// So often is it looked at whether there is something to ask a bead.
const LOOK_EVERY: Duration = Duration::from_millis(50);
/// Received bytes that may wait for the disk: minutes of a serial line.
const QUEUE: usize = 32 << 20;
/// Bytes that are kept of a port from which no frame has come yet.
const UNKNOWN: usize = 64 << 10;

/// What `--port` names.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Choice {
    /// Every serial port that opens.
    All,
    One(Address),
}

impl FromStr for Choice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "all" => Ok(Self::All),
            _ => text.parse().map(Self::One),
        }
    }
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let started = DateTime::<Utc>::from(SystemTime::now());
    let mut target = arguments.target(started)?;
    let (addresses, ports): (Vec<_>, Vec<_>) = arguments.open()?.into_iter().unzip();
    let mut recorder = loop {
        match Recorder::new(arguments, &addresses, &target, started) {
            // Another program began a recording in the same second.
            Err(RecordingError::Busy(_)) if arguments.out.is_none() => target = arguments.target(started)?,
            recorder => break recorder?,
        }
    };
    let stop = interrupt::orderly(format!(
        "the disk was too slow to complete the recording; what came is in {}.partial, for `bead recover`",
        target.path().display()
    ));
    let queue = Queue::new(QUEUE);
    let shared = Shared {
        stop: &stop,
        deadline: arguments
            .duration
            .and_then(|duration| recorder.opened.checked_add(duration)),
        wait: arguments.wait,
        alive: Mutex::new(Instant::now()),
        queue: &queue,
    };
    let (asks, asked): (Vec<_>, Vec<_>) = addresses.iter().map(|_| mpsc::channel()).unzip();
    let listeners = addresses.iter().zip(asked).enumerate();
    let listeners = listeners.map(|(source, (address, asks))| Listener {
        source,
        address,
        baud: arguments.baud,
        asks,
        shared: &shared,
    });
    let left = AtomicUsize::new(addresses.len());
    let (heard, kept) = thread::scope(|scope| {
        let (left, queue) = (&left, &queue);
        let threads: Vec<_> = listeners
            .zip(ports)
            .map(|(listener, port)| {
                scope.spawn(move || {
                    let _end = AtEnd(|| {
                        if left.fetch_sub(1, Ordering::Relaxed) == 1 {
                            queue.close();
                        }
                    });
                    listener.listen(port, |line| output::note(format_args!("{line}")))
                })
            })
            .collect();
        let kept = {
            let _end = AtEnd(|| {
                queue.close();
                stop.store(true, Ordering::Relaxed);
            });
            recorder.keep(queue, &asks)
        };
        let join = |thread: ScopedJoinHandle<'_, End>| {
            thread.join().unwrap_or_else(|cause| panic::resume_unwind(cause))
        };
        (threads.into_iter().map(join).collect::<Vec<_>>(), kept)
    });
    let seconds = recorder.opened.elapsed().as_secs_f64();
    let beads = recorder.beads();
    let several = recorder.is_of_several();
    let partial = recorder.writer.partial_path().display().to_string();
    let kept = kept.and_then(|()| recorder.writer.finish());
    let finished = kept.map_err(|error| {
        Failure::input(format!(
            "{error}; what came before is kept in {partial}, for `bead recover`"
        ))
    })?;
    let counters = finished.counters;
    let printed = recorder.printer.finish();

    let asked = asked_again(&recorder.gaps);
    recorder.complete.push(finished.path);
    let files: Vec<_> = recorder
        .complete
        .iter()
        .map(|path| path.display().to_string())
        .collect();
    let result = format!(
        "{}: {}{asked}",
        files.join(", "),
        summary(&counters, recorder.strikes, seconds)
    );
    if several {
        for line in beads {
            output::note(format_args!("{line}"));
        }
    }
    let (mut gone, mut away) = (Vec::new(), Vec::new());
    for (address, end) in addresses.iter().zip(heard) {
        match end {
            End::Stopped => {}
            End::Away(reason) => away.push(format!("{address} went away ({reason})")),
            End::Gone(reason) => gone.push(format!("{address} went away ({reason})")),
        }
    }
    if gone.len() == addresses.len() || arguments.wait.is_zero() && !gone.is_empty() {
        return Err(Failure::device(format!(
            "{}: all that came before is in {result}; plug it in or start it again, and record to another file",
            gone.join(", ")
        )));
    }
    for line in gone.iter().chain(&away) {
        output::note(format_args!("{line} and was not back at the end"));
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
        let given = |out: &Path| place::target(out, Kind::Recording, &[], self.overwrite);
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

    /// Opens the ports. Of several, those that do not open are told and left out.
    fn open(&self) -> Result<Vec<(Address, Port)>, Failure> {
        let mut addresses: Vec<Address> = Vec::new();
        for choice in &self.port {
            let found = match choice {
                Choice::One(address) => vec![address.clone()],
                Choice::All => all_serial(),
            };
            for address in found {
                if !addresses.iter().any(|other| other.is_same(&address)) {
                    addresses.push(address);
                } else if self.port.contains(&Choice::One(address.clone())) {
                    output::note(format_args!("{address} is named twice; it is recorded once"));
                }
            }
        }
        if addresses.is_empty() {
            return Err(Failure::device(
                "this computer has no serial port: plug the adapters in, or name a port",
            ));
        }
        let one = addresses.len() == 1;
        let mut open = Vec::new();
        for address in addresses {
            match address.open(self.baud) {
                Ok(port) => open.push((address, port)),
                Err(error) if one => return Err(Failure::device(error)),
                Err(error) => output::note(format_args!("{error}; the others are recorded")),
            }
        }
        if open.is_empty() {
            return Err(Failure::device("none of the ports opens"));
        }
        Ok(open)
    }
}

/// Does something at the end of a block, also of one that panics: who waits for it would wait for ever.
struct AtEnd<F: Fn()>(F);

impl<F: Fn()> Drop for AtEnd<F> {
    fn drop(&mut self) {
        self.0();
    }
}

/// What became of strikes that did not come whole, if there were any.
fn asked_again(gaps: &BTreeMap<(usize, u8), Gaps>) -> String {
    let fetched: u64 = gaps.values().map(Gaps::fetched).sum();
    let gone: u64 = gaps.values().map(Gaps::gone).sum();
    match (fetched, gone) {
        (0, 0) => String::new(),
        _ => format!("; {fetched} strikes fetched, {gone} not to be had"),
    }
}

/// A port that is recorded.
struct Source {
    address: Address,
    /// Where its bytes go; none in a recording of one, and before its bead is known.
    lane: Option<Lane>,
    /// What came before its bead was known, and what looks for a frame in it.
    before: Vec<(u64, Vec<u8>)>,
    reader: Reader,
    /// Its bead's address is another's.
    refused: bool,
    bead: Option<u8>,
    strikes: u64,
}

struct Recorder {
    writer: Writer,
    split: Duration,
    /// Files that are complete.
    complete: Vec<PathBuf>,
    sources: Vec<Source>,
    live: Live,
    opened: Instant,
    /// The same in ns since 1970.
    opened_ns: u64,
    strikes: u64,
    /// By port and address.
    gaps: BTreeMap<(usize, u8), Gaps>,
    fetch: bool,
    /// See [`Frame::from_the_future`].
    from_the_future: Option<String>,
    format: Format,
    /// If standard output fails or pauses, the recording goes on.
    printer: Printer,
}

impl Recorder {
    /// A recorder of ports that were opened just now.
    fn new(
        arguments: &Arguments,
        addresses: &[Address],
        target: &Target,
        started: DateTime<Utc>,
    ) -> Result<Self, RecordingError> {
        let opened = Instant::now();
        // From here on the monotonic clock counts, so that a step of the host's time is not taken for the
        // bead's drift.
        let opened_ns = SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .map_or(0, |since| since.as_nanos() as u64);
        let mut notes = BTreeMap::from([("started".into(), started.to_rfc3339())]);
        if addresses
            .iter()
            .any(|address| matches!(address, Address::Serial(_)))
        {
            notes.insert("baud".into(), arguments.baud.to_string());
        }
        let names: Vec<_> = addresses.iter().map(Address::to_string).collect();
        let names = names.join(", ");
        let about = About {
            source: names.clone(),
            notes,
            ..About::default()
        };
        let source = |address: &Address| Source {
            address: address.clone(),
            lane: None,
            before: Vec::new(),
            reader: Reader::default(),
            refused: false,
            bead: None,
            strikes: 0,
        };
        Ok(Self {
            writer: match addresses {
                [_] => Writer::create(target, &about)?,
                _ => Writer::create_for_several(target, &about)?,
            },
            split: arguments.split,
            complete: Vec::new(),
            sources: addresses.iter().map(source).collect(),
            live: Live::default(),
            opened,
            opened_ns,
            strikes: 0,
            gaps: BTreeMap::new(),
            fetch: !arguments.no_fetch,
            from_the_future: None,
            format: arguments.format,
            printer: Printer::new(format!("listening to {names}")),
        })
    }

    fn is_of_several(&self) -> bool {
        self.sources.len() > 1
    }

    /// A line for each port of several: whose it is, and what was lost there.
    fn beads(&self) -> Vec<String> {
        let line = |source: &Source| match (source.bead, source.lane) {
            (Some(bead), Some(lane)) => {
                let counters = self.writer.counters_of(lane);
                format!(
                    "bead {bead} at {}: {} strikes, {} frames; {} lost, {} corrupt, {} restarts",
                    source.address,
                    source.strikes,
                    counters.frames,
                    counters.lost,
                    counters.rejected.total(),
                    counters.restarts
                )
            }
            (Some(bead), None) => format!(
                "{} was not recorded: its bead has the address {bead}, as another; give it another: bead settings \
                 set address=N",
                source.address
            ),
            (None, _) => format!(
                "{}: no frame came; is there a bead, and does --baud match?",
                source.address
            ),
        };
        self.sources.iter().map(line).collect()
    }

    /// Records what comes until the queue is closed, and asks for what is missing.
    fn keep(&mut self, queue: &Queue, asks: &[Sender<Vec<u8>>]) -> Result<(), RecordingError> {
        loop {
            if let Some(path) = self.writer.split(self.split)? {
                output::note(format_args!(
                    "{} is complete; the recording goes on",
                    path.display()
                ));
                self.complete.push(path);
            }
            match queue.pop(LOOK_EVERY) {
                Ok(Some((source, _, bytes))) if bytes.is_empty() => {
                    let of_port = self.gaps.iter_mut().filter(|((port, _), _)| *port == source);
                    of_port.for_each(|(_, gaps)| gaps.reconnect());
                }
                Ok(Some((source, received, bytes))) => {
                    let since = received.duration_since(self.opened);
                    let received_ns = self.opened_ns + since.as_nanos() as u64;
                    self.take(source, bytes, received_ns)?;
                }
                Ok(None) => self.writer.flush_in_time()?,
                Err(Closed) => return Ok(()),
            }
            if self.fetch {
                let now = Instant::now();
                for ((source, _), gaps) in &mut self.gaps {
                    if let Some(request) = gaps.next(now) {
                        // A port that has gone away for good takes nothing.
                        let _ = asks[*source].send(request);
                    }
                }
            }
        }
    }

    /// Takes bytes from a port: at once, or when it is known whose they are.
    fn take(&mut self, source: usize, bytes: Vec<u8>, received_ns: u64) -> Result<(), RecordingError> {
        let several = self.is_of_several();
        let from = &mut self.sources[source];
        if !several || from.lane.is_some() {
            return self.keep_piece(source, &bytes, received_ns);
        }
        if from.refused {
            return Ok(());
        }
        from.reader.feed(&bytes, None, |item| {
            let address = item.frame().map(|frame| frame.header.address);
            from.bead = from.bead.or(address);
        });
        from.before.push((received_ns, bytes));
        let waiting = |from: &Source| from.before.iter().map(|(_, bytes)| bytes.len()).sum::<usize>();
        while waiting(from) > UNKNOWN {
            from.before.remove(0);
        }
        let Some(address) = from.bead else { return Ok(()) };
        let before = std::mem::take(&mut from.before);
        let origin = Origin {
            address,
            port: Some(from.address.to_string()),
            clock: Some("host".to_owned()),
            ..Origin::default()
        };
        match self.writer.join(&origin) {
            Ok(lane) => from.lane = Some(lane),
            Err(error @ RecordingError::SameAddress(_)) => {
                from.refused = true;
                output::note(format_args!(
                    "{}: {error}; it is not recorded, the others are",
                    from.address
                ));
                return Ok(());
            }
            Err(error) => return Err(error),
        }
        for (received_ns, bytes) in before {
            self.keep_piece(source, &bytes, received_ns)?;
        }
        Ok(())
    }

    fn keep_piece(&mut self, source: usize, bytes: &[u8], received_ns: u64) -> Result<(), RecordingError> {
        let several = self.is_of_several();
        let Self {
            writer,
            sources,
            live,
            strikes,
            gaps,
            from_the_future,
            format,
            printer,
            ..
        } = self;
        let from = &mut sources[source];
        let now = Instant::now();
        let take = |item: Item| {
            let Item::Frame(frame) = item else { return };
            live.push(&frame);
            *from_the_future = frame.from_the_future().or(from_the_future.take());
            if frame.arrival == Arrival::Duplicate {
                return;
            }
            let address = frame.header.address;
            let gaps = gaps
                .entry((source, address))
                .or_insert_with(|| Gaps::new(address));
            let fetched = gaps.push(&frame, now);
            let is_known = fetched
                .as_ref()
                .and_then(|strike| strike.fetched)
                .is_some_and(|copy| copy.before.result);
            if is_known {
                return;
            }
            let suffix = if fetched.is_some() { ", fetched" } else { "" };
            let frame = fetched.map_or(frame.clone(), |strike| as_measured(&frame, &strike));
            let line = match &frame.message {
                Message::Strike(strike) => {
                    *strikes += 1;
                    from.strikes += 1;
                    strike_line(&frame, strike) + suffix
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
                Format::Table if several => format!("bead {address}: {line}"),
                Format::Table => line,
            });
        };
        match from.lane {
            Some(lane) => writer.write_of(lane, bytes, Some(received_ns), take)?,
            None => writer.write(bytes, Some(received_ns), take)?,
        }
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

/// The strike frame of a fetched strike.
fn as_measured(frame: &Frame, fetched: &Assembled) -> Frame {
    Frame {
        header: fetched.header,
        message: fetched.strike.said.into(),
        ..frame.clone()
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
    // With a line end in it, a bead could print what looks like a strike.
    let detail = one_line(fault.detail.as_str());
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

/// How each bead's clock runs since its last restart, a line each, where the recording is long enough to
/// tell.
fn clock_lines(live: &Live) -> String {
    let line = |segment: &Segment| {
        let fit = segment.fit()?;
        let [ppm, within] = drift(fit.drift_ppm, Some(fit.uncertainty_ppm?));
        let (address, seconds) = (segment.address, fit.span);
        if !fit.in_real_time() {
            return Some(format!("address {address}: {}", times_as_fast(fit.drift_ppm)));
        }
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
        assert_eq!(
            fault_line(&fault(bead_wire::FaultCause::Panic, "x\nstrike 7 at 1.0 s")),
            "fault in boot 3: panic, x\\u000astrike 7 at 1.0 s"
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
