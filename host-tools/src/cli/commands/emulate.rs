//! `bead emulate`: the flash image in QEMU on what a bead would sense.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::ensure;
use bead_wire::Message;
use clap::Args;
use hertz_chain::Scenario;
use indicatif::ProgressBar;

use crate::bench::bridge::{self, Bridge};
use crate::bench::emulation::{Emulation, Ran};
use crate::bench::faults::{self, Planned};
use crate::bench::front_end::SAMPLE_RATE_HZ;
use crate::bench::sensed::{
    Timing, Truth, bead_of, load_scenario, simulate_with_ring_down, unlike_the_reduced_chain,
};
use crate::cli::bench_options::BenchOptions;
use crate::cli::failure::{Blame, Failure};
use crate::cli::front_end_options::FrontEndOptions;
use crate::cli::interrupt;
use crate::cli::output::{self, Format};
use crate::cli::place::{self, Force, Kind};
use crate::comparison::run::{MeasuredStrike, RunReport};
use crate::line::port::Address;
use crate::recording::file::{About, Part, Writer};
use crate::recording::whole::{Target, Unfinished};

const AFTER_HELP: &str = "\
The image is the file that is flashed to a board. It gets the bead's settings in its flash sector and codes at its
converter. What it sends is decoded, replayed and compared with the full f64 chain. --out leaves the recording
DIR/bead-N.mcap for `bead decode`, `bead replay` and `bead compare`, and the image's settings block DIR/bead-N.settings,
which can be flashed to a board of this calibration at 0x080A0000.

Exit status 1 if a frame is lost, a sample overruns, the image resets, a strike is not seen, or replay differs. With
--faults: if a fault is not reported, a fault is reported that was not provoked, a loss is not counted, or replay
differs.

Examples:
  bead emulate docs/scenarios/paper-strike.toml --bead 8 --out run
  bead emulate docs/scenarios/paper-strike.toml --bead 8 --noise off --format json
  bead emulate docs/scenarios/paper-strike.toml --bead 8 --strikes 5 --interval 0.05 --seed 7
  bead emulate docs/scenarios/paper-strike.toml --bead 8 --strikes 60 --faults docs/scenarios/faults.toml
  bead emulate docs/scenarios/ten-intruders.toml --bead 10 --sync-period 0.2 --clock-ppm -20 --out run
  bead emulate docs/scenarios/paper-strike.toml --bead 8 --listen unix:bead.sock
    and, meanwhile: bead command self-test --port unix:bead.sock";

/// Arguments of `bead emulate`.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    #[command(flatten)]
    bench: BenchOptions,
    /// Leave the recording and the settings block in this directory, which is made if it is missing.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
    /// Number of strikes.
    #[arg(long, value_name = "K", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    strikes: u32,
    /// Time from strike to strike, s.
    #[arg(long, value_name = "S", default_value_t = 0.1)]
    interval: f64,
    /// Time between edges at the sync input (PA15), s [default: no edges].
    #[arg(long, value_name = "S")]
    sync_period: Option<f64>,
    /// How fast the bead's crystal is, ppm; below 0 for a slow one.
    #[arg(long, value_name = "PPM", default_value = "0", allow_negative_numbers = true)]
    clock_ppm: f64,
    /// How long an instruction takes, as QEMU's -icount counts it: 2^N ns [default: 3, which is 8 ns].
    ///
    /// With 4 it is as slow as a core that waits for flash at every turn.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(0..=10))]
    shift: Option<u8>,
    /// Provoke the faults of this TOML file; docs/scenarios/faults.toml is one.
    #[arg(long, value_name = "F.toml")]
    faults: Option<PathBuf>,
    /// Do not run to an end, but be a bead at this address, unix:PATH or tcp:HOST:PORT, until Ctrl-C.
    #[arg(long, value_name = "ADDRESS", conflicts_with_all = ["out", "faults", "format"])]
    listen: Option<Address>,
    /// How to print the result.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
    #[command(flatten)]
    front_end: FrontEndOptions,
}

/// The bead reports edges that are more than 10 ms apart (`firmware/src/sync.rs`); the rest is for its own
/// delay.
const SYNC_LEAST: f64 = 0.02;
/// A run's last strike comes this long after its first at the latest, s: its codes are in memory, 0.8 MB a second.
const LONGEST: f64 = 1200.0;
/// Quiet before the first strike, s: the image has started, its detector is armed.
const LEAD_IN: f64 = 0.02;

impl Arguments {
    /// The recording and the settings block, if they are wanted.
    fn outputs(&self) -> Result<Option<[Target; 2]>, Failure> {
        let inputs = [Some(&self.bench.scenario), self.faults.as_ref()];
        let inputs: Vec<&Path> = inputs.into_iter().flatten().map(PathBuf::as_path).collect();
        let bead = self.bench.bead;
        let [recording, settings] = [format!("bead-{bead}.mcap"), format!("bead-{bead}.settings")];
        let files = [(&*recording, Kind::Recording), (&*settings, Kind::Settings)];
        let targets = |out: &PathBuf| place::targets(out, files, &inputs, self.force);
        self.out.as_ref().map(targets).transpose()
    }

    /// Refuses values that no run can have.
    fn check(&self) -> anyhow::Result<()> {
        let (interval, ppm) = (self.interval, self.clock_ppm);
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
        if let Some(period) = self.sync_period {
            ensure!(
                period >= SYNC_LEAST,
                "--sync-period {period}: give s, at least {SYNC_LEAST}"
            );
        }
        ensure!(
            ppm.abs() < 1000.0,
            "--clock-ppm {ppm}: a crystal is off by less than 1000 ppm"
        );
        Ok(())
    }
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    arguments.check().map_err(Failure::Input)?;
    let outputs = arguments.outputs()?;
    let (scenario, text) = load_scenario(&arguments.bench.scenario)?;
    let progress = output::spinner(format!("simulating {} beads", scenario.chain.beads));
    let emulation = prepare(arguments, &scenario, &progress)?;
    if let Some(address) = &arguments.listen {
        progress.finish_and_clear();
        let stop = interrupt::orderly("its socket may be left; remove it".to_owned());
        let ready = || {
            output::note(format_args!(
                "a bead is at {address} until Ctrl-C; its time passes while somebody is connected"
            ));
        };
        return Ok(bridge::serve(
            &mut Bridge::new(&emulation),
            address,
            ready,
            &stop,
        )?);
    }
    progress.set_message("running the image in QEMU");
    let ran = emulation.run()?;
    progress.finish_and_clear();

    // A disk that is full must not cost the result as well: it is printed all the same.
    let recorded = outputs.map(|outputs| record(arguments, &outputs, &text, &emulation, &ran));
    let recording = recorded.as_ref().and_then(|recorded| recorded.as_ref().ok());
    let report = RunReport::of(&emulation, ran, recording.cloned());
    output::print(arguments.format, &report, || table(&report))?;
    recorded.transpose()?;
    let verdict = report.verdict(arguments.strikes);
    verdict.map_err(|why| Failure::Verdict(why.to_string()))
}

/// Prepares the run: settings, stimulus, faults, clock and sync edges.
fn prepare(arguments: &Arguments, scenario: &Scenario, progress: &ProgressBar) -> Result<Emulation, Failure> {
    let front_end = arguments.front_end.front_end().map_err(Failure::Input)?;
    let faults = match &arguments.faults {
        Some(path) => faults::load(path)?,
        None => Vec::new(),
    };
    let image = arguments.bench.image()?;
    let bead = arguments.bench.bead;
    let solution = simulate_with_ring_down(scenario)?;
    bead_of(&solution, bead)?;
    if let Some(note) = unlike_the_reduced_chain(&solution, bead) {
        progress.suspend(|| output::note(format_args!("{note}")));
    }
    progress.set_message("digitising what the bead senses");
    let timing = Timing {
        lead_in: LEAD_IN,
        strikes: arguments.strikes,
        interval: arguments.interval,
    };
    let seed = arguments.front_end.seed();
    let mut emulation = Emulation::prepare(scenario, &solution, bead, &front_end, seed, timing, &image)?;
    let seconds = emulation.seconds();
    if let Some(late) = faults.iter().find(|fault| fault.at >= seconds) {
        return Err(Failure::input(format!(
            "--faults: {} at {} s comes after the end of the run at {seconds} s; make it earlier, or strike more often",
            late.kind.name(),
            late.at,
        )));
    }
    let untold = |fault: &&Planned| fault.cause().is_some() && fault.at + fault.told_after() > seconds;
    if let Some(early) = faults.iter().find(untold) {
        return Err(Failure::input(format!(
            "--faults: the run ends at {seconds} s, before the bead can tell of {} at {} s, which takes up to {} s; \
             give more --strikes or a longer --interval",
            early.kind.name(),
            early.at,
            early.told_after(),
        )));
    }
    emulation.faults = faults;
    emulation.shift = arguments.shift;
    if arguments.clock_ppm != 0.0 {
        emulation = emulation.with_clock(&solution, arguments.clock_ppm);
    }
    if let Some(period) = arguments.sync_period {
        let edges = (1..).map(|number| f64::from(number) * period);
        emulation.sync(edges.take_while(|edge| *edge < emulation.seconds()).collect());
    }
    Ok(emulation)
}

/// Writes everything that belongs to the run to one file.
fn record(
    arguments: &Arguments,
    [recording, settings]: &[Target; 2],
    scenario: &str,
    emulation: &Emulation,
    ran: &Ran,
) -> Result<PathBuf, Failure> {
    let path = recording.path();
    if let Some(directory) = path.parent() {
        place::make_directory(directory)?;
    }
    let firmware = ran.frames.iter().find_map(|frame| match &frame.message {
        Message::Identity(identity) => Some(format!("{} ({})", identity.firmware, identity.git)),
        _ => None,
    });
    let notes = [
        ("bead", arguments.bench.bead.to_string()),
        ("scenario", arguments.bench.scenario.display().to_string()),
    ];
    let about = About {
        source: "bead emulate".to_owned(),
        firmware,
        sample_rate_hz: SAMPLE_RATE_HZ,
        notes: notes.map(|(name, value)| (name.to_owned(), value)).into(),
    };
    let json = |part: Part, result: serde_json::Result<String>| {
        result.or_input(|| format!("cannot write {} of {}", part.name(), path.display()))
    };
    let truth = json(Part::Truth, serde_json::to_string_pretty(&emulation.truth))?;
    let report = json(Part::EmulatorReport, serde_json::to_string_pretty(&ran.report))?;
    let write = || {
        let mut writer = Writer::create(recording, &about)?;
        let partial = Remove(
            writer.partial_path().to_owned(),
            Unfinished::list(writer.partial_path()),
        );
        writer.attach(Part::Settings, &emulation.block)?;
        writer.attach(Part::Scenario, scenario.as_bytes())?;
        writer.attach(Part::Truth, truth.as_bytes())?;
        writer.attach(Part::EmulatorReport, report.as_bytes())?;
        ran.write(&mut writer, 0)?;
        let finished = writer.finish();
        drop(partial);
        finished
    };
    let written = write()?;
    settings.write_bytes(&emulation.block)?;
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

fn table(report: &RunReport) -> String {
    let mut parts = vec![strikes(report), counts(report)];
    if !report.provoked.is_empty() {
        parts.push(provoked(report));
    }
    if !report.faults.is_empty() {
        parts.push(reported(report));
    }
    parts.push(instructions(report));
    if !report.unknown_registers.is_empty() {
        let registers = report.unknown_registers.join(", ");
        parts.push(format!("registers without a model: {registers}"));
    }
    if let Some(recording) = &report.recording {
        parts.push(format!("recording: {}", recording.display()));
    }
    parts.join("\n\n")
}

const STRIKES: &str = "strike at sample | peak force (N) | truth | A measured (nJ) | B predicted (nJ) | truth \
                       | A off | B off | replay | flags";

fn strikes(report: &RunReport) -> String {
    let row = |strike: &MeasuredStrike| {
        let truth = |of: fn(&Truth) -> String| strike.truth.as_ref().map_or("echo".to_owned(), of);
        let off = |joule: f64| match strike.truth {
            Some(truth) => format!("{:+.3} %", (joule / truth.absorbed - 1.0) * 100.0),
            None => "-".to_owned(),
        };
        let flags = strike.flags.join(", ");
        [
            strike.sample_index.to_string(),
            format!("{:.4}", strike.peak_force),
            truth(|truth| format!("{:.4}", truth.peak_force)),
            format!("{:.2}", strike.absorbed_measured * 1e9),
            format!("{:.2}", strike.absorbed_predicted * 1e9),
            truth(|truth| format!("{:.2}", truth.absorbed * 1e9)),
            off(strike.absorbed_measured),
            off(strike.absorbed_predicted),
            output::either(strike.replay_identical, "identical", "differs"),
            output::either(flags.is_empty(), "-", &flags),
        ]
    };
    output::table(STRIKES, report.measured().map(row))
}

fn counts(report: &RunReport) -> String {
    let frames = &report.frames;
    let row = |name: &str, count: u64| [name.to_owned(), count.to_string()];
    let mut rows = vec![
        row("received", frames.received),
        row("lost", frames.lost),
        row("corrupt", frames.corrupt),
    ];
    for (cause, count) in &frames.dropped_by_cause {
        let cause = cause.replace('_', " ");
        rows.push(row(&format!("dropped by the bead, {cause}"), *count));
    }
    rows.extend([
        row("strikes passed over", report.strikes_passed_over),
        row("gaps in the samples", report.gaps.len() as u64),
        row("overruns", report.overruns),
        row("resets", report.resets as u64),
    ]);
    output::table("frames |", rows)
}

fn provoked(report: &RunReport) -> String {
    let rows = report.provoked.iter().map(|provoked| {
        let reported = output::either(provoked.reported, "yes", "no");
        [
            provoked.fault.kind.name().to_owned(),
            provoked.fault.at.to_string(),
            provoked.cause.map_or("-".to_owned(), |cause| cause.to_string()),
            provoked.cause.map_or("-".to_owned(), |_| reported),
        ]
    });
    output::table("provoked | at (s) | to be reported as | reported", rows)
}

fn reported(report: &RunReport) -> String {
    let rows = report.faults.iter().map(|fault| {
        [
            fault.cause.to_string(),
            fault.sample_index.to_string(),
            fault.boot.to_string(),
            fault.detail.clone(),
        ]
    });
    output::table("the bead reported | at sample | of boot | detail", rows)
}

fn instructions(report: &RunReport) -> String {
    let rows = report.instructions_per_sample.rows().map(|(name, count)| {
        let part = |count: f64| format!("{:.1} %", count / report.instructions_available * 100.0);
        let [count, part] = match count {
            Some(count) => [format!("{count:.1}"), part(count)],
            None => ["-", "-"].map(str::to_owned),
        };
        [name.to_owned(), count, part]
    });
    output::table("instructions a sample | | of those that fit", rows)
}
