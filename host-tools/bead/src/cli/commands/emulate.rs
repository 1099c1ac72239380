//! `bead emulate`: the flash image in QEMU on what a bead would sense.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{bail, ensure};
use bead_wire::Message;
use clap::{Args, ValueEnum};
use hertz_chain::{Scenario, Solution};
use indicatif::ProgressBar;
use serde::Serialize;

use crate::cli::beads::Beads;
use crate::cli::commands::emulated::{table, table_of_several};
use crate::cli::failure::{Blame, Failure};
use crate::cli::interrupt;
use crate::cli::output::{self, Format};
use crate::cli::place::{self, Kind, Overwrite};
use crate::cli::provenance::sha256_of;
use crate::cli::waveform_options::WaveformOptions;
use bead_bench::bridge::{self, Bridge, Door};
use bead_bench::emulation::{Emulation, Placed, Ran, settings_of};
use bead_bench::error::BenchError;
use bead_bench::faults::{self, Planned};
use bead_bench::image::find_image;
use bead_bench::run::RunReport;
use bead_bench::several;
use bead_bench::tables::BenchTables;
use bead_compare::emulated::StimulusFile;
use bead_compare::front_end::{FrontEnd, SAMPLE_RATE_HZ};
use bead_compare::given::Given;
use bead_compare::sensed::{
    Timing, bead_of, load_scenario, simulate_with_ring_down, unlike_the_reduced_chain,
};
use bead_compare::strike::FullChain;
use bead_compare::verdict::other_length;
use bead_instrument::Waveform;
use bead_line::port::Address;
use bead_recording::file::{About, Origin, Part, Writer};
use bead_tables::whole::{Target, Unfinished};

const AFTER_HELP: &str = "\
The image is the file that is flashed to a board. It gets the bead's settings in its flash sector and codes \
at its converter. What it sends is decoded, replayed and compared with the full f64 chain. --out leaves the \
recording DIR/bead-N.mcap for `bead decode`, `bead replay` and `bead compare`, and the image's settings \
block DIR/bead-N.settings, which can be flashed to a board of this calibration at 0x080A0000.

With several beads (--bead 7-16, 7,9,12 or all) one strike is simulated, and each bead runs in a QEMU of its \
own, as many at once as there are cores, with its own crystal, start, noise and address, on one time. Their \
sync inputs are on one line. All stand in one recording, DIR/chain.mcap. The same command gives the same \
bytes on any number of cores.

--stimulus plays a waveform of your own instead of the scenario's strike: force, acceleration or both over \
time, from a text table (CSV of an oscilloscope, a spreadsheet, a program), WAV, Parquet, or a recording. \
The scenario then only says which bead it is. Each result stands beside what f64 estimates make of the \
waveform: docs/waveforms.md.

Two tables of the scenario file say how beads differ from the reference: [front_end] has sensors (weak or \
strong), force_span, acceleration_span, wide_force_span, wide_acceleration_span, force_noise, \
acceleration_noise and pole; [clock] has ppm (of each crystal), spread, start_spread, sync_period and shift. \
docs/front-end.md and docs/time.md explain them.

Exit status 1 if a frame is lost, a sample overruns, the image resets, a strike is not seen, or replay \
differs. With --faults: if a fault is not reported, a fault is reported that was not provoked, a loss is not \
counted, or replay differs.

Examples:
  bead emulate docs/scenarios/paper-strike.toml --bead 8 --out run
  bead emulate docs/scenarios/paper-strike.toml --bead 8 --noise off \\
      --format json
  bead emulate docs/scenarios/paper-strike.toml --bead 8 --strikes 5 \\
      --interval 0.05 --seed 7
  bead emulate docs/scenarios/paper-strike.toml --bead 8 --strikes 60 \\
      --faults docs/scenarios/faults.toml
  bead emulate docs/scenarios/ten-intruders.toml --bead all --out run
  bead emulate docs/scenarios/paper-strike.toml --bead 8 --velocity 1.5
  bead emulate docs/scenarios/paper-strike.toml --bead 8 \\
      --stimulus scope.csv --force-column CH1:8.9N --out run
  bead emulate docs/scenarios/paper-strike.toml --bead 8 \\
      --listen unix:bead.sock
    and, meanwhile: bead command self-test --port unix:bead.sock";

/// Arguments of `bead emulate`.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    /// The scenario, a TOML file in SI units.
    scenario: PathBuf,
    /// The bead that senses: one with an intruder. Several sense one strike on one time: 7-16, 7,9,12 or all.
    #[arg(long, value_name = "N")]
    bead: Beads,
    /// The flash image [default: as `cargo xtask build` leaves it, else the one inside this program].
    #[arg(long, value_name = "ELF")]
    firmware: Option<PathBuf>,
    /// Leave the recording and the settings block in this directory, which is made if it is missing:
    /// bead-N.mcap, or chain.mcap of several beads.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Let the sensors feel this waveform, and not the scenario's strike: a text table, WAV, Parquet, or a
    /// recording.
    #[arg(long, value_name = "F")]
    stimulus: Option<PathBuf>,
    /// Number of strikes; how often the waveform is played.
    #[arg(long, value_name = "K", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    strikes: u32,
    /// Time from strike to strike, s.
    #[arg(long, value_name = "S", default_value_t = 0.1)]
    interval: f64,
    /// Velocity of the striker, m/s [default: the scenario's].
    #[arg(long, value_name = "M/S", value_parser = positive)]
    velocity: Option<f64>,
    /// Switch the noise of sensors, conditioner and converter on or off.
    #[arg(long, value_enum, default_value_t)]
    noise: Noise,
    /// Seed of the noise, and of what else is left to chance: the same seed gives the same codes.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Provoke the faults of this TOML file; docs/scenarios/faults.toml is one.
    #[arg(long, value_name = "F.toml")]
    faults: Option<PathBuf>,
    /// Do not run to an end, but be a bead at this address, unix:PATH or tcp:HOST:PORT, until Ctrl-C.
    #[arg(long, value_name = "ADDRESS", conflicts_with_all = ["out", "faults", "format"])]
    listen: Option<Address>,
    /// With --listen: let the bead's time follow this computer's, also while no program is connected: `real`,
    /// or how many seconds it has in one of this computer's. [default: as fast as it can while a program is
    /// connected]
    #[arg(long, value_name = "FACTOR", requires = "listen", value_parser = pace)]
    pace: Option<f64>,
    /// Wait for a debugger at this TCP port of this computer, and let it stop the image and look into it.
    #[arg(long, value_name = "PORT")]
    gdb: Option<u16>,
    /// Format of the result.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
    #[command(flatten)]
    waveform: WaveformOptions,
}

/// Noise of the front end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
enum Noise {
    /// As noisy as the real one.
    #[default]
    On,
    /// Ideal, except for its filter and its twelve bits.
    Off,
}

/// Longest time from the first strike to the last, s, of all beads together: codes take 0.8 MB of memory a
/// second.
const LONGEST: f64 = 1200.0;
/// Default time between sync edges with several beads, s.
const SYNC_OF_SEVERAL: f64 = 0.1;
/// Time in which a bead that listens has sync edges, s. They are in memory.
const SYNC_OF_LISTENING: f64 = 3600.0;
/// Quiet time before the first strike, s, in which the image starts and arms its detector.
const LEAD_IN: f64 = 0.02;

/// A number above 0.
fn positive(text: &str) -> Result<f64, String> {
    let number = text.parse().ok();
    number
        .filter(|number: &f64| number.is_finite() && *number > 0.0)
        .ok_or_else(|| "give a number above 0".to_owned())
}

/// A pace: `real` is 1.
fn pace(text: &str) -> Result<f64, String> {
    let factor = match text {
        "real" => Some(1.0),
        _ => text.parse().ok(),
    };
    factor
        .filter(|factor: &f64| (1e-3..=1e3).contains(factor))
        .ok_or_else(|| "give `real`, or a number from 0.001 to 1000".to_owned())
}

impl Arguments {
    /// The recording, and a settings block for each bead, if they are wanted.
    fn outputs(&self, beads: &[usize]) -> Result<Option<Vec<Target>>, Failure> {
        let inputs = [Some(&self.scenario), self.faults.as_ref(), self.stimulus.as_ref()];
        let inputs: Vec<&Path> = inputs.into_iter().flatten().map(PathBuf::as_path).collect();
        let recording = match self.bead {
            Beads::One(bead) => format!("bead-{bead}.mcap"),
            _ => "chain.mcap".to_owned(),
        };
        let settings = beads
            .iter()
            .map(|bead| (format!("bead-{bead}.settings"), Kind::Settings));
        let files: Vec<_> = std::iter::once((recording, Kind::Recording))
            .chain(settings)
            .collect();
        let targets = |out: &PathBuf| place::targets_of(out, &files, &inputs, self.overwrite);
        self.out.as_ref().map(targets).transpose()
    }

    /// Refuses values that no run can have.
    fn check(&self) -> anyhow::Result<()> {
        let interval = self.interval;
        ensure!(
            interval.is_finite() && interval > 0.0,
            "--interval {interval}: give a time in s"
        );
        let seconds = interval * f64::from(self.strikes - 1);
        ensure!(
            seconds <= LONGEST,
            "--strikes {} --interval {interval:?}: this takes {seconds:?} s, and a run {LONGEST} s at most; strike less often, \
             or sooner",
            self.strikes
        );
        if !matches!(self.bead, Beads::One(_)) {
            let alone = [
                ("--listen", self.listen.is_some()),
                ("--faults", self.faults.is_some()),
                ("--gdb", self.gdb.is_some()),
                ("--stimulus", self.stimulus.is_some()),
            ];
            if let Some((option, _)) = alone.iter().find(|(_, given)| *given) {
                bail!("{option} is for one bead; give --bead one number");
            }
        }
        Ok(())
    }

    /// The seed of the noise, `None` without noise.
    fn seed_of_noise(&self) -> Option<u64> {
        (self.noise == Noise::On).then_some(self.seed)
    }
}

/// Refuses more time of all beads together than fits in memory.
fn check_memory(arguments: &Arguments, tables: &BenchTables, beads: usize) -> anyhow::Result<()> {
    let seconds = tables.clock.start_spread + arguments.interval * f64::from(arguments.strikes - 1);
    let all = seconds * beads as f64;
    ensure!(
        all <= LONGEST || beads == 1,
        "--bead: {beads} beads for {seconds:.1} s each are {all:.0} s, and the codes of {LONGEST} s fit in memory; give \
         fewer beads or --strikes, or a shorter --interval"
    );
    Ok(())
}

/// The scenario with the striker's velocity that is asked for, the tables of the bench, and the text of both.
fn load(arguments: &Arguments) -> Result<(Scenario, BenchTables, String), Failure> {
    let (mut scenario, mut text) = load_scenario(&arguments.scenario)?;
    let file = arguments.scenario.display().to_string();
    let tables = BenchTables::from_toml(&text, &file)?;
    if let Some(velocity) = arguments.velocity {
        scenario.striker.velocity = velocity;
        text = format!(
            "{}\n{}",
            scenario.to_toml(),
            BenchTables::text_in(&text, &file)?.trim()
        );
    }
    Ok((scenario, tables, text))
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    arguments.check().map_err(Failure::Input)?;
    let (scenario, tables, text) = load(arguments)?;
    let beads = match arguments.bead {
        Beads::One(bead) => vec![bead],
        _ => arguments.bead.of(&scenario)?,
    };
    if arguments.stimulus.is_none() {
        arguments.waveform.without("--stimulus")?;
    }
    check_memory(arguments, &tables, beads.len()).map_err(Failure::Input)?;
    let outputs = arguments.outputs(&beads)?;
    // Before the work, which an address that does not do would waste.
    let door = arguments.listen.as_ref().map(Door::open).transpose()?;
    let bench = Bench::of(arguments, &scenario, &tables, &beads)?;
    if let (Some(address), Some(door)) = (&arguments.listen, &door) {
        return listen(arguments, &bench, address, door);
    }
    if let Some(port) = arguments.gdb {
        bench.progress.suspend(|| {
            output::note(format_args!(
                "the image waits for a debugger: target remote :{port}"
            ));
        });
    }
    let count = bench.placed.len();
    bench.progress.set_message(match count {
        1 => "running the image in QEMU".to_owned(),
        _ => format!("running {count} beads in QEMU"),
    });
    let prepare = |placed| bench.prepare(placed);
    let done = |done| {
        bench
            .progress
            .set_message(format!("{done} of {count} beads are done"))
    };
    let ran = several::run(&bench.placed, prepare, done)?;
    bench.progress.finish_and_clear();
    bench.print_remarks();

    // A disk that is full must not cost the result as well: it is printed all the same.
    let recorded = outputs.map(|outputs| record(arguments, &outputs, &text, &ran));
    let recording = recorded.as_ref().and_then(|recorded| recorded.as_ref().ok());
    let mut failures = Vec::new();
    let reports: Vec<_> = ran
        .into_iter()
        .map(|(emulation, mut ran)| {
            failures.push(ran.failure.take());
            let report = RunReport::of(&emulation, ran, recording.cloned());
            (emulation.truth, report)
        })
        .collect();
    match (&arguments.bead, &reports[..]) {
        (Beads::One(_), [(_, report)]) => output::print(arguments.format, report, || table(report))?,
        _ => {
            let beads = reports.iter().map(|(truth, report)| OfBead {
                bead: truth.bead,
                clock_ppm: truth.clock_ppm,
                began_s: truth.began,
                report,
            });
            let result = SeveralBeads {
                beads: beads.collect(),
            };
            output::print(arguments.format, &result, || table_of_several(&reports))?;
        }
    }
    for (truth, report) in &reports {
        for note in beyond_the_range(report, truth.bead) {
            output::note(format_args!("{note}"));
        }
    }
    recorded.transpose()?;
    for ((truth, report), failure) in reports.iter().zip(failures) {
        // An image that failed explains whatever else is missing.
        let verdict = match failure {
            Some(why) => Err(why),
            None => report.verdict(arguments.strikes).map_err(|why| why.to_string()),
        };
        verdict.map_err(|why| match arguments.bead {
            Beads::One(_) => Failure::Verdict(why),
            _ => Failure::Verdict(format!("bead {}: {why}", truth.bead)),
        })?;
    }
    Ok(())
}

/// Advice where a signal leaves the range of its sensor.
const WIDER_RANGES: &str =
    "write sensors = \"strong\" under [front_end] of the scenario, or give wider spans there";

/// A note for each sensor whose range a strike left: the estimates are then too low.
fn beyond_the_range(report: &RunReport, bead: usize) -> Vec<String> {
    let notes = [("force_railed", "force"), ("acceleration_railed", "acceleration")].map(|(flag, sensor)| {
        let strike = report.measured().find(|strike| strike.flags.contains(&flag))?;
        Some(format!(
            "bead {bead}: the strike at sample {} leaves the range of the {sensor} at the low gain, so what is measured of \
             it is too low; {WIDER_RANGES}",
            strike.sample_index
        ))
    });
    notes.into_iter().flatten().collect()
}

/// The result of several beads as JSON.
#[derive(Serialize, schemars::JsonSchema)]
pub(crate) struct SeveralBeads<'a> {
    beads: Vec<OfBead<'a>>,
}

/// A bead among several, as in the JSON.
#[derive(Serialize, schemars::JsonSchema)]
struct OfBead<'a> {
    bead: usize,
    clock_ppm: f64,
    began_s: f64,
    #[serde(flatten)]
    report: &'a RunReport,
}

/// Serves a bead at an address until Ctrl-C.
fn listen(arguments: &Arguments, bench: &Bench<'_>, address: &Address, door: &Door) -> Result<(), Failure> {
    let emulation = bench.prepare(bench.placed[0])?;
    bench.progress.finish_and_clear();
    bench.print_remarks();
    let stop = interrupt::orderly("its socket may be left; remove it".to_owned());
    let passes = match arguments.pace {
        Some(factor) => format!("passes {factor} times as fast as this computer's"),
        None => "passes while somebody is connected".to_owned(),
    };
    if let Some(port) = arguments.gdb {
        output::note(format_args!("it waits for a debugger: target remote :{port}"));
    }
    if bench.tables.clock.sync_period.is_some() {
        output::note(format_args!(
            "there are edges at its sync input for an hour of its time"
        ));
    }
    let mut bridge = Bridge::new(&emulation, arguments.pace)?;
    output::note(format_args!(
        "a bead is at {address} until Ctrl-C; its time {passes}"
    ));
    Ok(bridge::serve(&mut bridge, door, &stop)?)
}

/// The chain, and the beads in it that are run.
struct Bench<'a> {
    arguments: &'a Arguments,
    scenario: &'a Scenario,
    tables: &'a BenchTables,
    solution: Arc<Solution>,
    front_end: FrontEnd,
    image: PathBuf,
    placed: Vec<Placed>,
    faults: Vec<Planned>,
    /// Waveform in place of a strike of the chain.
    played: Option<Played>,
    progress: ProgressBar,
}

impl<'a> Bench<'a> {
    /// Simulates the strike.
    fn of(
        arguments: &'a Arguments,
        scenario: &'a Scenario,
        tables: &'a BenchTables,
        beads: &[usize],
    ) -> Result<Self, Failure> {
        let progress = output::spinner(format!("simulating {} beads", scenario.chain.beads));
        let mut front_end = tables.front_end.front_end()?;
        if arguments.noise == Noise::Off {
            for channel in front_end.channels_mut() {
                channel.noise_rms = 0.0;
            }
        }
        let faults = match &arguments.faults {
            Some(path) => faults::load(path)?,
            None => Vec::new(),
        };
        let noise = arguments.seed_of_noise();
        let several = !matches!(arguments.bead, Beads::One(_));
        let mut placed = several::placed(
            beads,
            &tables.clock.crystals(),
            tables.clock.start_spread,
            arguments.seed,
            noise.is_some(),
        )?;
        if !several {
            for one in &mut placed {
                (one.address, one.seed) = (0, noise);
            }
        }
        let played = Played::of(arguments, &front_end, beads)?;
        let image = find_image(arguments.firmware.as_deref())?;
        let solution = Arc::new(simulate_with_ring_down(scenario)?);
        for one in &placed {
            let bead = one.bead;
            bead_of(&solution, bead)?;
            let length = match played.is_some() || arguments.listen.is_some() {
                // Nothing is held against the scenario.
                true => None,
                false => {
                    let window = settings_of(&solution, *one, &front_end)?.window;
                    let chain = FullChain::of(scenario, &solution, bead)?;
                    other_length(scenario, &solution, &chain, bead, window)
                }
            };
            for note in unlike_the_reduced_chain(&solution, bead)
                .into_iter()
                .chain(length)
            {
                progress.suspend(|| output::note(format_args!("{note}")));
            }
        }
        progress.set_message("digitising what the bead senses");
        Ok(Self {
            arguments,
            scenario,
            tables,
            solution,
            front_end,
            image,
            placed,
            faults,
            played,
            progress,
        })
    }

    /// Prepares a bead's run: settings, stimulus, faults, clock and sync edges.
    fn prepare(&self, placed: Placed) -> Result<Emulation, BenchError> {
        let arguments = self.arguments;
        let timing = Timing {
            lead_in: LEAD_IN + self.tables.clock.start_spread,
            strikes: arguments.strikes,
            interval: arguments.interval,
        };
        let (front_end, image) = (&self.front_end, &self.image);
        let mut emulation = match &self.played {
            None => Emulation::place(self.scenario, &self.solution, placed, front_end, timing, image)?,
            Some(Played { waveform, file, .. }) => {
                let settings = settings_of(&self.solution, placed, front_end)?;
                let truth = Given::around_its_peak(waveform, &settings).truth();
                let waveform = waveform.clone();
                let mut emulation =
                    Emulation::play(&self.solution, placed, front_end, timing, image, waveform, truth)?;
                emulation.truth.stimulus = Some(file.clone());
                emulation
            }
        };
        self.check_faults(emulation.seconds())?;
        emulation.faults.clone_from(&self.faults);
        emulation.shift = self.tables.clock.shift;
        emulation.gdb = arguments.gdb;
        let several = !matches!(arguments.bead, Beads::One(_));
        if let Some(period) = self
            .tables
            .clock
            .sync_period
            .or(several.then_some(SYNC_OF_SEVERAL))
        {
            let until = if arguments.listen.is_some() {
                SYNC_OF_LISTENING
            } else {
                emulation.seconds()
            };
            emulation.sync_until((1..).map(|number| f64::from(number) * period), until);
        }
        Ok(emulation)
    }

    /// Prints the remarks on the waveform.
    fn print_remarks(&self) {
        for remark in self.played.iter().flat_map(|played| &played.remarks) {
            output::note(format_args!("{remark}"));
        }
    }

    /// Refuses faults that come too late for a run of this length, s.
    fn check_faults(&self, seconds: f64) -> Result<(), BenchError> {
        if let Some(late) = self.faults.iter().find(|fault| fault.at >= seconds) {
            return Err(BenchError::Unfit(format!(
                "--faults: {} at {} s comes after the end of the run at {seconds} s; make it earlier, or strike more often",
                late.kind.name(),
                late.at,
            )));
        }
        let untold =
            |fault: &&Planned| fault.cause().is_some() && fault.at + fault.reported_within() > seconds;
        if let Some(early) = self.faults.iter().find(untold) {
            return Err(BenchError::Unfit(format!(
                "--faults: the run ends at {seconds} s, before the bead can tell of {} at {} s, which takes up to {} s; \
                 give more --strikes or a longer --interval",
                early.kind.name(),
                early.at,
                early.reported_within(),
            )));
        }
        Ok(())
    }
}

/// A waveform that is played in place of the scenario's strike.
struct Played {
    waveform: Waveform,
    file: StimulusFile,
    /// Remarks for the user, a line each.
    remarks: Vec<String>,
}

impl Played {
    /// Reads the waveform, if one is given.
    fn of(arguments: &Arguments, front_end: &FrontEnd, beads: &[usize]) -> Result<Option<Self>, Failure> {
        let Some(path) = &arguments.stimulus else {
            return Ok(None);
        };
        let mut waveform = arguments.waveform.read(path, beads.first().copied())?;
        let seconds = waveform.seconds();
        if seconds > LONGEST {
            let what = format!(
                "it is {seconds:.3e} s long, and a run {LONGEST} s at most; cut the strike out of it"
            );
            return Err(Failure::input(format!("{}: {what}", path.display())));
        }
        let mut remarks = std::mem::take(&mut waveform.remarks);
        let acceleration = front_end.acceleration.wide.range();
        for (trace, name, si, (low, high)) in [
            (&waveform.force, "force", "N", front_end.force.wide.range()),
            (&waveform.acceleration, "acceleration", "m/s²", acceleration),
        ] {
            let Some(trace) = trace else {
                remarks.push(format!("it has no {name}, so that sensor stays at rest"));
                continue;
            };
            let (lowest, (_, highest)) = (trace.lowest(), trace.highest());
            if lowest < low || highest > high {
                remarks.push(format!(
                    "its {name} goes from {lowest:.4} to {highest:.4} {si}, and the front end from {low:.4} to {high:.4}, so \
                     codes stay at a rail; {WIDER_RANGES}"
                ));
            }
        }
        let file = StimulusFile {
            name: path
                .file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned(),
            sha256: sha256_of(path)?,
            force: waveform.force.is_some(),
            acceleration: waveform.acceleration.is_some(),
        };
        let remarks = remarks
            .into_iter()
            .map(|remark| format!("{}: {remark}", path.display()));
        Ok(Some(Self {
            waveform,
            file,
            remarks: remarks.collect(),
        }))
    }
}

/// Writes everything that belongs to the run to one file.
fn record(
    arguments: &Arguments,
    outputs: &[Target],
    scenario: &str,
    ran: &[(Emulation, Ran)],
) -> Result<PathBuf, Failure> {
    let [recording, settings @ ..] = outputs else {
        unreachable!("the recording is always wanted, as `Arguments::outputs` says");
    };
    let path = recording.path();
    if let Some(directory) = path.parent() {
        place::make_directory(directory)?;
    }
    let firmware = ran
        .iter()
        .flat_map(|(_, ran)| &ran.frames)
        .find_map(|frame| match &frame.message {
            Message::Identity(identity) => Some(format!("{} ({})", identity.firmware, identity.git)),
            _ => None,
        });
    let mut notes = BTreeMap::from([("scenario".to_owned(), arguments.scenario.display().to_string())]);
    if let Beads::One(bead) = arguments.bead {
        notes.insert("bead".to_owned(), bead.to_string());
    }
    if let Some(stimulus) = &arguments.stimulus {
        notes.insert("stimulus".to_owned(), stimulus.display().to_string());
    }
    let about = About {
        source: "bead emulate".to_owned(),
        firmware,
        sample_rate_hz: SAMPLE_RATE_HZ,
        notes,
    };
    let json = |part: Part, result: serde_json::Result<String>| {
        result.or_input(|| format!("cannot write {} of {}", part.name(), path.display()))
    };
    let mut parts = Vec::new();
    for (emulation, ran) in ran {
        let truth = json(Part::Truth, serde_json::to_string_pretty(&emulation.truth))?;
        let report = json(Part::EmulatorReport, serde_json::to_string_pretty(&ran.report))?;
        parts.push([
            (Part::Settings, emulation.block.clone()),
            (Part::Truth, truth.into_bytes()),
            (Part::EmulatorReport, report.into_bytes()),
        ]);
    }
    let write = || {
        let several = !matches!(arguments.bead, Beads::One(_));
        let mut writer = if several {
            Writer::create_for_several(recording, &about)?
        } else {
            Writer::create(recording, &about)?
        };
        let partial = Remove(
            writer.partial_path().to_owned(),
            Unfinished::list(writer.partial_path()),
        );
        if several {
            writer.attach(Part::Scenario, scenario.as_bytes())?;
            let mut lanes = Vec::new();
            for ((emulation, ran), parts) in ran.iter().zip(&parts) {
                let lane = writer.join(&Origin {
                    address: emulation.settings.description().address,
                    bead: Some(emulation.truth.bead),
                    port: None,
                    clock: Some("emulator".to_owned()),
                })?;
                for (part, data) in parts {
                    writer.attach_to(lane, *part, data)?;
                }
                lanes.push((lane, ran, emulation.truth.began));
            }
            several::write(&lanes, &mut writer)?;
        }
        if let ([(emulation, ran)], [[settings, truth, report]], false) = (ran, &parts[..], several) {
            writer.attach(settings.0, &settings.1)?;
            writer.attach(Part::Scenario, scenario.as_bytes())?;
            writer.attach(truth.0, &truth.1)?;
            writer.attach(report.0, &report.1)?;
            ran.write(&mut writer, (emulation.truth.began * 1e9).round() as u64)?;
        }
        let finished = writer.finish();
        drop(partial);
        finished
    };
    let written = write()?;
    for (target, (emulation, _)) in settings.iter().zip(ran) {
        target
            .beside(recording.path(), &written.path)
            .write_bytes(&emulation.block)?;
    }
    Ok(written.path)
}

/// A recording that is not complete. It is removed: the run can be repeated.
struct Remove(
    PathBuf,
    #[expect(dead_code, reason = "it is in a list until it is dropped")] Unfinished,
);

impl Drop for Remove {
    fn drop(&mut self) {
        // Finished, it has another name.
        let _ = fs::remove_file(&self.0);
    }
}
