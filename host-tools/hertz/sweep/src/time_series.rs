//! A simulation as a table: a row for each time, a column for each quantity.

use std::ffi::OsStr;
use std::fs::File;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use hertz_chain::{Model, Options, Run, Scenario, Snapshot, Snapshots, Summariser, Summary};

use bead_tables::whole::{STANDARD_OUTPUT, Target};
use bead_tables::{Cell, CellKind, Column, Writer};

/// The form of a file with a time series.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TimeSeriesForm {
    /// Parquet, with the scenario's title, the scenario (JSON) and the rate as notes.
    Parquet,
    /// Comma-separated values.
    Csv,
}

impl TimeSeriesForm {
    /// The form that the ending of a name stands for: `.parquet` or `.csv`. Standard output gets Parquet.
    pub fn of(path: &Path) -> Option<Self> {
        if path == Path::new(STANDARD_OUTPUT) {
            return Some(Self::Parquet);
        }
        let ending = path.extension().and_then(OsStr::to_str)?;
        match ending.to_ascii_lowercase().as_str() {
            "parquet" => Some(Self::Parquet),
            "csv" => Some(Self::Csv),
            _ => None,
        }
    }
}

/// A quantity: the name of its column, and its value at a time.
type SeriesColumn = (String, Box<dyn Fn(&Snapshot<'_>) -> f64>);

fn series(name: impl Into<String>, value: impl Fn(&Snapshot<'_>) -> f64 + 'static) -> SeriesColumn {
    (name.into(), Box::new(value))
}

fn all_series(model: &Model) -> Vec<SeriesColumn> {
    let mut all = vec![series("time_s", |s| s.time())];
    for contact in 1..=model.contacts() {
        let name = format!("contact_{contact}_force_n");
        all.push(series(name, move |s| s.force(contact)));
    }
    for body in 0..model.bodies() {
        let name = |quantity: &str| format!("body_{body}_{quantity}");
        all.extend([
            series(name("displacement_m"), move |s| s.displacement(body)),
            series(name("velocity_mps"), move |s| s.velocity(body)),
        ]);
    }
    for (number, intruder) in model.intruders().iter().enumerate() {
        let place = model.place_in_host(number).map(|place| format!("_{place}"));
        let (bead, place) = (intruder.bead, place.unwrap_or_default());
        let mut add = |quantity: &str, value: fn(&Snapshot<'_>, usize) -> f64| {
            let name = format!("bead_{bead}_intruder{place}_{quantity}");
            all.push(series(name, move |s| value(s, number)));
        };
        add("displacement_m", |s, number| s.motion_of(number).displacement);
        add("acceleration_mps2", |s, number| s.motion_of(number).acceleration);
        add("dissipated_j", |s, number| s.dissipated_by(number));
    }
    if model.is_driven() {
        all.push(series("drive_work_j", |s| s.energies().supplied));
    }
    all.extend([
        series("striker_energy_j", |s| s.energies().striker),
        series("chain_energy_j", |s| s.energies().chain),
        series("intruders_energy_j", |s| s.energies().intruders),
    ]);
    all
}

/// The table of a run, without a row.
fn table<'a>(
    file: &'a mut File,
    form: TimeSeriesForm,
    scenario: &Scenario,
    series: &[SeriesColumn],
    rate_hz: f64,
) -> anyhow::Result<Writer<'a>> {
    let columns = series.iter().map(|(name, _)| Column::new(name, CellKind::Number));
    let columns: Vec<_> = columns.collect();
    if form == TimeSeriesForm::Csv {
        return Writer::csv(file, &columns);
    }
    let (rate, json) = (rate_hz.to_string(), serde_json::to_string(scenario)?);
    let notes = [
        ("title", &*scenario.title),
        ("scenario", &json),
        ("rate_hz", &rate),
    ];
    Writer::parquet(file, "time_series", &columns, &notes)
}

/// Runs a scenario, writes `rate_hz` rows a second from time 0, and returns the summary. Only some rows are
/// held in memory, so the chain may have any length.
///
/// # Errors
/// The rate is not a positive number, yields no second row or cannot show the scenario's drive, the
/// scenario cannot be run, or the file cannot be written.
pub fn write(
    scenario: &Scenario,
    options: &Options<'_>,
    rate_hz: f64,
    form: TimeSeriesForm,
    target: &Target,
) -> anyhow::Result<Summary> {
    let (clock, end) = (Instant::now(), scenario.duration);
    let rows = end * rate_hz;
    if !(rate_hz > 0.0 && (1.0..1e9).contains(&rows)) {
        anyhow::bail!("--rate {rate_hz:?}: gives {rows:?} rows over {end} s; give a rate in Hz, such as 1e6");
    }
    if let Some(drive) = &scenario.drive {
        drive.check_rate(rate_hz)?;
    }
    let mut run = Run::new(scenario, options.accuracy)?;
    run.check(end, options.accuracy.longest_step)?;
    let mut summariser = Summariser::new(&mut run);
    let mut snapshots = Snapshots::new(&mut run, rate_hz, end);
    let mut failure = None;
    let written = target.write(|file| {
        let series = all_series(run.model());
        let mut table = table(file, form, scenario, &series, rate_hz)?;
        let ran = run.watch_while(end, |step| {
            summariser.observe(step);
            if let Some(progress) = options.progress.filter(|_| step.number().is_multiple_of(64)) {
                progress(step.to() / end);
            }
            let mut written = Ok(());
            snapshots.observe(step, |snapshot| {
                if written.is_ok() {
                    let cells = series.iter().map(|(_, value)| Cell::Number(value(snapshot)));
                    written = table.push(cells.collect());
                }
            });
            written.map_or_else(ControlFlow::Break, ControlFlow::Continue)
        });
        match ran {
            Ok(ControlFlow::Continue(())) => table.finish(),
            Ok(ControlFlow::Break(error)) => Err(error),
            // The file is dropped, and the error of the run is returned below.
            Err(error) => Err(anyhow::anyhow!("{}", failure.insert(error))),
        }
    });
    if let Some(error) = failure {
        return Err(error.into());
    }
    written?;
    let mut summary = summariser.summary(&mut run);
    summary.solver.seconds = clock.elapsed().as_secs_f64();
    Ok(summary)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bead_tables::Reader;

    #[test]
    fn both_forms_hold_the_solution_bit_for_bit() {
        // The wave does not reach the intruder.
        let mut scenario = Scenario::paper();
        scenario.duration = 1e-3;
        let solution = hertz_chain::simulate(&scenario).unwrap();
        let directory = tempfile::tempdir().unwrap();
        let at = |name: &str| directory.path().join(name);
        for (name, form) in [
            ("strike.parquet", TimeSeriesForm::Parquet),
            ("strike.csv", TimeSeriesForm::Csv),
        ] {
            assert_eq!(TimeSeriesForm::of(Path::new(name)), Some(form));
            let target = Target::new(at(name));
            let summary = write(&scenario, &Options::default(), 1e5, form, &target).unwrap();
            assert_eq!(summary.final_state, solution.summary().final_state);
        }
        let reader = Reader::open(&at("strike.parquet")).unwrap();
        assert_eq!((reader.rows(), reader.note("rate_hz")), (101, Some("100000")));
        let names: Vec<_> = reader.columns().iter().map(|column| &*column.name).collect();
        let csv = std::fs::read_to_string(at("strike.csv")).unwrap();
        let mut lines = csv.lines();
        assert_eq!(lines.next().unwrap(), names.join(","));
        let mut rows = 0;
        for row in reader.all_batches().flat_map(|batch| batch.unwrap().into_rows()) {
            let time = f64::from(rows) / 1e5;
            let snapshot = solution.at(time.min(solution.end()));
            let mut texts = lines.next().unwrap().split(',');
            for (name, cell) in names.iter().zip(row) {
                let text = texts.next().unwrap();
                assert_eq!(cell, Cell::Number(text.parse().unwrap()), "{name}");
                let expected = match *name {
                    "time_s" => snapshot.time(),
                    "contact_1_force_n" => snapshot.force(1),
                    "body_0_velocity_mps" => snapshot.velocity(0),
                    "chain_energy_j" => snapshot.energies().chain,
                    _ => continue,
                };
                assert_eq!(cell, Cell::Number(expected), "{name} in row {rows}");
            }
            rows += 1;
        }
        assert_eq!((rows, lines.next()), (101, None));
    }
}
