//! `bead simulate`: the full f64 chain.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use hertz_chain::{Bands, Dispersion, EnergySummary, Options, Run, Summary, Validity, summarise};
use indicatif::HumanDuration;

use crate::sensitivities::{self, ParameterSensitivities};
use bead_console::prelude::*;
use hertz_sweep::time_series::{self, TimeSeriesForm};

const AFTER_HELP: &str = "\
Examples:
  bead simulate docs/scenarios/paper-strike.toml
  bead simulate docs/scenarios/paper-strike.toml --format json | jq .energy
  bead simulate docs/scenarios/paper-strike.toml --sensitivities
  bead simulate docs/scenarios/paper-strike.toml --out strike.parquet \\
      --rate 1e6";

const REMARKS: usize = 5;

/// Arguments of `bead simulate`.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub struct Arguments {
    /// The scenario, a TOML file in SI units.
    scenario: PathBuf,
    /// Write the time series to this Parquet or CSV file, units in the column names.
    #[arg(long, value_name = "F.parquet|F.csv")]
    out: Option<PathBuf>,
    /// Rows a second in that file, Hz.
    #[arg(long, value_name = "HZ", default_value_t = 1e6, requires = "out")]
    rate: f64,
    /// Print by how much each force and energy changes with every parameter: its derivatives, exact through
    /// contacts that open and close. The run takes three times as long.
    #[arg(long, conflicts_with = "out")]
    sensitivities: bool,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Format of the summary.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// Runs `bead simulate`.
///
/// # Errors
/// [`Failure`], which carries the exit status.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let scenario = Scenario::load(&arguments.scenario)?;
    let out = arguments.out.as_deref().map(|path| output_file(path, arguments));
    let out = out.transpose()?;
    let progress = output::part_done(format!("of {} beads simulated", scenario.chain.beads));
    let accuracy = Options::default().accuracy;
    let fewest = Run::new(&scenario, accuracy)?.fewest_steps(scenario.duration, accuracy.longest_step);
    let (begun, remarked) = (Instant::now(), AtomicBool::new(false));
    let show = |part| {
        output::set_part(&progress, part);
        let remark = long_run(begun.elapsed(), part, fewest, scenario.duration);
        if let Some(remark) = remark.filter(|_| !remarked.swap(true, Ordering::Relaxed)) {
            progress.suspend(|| note!("{remark}"));
        }
    };
    let options = Options::default().with_progress(&show);
    let mut derivatives = None;
    let summary = match &out {
        // No time series is kept in memory, so a chain may have any length.
        None if arguments.sensitivities => {
            let (summary, rows) = sensitivities::of_all(&scenario, &options)?;
            derivatives = Some(rows);
            summary
        }
        None => summarise(&scenario, &options)?,
        Some((form, out)) => time_series::write(&scenario, &options, arguments.rate, *form, out)?,
    };
    progress.finish_and_clear();
    let validity = Validity::of(&scenario, &summary.peak_force)?;
    // A chain without load or with unlike beads has no bands, which is no error.
    let bands = Dispersion::of(&scenario)
        .ok()
        .map(|dispersion| dispersion.bands());
    let report = SimulateReport {
        summary,
        validity,
        bands,
        sensitivities: derivatives,
    };
    output::print(arguments.format, &report, || table(&scenario.title, &report))
}

/// The form and the place of the time series.
fn output_file(path: &Path, arguments: &Arguments) -> Result<(TimeSeriesForm, Target), Failure> {
    let form = TimeSeriesForm::of(path);
    let kind = if form == Some(TimeSeriesForm::Csv) {
        FileKind::Table
    } else {
        FileKind::Parquet
    };
    let target = place::target(path, kind, &[&arguments.scenario], arguments.overwrite)?;
    let form = form.ok_or_else(|| {
        let what = "ends neither with .parquet nor with .csv; give the time series one of these endings";
        failure!(Input, "{} {what}", path.display())
    })?;
    Ok((form, target))
}

/// A remark on a long run, which may be a slip of units. `part` of the run is done after `elapsed`; all of it
/// takes at least `fewest` steps for `duration` seconds of the scenario.
fn long_run(elapsed: Duration, part: f64, fewest: f64, duration: f64) -> Option<String> {
    /// Time after which the pace is known.
    const KNOWN: Duration = Duration::from_secs(5);
    /// Shortest long run, s.
    const LONG: f64 = 60.0;
    let whole = elapsed.as_secs_f64() / part;
    if elapsed < KNOWN || whole < LONG {
        return None;
    }
    let time = match Duration::try_from_secs_f64(whole) {
        Ok(time) if whole < 3e9 => HumanDuration(time).to_string(),
        _ => "more than a century".to_owned(),
    };
    let step = duration / fewest;
    Some(format!(
        "at this pace the run takes {time}: at least {fewest:.1e} steps of at most {step:.1e} s; if it should be quick, \
         check units, and anything very small, stiff or light compared with the rest"
    ))
}

/// The summary, and how well each contact met the assumptions of the model.
#[derive(Serialize, JsonSchema)]
pub struct SimulateReport {
    #[serde(flatten)]
    summary: Summary,
    /// One entry for each of `peak_force`; none where contacts have a stiffness of their own.
    validity: Vec<Validity>,
    /// Bands of linear waves; none unless the chain is loaded, and its beads and their intruders are alike,
    /// or in cells that are.
    #[serde(skip_serializing_if = "Option::is_none")]
    bands: Option<Bands>,
    /// Derivatives of the results by each parameter of the scenario, if they were asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    sensitivities: Option<Vec<ParameterSensitivities>>,
}

fn table(title: &str, report: &SimulateReport) -> String {
    let SimulateReport {
        summary, validity, ..
    } = report;
    let mut parts = Vec::from_iter(Some(title.to_owned()).filter(|title| !title.is_empty()));
    let known = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.4}"));
    let contacts = summary.peak_force.iter().enumerate().map(|(index, peak)| {
        let valid = validity.get(index);
        let shown = |text: Option<String>| text.unwrap_or_else(|| "-".to_owned());
        [
            peak.contact.to_string(),
            format!("{:.4}", peak.force),
            format!("{:.4}", peak.time * 1e3),
            known(peak.fwhm.map(|width| width * 1e3)),
            shown(valid.map(|valid| format!("{:.1}", valid.pressure * 1e-6))),
            shown(valid.map(|valid| format!("{:.4}", valid.radius_ratio))),
            shown(valid.and_then(|valid| Some(format!("{:.2}", valid.periods?)))),
        ]
    });
    parts.push(output::table(
        "contact | peak force (N) | at (ms) | width at half (ms) | p₀ (MPa) | a/R | width/period",
        contacts,
    ));
    let remarks: Vec<_> = validity.iter().flat_map(Validity::remarks).collect();
    if !remarks.is_empty() {
        let more = remarks.len().saturating_sub(REMARKS);
        let first = remarks.into_iter().take(REMARKS);
        let mut lines: Vec<_> = first.map(|remark| format!("Remark: {remark}.")).collect();
        if more > 0 {
            lines.push(format!("And {more} more such remarks."));
        }
        parts.push(lines.join("\n"));
    }

    if !summary.intruders.is_empty() {
        let intruders = summary.intruders.iter().map(|intruder| {
            [
                match intruder.place {
                    None => intruder.bead.to_string(),
                    Some(place) => format!("{} ({place})", intruder.bead),
                },
                format!("{:.2}", intruder.acceleration_max),
                format!("{:.2}", intruder.acceleration_min),
                format!("{:.3}", intruder.relative_displacement_max * 1e6),
                format!("{:.2}", intruder.dissipated * 1e9),
            ]
        });
        let header =
            "intruder in bead | acceleration max (m/s²) | min (m/s²) | displacement (µm) | dissipated (nJ)";
        parts.push(output::table(header, intruders));
    }

    parts.push(energies(&summary.energy));
    parts.extend(report.bands.as_ref().map(pass_bands));
    let sensitivities = report.sensitivities.iter();
    parts.extend(sensitivities.map(|rows| sensitivities::table(summary, rows)));
    let solver = &summary.solver;
    parts.push(format!(
        "{:.3} ms simulated in {:.2} s: {} steps, {} evaluations, energy balance closes to {:.1e}",
        summary.final_state.time * 1e3,
        solver.seconds,
        solver.steps,
        solver.evaluations,
        summary.energy.balance_error,
    ));
    parts.join("\n\n")
}

/// The table of energies, each also as a part of the striker's energy plus the work of the drive.
fn energies(energy: &EnergySummary) -> String {
    let given = energy.striker_initial + energy.drive_work.unwrap_or(0.0);
    let mut rows = vec![("striker, initial", energy.striker_initial)];
    rows.extend(energy.drive_work.map(|work| ("work of the drive", work)));
    rows.extend([
        ("striker, final", energy.striker_final),
        ("chain, final", energy.chain_final),
        ("intruders, final", energy.intruders_final),
        ("dissipated in contacts", energy.dissipated_contacts),
        ("dissipated in intruders", energy.dissipated_intruders),
    ]);
    rows.extend(
        energy
            .dissipated_ground
            .map(|lost| ("dissipated on the ground", lost)),
    );
    rows.push(("chain, highest", energy.chain_max));
    let rows = rows.into_iter().map(|(name, joule)| {
        let part = if given > 0.0 {
            format!("{:.3} %", joule / given * 100.0)
        } else {
            "-".to_owned()
        };
        [name.to_owned(), format!("{:.4}", joule * 1e6), part]
    });
    let of = if energy.drive_work.is_some() {
        "of the input"
    } else {
        "of the striker's"
    };
    output::table(&format!("energy | µJ | {of}"), rows)
}

/// The bands in a line.
fn pass_bands(bands: &Bands) -> String {
    let mut line = format!("Linear waves pass up to {:.2} Hz", bands.acoustic_top);
    for (place, [from, to]) in bands.pass.iter().enumerate().skip(1) {
        let and = if place + 1 == bands.pass.len() { "and " } else { "" };
        line += &format!(", {and}from {from:.2} to {to:.2} Hz");
    }
    line + "."
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_run_is_remarked_on_once_its_pace_is_known() {
        let seconds = Duration::from_secs;
        let remark = |elapsed, part| long_run(seconds(elapsed), part, 2e9, 4e-3);
        // Too early, and quick enough.
        assert_eq!(remark(4, 1e-6), None);
        assert_eq!(remark(6, 0.2), None);
        let hours = "17 hours: at least 2.0e9 steps of at most 2.0e-12 s; ";
        let century = "more than a century: ";
        for (part, time) in [(1e-4, hours), (1e-12, century), (1e-30, century), (0.0, century)] {
            let text = remark(6, part).unwrap();
            assert!(
                text.starts_with(&format!("at this pace the run takes {time}")),
                "{text}"
            );
        }
    }
}
