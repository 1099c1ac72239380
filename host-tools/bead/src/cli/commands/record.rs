//! `bead record`: records what beads send in one file, and prints their strikes.

use std::collections::BTreeMap;
use std::iter;
use std::time::Duration;

use bead_wire::Counters;
use chrono::{DateTime, Utc};

use super::clock::{drift, rfc3339, times_as_fast};
use crate::cli::commands::prelude::*;
use crate::cli::note_options::NoteOptions;
use crate::cli::provenance::now;
use bead_console::printer::Printer;
use bead_line::lines;
use bead_line::listener::End;
use bead_line::port::{Address, open_all};
use bead_line::recorder::{Recorded, RecordedPort, Recorder, RecorderObserver, RecorderOptions};
use bead_recording::clock::Live;
use bead_recording::file::{About, RecordingError};
use bead_recording::frames::Frame;

const AFTER_HELP: &str = "\
Several beads go into one recording, on the host's time: --port for each, or --port all for every serial \
port of this computer. A port that does not open, that has no bead, or whose bead has the address of another \
bead is reported in one line; the others continue. A port that goes away is opened again as soon as it is \
back, and continues in the same recording.

A cut line loses no strike: a bead keeps at least its last twelve strikes. A strike that arrived incomplete is \
requested again, and is in the recording once. --no-fetch only listens.

Ends at Ctrl-C or after --duration with exit status 0, and with 3 when all ports are away for longer than \
--wait, or no frame came. The recording is complete in each case. At Ctrl-C, SIGTERM or SIGHUP, completing it \
takes less than 5 seconds. If killed, `bead record` leaves F.mcap.partial, in which at most the last two \
seconds are missing; `bead recover` makes a whole recording of it. The recording keeps every byte as received, \
corrupt frames included, with the time of receipt. After a day (sooner with many ports, or after 30 GB of a \
fast source) it continues in F-2.mcap, between two strikes, so `bead record` can run for months, in at most \
256 MB of memory. `bead export` takes many files. Each strike is printed as it comes. The last line says how \
fast the bead's clock is against this host's, if the recording is long enough; see `bead clock`.

Examples:
  bead record --port /dev/ttyUSB0
  bead record --port /dev/ttyUSB0 --out strikes.mcap --duration 60
  bead record --port /dev/ttyUSB0 --note operator=Ana specimen=A12
  bead record --port /dev/ttyUSB0 --port /dev/ttyUSB1 --out chain.mcap
  bead record --port all --out chain.mcap
  bead record --port tcp:192.168.1.7:4000 --format json | \\
      jq .absorbed_measured_j";

#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    /// A serial port or pty, tcp:HOST:PORT or unix:PATH; repeat for more beads. Or all: every serial
    /// port of this computer.
    #[arg(long, value_name = "P", required = true, value_parser = port)]
    port: Vec<PortChoice>,
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
    /// Continue in a new file after this time, s; at most a day.
    #[arg(long, value_name = "SECONDS", default_value = "86400", value_parser = split)]
    split: Duration,
    /// Time to wait for the ports when all have gone away, s; 0 to end as soon as one does.
    #[arg(long, value_name = "SECONDS", default_value = "10", value_parser = wait)]
    wait: Duration,
    /// Do not ask the bead for strikes that arrived incomplete: only listen.
    #[arg(long)]
    no_fetch: bool,
    #[command(flatten)]
    notes: NoteOptions,
    /// Format of the strikes; JSON is one object a line, as from `bead decode`, with the time of
    /// receipt.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

fn wait(text: &str) -> Result<Duration, String> {
    match text.parse() {
        Ok(0.0) => Ok(Duration::ZERO),
        _ => output::seconds(text),
    }
}

/// Parses a time, s, of one second to a day: the memory that a recording takes grows with it.
fn split(text: &str) -> Result<Duration, String> {
    let time = output::seconds_of_a_day(text)
        .ok()
        .filter(|time| time.as_secs() >= 1);
    time.ok_or_else(|| "give 1 to 86400 s (a day)".to_owned())
}

/// Parses the value of `--port`; `None` is every serial port that opens.
pub(super) fn port(text: &str) -> Result<PortChoice, String> {
    match text {
        "all" => Ok(None),
        _ => text.parse().map(Some),
    }
}

pub(super) type PortChoice = Option<Address>;

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let started = now();
    let own_target = || target(arguments.out.as_deref(), arguments.overwrite, started);
    let mut target = own_target()?;
    let note = |line: String| note!("{line}");
    let open = open_all(&arguments.port, arguments.baud, note).map_err(|why| failure!(Device, "{why}"))?;
    let (addresses, ports): (Vec<_>, Vec<_>) = open.into_iter().unzip();
    let names: Vec<_> = addresses.iter().map(Address::to_string).collect();
    let is_of_several = addresses.len() > 1;
    let mut lines = StrikePrinter {
        is_of_several,
        format: arguments.format,
        printer: Printer::new(format!("listening to {}", names.join(", "))),
    };
    let options = RecorderOptions {
        baud: arguments.baud,
        duration: arguments.duration,
        split: arguments.split,
        wait: arguments.wait,
        fetch: !arguments.no_fetch,
    };
    let mut about = About {
        notes: BTreeMap::from([("started".to_owned(), started.to_rfc3339())]),
        remarks: arguments.notes.signed(),
        ..About::default()
    };
    if addresses
        .iter()
        .any(|address| matches!(address, Address::Serial(_)))
    {
        about.notes.insert("baud".to_owned(), arguments.baud.to_string());
    }
    let recorder = loop {
        match Recorder::new(&target, &addresses, options, about.clone(), &mut lines, &note) {
            // Another program began a recording in the same second.
            Err(RecordingError::Busy(_)) if arguments.out.is_none() => target = own_target()?,
            recorder => break recorder?,
        }
    };
    let stop = interrupt::orderly(format!(
        "the disk was too slow to complete the recording; `bead recover` completes {}.partial",
        target.path().display()
    ));
    let recorded = recorder.run(ports, &stop).map_err(Failure::input)?;
    let printed = lines.printer.finish();
    if is_of_several {
        recorded.ports.iter().map(RecordedPort::to_string).for_each(note);
    }
    let [gone, away] = not_back(&recorded);
    let summary = recorded.to_string();
    if gone.len() == addresses.len() || arguments.wait.is_zero() && !gone.is_empty() {
        bail!(
            Device,
            "{}: all that came before is in {summary}; plug it in or start it again, and record to another file",
            gone.join(", ")
        );
    }
    for line in gone.iter().chain(&away) {
        note!("{line} and was not back at the end");
    }
    note(summary);
    clock_lines(&recorded.clocks).for_each(note);
    recorded.from_the_future.iter().for_each(|line| note!("{line}"));
    printed?;
    frames_came(&recorded)
}

/// A line about each port that has gone away for good, and about each that was away at the end.
pub(super) fn not_back(recorded: &Recorded) -> [Vec<String>; 2] {
    let (mut gone, mut away) = (Vec::new(), Vec::new());
    for port in &recorded.ports {
        let (ended, reason) = match &port.end {
            End::Stopped => continue,
            End::Away(reason) => (&mut away, reason),
            End::Gone(reason) => (&mut gone, reason),
        };
        ended.push(format!("{} went away ({reason})", port.address));
    }
    [gone, away]
}

/// Fails if no frame came, with the likely reason.
pub(super) fn frames_came(recorded: &Recorded) -> Result<(), Failure> {
    match recorded.counters {
        Counters { frames: 1.., .. } => Ok(()),
        Counters { bytes: 0, .. } => {
            bail!(
                Device,
                "nothing came: is the bead powered, and its PA9 wired to the adapter's receive pin?"
            )
        }
        _ => bail!(
            Device,
            "bytes came, but no frame among them: does --baud match, and is the sender a bead?"
        ),
    }
}

/// Prints the strikes and faults of a recording. If standard output fails or pauses, the recording continues.
struct StrikePrinter {
    is_of_several: bool,
    format: Format,
    printer: Printer,
}

impl RecorderObserver for StrikePrinter {
    fn message(&mut self, frame: &Frame, received_ns: u64, is_fetched: bool) {
        let Some(line) = lines::of_message(frame, is_fetched) else {
            return;
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

/// The file of a recording that begins now. A name made from the date is one that no file has yet, finished
/// or not.
pub(super) fn target(
    out: Option<&Path>,
    overwrite: Overwrite,
    started: DateTime<Utc>,
) -> Result<Target, Failure> {
    let given = |out: &Path| place::target(out, FileKind::Recording, &[], overwrite);
    if let Some(out) = out {
        return given(out);
    }
    let date = started.format("bead-%Y%m%d-%H%M%S");
    let numbers = iter::once(String::new()).chain((2..).map(|number| format!("-{number}")));
    let mut names = numbers.map(|number| PathBuf::from(format!("{date}{number}.mcap")));
    let is_free = |name: &PathBuf| !name.exists() && !name.with_extension("mcap.partial").exists();
    let free = names.find(is_free).expect("the numbers do not end");
    given(&free)
}

/// The drift of each bead's clock since its last restart, a line each, where the recording is long enough.
pub(super) fn clock_lines(live: &Live) -> impl Iterator<Item = String> {
    live.segments().filter_map(|segment| {
        let fit = segment.fit()?;
        let [ppm, within] = drift(fit.drift_ppm, Some(fit.uncertainty_ppm?));
        let (address, seconds) = (segment.address, fit.span);
        if !fit.in_real_time() {
            return Some(format!("address {address}: {}", times_as_fast(fit.drift_ppm)));
        }
        Some(format!(
            "the clock of the bead at address {address} is {ppm} ± {within} ppm fast against this host's, over \
             {seconds:.0} s"
        ))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_clock_is_told_as_soon_as_it_can_be() {
        let mut live = Live::default();
        let mut sent = |second: u64| {
            let arrival = bead_wire::Arrival::Next { lost: 0 };
            let mut frame = Frame::of(0, 0, arrival, bead_testing::Speaker::at(0).identity());
            frame.header.sample_index = 100_000 * second;
            // A bead that is fast by 50 ppm, and frames up to 30 us late.
            frame.received_ns = Some(second * 999_950_002 + second * 7919 % 30_011);
            live.push(&frame);
            clock_lines(&live).collect::<String>()
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
        assert!(
            last.ends_with(" ppm fast against this host's, over 59 s"),
            "{last}"
        );
    }
}
