//! `bead record`: records what beads send in one file, and prints their strikes.

use std::collections::BTreeMap;
use std::iter;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::{Duration, SystemTime};

use bead_wire::{Counters, Fault, Message, Strike};
use chrono::{DateTime, Utc};
use clap::Args;

use super::clock::{drift, rfc3339, times_as_fast};
use crate::cli::failure::Failure;
use crate::cli::interrupt;
use crate::cli::output::{self, Format};
use crate::cli::place::{self, Kind, Overwrite};
use crate::cli::printer::Printer;
use bead_line::listener::End;
use bead_line::port::{Address, Port, all_serial};
use bead_line::recorder::{Observer, Options, Recorded, RecordedPort, Recorder};
use bead_recording::clock::{Live, Segment};
use bead_recording::file::RecordingError;
use bead_recording::frames::Frame;
use bead_tables::printable::one_line;
use bead_tables::whole::Target;

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

/// Parses a time, s, that may be 0.
fn wait(text: &str) -> Result<Duration, String> {
    match text.parse() {
        Ok(0.0) => Ok(Duration::ZERO),
        _ => output::seconds(text),
    }
}

/// Longest time of a file: the memory that a recording takes grows with it.
const DAY: Duration = Duration::from_secs(86_400);

/// Parses a time, s, of one second to a day.
fn split(text: &str) -> Result<Duration, String> {
    let time = output::seconds(text)?;
    if (Duration::from_secs(1)..=DAY).contains(&time) {
        Ok(time)
    } else {
        Err("from 1 to 86400 s, a day".to_owned())
    }
}

/// Argument of `--port`.
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
    let names: Vec<_> = addresses.iter().map(Address::to_string).collect();
    let is_of_several = addresses.len() > 1;
    let mut lines = Lines {
        is_of_several,
        format: arguments.format,
        printer: Printer::new(format!("listening to {}", names.join(", "))),
    };
    let note = |line: String| note!("{line}");
    let options = arguments.options();
    let recorder = loop {
        let notes = arguments.notes(started, &addresses);
        match Recorder::new(&target, &addresses, options, notes, &mut lines, &note) {
            // Another program began a recording in the same second.
            Err(RecordingError::Busy(_)) if arguments.out.is_none() => target = arguments.target(started)?,
            recorder => break recorder?,
        }
    };
    let stop = interrupt::orderly(format!(
        "the disk was too slow to complete the recording; what came is in {}.partial, for `bead recover`",
        target.path().display()
    ));
    let recorded = recorder.run(ports, &stop).map_err(Failure::input)?;
    let printed = lines.printer.finish();
    if is_of_several {
        recorded.ports.iter().map(port_line).for_each(note);
    }
    let summary = summary(&recorded);
    let mut gone = Vec::new();
    let mut away = Vec::new();
    for port in &recorded.ports {
        match &port.end {
            End::Stopped => {}
            End::Away(reason) => away.push(format!("{} went away ({reason})", port.address)),
            End::Gone(reason) => gone.push(format!("{} went away ({reason})", port.address)),
        }
    }
    if gone.len() == addresses.len() || arguments.wait.is_zero() && !gone.is_empty() {
        bail!(
            Device,
            "{}: all that came before is in {summary}; plug it in or start it again, and record to another file",
            gone.join(", ")
        );
    }
    for line in gone.iter().chain(&away) {
        note(format!("{line} and was not back at the end"));
    }
    let clocks = Some(clock_lines(&recorded.clocks)).filter(|lines| !lines.is_empty());
    let lines = [Some(summary), clocks, recorded.from_the_future];
    lines.into_iter().flatten().for_each(note);
    printed?;
    advice(&recorded.counters).map_or(Ok(()), |advice| Err(failure!(Device, "{advice}")))
}

/// Prints the strikes and faults of a recording. If standard output fails or pauses, the recording goes on.
struct Lines {
    is_of_several: bool,
    format: Format,
    printer: Printer,
}

impl Observer for Lines {
    fn message(&mut self, frame: &Frame, received_ns: u64, is_fetched: bool) {
        let line = match &frame.message {
            Message::Strike(strike) => strike_line(frame, strike) + if is_fetched { ", fetched" } else { "" },
            Message::Fault(fault) => fault_line(fault),
            _ => return,
        };
        self.printer.line(match self.format {
            Format::Json => {
                let mut json = frame.json();
                json["received"] = rfc3339(received_ns as i64).into();
                json.to_string()
            }
            Format::Table if self.is_of_several => format!("bead {}: {line}", frame.header.address),
            Format::Table => line,
        });
    }

    fn progress(&mut self, counters: &Counters, strikes: u64) {
        self.printer.status(|| {
            format!(
                "{} frames, {} lost, {} corrupt, {strikes} strikes",
                counters.frames,
                counters.lost,
                counters.rejected.total()
            )
        });
    }
}

impl Arguments {
    fn options(&self) -> Options {
        Options {
            baud: self.baud,
            duration: self.duration,
            split: self.split,
            wait: self.wait,
            fetch: !self.no_fetch,
        }
    }

    /// Notes in the recording, by name.
    fn notes(&self, started: DateTime<Utc>, addresses: &[Address]) -> BTreeMap<String, String> {
        let is_serial = |address: &Address| matches!(address, Address::Serial(_));
        let baud = addresses.iter().any(is_serial).then_some(self.baud);
        let baud = baud.map(|baud| ("baud".to_owned(), baud.to_string()));
        let started = ("started".to_owned(), started.to_rfc3339());
        [started].into_iter().chain(baud).collect()
    }

    /// The file of the recording. A name of the date is one that no file has yet, finished or not.
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
                    note!("{address} is named twice; it is recorded once");
                }
            }
        }
        if addresses.is_empty() {
            bail!(
                Device,
                "this computer has no serial port: plug the adapters in, or name a port"
            );
        }
        let one = addresses.len() == 1;
        let mut open = Vec::new();
        for address in addresses {
            match address.open(self.baud) {
                Ok(port) => open.push((address, port)),
                Err(error) if one => bail!(Device, "{error}"),
                Err(error) => note!("{error}; the others are recorded"),
            }
        }
        if open.is_empty() {
            bail!(Device, "none of the ports opens");
        }
        Ok(open)
    }
}

/// A line for a port of several: its bead, and what was lost there.
fn port_line(port: &RecordedPort) -> String {
    let RecordedPort { address, strikes, .. } = port;
    match (port.bead, &port.counters) {
        (Some(bead), Some(counters)) => format!(
            "bead {bead} at {address}: {strikes} strikes, {} frames; {} lost, {} corrupt, {} restarts",
            counters.frames,
            counters.lost,
            counters.rejected.total(),
            counters.restarts
        ),
        (Some(bead), None) => format!(
            "{address} was not recorded: its bead has the address {bead}, as another; give it another: bead settings \
             set address=N"
        ),
        (None, _) => format!("{address}: no frame came; is there a bead, and does --baud match?"),
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

/// One line about the files of a recording and their content.
fn summary(recorded: &Recorded) -> String {
    let Recorded {
        counters,
        strikes,
        fetched,
        gone,
        ..
    } = recorded;
    let files: Vec<_> = recorded
        .files
        .iter()
        .map(|path| path.display().to_string())
        .collect();
    let lost = match (fetched, gone) {
        (0, 0) => String::new(),
        _ => format!("; {fetched} strikes fetched, {gone} not to be had"),
    };
    format!(
        "{}: {strikes} strikes, {} frames in {} bytes and {:.1} s; {} lost, {} corrupt, {} restarts{lost}",
        files.join(", "),
        counters.frames,
        counters.bytes,
        recorded.duration.as_secs_f64(),
        counters.lost,
        counters.rejected.total(),
        counters.restarts
    )
}

/// The drift of each bead's clock since its last restart, a line each, where the recording is long enough.
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

/// A hint for a recording without a frame.
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
                arrival: bead_wire::Arrival::Next { lost: 0 },
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
