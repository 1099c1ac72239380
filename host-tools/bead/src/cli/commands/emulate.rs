//! `bead emulate`: the flash image in QEMU on what a bead would sense.

use std::collections::BTreeMap;
use std::env;
use std::iter;
use std::sync::Arc;

use hertz_chain::Solution;
use indicatif::ProgressBar;

use crate::cli::commands::emulated::EmulatedBead;
use crate::cli::commands::emulated::{table, table_of_several};
use crate::cli::commands::prelude::*;
use crate::cli::commands::settings_file;
use crate::cli::note_options::{Author, note};
use crate::cli::provenance::{name_of, sha256_of};
use crate::cli::waveform_options::WaveformOptions;
use bead_bench::bridge::{self, Bridge, Door, Pace};
use bead_bench::emulation::{Emulation, Placed, Ran, settings_of};
use bead_bench::error::BenchError;
use bead_bench::faults::{self, Planned};
use bead_bench::image::find_image;
use bead_bench::recording;
use bead_bench::run::RunReport;
use bead_bench::several;
use bead_bench::tables::BenchTables;
use bead_compare::emulated::StimulusFile;
use bead_compare::front_end::AnalogFrontEnd;
use bead_compare::given::{GivenEstimates, noise_triggers};
use bead_compare::sensed::{
    Timing, bead_of, load_scenario, simulate_with_ring_down, unlike_the_reduced_chain,
};
use bead_compare::strike::FullChain;
use bead_compare::verdict::other_length;
use bead_console::beads::BeadNumbers;
use bead_instrument::Waveform;
use bead_line::port::Address;
use bead_recording::file::{About, Note};
use stm32f405_qemu::AnalogWire;

const AFTER_HELP: &str = "\
The image is the file that is flashed to a board. It gets the bead's settings in its flash sector and codes \
at its converter. Everything it sends is decoded, replayed and compared with the full f64 chain. --out writes \
the recording DIR/bead-N.mcap for `bead decode`, `bead replay` and `bead compare`, and the image's settings \
block DIR/bead-N.settings, which can be flashed at 0x0800C000 to a board with this calibration.

With several beads (--bead 7-16, 7,9,12 or all) one strike is simulated, and each bead runs in its own QEMU \
with its own crystal, start, noise and address, as many at once as there are cores. The beads share one time \
and one sync line, and go into one recording, DIR/chain.mcap. The same command gives the same bytes on any \
number of cores.

--stimulus plays a waveform of your own instead of the scenario's strike: force, acceleration or both over \
time, from a text table (CSV of an oscilloscope, a spreadsheet, a program), WAV, Parquet, or a recording. \
The scenario then only describes the bead. Each result is shown next to the f64 estimates of the waveform: \
docs/waveforms.md.

Tables of the scenario file describe how beads differ from the reference: [front_end] has sensors (weak or \
strong), force_span, acceleration_span, wide_force_span, wide_acceleration_span, force_noise, \
acceleration_noise, pole and noise (false for none); [clock] has ppm (of each crystal), spread, start_spread, \
sync_period, shift and, for --listen, pace: seconds of the bead's time per second of this computer's. With \
--listen, [[analog_wire]] puts a wire from an output to an input in place of the sensors; inputs without a \
wire are open. docs/front-end.md, docs/time.md and docs/bench.md explain them.

QEMU_GDB=PORT in the environment makes the image wait for a debugger at this TCP port.

Exit status 1 if a frame is lost, a sample overruns, the image resets, a strike is not seen or leaves the \
range of a sensor, or replay differs. With --faults: if a fault is not reported, a fault is reported that was not provoked, a loss is not \
counted, or replay differs.

Examples:
  bead emulate docs/scenarios/paper-strike.toml --bead 8 --out run
  bead emulate docs/scenarios/paper-strike.toml --bead 8 --format json
  bead emulate docs/scenarios/paper-strike.toml --bead 8 --strikes 5:0.05 --seed 7
  bead emulate docs/scenarios/paper-strike.toml --bead 8 --strikes 60 \\
      --faults docs/scenarios/faults.toml
  bead emulate docs/scenarios/ten-intruders.toml --bead all --out run
  bead emulate docs/scenarios/paper-strike.toml --bead 8 --uncertainty bead.toml
  bead emulate docs/scenarios/paper-strike.toml --bead 8 --settings bead.toml
  bead emulate docs/scenarios/paper-strike.toml --bead 8 --velocity 1.5
  bead emulate docs/scenarios/paper-strike.toml --bead 8 \\
      --stimulus scope.csv --read force=CH1:8.9N --out run
  bead emulate docs/scenarios/paper-strike.toml --bead 8 \\
      --listen unix:bead.sock
    and, meanwhile: bead command self-test --port unix:bead.sock
  bead emulate docs/scenarios/bench.toml --bead 8 --listen unix:bead.sock
    and, meanwhile: bead bench --port unix:bead.sock";

#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    /// The scenario, a TOML file in SI units.
    scenario: PathBuf,
    /// The sensing bead: one with an intruder. Several sense one strike on a common time: 7-16, 7,9,12 or
    /// all.
    #[arg(long, value_name = "N")]
    bead: BeadNumbers,
    /// The flash image [default: as `cargo xtask build` leaves it, else the one inside this program].
    #[arg(long, value_name = "ELF")]
    firmware: Option<PathBuf>,
    /// Write the recording and the settings block to this directory, which is made if it is missing:
    /// bead-N.mcap, or chain.mcap for several beads.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
    /// A note in the recording, such as operator=Ana specimen=A12; repeat for more.
    #[arg(long, value_name = "KEY=VALUE", num_args = 1.., value_parser = note)]
    note: Vec<Note>,
    /// Let the sensors feel this waveform instead of the scenario's strike: a text table, WAV, Parquet, or a
    /// recording.
    #[arg(long, value_name = "F")]
    stimulus: Option<PathBuf>,
    /// Put the uncertainties in this file, such as bead.toml, into the settings: the bead then sends the
    /// uncertainties of its energies.
    #[arg(long, value_name = "F.toml|F.settings")]
    uncertainty: Option<PathBuf>,
    /// Give the bead these settings, as its owner would, in place of those that fit the scenario and its
    /// front end. An error in them is an error in the results.
    #[arg(long, value_name = "F.toml|F.settings", conflicts_with = "uncertainty")]
    settings: Option<PathBuf>,
    /// Number of strikes, or how often the waveform is played, and the time from one to the next, s.
    #[arg(long, value_name = "K[:S]", default_value = "1:0.1", value_parser = strikes)]
    strikes: Strikes,
    /// Velocity of the striker, m/s [default: the scenario's].
    #[arg(long, value_name = "M/S", value_parser = positive)]
    velocity: Option<f64>,
    /// Seed of the noise and of all else that is random: the same seed gives the same codes.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Provoke the faults of this TOML file; docs/scenarios/faults.toml is one.
    #[arg(long, value_name = "F.toml")]
    faults: Option<PathBuf>,
    /// Act as a bead at this address, unix:PATH or tcp:HOST:PORT, until Ctrl-C. Its time passes as fast as
    /// possible while a program is connected, or at the `pace` under [clock].
    #[arg(long, value_name = "ADDRESS", conflicts_with_all = ["out", "faults", "format"])]
    listen: Option<Address>,
    /// Format of the result.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
    #[command(flatten)]
    waveform: WaveformOptions,
}

/// `--strikes`.
#[derive(Debug, Clone, Copy)]
struct Strikes {
    count: u32,
    /// Time from one to the next, s.
    interval: f64,
}

/// Parses a number of strikes with the time between them, as `5` or `5:0.05`.
fn strikes(text: &str) -> Result<Strikes, String> {
    let (count, interval) = match text.split_once(':') {
        Some((count, interval)) => (count, positive(interval)?),
        None => (text, INTERVAL),
    };
    match count.parse() {
        Ok(count @ 1..=10_000) => Ok(Strikes { count, interval }),
        _ => Err(
            "give a whole number from 1 to 10000, and after a colon the seconds between strikes".to_owned(),
        ),
    }
}

/// Returns the TCP port for a debugger that the environment asks for. QEMU's own user mode has the same name.
fn debugger_port() -> Result<Option<u16>, Failure> {
    let Some(port) = env::var_os("QEMU_GDB") else {
        return Ok(None);
    };
    let shown = port.to_string_lossy();
    let port = shown
        .parse()
        .map_err(|_| failure!(Input, "QEMU_GDB={shown}: give the number of a TCP port"))?;
    Ok(Some(port))
}

/// Time from strike to strike where none is given, s.
const INTERVAL: f64 = 0.1;
/// Longest time from the first strike to the last, s, of all beads together: codes take 0.8 MB of memory a
/// second.
const LONGEST: f64 = 1200.0;
/// Default time between sync edges with several beads, s.
const SYNC_OF_SEVERAL: f64 = 0.1;
/// Time in which a bead that listens has sync edges, s. They are in memory.
const SYNC_OF_LISTENING: f64 = 3600.0;
/// Quiet time before the first strike, s, in which the image starts and arms its detector.
const LEAD_IN: f64 = 0.02;

impl Arguments {
    /// The number of the bead, if there is only one.
    fn one(&self) -> Option<usize> {
        match self.bead {
            BeadNumbers::One(bead) => Some(bead),
            _ => None,
        }
    }

    /// Refuses options that do not go together, and more time of all beads together than fits in memory.
    fn check(&self, tables: &BenchTables, beads: usize) -> Result<(), Failure> {
        let Strikes { count, interval } = self.strikes;
        let seconds = tables.clock.start_spread + interval * f64::from(count - 1);
        let all = seconds * beads as f64;
        if beads > 1 && all > LONGEST {
            bail!(
                Input,
                "--bead: {beads} beads for {seconds:.1} s each are {all:.0} s, but memory holds the codes of at most {LONGEST} s; \
                 give fewer beads, fewer --strikes, or a shorter time between strikes"
            );
        }
        let alone = [
            ("--listen", self.listen.is_some()),
            ("--faults", self.faults.is_some()),
            ("--stimulus", self.stimulus.is_some()),
            ("--settings", self.settings.is_some()),
        ];
        if let Some((option, _)) = alone.iter().find(|(_, given)| *given && self.one().is_none()) {
            bail!(Input, "{option} takes only one bead; give --bead one number");
        }
        if self.stimulus.is_none() {
            self.waveform.without("--stimulus")?;
        }
        if self.listen.is_none() && !tables.analog_wire.is_empty() {
            bail!(
                Input,
                "[[analog_wire]]: wires replace the sensors, so no strike is felt; give --listen ADDRESS too, or remove the wires \
                 from the scenario"
            );
        }
        if self.out.is_none() && !self.note.is_empty() {
            bail!(
                Input,
                "--note needs a recording, and none is written; give --out DIR too"
            );
        }
        Ok(())
    }

    /// The recording, and behind it a settings block for each bead, if they are wanted.
    fn outputs(&self, beads: &[usize]) -> Result<Option<Vec<Target>>, Failure> {
        let Some(out) = &self.out else { return Ok(None) };
        let inputs = [Some(&self.scenario), self.faults.as_ref(), self.stimulus.as_ref()];
        let inputs: Vec<&Path> = inputs.into_iter().flatten().map(PathBuf::as_path).collect();
        let recording = match self.one() {
            Some(bead) => format!("bead-{bead}.mcap"),
            None => "chain.mcap".to_owned(),
        };
        let block = |bead| (format!("bead-{bead}.settings"), FileKind::Settings);
        let settings = beads.iter().map(block);
        let files = iter::once((recording, FileKind::Recording)).chain(settings);
        place::targets(out, files, &inputs, self.overwrite).map(Some)
    }
}

/// The scenario with the striker's velocity that is asked for, the tables of the bench, and the text of both.
fn load(arguments: &Arguments) -> Result<(Scenario, BenchTables, String), Failure> {
    let (mut scenario, mut text) = load_scenario(&arguments.scenario)?;
    let file = arguments.scenario.display().to_string();
    let tables = BenchTables::from_toml(&text, &file)?;
    if let Some(velocity) = arguments.velocity {
        scenario.striker.velocity = velocity;
        let of_bench = BenchTables::text_in(&text, &file)?;
        text = format!("{}\n{}", scenario.to_toml(), of_bench.trim());
    }
    Ok((scenario, tables, text))
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let (scenario, tables, text) = load(arguments)?;
    let beads = match arguments.one() {
        Some(bead) => vec![bead],
        None => arguments.bead.of(&scenario)?,
    };
    arguments.check(&tables, beads.len())?;
    let outputs = arguments.outputs(&beads)?;
    // Before the work, which an unusable address would waste.
    let door = arguments.listen.as_ref().map(Door::open).transpose()?;
    let bench = BenchOfRun::of(arguments, &scenario, &tables, &beads)?;
    if let (Some(address), Some(door)) = (&arguments.listen, &door) {
        return listen(&bench, address, door);
    }
    let progress = &bench.progress;
    if let Some(port) = bench.gdb {
        progress.suspend(|| note!("the image waits for a debugger: target remote :{port}"));
    }
    let count = bench.placed.len();
    progress.set_message(match count {
        1 => "running the image in QEMU".to_owned(),
        _ => format!("running {count} beads in QEMU"),
    });
    let done = |done| progress.set_message(format!("{done} of {count} beads are done"));
    let ran = several::run(&bench.placed, |placed| bench.prepare(placed), done)?;
    progress.finish_and_clear();
    bench.print_remarks();

    // The result is printed even if the disk is full.
    let recorded = outputs.map(|outputs| record(arguments, &outputs, &text, &ran));
    let recording = recorded.as_ref().and_then(|recorded| recorded.as_ref().ok());
    let mut result = SeveralBeads { beads: Vec::new() };
    let mut failures = Vec::new();
    for (emulation, mut ran) in ran {
        let (truth, failure) = (&emulation.truth, ran.failure.take());
        let (bead, clock_ppm, began_s) = (truth.bead, truth.clock_ppm, truth.began);
        let report = RunReport::of(&emulation, ran, recording.cloned());
        // An image that failed explains whatever else is missing.
        let failure = failure.map_or_else(
            || report.verdict(arguments.strikes.count),
            |why| Err(anyhow::anyhow!(why)),
        );
        failures.extend(failure.err().map(|why| match arguments.one() {
            Some(_) => failure!(Verdict, "{why}"),
            None => failure!(Verdict, "bead {bead}: {why}"),
        }));
        result.beads.push(EmulatedBead {
            bead,
            clock_ppm,
            began_s,
            report,
        });
    }
    match (arguments.one(), &result.beads[..]) {
        (Some(_), [one]) => output::print(arguments.format, &one.report, || table(&one.report))?,
        (_, beads) => output::print(arguments.format, &result, || table_of_several(beads))?,
    }
    recorded.transpose()?;
    failures.into_iter().next().map_or(Ok(()), Err)
}

/// The result of several beads as JSON.
#[derive(Serialize, JsonSchema)]
pub(crate) struct SeveralBeads {
    beads: Vec<EmulatedBead>,
}

const WIDER_RANGES: &str =
    "write sensors = \"strong\" under [front_end] of the scenario, or give wider spans there";

fn listen(bench: &BenchOfRun<'_>, address: &Address, door: &Door) -> Result<(), Failure> {
    let emulation = bench.prepare(bench.placed[0])?;
    bench.progress.finish_and_clear();
    bench.print_remarks();
    let stop = interrupt::orderly("the socket may still exist; remove it".to_owned());
    let clock = &bench.tables.clock;
    let passes = match clock.pace {
        Some(factor) => format!("passes {factor} times as fast as this computer's"),
        None => "passes while a program is connected".to_owned(),
    };
    if let Some(port) = bench.gdb {
        note!("the image waits for a debugger: target remote :{port}");
    }
    if clock.sync_period.is_some() {
        note!("the bead's sync input gets edges for the first hour of its time");
    }
    let mut bridge = Bridge::new(&emulation, clock.pace.map(Pace::new))?;
    note!("a bead is at {address} until Ctrl-C; its time {passes}");
    Ok(bridge::serve(&mut bridge, door, &stop)?)
}

struct BenchOfRun<'a> {
    arguments: &'a Arguments,
    scenario: &'a Scenario,
    tables: &'a BenchTables,
    solution: Arc<Solution>,
    front_end: AnalogFrontEnd,
    image: PathBuf,
    placed: Vec<Placed>,
    faults: Vec<Planned>,
    wires: Vec<AnalogWire>,
    /// TCP port for a debugger.
    gdb: Option<u16>,
    /// Waveform in place of a strike of the chain.
    played: Option<Played>,
    progress: ProgressBar,
}

impl<'a> BenchOfRun<'a> {
    fn of(
        arguments: &'a Arguments,
        scenario: &'a Scenario,
        tables: &'a BenchTables,
        beads: &[usize],
    ) -> Result<Self, Failure> {
        let progress = output::spinner(format!("simulating {} beads", scenario.chain.beads));
        let (front_end, noise) = (tables.front_end.front_end()?, tables.front_end.has_noise());
        let faults = arguments.faults.as_deref().map_or(Ok(Vec::new()), faults::load)?;
        let (clocks, spread) = (tables.clock.crystals(), tables.clock.start_spread);
        let mut placed = several::placed(beads, &clocks, spread, arguments.seed, noise)?;
        if let ([one], Some(_)) = (&mut placed[..], arguments.one()) {
            (one.address, one.seed) = (0, noise.then_some(arguments.seed));
        }
        let stated = settings_file::uncertainty(arguments.uncertainty.as_deref())?;
        placed.iter_mut().for_each(|one| one.uncertainty = stated);
        if let Some(file) = &arguments.settings {
            let owners = settings_file::decoded(file)?;
            placed.iter_mut().for_each(|one| one.owners = Some(owners));
        }
        let mut played = Played::of(arguments, &front_end, beads)?;
        let image = find_image(arguments.firmware.as_deref())?;
        let solution = Arc::new(simulate_with_ring_down(scenario)?);
        for one in &placed {
            let bead = one.bead;
            bead_of(&solution, bead)?;
            let mut remarks = unlike_the_reduced_chain(&solution, bead).notes;
            if let Some(played) = &mut played {
                let settings = settings_of(&solution, *one, &front_end)?;
                let note = noise_triggers(&played.waveform, &settings);
                let name = &played.file.name;
                played.remarks.extend(note.map(|note| format!("{name}: {note}")));
            }
            // A waveform, or a bead that listens, is not held against the scenario.
            if played.is_none() && arguments.listen.is_none() {
                let window = settings_of(&solution, *one, &front_end)?.window;
                let chain = FullChain::of(scenario, &solution, bead)?;
                remarks.extend(other_length(scenario, &solution, &chain, bead, window));
            }
            progress.suspend(|| remarks.iter().for_each(|remark| note!("{remark}")));
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
            wires: tables.wires()?,
            gdb: debugger_port()?,
            played,
            progress,
        })
    }

    /// Prepares a bead's run: settings, stimulus, faults, clock and sync edges.
    fn prepare(&self, placed: Placed) -> Result<Emulation, BenchError> {
        let (arguments, clock) = (self.arguments, &self.tables.clock);
        let timing = Timing {
            lead_in: LEAD_IN + clock.start_spread,
            strikes: arguments.strikes.count,
            interval: arguments.strikes.interval,
        };
        let (solution, front_end, image) = (&self.solution, &self.front_end, &self.image);
        let mut emulation = match &self.played {
            None => Emulation::place(self.scenario, solution, placed, front_end, timing, image)?,
            Some(Played { waveform, file, .. }) => {
                let settings = settings_of(solution, placed, front_end)?;
                let truth = GivenEstimates::around_its_peak(waveform, &settings).truth();
                let waveform = waveform.clone();
                let mut emulation =
                    Emulation::play(solution, placed, front_end, timing, image, waveform, truth)?;
                emulation.truth.stimulus = Some(file.clone());
                emulation
            }
        };
        faults::check(&self.faults, emulation.seconds())?;
        emulation.faults.clone_from(&self.faults);
        emulation.shift = clock.shift;
        emulation.wires.clone_from(&self.wires);
        emulation.gdb = self.gdb;
        let of_several = arguments.one().is_none().then_some(SYNC_OF_SEVERAL);
        if let Some(period) = clock.sync_period.or(of_several) {
            let listens = arguments.listen.is_some();
            let until = if listens {
                SYNC_OF_LISTENING
            } else {
                emulation.seconds()
            };
            emulation.sync_until((1..).map(|number| f64::from(number) * period), until);
        }
        Ok(emulation)
    }

    fn print_remarks(&self) {
        for remark in self.played.iter().flat_map(|played| &played.remarks) {
            note!("{remark}");
        }
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
    fn of(
        arguments: &Arguments,
        front_end: &AnalogFrontEnd,
        beads: &[usize],
    ) -> Result<Option<Self>, Failure> {
        let Some(path) = &arguments.stimulus else {
            return Ok(None);
        };
        let shown = path.display();
        let mut waveform = arguments.waveform.read(path, beads.first().copied())?;
        let seconds = waveform.seconds();
        if seconds > LONGEST {
            bail!(
                Input,
                "{shown}: it is {seconds:.3e} s long, but a run lasts at most {LONGEST} s; cut the strike out of it"
            );
        }
        let mut remarks = std::mem::take(&mut waveform.remarks);
        let (force, acceleration) = (front_end.force.wide.range(), front_end.acceleration.wide.range());
        for (trace, name, si, (low, high)) in [
            (&waveform.force, "force", "N", force),
            (&waveform.acceleration, "acceleration", "m/s²", acceleration),
        ] {
            let Some(trace) = trace else {
                remarks.push(format!("it has no {name}, so the {name} sensor stays at rest"));
                continue;
            };
            let (lowest, (_, highest)) = (trace.lowest(), trace.highest());
            if lowest < low || highest > high {
                remarks.push(format!(
                    "its {name} goes from {lowest:.4} to {highest:.4} {si}, but the front end only from {low:.4} to {high:.4}, so \
                     codes stay at a rail; {WIDER_RANGES}"
                ));
            }
        }
        let file = StimulusFile {
            name: name_of(path),
            sha256: sha256_of(path)?,
            force: waveform.force.is_some(),
            acceleration: waveform.acceleration.is_some(),
        };
        let remarks = remarks
            .iter()
            .map(|remark| format!("{shown}: {remark}"))
            .collect();
        Ok(Some(Self {
            waveform,
            file,
            remarks,
        }))
    }
}

/// Writes everything that belongs to the run to one file, and the settings blocks beside it.
fn record(
    arguments: &Arguments,
    outputs: &[Target],
    scenario: &str,
    ran: &[(Emulation, Ran)],
) -> Result<PathBuf, Failure> {
    let recording = &outputs[0];
    if let Some(directory) = recording.path().parent() {
        place::make_directory(directory)?;
    }
    let mut notes = BTreeMap::from([("scenario".to_owned(), arguments.scenario.display().to_string())]);
    notes.extend(arguments.one().map(|bead| ("bead".to_owned(), bead.to_string())));
    let stimulus = arguments.stimulus.as_ref();
    notes.extend(stimulus.map(|stimulus| ("stimulus".to_owned(), stimulus.display().to_string())));
    let about = About {
        notes,
        remarks: Author::default().sign(arguments.note.clone()),
        ..About::default()
    };
    let written = recording::write(recording, ran, arguments.one().is_none(), scenario, about)?;
    for (target, (emulation, _)) in outputs[1..].iter().zip(ran) {
        let target = target.beside(recording.path(), &written);
        target.write_bytes(&emulation.block)?;
    }
    Ok(written)
}
