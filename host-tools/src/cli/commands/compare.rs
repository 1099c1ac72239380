//! `bead compare`: device, replay, f64 from the same samples and the full chain, side by side.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;

use crate::bench::emulation::{EmulatorReport, RunTruth};
use crate::bench::sensed::{only_host, simulate_with_ring_down};
use crate::cli::beads::Beads;
use crate::cli::commands::compare_reference;
use crate::cli::commands::compare_row::{self, Wanted};
use crate::cli::commands::compared::{Velocity, echoes_left_out, scenario, shown};
use crate::cli::failure::Failure;
use crate::cli::output::{self, Format};
use crate::cli::place::{self, Kind, Overwrite};
use crate::cli::provenance;
use crate::cli::waveform_options::WaveformOptions;
use crate::comparison::page::Page;
use crate::comparison::pictures::{residual_chart, strike_chart};
use crate::comparison::replay::replay;
use crate::comparison::spread::{Deviations, Spread};
use crate::comparison::strike::{FullChain, Row, StrikeComparison};
use crate::comparison::velocity::{self, FittedVelocity};
use crate::comparison::verdict::{Echoes, Soundness, failure, other_length, overruns};
use crate::recording::file::{Bead, Part};
use crate::recording::received::Received;
use crate::tables::whole::Target;

const AFTER_HELP: &str = "\
Goals: A within 0.2 % of the full chain, B within 0.5 %, replay identical, no frame lost, no overrun. \
Several strikes are judged together: the mean by these goals, the scatter of A by 0.5 % and of B by 1 %, \
each with its uncertainty. An emulated run must also leave a quarter of the core free while a strike is \
measured. Exit status 1 if a goal is missed.

How fast a striker was is rarely known to 0.1 %, and the energy goes with its square. --velocity fit finds \
the velocity from the recorded force alone, prints it with its uncertainty, and judges A and B against the \
chain at that velocity.

What comes again before the striker hits anew, as beads that parted meet again, is an echo: it is replayed, \
but not held against the chain. Of a recording of real beads it is what comes while a strike is simulated: the \
scenario's duration and 6 ms.

Of a recording of several beads (`bead emulate --bead 7-16`, `bead record --port all`) all are compared with \
one simulation:
each by the goals above; when the wave came to each on the time of their sync edges, and how fast it went; \
the energy E(n) that n intruders leave, and T, the part that each lets pass, by the beads' own A and B. \
docs/row.md says how to read it.

With --reference a strike is held against the record of another instrument instead, and not against the \
chain: they are aligned, and correlation, gain, arrival, peak, energy and residual are printed \
(docs/waveforms.md). Exit status 1 if replay differs.

Examples:
  bead compare run/bead-8.mcap --scenario docs/scenarios/paper-strike.toml
  bead compare run/bead-8.mcap --velocity fit
  bead compare run/bead-8.mcap --report report.html
  bead compare run/bead-8.mcap --figures figures
  bead compare run/chain.mcap --report row.html
  bead compare run/chain.mcap --bead 9
  bead compare run/bead-8.mcap --reference scope.csv --force-column CH1:8.9N \\
      --report report.html";

/// Arguments of `bead compare`.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    /// The recording.
    recording: PathBuf,
    /// The scenario that was recorded [default: the one that the recording carries, if it was emulated].
    #[arg(long, value_name = "S.toml")]
    scenario: Option<PathBuf>,
    /// The bead that sensed [default: as the recording says, else the only one with an intruder; of a
    /// recording of several, all of them]. Several side by side: 7-9, 7,9 or all.
    #[arg(long, value_name = "N")]
    bead: Option<Beads>,
    /// Velocity of the striker in m/s, in place of the scenario's; `fit`: the one that gives the recorded
    /// forces.
    #[arg(long, value_name = "V|fit")]
    velocity: Option<Velocity>,
    /// Hold a strike against the record of another instrument: a text table (CSV), WAV, Parquet, or a
    /// recording.
    #[arg(long, value_name = "F", conflicts_with_all = ["scenario", "velocity", "figures"])]
    reference: Option<PathBuf>,
    /// With --reference: which strike of the recording, counted from 0 [default: the first that is whole].
    #[arg(long, value_name = "N", requires = "reference")]
    strike: Option<usize>,
    /// Write a report: one self-contained HTML file.
    #[arg(long, value_name = "F.html")]
    report: Option<PathBuf>,
    /// Write the figures as SVG files into this directory, which is made if it is missing.
    #[arg(long, value_name = "DIR")]
    figures: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
    /// How to print the result.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
    #[command(flatten)]
    columns: WaveformOptions,
}

/// The result as JSON.
#[derive(Serialize, JsonSchema)]
pub(crate) struct Report<'a> {
    bead: usize,
    striker_velocity: Option<FittedVelocity>,
    strikes: &'a Vec<StrikeComparison>,
    strikes_left_out: usize,
    /// Of A, and of B.
    spread: &'a [Spread; 2],
    frames_lost: u64,
    frames_corrupt: u64,
    overruns: u64,
    instructions_per_sample: Option<f64>,
    pass: bool,
    failure: Option<&'a str>,
}

/// Strikes that are kept and shown at most. The means are over all.
const STRIKES_MOST: usize = 10_000;

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let (scenario_file, reference) = (arguments.scenario.as_ref(), arguments.reference.as_ref());
    if reference.is_none() {
        arguments.columns.without("--reference")?;
    }
    let inputs = [Some(&arguments.recording), scenario_file, reference];
    let inputs: Vec<&Path> = inputs.into_iter().flatten().map(PathBuf::as_path).collect();
    let report = place::optional(
        arguments.report.as_deref(),
        Kind::Page,
        &inputs,
        arguments.overwrite,
    )?;
    let mut received = Received::open(&arguments.recording)?;
    let of_several = received.recording.beads.len() > 1;
    let (only, row) = match &arguments.bead {
        Some(Beads::One(bead)) => (Some(*bead), false),
        Some(Beads::Several(beads)) => {
            keep(&mut received, beads)?;
            (None, true)
        }
        Some(Beads::All) | None => (None, of_several),
    };
    if row && reference.is_none() {
        return compare_row::run(
            &received,
            &Wanted {
                scenario: arguments.scenario.as_deref(),
                velocity: arguments.velocity,
                report,
                figures: arguments.figures.as_deref(),
                inputs: &inputs,
                overwrite: arguments.overwrite,
                format: arguments.format,
            },
        );
    }
    if row {
        return Err(Failure::input(format!(
            "{} has several beads; say with --bead which one is held against the reference",
            received.path.display()
        )));
    }
    let figures = arguments.figures.as_deref().map(|directory| {
        let names = ["strike.svg", "residuals.svg"].map(|name| (name, Kind::Drawing));
        place::targets(directory, names, &inputs, arguments.overwrite)
    });
    let figures = figures.transpose()?;
    let (received, place) = of_one_bead(received, only)?;
    if let Some(reference) = reference {
        return compare_reference::run(&compare_reference::Request {
            received: &received,
            reference,
            bead: only.or(place),
            strike: arguments.strike,
            columns: &arguments.columns,
            report,
            format: arguments.format,
        });
    }
    let (mut scenario, text) = scenario(arguments.scenario.as_deref(), &received)?;
    let mut recorded = received.strikes()?;
    let truth: Option<RunTruth> = received.json(Part::Truth)?;
    let emulator: Option<EmulatorReport> = received.json(Part::EmulatorReport)?;
    let told = only.or(truth.as_ref().map(|truth| truth.bead)).or(place);
    let bead = told.map_or_else(|| only_host(&scenario), Ok)?;
    let mut echoes = Echoes::of(&scenario, truth);

    let progress = output::spinner(format!("simulating {} beads", scenario.chain.beads));
    let fitted = match arguments.velocity {
        None => None,
        Some(Velocity::Given(velocity)) => {
            scenario.striker.velocity = velocity;
            None
        }
        Some(Velocity::Fit) => {
            let strikes = velocity::first_strikes(received.strikes()?, echoes.clone());
            let fitted = velocity::fit(&scenario, bead, &strikes)?;
            scenario.striker.velocity = fitted.velocity;
            Some(fitted)
        }
    };
    let solution = Arc::new(simulate_with_ring_down(&scenario)?);
    let chain = FullChain::of(&scenario, &solution, bead)?;
    if let Some(note) = chain.note() {
        progress.suspend(|| output::note(format_args!("{note}")));
    }
    let mut strikes: Vec<StrikeComparison> = Vec::new();
    let mut settings = None;
    let mut drawn = false;
    // The energy goes with the square of the velocity.
    let mut deviations = Deviations::within(fitted.map_or(0.0, |fit| 2.0 * fit.uncertainty / fit.velocity));
    let (mut compared, mut again, mut differs) = (0, 0, None);
    for strike in recorded.by_ref() {
        if echoes.has(&strike) {
            again += 1;
            differs = differs.or_else(|| replay(&strike).first_difference);
            continue;
        }
        compared += 1;
        progress.set_message(format!("comparing strike {compared}"));
        let mut comparison = chain.compare(&strike);
        deviations.push(&comparison.deviation);
        differs = differs.or_else(|| comparison.first_difference.clone());
        if strikes.len() == STRIKES_MOST {
            continue;
        }
        // The figures show the first strike that was received whole; the curves of others would fill the
        // memory.
        if drawn {
            comparison.traces = None;
        }
        drawn |= comparison.traces.is_some();
        settings = settings.or(strike.settings.filter(|_| strikes.is_empty()));
        strikes.push(comparison);
    }
    progress.finish_and_clear();
    let heard = recorded.frames();
    if strikes.is_empty() {
        return Err(received.no_strike(heard).into());
    }
    let length = settings.and_then(|of| other_length(&scenario, &solution, &chain, bead, of.window));
    let left = (again > 0).then(|| echoes_left_out(&again.to_string()));
    for note in length.into_iter().chain(left) {
        output::note(format_args!("{note}"));
    }

    if strikes.len() > 1 || fitted.is_some() {
        strikes = strikes.into_iter().map(StrikeComparison::among_others).collect();
    }
    let left_out = compared - strikes.len();
    let spread = deviations.spread();
    let soundness = Soundness::of(heard.counters(), overruns(&received)?, emulator.as_ref());
    let failure = failure(differs.as_deref(), &soundness, &spread);
    let mut made = report.as_ref().map_or(Ok(Vec::new()), |_| {
        provenance::made(&received.path, provenance::scenario(&text))
    })?;
    made.extend(fitted.map(|fitted| ("striker's velocity", shown(&fitted))));
    if left_out > 0 {
        let of = format!("the first {STRIKES_MOST} of {compared}; the verdict is over all");
        made.push(("strikes shown", of));
    }
    let page = Page {
        title: &scenario.title,
        recording: &received.path.file_name().unwrap_or_default().to_string_lossy(),
        bead,
        strikes: &strikes,
        spread: &spread,
        failure: failure.as_deref(),
        counters: heard.counters(),
        identity: heard.identity.as_ref(),
        status: heard.status.as_ref(),
        settings: settings.as_ref(),
        emulator: emulator.as_ref(),
        made: &made,
        scenario: &text,
    };
    if let Some(report) = &report {
        report.write_bytes(page.html()?)?;
    }
    if let Some((directory, figures)) = arguments.figures.as_ref().zip(figures) {
        write_figures(directory, &figures, &strikes)?;
    }
    let result = Report {
        bead,
        striker_velocity: fitted,
        strikes: &strikes,
        strikes_left_out: left_out,
        spread: &spread,
        frames_lost: soundness.lost,
        frames_corrupt: soundness.corrupt,
        overruns: soundness.overruns,
        instructions_per_sample: soundness.instructions.map(|(total, _)| total),
        pass: failure.is_none(),
        failure: failure.as_deref(),
    };
    output::print(arguments.format, &result, || {
        let mut parts = vec![table(&strikes, &spread, &soundness)];
        parts.extend(fitted.map(|fitted| format!("striker's velocity: {}", shown(&fitted))));
        if left_out > 0 {
            parts.push(format!(
                "{left_out} more strikes are not shown; means and scatter are over all {compared}"
            ));
        }
        parts.join("\n\n")
    })?;
    failure.map_or(Ok(()), |what| Err(Failure::Verdict(what)))
}

/// What came from the one bead that is compared, and its place, if the recording knows it. Each bead of a row
/// has a truth of its own.
/// Keeps the beads of these numbers alone.
///
/// # Errors
/// One of them is not in the recording.
fn keep(received: &mut Received, beads: &[usize]) -> Result<(), Failure> {
    let places: Vec<usize> = received.recording.beads.iter().map(Bead::place).collect();
    if let Some(missing) = beads.iter().find(|bead| !places.contains(bead)) {
        return Err(Failure::input(format!(
            "{}: bead {missing} is not in it; its beads are {places:?}",
            received.path.display()
        )));
    }
    received
        .recording
        .beads
        .retain(|bead| beads.contains(&bead.place()));
    Ok(())
}

fn of_one_bead(received: Received, asked: Option<usize>) -> Result<(Received, Option<usize>), Failure> {
    let beads = &received.recording.beads;
    let places: Vec<usize> = beads.iter().map(Bead::place).collect();
    if places.is_empty() {
        return Ok((received, None));
    }
    let asked_for = |place: &usize| asked.is_none_or(|asked| asked == *place);
    match places.iter().position(asked_for) {
        Some(at) => Ok((received.of(&beads[at]), Some(places[at]))),
        None => Err(Failure::input(format!(
            "{} has the beads {places:?}; give --bead one of them, or leave it out to compare them all",
            received.path.display(),
        ))),
    }
}

fn write_figures(
    directory: &Path,
    figures: &[Target; 2],
    strikes: &[StrikeComparison],
) -> Result<(), Failure> {
    let Some(traces) = strikes.iter().find_map(|strike| strike.traces.as_ref()) else {
        // Its replay is impossible, too, and so the comparison says no.
        output::note(format_args!(
            "no strike came with its settings and all of its samples: --figures has nothing to draw"
        ));
        return Ok(());
    };
    place::make_directory(directory)?;
    for (figure, chart) in figures.iter().zip([strike_chart(traces), residual_chart(traces)]) {
        figure.write_bytes(chart.standalone_svg()?)?;
    }
    Ok(())
}

fn table(strikes: &[StrikeComparison], spread: &[Spread; 2], soundness: &Soundness) -> String {
    let mut rows = Vec::new();
    for strike in strikes {
        let (number, sample) = (strike.strike, strike.sample_index);
        rows.push(vec![format!("strike {number}, sample {sample}")]);
        rows.extend(strike.rows().map(cells));
        let replay = output::either(strike.replay_identical, "identical", "differ");
        rows.push(vec!["  bits of device and replay".to_owned(), replay]);
        rows.extend(strike.shape_rows().into_iter().map(cells));
        if !strike.flags.is_empty() {
            rows.push(vec!["  flags".to_owned(), strike.flags.join(", ")]);
        }
    }
    for spread in spread {
        let (Some(within), Some(scatter)) = (spread.uncertainty, spread.scatter) else {
            continue;
        };
        let mean = format!("{:+.3} ± {:.3} %", spread.mean * 100.0, within * 100.0);
        let goals = [spread.goal, spread.scatter_goal].map(|goal| goal * 100.0);
        let mut row = vec![format!("{}, mean of {} strikes", spread.estimate, spread.strikes)];
        row.extend(["", "", "", ""].map(str::to_owned));
        row.extend([mean, format!("{:.1} %", goals[0]), String::new()]);
        rows.push(row);
        let mut row = vec![format!("{}, scatter (rms)", spread.estimate)];
        row.extend(["", "", "", ""].map(str::to_owned));
        let met = output::either(spread.pass, "met", "missed");
        row.extend([
            format!("{:.3} %", scatter * 100.0),
            format!("{:.1} %", goals[1]),
            met,
        ]);
        rows.push(row);
    }
    for (name, value, goal, met) in soundness.rows() {
        let mut row = vec![name.to_owned(), value];
        row.resize(6, String::new());
        row.extend([goal, output::either(met, "met", "missed")]);
        rows.push(row);
    }
    let header = "| device | replay | f64, same samples | f64 chain | device off by | goal |";
    output::table(header, rows)
}

fn cells(row: Row) -> Vec<String> {
    let met = row.met().map(|met| output::either(met, "met", "missed"));
    let goal = row.goal.map(|goal| format!("{:.1} %", goal * 100.0));
    let off = row.off.map(|off| format!("{:+.3} %", off * 100.0));
    let dash = || "-".to_owned();
    let mut cells = vec![format!("  {}", row.name)];
    cells.extend(row.cells.map(|cell| cell.unwrap_or_else(dash)));
    cells.extend([
        off.unwrap_or_else(dash),
        goal.unwrap_or_default(),
        met.unwrap_or_default(),
    ]);
    cells
}
