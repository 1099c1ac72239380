//! `bead emulate`: the flash image in QEMU on what a bead would sense.

use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use bead_wire::{FORCE_UNIT_N, FaultCause, Status};
use clap::Args;
use serde::Serialize;
use serde_json::Value;

use crate::bench::bridge::{self, Bridge};
use crate::bench::emulation::{Emulation, EmulatorReport, InstructionsPerSample, Ran, find_image};
use crate::bench::faults::{self, Planned};
use crate::bench::front_end::SAMPLE_RATE_HZ;
use crate::bench::sensed::{
    Timing, Truth, bead_of, load_scenario, simulate_with_ring_down, unlike_the_reduced_chain,
};
use crate::cli::failure::{Blame, Failure};
use crate::cli::front_end_options::FrontEndOptions;
use crate::cli::output::{self, Format};
use crate::comparison::replay::replay;
use crate::line::port::Address;
use crate::recording::file::{About, Part, Writer};
use crate::recording::frames::{self, Frame, Message, flag_names, joules};
use crate::recording::strikes::assemble;

const AFTER_HELP: &str = "\
The image is the very file that is flashed to a board. It gets the bead's settings in its flash sector and codes at
its converter; what it sends is decoded, replayed and held against the full f64 chain. With --out the recording
DIR/bead-N.mcap is left for `bead decode`, `bead replay` and `bead compare`, and the settings block that the image
was given as DIR/bead-N.settings, to be flashed to a board of this calibration at 0x080A0000.

Exit status 1 if a frame is lost, a sample overruns, the image resets, a strike is not seen, or replay differs. With
--faults: if a fault is not reported, one is reported that was not provoked, something is lost that is not counted, or
replay differs.

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
    /// The scenario, a TOML file in SI units.
    scenario: PathBuf,
    /// The bead that senses: one with an intruder.
    #[arg(long, value_name = "N")]
    bead: usize,
    /// The flash image [default: as `cargo xtask build` leaves it].
    #[arg(long, value_name = "ELF")]
    firmware: Option<PathBuf>,
    /// Leave the recording and the settings block in this directory, which is made if need be.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// How often the chain is struck.
    #[arg(long, value_name = "K", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    strikes: u32,
    /// Time from strike to strike, s.
    #[arg(long, value_name = "S", default_value_t = 0.1)]
    interval: f64,
    /// Give an edge at the sync input (PA15) every so many s.
    #[arg(long, value_name = "S")]
    sync_period: Option<f64>,
    /// The bead's crystal is fast by so many ppm, below 0 slow.
    #[arg(
        long,
        value_name = "PPM",
        default_value_t = 0.0,
        allow_negative_numbers = true
    )]
    clock_ppm: f64,
    /// Provoke the faults of this TOML file; docs/scenarios/faults.toml is one.
    #[arg(long, value_name = "F.toml")]
    faults: Option<PathBuf>,
    /// Do not run to an end: be a bead at this address, unix:PATH or tcp:HOST:PORT, until Ctrl-C.
    #[arg(long, value_name = "ADDRESS", conflicts_with_all = ["out", "faults", "format"])]
    listen: Option<Address>,
    /// How to print the result.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
    #[command(flatten)]
    front_end: FrontEndOptions,
}

/// The bead tells edges that are farther apart than 10 ms (`firmware/src/sync.rs`), and some for its own delay.
const SYNC_LEAST: f64 = 0.02;
/// Quiet before the first strike, s: the image has started, its detector is armed.
const LEAD_IN: f64 = 0.02;

#[derive(Debug, Serialize)]
struct Report {
    frames: Frames,
    overruns: u64,
    resets: usize,
    strikes: Vec<Strike>,
    /// Weaker waves of a strike that came when its window was over, and were measured as well: beads that meet again.
    echoes: Vec<Strike>,
    provoked: Vec<Provoked>,
    faults: Vec<Told>,
    health: Option<Value>,
    instructions_per_sample: InstructionsPerSample,
    instructions_available: f64,
    saturated: [usize; 2],
    unknown_registers: Vec<String>,
    recording: Option<PathBuf>,
}

/// A fault of the file, and whether the bead told of it.
#[derive(Debug, Serialize)]
struct Provoked {
    #[serde(flatten)]
    fault: Planned,
    /// What the bead is to report; none if it is to notice nothing.
    cause: Option<FaultCause>,
    reported: bool,
}

/// A fault that the bead told of.
#[derive(Debug, Serialize)]
struct Told {
    sample_index: u64,
    cause: FaultCause,
    boot: u32,
    detail: String,
}

#[derive(Debug, Serialize)]
struct Frames {
    received: u64,
    lost: u64,
    corrupt: u64,
    dropped_by_cause: BTreeMap<&'static str, u64>,
}

#[derive(Debug, Serialize)]
struct Strike {
    sample_index: u64,
    peak_force: f64,
    absorbed_measured: f64,
    absorbed_predicted: f64,
    flags: Vec<&'static str>,
    /// Of the strike; none of an echo.
    #[serde(skip_serializing_if = "Option::is_none")]
    truth: Option<Truth>,
    replay_identical: bool,
    #[serde(skip)]
    first_difference: Option<String>,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    if !(arguments.interval.is_finite() && arguments.interval > 0.0) {
        return Err(Failure::input(format!(
            "--interval {}: give a time in s",
            arguments.interval
        )));
    }
    if let Some(period) = arguments
        .sync_period
        .filter(|period| period.is_nan() || *period < SYNC_LEAST)
    {
        return Err(Failure::input(format!(
            "--sync-period {period}: give s, at least {SYNC_LEAST}"
        )));
    }
    if arguments.clock_ppm.is_nan() || arguments.clock_ppm.abs() >= 1000.0 {
        return Err(Failure::input(format!(
            "--clock-ppm {}: a crystal is off by less than 1000 ppm",
            arguments.clock_ppm
        )));
    }
    let front_end = arguments.front_end.front_end()?;
    let (scenario, text) = load_scenario(&arguments.scenario)?;
    let faults = match &arguments.faults {
        Some(path) => faults::load(path)?,
        None => Vec::new(),
    };
    let image = find_image(arguments.firmware.as_deref())?;
    if let Some(out) = arguments
        .out
        .as_deref()
        .filter(|out| out.exists() && !out.is_dir())
    {
        return Err(Failure::input(format!(
            "--out {} is a file; give a directory",
            out.display()
        )));
    }

    let progress = output::spinner(format!("simulating {} beads", scenario.chain.beads));
    let solution = simulate_with_ring_down(&scenario)?;
    bead_of(&solution, arguments.bead)?;
    if let Some(note) = unlike_the_reduced_chain(&solution, arguments.bead) {
        progress.suspend(|| eprintln!("bead: {note}"));
    }
    progress.set_message("digitising what the bead senses");
    let timing = Timing {
        lead_in: LEAD_IN,
        strikes: arguments.strikes,
        interval: arguments.interval,
    };
    let seed = arguments.front_end.seed();
    let mut emulation = Emulation::prepare(
        &scenario,
        &solution,
        arguments.bead,
        &front_end,
        seed,
        timing,
        &image,
    )?;
    if let Some(late) = faults.iter().find(|fault| fault.at >= emulation.seconds()) {
        return Err(Failure::input(format!(
            "--faults: {} at {} s comes after the end of the run at {} s; make it earlier, or strike more often",
            late.kind.name(),
            late.at,
            emulation.seconds()
        )));
    }
    if let Some(address) = &arguments.listen {
        progress.finish_and_clear();
        let stop = output::stop_at_signals().or_input(|| "cannot listen for Ctrl-C")?;
        eprintln!("bead: a bead is at {address} until Ctrl-C; its time passes while somebody is connected");
        return bridge::serve(&mut Bridge::new(&emulation), address, &stop);
    }
    emulation.faults = faults;
    if arguments.clock_ppm != 0.0 {
        emulation = emulation.with_clock(&solution, arguments.clock_ppm);
    }
    if let Some(period) = arguments.sync_period {
        let edges = (1..).map(|number| f64::from(number) * period);
        let seconds = emulation.seconds();
        emulation.sync(edges.take_while(|edge| *edge < seconds).collect());
    }
    progress.set_message("running the image in QEMU");
    let ran = emulation.timed()?;
    progress.finish_and_clear();

    let recording = match &arguments.out {
        Some(out) => Some(record(arguments, out, &text, &emulation, &ran)?),
        None => None,
    };
    let report = report(&emulation, &ran.stream, &ran.report, recording);
    match arguments.format {
        Format::Json => output::print_json(&report)?,
        Format::Table => output::print_line(&table(&report))?,
    }
    verdict(&report, arguments.strikes)
}

/// Leaves everything that belongs to the run in one file.
fn record(
    arguments: &Arguments,
    out: &Path,
    scenario: &str,
    emulation: &Emulation,
    ran: &Ran,
) -> Result<PathBuf, Failure> {
    fs::create_dir_all(out)
        .or_input(|| format!("cannot make the directory {}; give --out another", out.display()))?;
    let path = out.join(format!("bead-{}.mcap", arguments.bead));
    let (frames, _) = frames::decode(&ran.stream);
    let firmware = frames.iter().find_map(|frame| match &frame.message {
        Message::Identity(identity) => Some(format!("{} ({})", identity.firmware, identity.git)),
        _ => None,
    });
    let about = About {
        source: "bead emulate".to_owned(),
        firmware,
        sample_rate_hz: SAMPLE_RATE_HZ,
        notes: BTreeMap::from([
            ("bead".to_owned(), arguments.bead.to_string()),
            ("scenario".to_owned(), arguments.scenario.display().to_string()),
        ]),
    };
    let json = |part: Part, result: serde_json::Result<String>| {
        result.or_input(|| format!("cannot write {} of {}", part.name(), path.display()))
    };
    let truth = json(Part::Truth, serde_json::to_string_pretty(&emulation.truth))?;
    let report = json(Part::EmulatorReport, serde_json::to_string_pretty(&ran.report))?;
    let write = || {
        let mut writer = Writer::create(&path, &about)?;
        writer.attach(Part::Settings, &emulation.block)?;
        writer.attach(Part::Scenario, scenario.as_bytes())?;
        writer.attach(Part::Truth, truth.as_bytes())?;
        writer.attach(Part::EmulatorReport, report.as_bytes())?;
        ran.write(&mut writer, 0)?;
        writer.finish()
    };
    write().map_err(Failure::input)?;
    let settings = out.join(format!("bead-{}.settings", arguments.bead));
    output::write_whole(&settings, |file| Ok(file.write_all(&emulation.block)?))?;
    Ok(path)
}

fn report(
    emulation: &Emulation,
    stream: &[u8],
    measured: &EmulatorReport,
    recording: Option<PathBuf>,
) -> Report {
    let (frames, counters) = frames::decode(stream);
    let statuses = last_statuses(&frames);
    let counted =
        |count: &dyn Fn(&Status) -> u32| statuses.iter().map(|status| u64::from(count(status))).sum();
    let mut struck = None;
    let mut echoes = Vec::new();
    let mut strikes = Vec::new();
    for strike in assemble(&frames, Some(&emulation.settings)) {
        let begun = emulation
            .truth
            .starts
            .iter()
            .rposition(|&start| start <= strike.said.trigger_index as f64);
        // After a reset the indices begin anew and do not tell which strike it was.
        let is_echo = measured.resets == 0 && begun.is_some() && begun == struck;
        struck = begun;
        let replay = replay(&strike);
        let list = if is_echo { &mut echoes } else { &mut strikes };
        list.push(Strike {
            sample_index: strike.said.trigger_index,
            peak_force: f64::from(strike.said.peak_force) * FORCE_UNIT_N,
            absorbed_measured: joules(strike.said.absorbed_measured),
            absorbed_predicted: joules(strike.said.absorbed_predicted),
            flags: flag_names(strike.said.flags),
            truth: (!is_echo).then_some(emulation.truth.truth),
            replay_identical: replay.identical(),
            first_difference: replay.first_difference,
        });
    }
    let told = told(&frames);
    Report {
        frames: Frames {
            received: counters.frames,
            lost: counters.lost,
            corrupt: counters.rejected.total(),
            dropped_by_cause: BTreeMap::from([
                ("queue_full", counted(&|status| status.frames_dropped_queue_full)),
                ("too_long", counted(&|status| status.frames_dropped_too_long)),
            ]),
        },
        // What the bead noticed and what the converter saw must be the same.
        overruns: measured.overruns.max(counted(&|status| status.overruns)),
        resets: measured.resets,
        strikes,
        echoes,
        provoked: answered(&emulation.faults, &told),
        faults: told,
        health: frames
            .iter()
            .rev()
            .find(|frame| matches!(frame.message, Message::Health(_)))
            .map(Frame::body),
        instructions_per_sample: measured.instructions_per_sample,
        instructions_available: measured.instructions_available,
        saturated: measured.saturated,
        unknown_registers: measured.unknown_registers.clone(),
        recording,
    }
}

/// The last status of every boot: its counts are since the reset. Power-up counts boots anew, but time too.
fn last_statuses(frames: &[Frame]) -> Vec<Status> {
    let mut last: Vec<(u8, Status)> = Vec::new();
    for frame in frames {
        let Message::Status(status) = frame.message else {
            continue;
        };
        let same_boot = |(boot, before): &&mut (u8, Status)| {
            *boot == frame.header.boot && before.uptime_ms <= status.uptime_ms
        };
        match last.last_mut().filter(same_boot) {
            Some((_, before)) => *before = status,
            None => last.push((frame.header.boot, status)),
        }
    }
    last.into_iter().map(|(_, status)| status).collect()
}

fn told(frames: &[Frame]) -> Vec<Told> {
    let faults = frames.iter().filter_map(|frame| match &frame.message {
        Message::Fault(fault) => Some(Told {
            sample_index: frame.header.sample_index,
            cause: fault.cause,
            boot: fault.boot,
            detail: fault.detail.clone(),
        }),
        _ => None,
    });
    faults.collect()
}

/// Which faults of the file the bead told of: the first of a cause answers the first that was to have it.
fn answered(planned: &[Planned], told: &[Told]) -> Vec<Provoked> {
    let mut in_time: Vec<&Planned> = planned.iter().collect();
    in_time.sort_by(|a, b| a.at.total_cmp(&b.at));
    let mut open: Vec<FaultCause> = told.iter().map(|fault| fault.cause).collect();
    let mut answer = |fault: &&Planned| {
        let cause = fault.cause();
        let at = open.iter().position(|told| Some(*told) == cause);
        Provoked {
            fault: **fault,
            cause,
            reported: at.map(|at| open.remove(at)).is_some(),
        }
    };
    in_time.iter().map(&mut answer).collect()
}

fn verdict(report: &Report, struck: u32) -> Result<(), Failure> {
    let Frames { lost, corrupt, .. } = report.frames;
    let no = |what: String| Err(Failure::Verdict(what));
    if let Some(what) = report
        .strikes
        .iter()
        .chain(&report.echoes)
        .find_map(|strike| strike.first_difference.as_ref())
    {
        return no(format!("replay differs: {what}"));
    }
    if !report.provoked.is_empty() {
        return verdict_on_faults(report, struck);
    }
    if lost + corrupt > 0 {
        return no(format!(
            "{lost} frames were lost and {corrupt} corrupt; see `bead decode` of the recording"
        ));
    }
    if report.overruns > 0 {
        return no(format!(
            "{} overruns: the image is too slow for its sample rate",
            report.overruns
        ));
    }
    if report.resets > 0 {
        return no(format!(
            "the image reset {} times; its fault frames say why",
            report.resets
        ));
    }
    if report.strikes.len() != struck as usize {
        return no(format!(
            "{} of {struck} strikes were seen; strikes closer than a window, or below the trigger, are not",
            report.strikes.len()
        ));
    }
    Ok(())
}

/// With faults: each is told, none is made up, and all that was lost is counted.
fn verdict_on_faults(report: &Report, struck: u32) -> Result<(), Failure> {
    let no = |what: String| Err(Failure::Verdict(what));
    if let Some(silent) = report
        .provoked
        .iter()
        .find(|fault| fault.cause.is_some() && !fault.reported)
    {
        return no(format!(
            "{} at {} s was not reported",
            silent.fault.kind.name(),
            silent.fault.at
        ));
    }
    let reported = report.provoked.iter().filter(|fault| fault.reported).count();
    // What follows from a fault: a strike that it cut, and the end of a condition.
    let follows = |told: &&Told| matches!(told.cause, FaultCause::StrikeCut | FaultCause::Recovered);
    let told = report.faults.len() - report.faults.iter().filter(follows).count();
    if told != reported {
        return no(format!(
            "{told} faults were reported where {reported} were provoked"
        ));
    }
    let resets = report
        .provoked
        .iter()
        .filter(|fault| fault.fault.resets())
        .count();
    if report.resets != resets {
        return no(format!(
            "the image reset {} times where {resets} faults end in a reset",
            report.resets
        ));
    }
    // A converter whose DMA stream stopped overruns as well.
    let overruns = report
        .faults
        .iter()
        .filter(|told| matches!(told.cause, FaultCause::AdcOverrun | FaultCause::DmaError))
        .count();
    if overruns as u64 != report.overruns {
        return no(format!(
            "{} overruns where {overruns} follow from what was reported",
            report.overruns
        ));
    }
    let Frames {
        lost,
        corrupt,
        dropped_by_cause,
        ..
    } = &report.frames;
    let dropped: u64 = dropped_by_cause.values().sum();
    // A reset cuts the frame that is being sent, and takes what waits with it.
    if *lost != dropped || *corrupt > resets as u64 {
        return no(format!(
            "{lost} frames were lost and {corrupt} corrupt where the bead dropped {dropped} and {resets} resets cut one each at most"
        ));
    }
    let cut = report
        .faults
        .iter()
        .filter(|told| told.cause == FaultCause::StrikeCut);
    let known = report.strikes.len() + cut.count();
    if resets == 0 && known < struck as usize {
        return no(format!(
            "{known} of {struck} strikes were measured or reported as cut"
        ));
    }
    Ok(())
}

fn table(report: &Report) -> String {
    let mut parts = Vec::new();
    let mut strikes = output::table([
        "strike at sample",
        "peak force (N)",
        "truth",
        "A measured (nJ)",
        "B predicted (nJ)",
        "truth",
        "A off",
        "B off",
        "replay",
        "flags",
    ]);
    let both = report.strikes.iter().chain(&report.echoes);
    for strike in both {
        let true_one = |of: fn(&Truth) -> String| strike.truth.as_ref().map_or("echo".to_owned(), of);
        let off = |joule: f64| match strike.truth {
            Some(truth) => format!("{:+.3} %", (joule / truth.absorbed - 1.0) * 100.0),
            None => "-".to_owned(),
        };
        strikes.add_row([
            strike.sample_index.to_string(),
            format!("{:.4}", strike.peak_force),
            true_one(|truth| format!("{:.4}", truth.peak_force)),
            format!("{:.2}", strike.absorbed_measured * 1e9),
            format!("{:.2}", strike.absorbed_predicted * 1e9),
            true_one(|truth| format!("{:.2}", truth.absorbed * 1e9)),
            off(strike.absorbed_measured),
            off(strike.absorbed_predicted),
            (if strike.replay_identical {
                "identical"
            } else {
                "differs"
            })
            .to_owned(),
            if strike.flags.is_empty() {
                "-".to_owned()
            } else {
                strike.flags.join(", ")
            },
        ]);
    }
    parts.push(output::table_text(&strikes));

    let mut counts = output::table(["frames", ""]);
    let Frames {
        received,
        lost,
        corrupt,
        dropped_by_cause,
    } = &report.frames;
    let dropped = dropped_by_cause.iter().map(|(cause, count)| {
        (
            format!("dropped by the bead, {}", cause.replace('_', " ")),
            *count,
        )
    });
    let rows = [("received", *received), ("lost", *lost), ("corrupt", *corrupt)];
    let rows = rows
        .into_iter()
        .map(|(name, count)| (name.to_owned(), count))
        .chain(dropped)
        .chain([
            ("overruns".to_owned(), report.overruns),
            ("resets".to_owned(), report.resets as u64),
        ]);
    for (name, count) in rows {
        counts.add_row([name, count.to_string()]);
    }
    parts.push(output::table_text(&counts));

    if !report.provoked.is_empty() {
        let mut provoked = output::table(["provoked", "at (s)", "to be reported as", "reported"]);
        for Provoked {
            fault,
            cause,
            reported,
        } in &report.provoked
        {
            provoked.add_row([
                fault.kind.name().to_owned(),
                fault.at.to_string(),
                cause.map_or("-", FaultCause::name).to_owned(),
                match (cause, reported) {
                    (None, _) => "-",
                    (_, true) => "yes",
                    (_, false) => "no",
                }
                .to_owned(),
            ]);
        }
        parts.push(output::table_text(&provoked));
    }
    if !report.faults.is_empty() {
        let mut told = output::table(["the bead reported", "at sample", "of boot", "detail"]);
        for fault in &report.faults {
            told.add_row([
                fault.cause.name().to_owned(),
                fault.sample_index.to_string(),
                fault.boot.to_string(),
                fault.detail.clone(),
            ]);
        }
        parts.push(output::table_text(&told));
    }

    let per_sample = report.instructions_per_sample;
    let mut instructions = output::table(["instructions a sample", "", "of those that fit"]);
    for (name, count) in [
        ("estimate A, observer", per_sample.observer),
        ("estimate B, reduced chain", per_sample.reduced_chain),
        ("calibration, peaks, chunks of a window", per_sample.window),
        ("frames, by sample of a window", per_sample.framing),
        ("trigger", per_sample.trigger),
        ("all, while a strike is measured", per_sample.total),
        ("all, in the busiest block", per_sample.worst_block),
        ("all, while none is", per_sample.idle),
        ("all, over the run", Some(per_sample.run)),
    ] {
        let cells = count.map(|count| {
            [
                format!("{count:.1}"),
                format!("{:.1} %", count / report.instructions_available * 100.0),
            ]
        });
        let [count, part] = cells.unwrap_or_else(|| ["-".to_owned(), "-".to_owned()]);
        instructions.add_row([name.to_owned(), count, part]);
    }
    parts.push(output::table_text(&instructions));

    if !report.unknown_registers.is_empty() {
        parts.push(format!(
            "registers without a model: {}",
            report.unknown_registers.join(", ")
        ));
    }
    if let Some(recording) = &report.recording {
        parts.push(format!("recording: {}", recording.display()));
    }
    parts.join("\n\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn the_json_has_the_keys_of_the_contract() {
        let report = Report {
            frames: Frames {
                received: 27,
                lost: 0,
                corrupt: 0,
                dropped_by_cause: BTreeMap::from([("queue_full", 0)]),
            },
            overruns: 0,
            resets: 0,
            echoes: Vec::new(),
            provoked: Vec::new(),
            faults: Vec::new(),
            health: None,
            strikes: vec![Strike {
                sample_index: 2144,
                peak_force: 6.0,
                absorbed_measured: 8e-7,
                absorbed_predicted: 8e-7,
                flags: vec!["force_railed"],
                truth: Some(Truth {
                    peak_force: 6.0,
                    absorbed: 8e-7,
                }),
                replay_identical: true,
                first_difference: None,
            }],
            instructions_per_sample: InstructionsPerSample {
                observer: Some(1.0),
                reduced_chain: Some(2.0),
                window: Some(6.0),
                framing: Some(7.0),
                trigger: Some(8.0),
                total: Some(3.0),
                worst_block: Some(4.0),
                idle: Some(9.0),
                run: 5.0,
            },
            instructions_available: 1250.0,
            saturated: [0, 0],
            unknown_registers: Vec::new(),
            recording: None,
        };
        let printed = serde_json::to_value(&report).unwrap();
        let contract = json!({
            "frames": {"received": 27, "lost": 0, "corrupt": 0, "dropped_by_cause": {"queue_full": 0}},
            "overruns": 0,
            "resets": 0,
            "strikes": [{
                "sample_index": 2144,
                "peak_force": 6.0,
                "absorbed_measured": 8e-7,
                "absorbed_predicted": 8e-7,
                "flags": ["force_railed"],
                "truth": {"peak_force": 6.0, "absorbed": 8e-7},
                "replay_identical": true,
            }],
            "instructions_per_sample":
                {"observer": 1.0, "reduced_chain": 2.0, "window": 6.0, "framing": 7.0, "trigger": 8.0,
                 "total": 3.0, "worst_block": 4.0, "idle": 9.0, "run": 5.0},
        });
        for (key, value) in contract.as_object().unwrap() {
            assert_eq!(&printed[key], value, "{key}");
        }
    }

    #[test]
    fn what_a_check_says_no_to_is_the_gravest() {
        let strike = |first_difference: Option<&str>| Strike {
            sample_index: 0,
            peak_force: 0.0,
            absorbed_measured: 0.0,
            absorbed_predicted: 0.0,
            flags: Vec::new(),
            truth: None,
            replay_identical: first_difference.is_none(),
            first_difference: first_difference.map(str::to_owned),
        };
        let report = |lost, overruns, resets, strikes| Report {
            frames: Frames {
                received: 9,
                lost,
                corrupt: 0,
                dropped_by_cause: BTreeMap::new(),
            },
            overruns,
            resets,
            strikes,
            echoes: Vec::new(),
            provoked: Vec::new(),
            faults: Vec::new(),
            health: None,
            instructions_per_sample: InstructionsPerSample {
                observer: None,
                reduced_chain: None,
                window: None,
                framing: None,
                trigger: None,
                total: None,
                worst_block: None,
                idle: None,
                run: 0.0,
            },
            instructions_available: 1250.0,
            saturated: [0, 0],
            unknown_registers: Vec::new(),
            recording: None,
        };
        let says = |report: Report| match verdict(&report, 1) {
            Ok(()) => "passed".to_owned(),
            Err(failure) => {
                assert_eq!(failure.exit_status(), 1);
                failure.to_string()
            }
        };
        assert_eq!(says(report(0, 0, 0, vec![strike(None)])), "passed");
        assert!(says(report(1, 2, 3, vec![strike(Some("strike 0: x"))])).starts_with("replay differs"));
        assert!(says(report(1, 2, 3, vec![strike(None)])).starts_with("1 frames were lost"));
        assert!(says(report(0, 2, 3, vec![strike(None)])).starts_with("2 overruns"));
        assert!(says(report(0, 0, 3, vec![strike(None)])).starts_with("the image reset 3 times"));
        assert!(says(report(0, 0, 0, Vec::new())).starts_with("0 of 1 strikes"));
    }
}
