//! `bead emulate`: the flash image in QEMU on what a bead would sense.

use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use bead_wire::FORCE_UNIT_N;
use clap::Args;
use serde::Serialize;

use crate::emulation::{Emulation, EmulatorReport, InstructionsPerSample, find_image};
use crate::failure::{Blame, Failure};
use crate::frames::{self, Frame, Message, flag_names, joules};
use crate::front_end::SAMPLE_RATE_HZ;
use crate::front_end_options::FrontEndOptions;
use crate::output::{self, Format};
use crate::recording::{About, Part, Writer};
use crate::replay::replay;
use crate::sensed::{
    Timing, Truth, bead_of, load_scenario, simulate_with_ring_down, unlike_the_reduced_chain,
};
use crate::strikes::assemble;

const AFTER_HELP: &str = "\
The image is the very file that is flashed to a board. It gets the bead's settings in its flash sector and codes at
its converter; what it sends is decoded, replayed and held against the full f64 chain. With --out the recording
DIR/bead-N.mcap is left for `bead decode`, `bead replay` and `bead compare`, and the settings block that the image
was given as DIR/bead-N.settings, to be flashed to a board of this calibration at 0x080E0000.

Exit status 1 if a frame is lost, a sample overruns, the image resets, a strike is not seen, or replay differs.

Examples:
  bead emulate docs/scenarios/paper-strike.toml --bead 8 --out run
  bead emulate docs/scenarios/paper-strike.toml --bead 8 --noise off --format json
  bead emulate docs/scenarios/paper-strike.toml --bead 8 --strikes 5 --interval 0.05 --seed 7";

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
    /// How to print the result.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
    #[command(flatten)]
    front_end: FrontEndOptions,
}

/// Quiet before the first strike, s: the image has started, its detector is armed.
const LEAD_IN: f64 = 0.02;

#[derive(Debug, Serialize)]
struct Report {
    frames: Frames,
    overruns: u64,
    resets: usize,
    strikes: Vec<Strike>,
    instructions_per_sample: InstructionsPerSample,
    instructions_available: f64,
    saturated: [usize; 2],
    unknown_registers: Vec<String>,
    recording: Option<PathBuf>,
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
    truth: Truth,
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
    let front_end = arguments.front_end.front_end()?;
    let (scenario, text) = load_scenario(&arguments.scenario)?;
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
    let emulation = Emulation::prepare(
        &scenario,
        &solution,
        arguments.bead,
        &front_end,
        seed,
        timing,
        &image,
    )?;
    progress.set_message("running the image in QEMU");
    let (stream, measured) = emulation.run()?;
    progress.finish_and_clear();

    let recording = match &arguments.out {
        Some(out) => Some(record(arguments, out, &text, &emulation, &stream, &measured)?),
        None => None,
    };
    let report = report(&emulation, &stream, &measured, recording);
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
    stream: &[u8],
    measured: &EmulatorReport,
) -> Result<PathBuf, Failure> {
    fs::create_dir_all(out)
        .or_input(|| format!("cannot make the directory {}; give --out another", out.display()))?;
    let path = out.join(format!("bead-{}.mcap", arguments.bead));
    let (frames, _) = frames::decode(stream);
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
    let report = json(Part::EmulatorReport, serde_json::to_string_pretty(measured))?;
    let write = || {
        let mut writer = Writer::create(&path, &about)?;
        writer.attach(Part::Settings, &emulation.block)?;
        writer.attach(Part::Scenario, scenario.as_bytes())?;
        writer.attach(Part::Truth, truth.as_bytes())?;
        writer.attach(Part::EmulatorReport, report.as_bytes())?;
        writer.write(stream)?;
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
    let status = last_status(&frames);
    let strikes = assemble(&frames, Some(&emulation.settings))
        .iter()
        .map(|strike| {
            let replay = replay(strike);
            Strike {
                sample_index: strike.said.trigger_index,
                peak_force: f64::from(strike.said.peak_force) * FORCE_UNIT_N,
                absorbed_measured: joules(strike.said.absorbed_measured),
                absorbed_predicted: joules(strike.said.absorbed_predicted),
                flags: flag_names(strike.said.flags),
                truth: emulation.truth.truth,
                replay_identical: replay.identical(),
                first_difference: replay.first_difference,
            }
        })
        .collect();
    Report {
        frames: Frames {
            received: counters.frames,
            lost: counters.lost,
            corrupt: counters.rejected.total(),
            dropped_by_cause: BTreeMap::from([
                (
                    "queue_full",
                    status.map_or(0, |status| status.frames_dropped_queue_full.into()),
                ),
                (
                    "too_long",
                    status.map_or(0, |status| status.frames_dropped_too_long.into()),
                ),
            ]),
        },
        // What the bead noticed and what the converter saw must be the same.
        overruns: measured
            .overruns
            .max(status.map_or(0, |status| status.overruns.into())),
        resets: measured.resets,
        strikes,
        instructions_per_sample: measured.instructions_per_sample,
        instructions_available: measured.instructions_available,
        saturated: measured.saturated,
        unknown_registers: measured.unknown_registers.clone(),
        recording,
    }
}

fn last_status(frames: &[Frame]) -> Option<&bead_wire::Status> {
    frames.iter().rev().find_map(|frame| match &frame.message {
        Message::Status(status) => Some(status),
        _ => None,
    })
}

fn verdict(report: &Report, struck: u32) -> Result<(), Failure> {
    let Frames { lost, corrupt, .. } = report.frames;
    let no = |what: String| Err(Failure::Verdict(what));
    if let Some(what) = report
        .strikes
        .iter()
        .find_map(|strike| strike.first_difference.as_ref())
    {
        return no(format!("replay differs: {what}"));
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
    for strike in &report.strikes {
        let truth = strike.truth;
        let off = |joule: f64| format!("{:+.3} %", (joule / truth.absorbed - 1.0) * 100.0);
        strikes.add_row([
            strike.sample_index.to_string(),
            format!("{:.4}", strike.peak_force),
            format!("{:.4}", truth.peak_force),
            format!("{:.2}", strike.absorbed_measured * 1e9),
            format!("{:.2}", strike.absorbed_predicted * 1e9),
            format!("{:.2}", truth.absorbed * 1e9),
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
            strikes: vec![Strike {
                sample_index: 2144,
                peak_force: 6.0,
                absorbed_measured: 8e-7,
                absorbed_predicted: 8e-7,
                flags: vec!["force_railed"],
                truth: Truth {
                    peak_force: 6.0,
                    absorbed: 8e-7,
                },
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
            truth: Truth {
                peak_force: 1.0,
                absorbed: 1.0,
            },
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
