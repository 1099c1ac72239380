//! `bead monitor`: live beads on a terminal, in a browser and in other programs.

use std::fmt::Display;
use std::net::{SocketAddr, ToSocketAddrs};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::thread;
use std::time::Duration;

use bead_bench::image::find_image;
use bead_bench::live_beads::LiveBeads;
use bead_bench::tables::BenchTables;
use bead_compare::sensed::load_scenario;
use bead_line::key;
use bead_line::port::{Address, open_all};
use bead_line::recorder::{Recorded, Recorder, RecorderOptions};
use bead_monitor::foxglove::FoxgloveServer;
use bead_monitor::udp::UdpSender;
use bead_monitor::web::WebPage;
use bead_monitor::{Control, Monitor, SharedMonitor, follow, terminal};
use bead_recording::file::{About, Follower};
use chrono::{DateTime, Utc};
use clap::ArgGroup;

use super::record::{self, PortChoice};
use super::settings_file;
use crate::cli::commands::prelude::*;
use crate::cli::note_options::{NoteOptions, note};
use crate::cli::provenance::now;
use bead_console::beads::BeadNumbers;

const AFTER_HELP: &str = "\
Shows each bead's last strike with force, acceleration and residual, both energies with their uncertainties, \
flags in words, the strikes before it, losses by cause, health, supply and clock. ± is two standard \
uncertainties. The keys are at the bottom. 80x24 is enough; a smaller window shows only the numbers. NO_COLOR \
is heeded.

It records as `bead record` does, to --out or to bead-DATE-TIME.mcap, and no page ever delays the recording. A port \
that goes away is opened again as soon as it is back. q, Ctrl-C, SIGTERM, SIGHUP and a closed terminal complete \
the recording. A recording that another program is writing (F.mcap.partial) is shown as it grows.

Exit status 2 without a terminal, and 3 if no port opens or no frame came.

Examples:
  bead monitor --port /dev/ttyUSB0
  bead monitor --port all --out chain.mcap --note operator=Ana
  bead monitor --emulate docs/scenarios/ten-intruders.toml --bead 7,8
  bead monitor --port /dev/ttyUSB0 --web
  bead monitor --port /dev/ttyUSB0 --udp 127.0.0.1:9870
  bead monitor --port /dev/ttyUSB0 --foxglove
  bead monitor night.mcap.partial";

#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP, group = ArgGroup::new("source").required(true))]
pub(crate) struct Arguments {
    /// A recording, finished or growing, to show in place of live beads.
    #[arg(value_name = "F.mcap", group = "source", conflicts_with_all = ["out", "note", "key", "duration"])]
    recording: Option<PathBuf>,
    /// A serial port or pty, tcp:HOST:PORT or unix:PATH; repeat for more beads. Or all: every serial
    /// port of this computer.
    #[arg(long, value_name = "P", group = "source", value_parser = record::port)]
    port: Vec<PortChoice>,
    /// Show emulated beads of this scenario, a TOML file in SI units: each is the image in QEMU, struck about
    /// once a second.
    #[arg(long, value_name = "SCENARIO", group = "source", requires = "bead")]
    emulate: Option<PathBuf>,
    /// The emulated beads: those with an intruder. 7-16, 7,9,12 or all.
    #[arg(long, value_name = "N", requires = "emulate", conflicts_with_all = ["port", "recording"])]
    bead: Option<BeadNumbers>,
    /// Put the uncertainties in this file, such as bead.toml, into the settings of emulated beads.
    #[arg(long, value_name = "F.toml|F.settings", requires = "emulate")]
    uncertainty: Option<PathBuf>,
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
    #[command(flatten)]
    notes: NoteOptions,
    /// Serve a page for a browser in place of the one on the terminal, at this address [default: 127.0.0.1
    /// and a free port]. The printed URL contains a secret.
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, require_equals = true, value_parser = web_address,
        default_missing_value = "127.0.0.1:0")]
    web: Option<SocketAddr>,
    /// Serve live channels to Foxglove or Lichtblick at this address [default: 127.0.0.1:8765]. Any program
    /// and any web page on this computer can read them.
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, require_equals = true, value_parser = web_address,
        default_missing_value = "127.0.0.1:8765")]
    foxglove: Option<SocketAddr>,
    /// Serve page and channels to other computers too: not encrypted, so whoever sees the traffic sees the
    /// URL and all that the beads measure.
    #[arg(long)]
    insecure_network: bool,
    /// Send each strike as JSON to this address by UDP, for PlotJuggler.
    #[arg(long, value_name = "HOST:PORT", value_parser = udp_address)]
    udp: Option<SocketAddr>,
    /// Sign the requests to arm and disarm with the key in this file.
    #[arg(long, value_name = "F.key")]
    key: Option<PathBuf>,
}

/// Parses an address to serve the page at.
fn web_address(text: &str) -> Result<SocketAddr, String> {
    text.parse()
        .map_err(|_| "give an address of this computer with a port, such as 127.0.0.1:8080".to_owned())
}

/// Finds the address of another program.
fn udp_address(text: &str) -> Result<SocketAddr, String> {
    let found = text.to_socket_addrs().ok().and_then(|mut found| found.next());
    found.ok_or_else(|| "give host and port number, as in 127.0.0.1:9870".to_owned())
}

/// Time after which the recording continues in another file.
const SPLIT: Duration = Duration::from_secs(86_400);

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let pages = Pages::open(arguments)?;
    match &arguments.recording {
        Some(recording) => show_recording(recording, pages),
        None => show_beads(arguments, pages),
    }
}

/// The pages that were asked for.
struct Pages {
    has_terminal: bool,
    web: Option<WebPage>,
    foxglove: Option<FoxgloveServer>,
    udp: Option<UdpSender>,
}

impl Pages {
    fn open(arguments: &Arguments) -> Result<Self, Failure> {
        let has_terminal = arguments.web.is_none() && terminal::is_there();
        let serves = arguments.web.is_some() || arguments.foxglove.is_some();
        if arguments.insecure_network && !serves {
            bail!(
                Input,
                "--insecure-network needs --web or --foxglove; give one of them, or leave it out"
            );
        }
        if !has_terminal && !serves && arguments.udp.is_none() {
            bail!(
                Input,
                "standard input and output are not a terminal, which the page needs; run it in one, give --web for a \
                 browser, or record without a page: bead record"
            );
        }
        let check = |option: &str, at: SocketAddr| {
            if !at.ip().is_loopback() && !arguments.insecure_network {
                bail!(
                    Input,
                    "{option}={at}: other computers could see the data, which is not encrypted; give 127.0.0.1 and connect with \
                     `ssh -L`, or accept the risk with --insecure-network"
                );
            }
            Ok(())
        };
        let taken = |at: SocketAddr, error: &dyn Display| {
            failure!(
                Input,
                "cannot listen at {at}: {error}; give an address of this computer and a free port"
            )
        };
        let web = |at: SocketAddr| {
            check("--web", at)?;
            WebPage::open(at).map_err(|error| taken(at, &error))
        };
        let foxglove = |at: SocketAddr| {
            check("--foxglove", at)?;
            FoxgloveServer::open(at).map_err(|error| taken(at, &error))
        };
        let udp = |to: SocketAddr| {
            UdpSender::open(to)
                .map_err(|error| failure!(Input, "cannot send to {to}: {error}; correct the address"))
        };
        Ok(Self {
            has_terminal,
            web: arguments.web.map(web).transpose()?,
            foxglove: arguments.foxglove.map(foxglove).transpose()?,
            udp: arguments.udp.map(udp).transpose()?,
        })
    }

    /// Shows all pages until `stop`. When a page ends, for whatever reason, everything stops.
    fn show(
        self,
        monitor: &SharedMonitor,
        control: Option<Control>,
        stop: &AtomicBool,
    ) -> Result<(), Failure> {
        if let Some(web) = &self.web {
            note!("the page is at {} until Ctrl-C", web.url());
        }
        if let Some(foxglove) = &self.foxglove {
            let port = foxglove.port();
            note!("Foxglove and Lichtblick find the beads at ws://localhost:{port}");
        }
        thread::scope(|scope| {
            let foxglove = self.foxglove;
            let foxglove = foxglove.map(|foxglove| scope.spawn(move || foxglove.serve(monitor, stop)));
            let web = self.web.map(|web| {
                scope.spawn(move || {
                    let _stop = StopAtEnd(stop);
                    web.serve(monitor.clone(), stop)
                })
            });
            let udp = self.udp.map(|udp| scope.spawn(move || udp.serve(monitor, stop)));
            let shown = if self.has_terminal {
                let _stop = StopAtEnd(stop);
                terminal::run(monitor, control.as_ref(), stop)
            } else {
                Ok(())
            };
            let served = web.map_or(Ok(()), join);
            foxglove.into_iter().chain(udp).for_each(join);
            shown.map_err(|error| {
                failure!(
                    Input,
                    "the terminal was closed ({error}); all that came before is recorded"
                )
            })?;
            served.map_err(|error| failure!(Input, "the page cannot be served any more: {error}"))
        })
    }
}

fn show_recording(path: &Path, pages: Pages) -> Result<(), Failure> {
    let follower = Follower::open(path)?;
    let name = path.display().to_string();
    let monitor = SharedMonitor::new(Monitor::new(vec![name.clone()], name));
    monitor.lock().set_file(path);
    let stop = interrupt::orderly("another program writes the recording, and continues".to_owned());
    let (shown, followed) = thread::scope(|scope| {
        let pages = scope.spawn(|| pages.show(&monitor, None, &stop));
        let followed = follow(&monitor, follower, &stop);
        if followed.is_err() {
            stop.store(true, Ordering::Relaxed);
        }
        (join(pages), followed)
    });
    followed?;
    shown
}

fn show_beads(arguments: &Arguments, pages: Pages) -> Result<(), Failure> {
    let key = arguments.key.as_deref().map(key::read).transpose()?;
    let started = now();
    // Before the work, which an unusable name would waste.
    record::target(arguments.out.as_deref(), arguments.overwrite, started)?;
    let live = arguments.emulate.as_deref();
    let live = live.map(|scenario| arguments.live_beads(scenario)).transpose()?;
    let emulated = live.iter().flat_map(LiveBeads::addresses).cloned().map(Some);
    let wanted: Vec<PortChoice> = arguments.port.iter().cloned().chain(emulated).collect();
    let open = open_all(&wanted, arguments.baud, |line| note!("{line}"));
    let open = open.map_err(|why| failure!(Device, "{why}"))?;
    let (addresses, ports): (Vec<_>, Vec<_>) = open.into_iter().unzip();
    let name = |address: &Address| match &live {
        Some(_) => "the emulator".to_owned(),
        None => address.to_string(),
    };
    let names = addresses.iter().map(name).collect();
    let monitor = SharedMonitor::new(Monitor::new(names, String::new()));
    let (orders, ordered) = mpsc::channel();
    let author = arguments.notes.author().clone();
    let sign = move |text: &str| {
        let notes = author.sign(vec![note(text)?]);
        notes.into_iter().next().ok_or_else(String::new)
    };
    let control = Control::new(orders, key, Box::new(sign));
    let is_printed = !pages.has_terminal;
    let tell = |line: String| {
        if is_printed {
            note!("{line}");
        }
        monitor.lock().tell(&line);
    };
    let mut observer = monitor.clone();
    let recorder = arguments.recorder(&addresses, started, &mut observer, &tell)?;
    let recorder = recorder.with_orders(ordered);
    let stop = interrupt::orderly(
        "the disk was too slow to complete the recording; `bead recover` completes it".to_owned(),
    );
    let (shown, recorded) = thread::scope(|scope| {
        if let Some(live) = &live {
            scope.spawn(|| live.serve(&stop, &tell));
        }
        let pages = scope.spawn(|| pages.show(&monitor, Some(control), &stop));
        // The thread of the pages sets `stop` when it ends.
        let recorded = recorder.run(ports, &stop);
        (join(pages), recorded)
    });
    let recorded = recorded.map_err(Failure::input)?;
    summarise(&recorded);
    shown?;
    record::frames_came(&recorded)
}

fn join<T>(thread: thread::ScopedJoinHandle<'_, T>) -> T {
    thread
        .join()
        .unwrap_or_else(|cause| std::panic::resume_unwind(cause))
}

/// Prints the lines that end a recording.
fn summarise(recorded: &Recorded) {
    if recorded.ports.len() > 1 {
        recorded.ports.iter().for_each(|port| note!("{port}"));
    }
    for line in record::not_back(recorded).iter().flatten() {
        note!("{line} and was not back at the end");
    }
    note!("{recorded}");
    record::clock_lines(&recorded.clocks).for_each(|line| note!("{line}"));
    recorded.from_the_future.iter().for_each(|line| note!("{line}"));
}

struct StopAtEnd<'a>(&'a AtomicBool);

impl Drop for StopAtEnd<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

impl Arguments {
    fn live_beads(&self, path: &Path) -> Result<LiveBeads, Failure> {
        let (scenario, text) = load_scenario(path)?;
        let tables = BenchTables::from_toml(&text, &path.display().to_string())?;
        let beads = match &self.bead {
            Some(BeadNumbers::One(bead)) => vec![*bead],
            Some(several) => several.of(&scenario)?,
            None => Vec::new(),
        };
        let stated = settings_file::uncertainty(self.uncertainty.as_deref())?;
        let image = find_image(None)?;
        let front_end = tables.front_end.front_end()?;
        let seed = tables.front_end.has_noise().then_some(1);
        let live = LiveBeads::open(&scenario, &front_end, &beads, stated, seed, &image)?;
        Ok(live.with_pace(tables.clock.pace.unwrap_or(1.0)))
    }

    fn recorder<'a>(
        &self,
        addresses: &[Address],
        started: DateTime<Utc>,
        observer: &'a mut SharedMonitor,
        tell: &'a (dyn Fn(String) + Sync),
    ) -> Result<Recorder<'a>, Failure> {
        let options = RecorderOptions {
            baud: self.baud,
            duration: self.duration,
            split: SPLIT,
            // The page says which port is away, and its reader knows how long to wait.
            wait: Duration::MAX,
            fetch: true,
        };
        let about = About {
            notes: [("started".to_owned(), started.to_rfc3339())].into(),
            remarks: self.notes.signed(),
            ..About::default()
        };
        let target = record::target(self.out.as_deref(), self.overwrite, started)?;
        observer.lock().record_to(target.path());
        Ok(Recorder::new(&target, addresses, options, about, observer, tell)?)
    }
}
