//! `bead monitor`: live beads on a terminal, a page in a browser, and in other programs.

use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::thread::{self, Scope};
use std::time::{Duration, Instant, SystemTime};
use std::{io, panic};

use chrono::{DateTime, Utc};
use tempfile::TempDir;

use super::record::{PortChoice, conclude, new_target, port};
use crate::cli::beads::BeadNumbers;
use crate::cli::commands::prelude::*;
use crate::cli::commands::settings_file;
use crate::cli::note_options::{NoteOptions, note};
use bead_bench::bridge::{self, Bridge, Door};
use bead_bench::emulation::Emulation;
use bead_bench::error::BenchError;
use bead_bench::image::find_image;
use bead_bench::several;
use bead_bench::tables::BenchTables;
use bead_compare::sensed::{Timing, load_scenario, simulate_with_ring_down};
use bead_line::key;
use bead_line::port::{Address, Port, open_all};
use bead_line::recorder::{Recorded, Recorder, RecorderOptions, RecorderOrder};
use bead_monitor::udp::Datagrams;
use bead_monitor::web::WebPage;
use bead_monitor::{Control, Monitor, SharedMonitor, follow, terminal};
use bead_recording::file::{About, Follower};

const AFTER_HELP: &str = "\
The beads come from ports, from a recording that another program writes, or from the emulator. What comes from \
ports and from the emulator is recorded at the same time, as `bead record` does it. No page holds up the \
recorder.

Keys: up and down choose a bead, left and right a strike; n writes a note into the recording, a arms the bead, d \
disarms it; q ends, and completes the recording. 80 by 24 cells are enough, and fewer show less.

--web prints an address for a browser on this computer, with a token in it that changes each time. Without a \
terminal, --web, --udp run until Ctrl-C or --duration.

Exit status 0 at q, Ctrl-C or --duration; 2 if there is no terminal and no other page; 3 when no port is left.

Examples:
  bead monitor --port /dev/ttyUSB0
  bead monitor --port /dev/ttyUSB0 --port /dev/ttyUSB1 --out chain.mcap
  bead monitor --port all --web
  bead monitor strikes.mcap.partial
  bead monitor --emulate docs/scenarios/ten-intruders.toml --bead 7-8
  bead monitor --emulate docs/scenarios/ten-intruders.toml --web \\
      --uncertainty docs/scenarios/paper-bead.toml
  bead monitor --port /dev/ttyUSB0 --udp 127.0.0.1:9870";

#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    /// A recording, finished or still being written (F.mcap.partial).
    #[arg(value_name = "F.mcap", required_unless_present_any = ["port", "emulate"])]
    follow: Option<PathBuf>,
    /// A serial port or pty, tcp:HOST:PORT or unix:PATH; again for each further bead. Or all: every serial
    /// port here.
    #[arg(long, value_name = "P", value_parser = port, conflicts_with = "follow")]
    port: Vec<PortChoice>,
    /// Emulate beads that are struck again and again, as this scenario has them.
    #[arg(long, value_name = "SCENARIO", conflicts_with_all = ["follow", "port"])]
    emulate: Option<PathBuf>,
    /// The beads to emulate: 7, 7-16, 7,9,12 or all.
    #[arg(long, value_name = "N", default_value = "all", requires = "emulate")]
    bead: BeadNumbers,
    /// Time from strike to strike of emulated beads, s.
    #[arg(long, value_name = "S", default_value = "2", value_parser = positive, requires = "emulate")]
    interval: f64,
    /// Let the settings of emulated beads state the uncertainties of this file, as bead.toml has them: the
    /// beads then send those of their energies.
    #[arg(long, value_name = "F.toml|F.settings", requires = "emulate")]
    uncertainty: Option<PathBuf>,
    /// The recording [default: bead-DATE-TIME.mcap, in UTC].
    #[arg(long, value_name = "F.mcap", conflicts_with = "follow")]
    out: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Bits a second of a serial port.
    #[arg(long, default_value_t = 2_000_000, value_parser = clap::value_parser!(u32).range(1..))]
    baud: u32,
    /// Sign requests to arm and disarm with the key in this file.
    #[arg(long, value_name = "F.key")]
    key: Option<PathBuf>,
    #[command(flatten)]
    notes: NoteOptions,
    /// Stop after this time, s.
    #[arg(long, value_name = "SECONDS", value_parser = output::seconds)]
    duration: Option<Duration>,
    /// Serve the page to a browser at this address of this computer.
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, default_missing_value = "127.0.0.1:0")]
    web: Option<SocketAddr>,
    /// Let --web serve other computers too. The page is not encrypted: who reads the network reads the
    /// token, and with it all strikes.
    #[arg(long, requires = "web")]
    web_without_encryption: bool,
    /// Send each strike and each state as a JSON datagram, as PlotJuggler takes it.
    #[arg(long, value_name = "HOST:PORT")]
    udp: Option<String>,
}

/// Time for which all ports may be away.
const WAIT: Duration = Duration::from_secs(10);
/// Time between edges at the sync inputs of emulated beads, and that in which there are any, s.
const SYNC_PERIOD: f64 = 0.1;
const SYNCED: f64 = 3600.0;
/// Time after which a recording goes on in another file.
const SPLIT: Duration = Duration::from_secs(86_400);

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let refused = terminal::refusal();
    if let Some(why) = refused.filter(|_| arguments.web.is_none() && arguments.udp.is_none()) {
        bail!(Input, "{why}");
    }
    // Before a recording begins.
    let open = !arguments.web_without_encryption;
    let web = arguments.web.map(|address| WebPage::open(address, open));
    let web = web.transpose().map_err(Failure::input)?;
    let udp = arguments.udp.as_deref().map(Datagrams::to).transpose();
    let udp = udp.map_err(Failure::input)?;
    let source = Source::open(arguments)?;
    let stop = interrupt::orderly(source.remains());
    let monitor = SharedMonitor::new(source.monitor());
    let (orders, ordered) = mpsc::channel();
    let control = source.control(arguments, orders)?;
    let (fed, shown) = thread::scope(|scope| {
        let (monitor, stop) = (&monitor, &*stop);
        if let Some(web) = web {
            note!("the page is at {}", web.url());
            monitor.lock().tell(&format!("the page is at {}", web.url()));
            scope.spawn(move || ended(web.serve(monitor, stop), monitor, stop));
        }
        if let Some(udp) = udp {
            scope.spawn(move || udp.serve(monitor, stop));
        }
        let feeding = scope.spawn(move || {
            let fed = source.feed(arguments, monitor, ordered, stop);
            // The pages end with what they show.
            stop.store(true, Ordering::Relaxed);
            fed
        });
        let deadline = arguments
            .duration
            .and_then(|duration| Instant::now().checked_add(duration));
        let shown = match refused {
            None => terminal::show(monitor, control.as_ref(), deadline, stop),
            Some(_) => {
                while !stop.load(Ordering::Relaxed) && deadline.is_none_or(|at| Instant::now() < at) {
                    thread::sleep(Duration::from_millis(50));
                }
                stop.store(true, Ordering::Relaxed);
                Ok(())
            }
        };
        let fed = feeding.join();
        (fed.unwrap_or_else(|cause| panic::resume_unwind(cause)), shown)
    });
    let concluded =
        fed.and_then(|recorded| recorded.map_or(Ok(()), |recorded| conclude(recorded, WAIT, Ok(()))));
    // A page that failed costs no recording, and its reason comes after that.
    concluded.and(
        shown
            .context("the terminal cannot be drawn on; the recording is complete")
            .map_err(Failure::from),
    )
}

/// Ends all when a page ends early.
fn ended(served: io::Result<()>, monitor: &SharedMonitor, stop: &AtomicBool) {
    if let Err(why) = served
        && !stop.load(Ordering::Relaxed)
    {
        monitor
            .lock()
            .tell(&format!("the web page ended: {why}; the recording goes on"));
    }
}

/// The origin of the frames.
enum Source {
    /// A recording of another program.
    Recording(PathBuf, Box<Follower>),
    /// Ports that are recorded.
    Ports {
        open: Vec<(Address, Port)>,
        target: Target,
        emulated: Option<EmulatedBeads>,
    },
}

impl Source {
    fn open(arguments: &Arguments) -> Result<Self, Failure> {
        if let Some(path) = &arguments.follow {
            let follower = Box::new(Follower::open(path)?);
            return Ok(Self::Recording(path.clone(), follower));
        }
        let started = DateTime::<Utc>::from(SystemTime::now());
        let target = new_target(arguments.out.as_deref(), arguments.overwrite, started)?;
        let emulated = arguments.emulate.as_deref();
        let emulated = emulated
            .map(|scenario| EmulatedBeads::prepare(scenario, arguments))
            .transpose()?;
        let ports = match &emulated {
            Some(emulated) => emulated.addresses.iter().cloned().map(Some).collect(),
            None => arguments.port.clone(),
        };
        let open = open_all(&ports, arguments.baud, |line| note!("{line}"));
        let open = open.map_err(|why| failure!(Device, "{why}"))?;
        Ok(Self::Ports {
            open,
            target,
            emulated,
        })
    }

    /// A monitor of it, of which nothing came yet.
    fn monitor(&self) -> Monitor {
        match self {
            Self::Recording(path, _) => {
                let path = path.display().to_string();
                Monitor::new(vec![path.clone()], format!("follows {path}"))
            }
            Self::Ports {
                open,
                target,
                emulated,
            } => {
                let port = |(address, _): &(Address, Port)| match emulated {
                    Some(_) => "emulated".to_owned(),
                    None => address.to_string(),
                };
                let recording = format!("recording {}", target.path().display());
                Monitor::new(open.iter().map(port).collect(), recording)
            }
        }
    }

    /// What is left if the recording cannot be completed in time.
    fn remains(&self) -> String {
        match self {
            Self::Recording(..) => "nothing is left behind, run it again".to_owned(),
            Self::Ports { target, .. } => format!(
                "the disk was too slow to complete the recording; what came is in {}.partial, for `bead recover`",
                target.path().display()
            ),
        }
    }

    /// The way to the recorder, if there is one.
    fn control(
        &self,
        arguments: &Arguments,
        orders: mpsc::Sender<RecorderOrder>,
    ) -> Result<Option<Control>, Failure> {
        let key = arguments.key.as_deref().map(key::read).transpose()?;
        let author = arguments.notes.author.clone();
        let parse = move |text: &str| note(text).map(|note| author.sign(vec![note]).remove(0));
        let control = Control::new(orders, key, Box::new(parse));
        Ok(matches!(self, Self::Ports { .. }).then_some(control))
    }

    /// Feeds the monitor until `stop`. Gives what was recorded.
    fn feed(
        self,
        arguments: &Arguments,
        monitor: &SharedMonitor,
        orders: mpsc::Receiver<RecorderOrder>,
        stop: &AtomicBool,
    ) -> Result<Option<Recorded>, Failure> {
        let (open, target, emulated) = match self {
            Self::Recording(_, follower) => {
                follow(monitor, *follower, stop)?;
                return Ok(None);
            }
            Self::Ports {
                open,
                target,
                emulated,
            } => (open, target, emulated),
        };
        let (addresses, ports): (Vec<_>, Vec<_>) = open.into_iter().unzip();
        let options = RecorderOptions {
            baud: arguments.baud,
            duration: None,
            split: SPLIT,
            wait: WAIT,
            fetch: true,
        };
        let about = About {
            remarks: arguments.notes.signed(),
            ..About::default()
        };
        let tell = |line: String| monitor.lock().tell(&line);
        let mut observer = monitor.clone();
        let recorder = Recorder::new(&target, &addresses, options, about, &mut observer, &tell)?;
        let recorder = recorder.with_orders(orders);
        thread::scope(|scope| {
            if let Some(emulated) = &emulated {
                emulated.run(scope, monitor, stop);
            }
            recorder.run(ports, stop).map(Some).map_err(Failure::input)
        })
    }
}

/// Beads in the emulator, each behind a socket, as if it were at a port.
struct EmulatedBeads {
    addresses: Vec<Address>,
    doors: Vec<Door>,
    emulations: Vec<Emulation>,
    pace: f64,
    /// Removed with the sockets at the end.
    _folder: TempDir,
}

impl EmulatedBeads {
    fn prepare(scenario: &Path, arguments: &Arguments) -> Result<Self, Failure> {
        let progress = output::spinner("simulating what the beads sense".to_owned());
        let (scenario_of, text) = load_scenario(scenario)?;
        let tables = BenchTables::from_toml(&text, &scenario.display().to_string())?;
        let beads = arguments.bead.of(&scenario_of)?;
        let front_end = tables.front_end.front_end()?;
        let (clock, image) = (&tables.clock, find_image(None)?);
        let mut placed = several::placed(&beads, &clock.crystals(), clock.start_spread, 1, true)?;
        // What they feel is repeated, each time after as many of their scans: with one crystal and one start the
        // wave runs along the row each time.
        let stated = arguments.uncertainty.as_deref();
        let stated = stated.map(settings_file::uncertainty).transpose()?;
        for one in &mut placed {
            (one.clock_ppm, one.began, one.uncertainty) = (0.0, 0.0, stated);
        }
        let solution = simulate_with_ring_down(&scenario_of)?;
        let timing = Timing {
            lead_in: 0.5 * arguments.interval,
            strikes: 1,
            interval: arguments.interval,
        };
        let period = clock.sync_period.unwrap_or(SYNC_PERIOD);
        let emulate = |placed| {
            let mut emulation =
                Emulation::place(&scenario_of, &solution, placed, &front_end, timing, &image)?;
            emulation.sync_until((1..).map(|number| f64::from(number) * period), SYNCED);
            Ok::<_, BenchError>(emulation)
        };
        let emulations = placed.into_iter().map(emulate).collect::<Result<Vec<_>, _>>()?;
        let folder = tempfile::tempdir().context("cannot make a folder for the sockets of the beads")?;
        let address = |bead: &usize| Address::Unix(folder.path().join(format!("bead-{bead}.sock")));
        let addresses: Vec<_> = beads.iter().map(address).collect();
        let doors = addresses.iter().map(Door::open).collect::<Result<Vec<_>, _>>()?;
        progress.finish_and_clear();
        Ok(Self {
            addresses,
            doors,
            emulations,
            pace: clock.pace.unwrap_or(1.0),
            _folder: folder,
        })
    }

    /// Runs each bead on a thread of its own until `stop`.
    fn run<'scope>(
        &'scope self,
        scope: &'scope Scope<'scope, '_>,
        monitor: &'scope SharedMonitor,
        stop: &'scope AtomicBool,
    ) {
        for (emulation, door) in self.emulations.iter().zip(&self.doors) {
            scope.spawn(move || {
                let bridge = Bridge::new(emulation, Some(self.pace));
                let served = bridge.and_then(|mut bridge| bridge::serve(&mut bridge, door, stop));
                if let Err(why) = served {
                    let bead = emulation.truth.bead;
                    monitor.lock().tell(&format!("bead {bead} is gone: {why}"));
                }
            });
        }
    }
}
