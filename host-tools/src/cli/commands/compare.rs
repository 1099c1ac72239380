//! `bead compare`: device, replay, f64 from the same samples and the full chain, side by side.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;

use crate::bench::emulation::{EmulatorReport, RunTruth};
use crate::bench::sensed::{load_scenario, only_host};
use crate::cli::failure::{Blame, Failure};
use crate::cli::output::{self, Format};
use crate::comparison::page::{Report, percent, residual_chart, strike_chart};
use crate::comparison::strike::{Chain, Shape, ShapeComparison, StrikeComparison, Values};
use crate::recording::file::Part;
use crate::recording::received::Received;

const AFTER_HELP: &str = "\
Goals: A within 0.2 % of the full chain, B within 0.5 %, replay identical, no frame lost, no overrun; of an
emulated run also a quarter of the core free while a strike is measured. Exit status 1 if one is missed.

Examples:
  bead compare run/bead-8.mcap --scenario docs/scenarios/paper-strike.toml
  bead compare run/bead-8.mcap --scenario docs/scenarios/paper-strike.toml --report report.html
  bead compare run/bead-8.mcap --scenario docs/scenarios/paper-strike.toml --figures figures";

/// Arguments of `bead compare`.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    /// The recording.
    recording: PathBuf,
    /// The scenario that it is a recording of.
    #[arg(long, value_name = "S.toml")]
    scenario: PathBuf,
    /// The bead that sensed [default: as the recording says, else the only one with an intruder].
    #[arg(long, value_name = "N")]
    bead: Option<usize>,
    /// Write a report of one self-contained HTML file.
    #[arg(long, value_name = "F.html")]
    report: Option<PathBuf>,
    /// Write the figures as SVG files of their own into this directory, which is made if need be.
    #[arg(long, value_name = "DIR")]
    figures: Option<PathBuf>,
    /// How to print the result.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

#[derive(Serialize)]
struct Output<'a> {
    bead: usize,
    strikes: &'a [StrikeComparison],
    frames_lost: u64,
    frames_corrupt: u64,
    overruns: u64,
    instructions_per_sample: Option<f64>,
    pass: bool,
    failure: Option<&'a str>,
}

/// What must hold of the run as a whole.
struct Soundness {
    lost: u64,
    corrupt: u64,
    overruns: u64,
    /// Of an emulated run: instructions a sample while a strike was measured, and how many fit.
    instructions: Option<(f64, f64)>,
}

/// Part of the core that work on a strike may take.
const BUSY_MOST: f64 = 0.75;

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let (scenario, _) = load_scenario(&arguments.scenario)?;
    let received = Received::open(&arguments.recording)?;
    let recorded = received.some_strikes()?;
    let truth: Option<RunTruth> = received.json(Part::Truth)?;
    let emulator: Option<EmulatorReport> = received.json(Part::EmulatorReport)?;
    let bead = match arguments.bead.or(truth.as_ref().map(|truth| truth.bead)) {
        Some(bead) => bead,
        None => only_host(&scenario)?,
    };

    let progress = output::spinner(format!("simulating {} beads", scenario.chain.beads));
    let chain = Chain::run(&scenario, bead)?;
    if let Some(note) = chain.note() {
        progress.suspend(|| eprintln!("bead: {note}"));
    }
    let mut strikes = Vec::with_capacity(recorded.len());
    for (number, strike) in recorded.iter().enumerate() {
        progress.set_message(format!("comparing strike {} of {}", number + 1, recorded.len()));
        strikes.push(chain.compare(strike));
    }
    progress.finish_and_clear();

    let soundness = Soundness {
        lost: received.counters.lost,
        corrupt: received.counters.rejected.total(),
        overruns: received
            .status()
            .map_or(0, |status| status.overruns.into())
            .max(emulator.as_ref().map_or(0, |emulator| emulator.overruns)),
        instructions: emulator.as_ref().and_then(|emulator| {
            let total = emulator.instructions_per_sample.total?;
            Some((total, emulator.instructions_available))
        }),
    };
    let failure = failure(&strikes, &soundness);
    let report = Report {
        title: &scenario.title,
        recording: &received.path.file_name().unwrap_or_default().to_string_lossy(),
        bead,
        strikes: &strikes,
        failure: failure.as_deref(),
        counters: &received.counters,
        identity: received.identity(),
        status: received.status(),
        settings: recorded[0].settings.as_ref(),
        emulator: emulator.as_ref(),
    };
    if let Some(path) = &arguments.report {
        write_text(path, &report.html()?)?;
    }
    if let Some(directory) = &arguments.figures {
        write_figures(directory, &strikes)?;
    }
    match arguments.format {
        Format::Json => output::print_json(&Output {
            bead,
            strikes: &strikes,
            frames_lost: soundness.lost,
            frames_corrupt: soundness.corrupt,
            overruns: soundness.overruns,
            instructions_per_sample: soundness.instructions.map(|(total, _)| total),
            pass: failure.is_none(),
            failure: failure.as_deref(),
        })?,
        Format::Table => output::print_line(&table(&strikes, &soundness))?,
    }
    failure.map_or(Ok(()), |what| Err(Failure::Verdict(what)))
}

/// The first check that said no, gravest first.
fn failure(strikes: &[StrikeComparison], soundness: &Soundness) -> Option<String> {
    if let Some(what) = strikes.iter().find_map(|strike| strike.first_difference.as_ref()) {
        return Some(format!("replay differs: {what}"));
    }
    let &Soundness {
        lost,
        corrupt,
        overruns,
        instructions,
    } = soundness;
    if lost + corrupt > 0 {
        return Some(format!("{lost} frames were lost and {corrupt} corrupt"));
    }
    if overruns > 0 {
        return Some(format!("{overruns} overruns: samples are missing"));
    }
    if let Some((total, available)) = instructions.filter(|(total, fit)| *total > BUSY_MOST * fit) {
        return Some(format!(
            "a sample of a strike costs {total:.0} instructions, more than {:.0} % of the {available:.0} that fit",
            BUSY_MOST * 100.0
        ));
    }
    strikes.iter().find_map(|strike| {
        [
            ("A", strike.deviation.absorbed_measured, strike.goal.absorbed_measured),
            ("B", strike.deviation.absorbed_predicted, strike.goal.absorbed_predicted),
        ]
        .into_iter()
        .find(|(_, off, goal)| off.abs() > *goal)
        .map(|(name, off, goal)| {
            format!(
                "strike {}: {name} is {} off the full chain, more than its goal of {:.1} %; see docs/accuracy.md",
                strike.strike,
                percent(off),
                goal * 100.0
            )
        })
    })
}

fn write_text(path: &Path, text: &str) -> Result<(), Failure> {
    output::write_whole(path, |file| Ok(file.write_all(text.as_bytes())?))
}

fn write_figures(directory: &Path, strikes: &[StrikeComparison]) -> Result<(), Failure> {
    let Some(traces) = strikes.iter().find_map(|strike| strike.traces.as_ref()) else {
        return Err(Failure::input(
            "no strike was received whole, so there is nothing to draw",
        ));
    };
    fs::create_dir_all(directory).or_input(|| {
        format!(
            "cannot make the directory {}; give --figures another",
            directory.display()
        )
    })?;
    write_text(
        &directory.join("strike.svg"),
        &strike_chart(traces).standalone_svg()?,
    )?;
    write_text(
        &directory.join("residuals.svg"),
        &residual_chart(traces).standalone_svg()?,
    )
}

fn table(strikes: &[StrikeComparison], soundness: &Soundness) -> String {
    let mut table = output::table([
        "",
        "device",
        "replay",
        "f64, same samples",
        "f64 chain",
        "device off by",
        "goal",
        "",
    ]);
    for strike in strikes {
        table.add_row([format!(
            "strike {}, sample {}",
            strike.strike, strike.sample_index
        )]);
        type Of = fn(&Values) -> f64;
        let rows: [(&str, Of, f64, usize, Option<f64>); 3] = [
            (
                "  A, measured (nJ)",
                |v| v.absorbed_measured,
                1e9,
                3,
                Some(strike.goal.absorbed_measured),
            ),
            (
                "  B, predicted (nJ)",
                |v| v.absorbed_predicted,
                1e9,
                3,
                Some(strike.goal.absorbed_predicted),
            ),
            ("  peak force (N)", |v| v.peak_force, 1.0, 5, None),
        ];
        for (name, of, scale, digits, goal) in rows {
            let cell = |values: Option<Values>| {
                values.map_or_else(
                    || "-".to_owned(),
                    |values| format!("{:.digits$}", of(&values) * scale),
                )
            };
            let off = of(&strike.deviation);
            table.add_row([
                name.to_owned(),
                cell(Some(strike.device)),
                cell(strike.replay),
                cell(strike.f64_samples),
                cell(Some(strike.f64_chain)),
                format!("{:+.3} %", off * 100.0),
                goal.map_or_else(String::new, |goal| format!("{:.1} %", goal * 100.0)),
                goal.map_or("", |goal| if off.abs() <= goal { "met" } else { "missed" })
                    .to_owned(),
            ]);
        }
        table.add_row([
            "  bits of device and replay".to_owned(),
            (if strike.replay_identical {
                "identical"
            } else {
                "differ"
            })
            .to_owned(),
        ]);
        if let Some(ShapeComparison { device, f64_chain }) = &strike.shape {
            type Of = fn(&Shape) -> f64;
            let rows: [(&str, Of, f64, usize); 6] = [
                ("  width at half height (µs)", |shape| shape.width, 1e6, 2),
                ("  impulse (mN·s)", |shape| shape.impulse, 1e3, 4),
                ("  ringing (Hz)", |shape| shape.ring_frequency, 1.0, 1),
                ("  its decay (1/s)", |shape| shape.ring_decay, 1.0, 1),
                ("  so k is (kN/m)", |shape| shape.stiffness, 1e-3, 1),
                ("  and c (N·s/m)", |shape| shape.damping, 1.0, 2),
            ];
            for (name, of, scale, digits) in rows {
                table.add_row([
                    name.to_owned(),
                    format!("{:.digits$}", of(device) * scale),
                    String::new(),
                    String::new(),
                    format!("{:.digits$}", of(f64_chain) * scale),
                    format!("{:+.3} %", 100.0 * (of(device) / of(f64_chain) - 1.0)),
                ]);
            }
        }
        if !strike.flags.is_empty() {
            table.add_row(["  flags".to_owned(), strike.flags.join(", ")]);
        }
    }
    let mut must = |name: &str, value: String, goal: String, met: bool| {
        let blank = String::new;
        let verdict = (if met { "met" } else { "missed" }).to_owned();
        table.add_row([
            name.to_owned(),
            value,
            blank(),
            blank(),
            blank(),
            blank(),
            goal,
            verdict,
        ]);
    };
    for (name, count) in [
        ("frames lost", soundness.lost),
        ("frames corrupt", soundness.corrupt),
        ("overruns", soundness.overruns),
    ] {
        must(name, count.to_string(), "0".to_owned(), count == 0);
    }
    if let Some((total, available)) = soundness.instructions {
        let most = BUSY_MOST * available;
        must(
            "instructions a sample",
            format!("{total:.1}"),
            format!("{most:.1}"),
            total <= most,
        );
    }
    output::table_text(&table)
}
