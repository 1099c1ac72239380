//! A simulation as a Parquet file. Each row is a time, each column a quantity with its unit in the name.
//!
//! The file's key-value metadata holds the scenario's title, the scenario itself (JSON) and the row rate.

use std::fs::File;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use anyhow::Context;
use hertz_chain::{Model, Options, Run, Scenario, SimulateError, Snapshot, Snapshots, Summariser, Summary};
use parquet::basic::Compression;
use parquet::data_type::DoubleType;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;

use crate::recording::whole::{Target, WriteError};

/// Why a time series is not written.
#[derive(Debug, thiserror::Error)]
pub enum TimeSeriesError {
    /// A rate that gives no second row, or too many.
    #[error("--rate {rate_hz:?}: gives {rows:?} rows over {end} s; give a rate in Hz, such as 1e6")]
    Rate {
        /// Rows a second, Hz.
        rate_hz: f64,
        /// Rows in all.
        rows: f64,
        /// The end of the simulation, s.
        end: f64,
    },
    /// The scenario cannot be run.
    #[error(transparent)]
    Simulate(#[from] SimulateError),
    /// The file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

/// Rows held in memory at a time.
const ROW_GROUP: usize = 8192;
/// Values held in memory at a time.
const VALUES: usize = 1 << 22;

/// A column: its name, and its value at a time.
type Column = (String, Box<dyn Fn(&Snapshot<'_>) -> f64>);

fn column(name: impl Into<String>, value: impl Fn(&Snapshot<'_>) -> f64 + 'static) -> Column {
    (name.into(), Box::new(value))
}

fn columns(model: &Model) -> Vec<Column> {
    let mut columns = vec![column("time_s", |s| s.time())];
    for contact in 1..=model.contacts() {
        let name = format!("contact_{contact}_force_N");
        columns.push(column(name, move |s| s.force(contact)));
    }
    for body in 0..model.bodies() {
        let name = |quantity: &str| format!("body_{body}_{quantity}");
        columns.extend([
            column(name("displacement_m"), move |s| s.displacement(body)),
            column(name("velocity_m_per_s"), move |s| s.velocity(body)),
        ]);
    }
    for bead in model.intruders().iter().map(|intruder| intruder.bead) {
        let mut add = |quantity: &str, value: fn(&Snapshot<'_>, usize) -> Option<f64>| {
            let name = format!("bead_{bead}_intruder_{quantity}");
            columns.push(column(name, move |s| value(s, bead).unwrap_or(f64::NAN)));
        };
        add("displacement_m", |s, bead| s.intruder_displacement(bead));
        add("acceleration_m_per_s2", |s, bead| s.intruder_acceleration(bead));
        add("dissipated_J", |s, bead| s.intruder_dissipated(bead));
    }
    columns.extend([
        column("striker_energy_J", |s| s.energies().striker),
        column("chain_energy_J", |s| s.energies().chain),
        column("intruders_energy_J", |s| s.energies().intruders),
    ]);
    columns
}

/// A file of rows that come one by one.
struct Rows<'a> {
    writer: SerializedFileWriter<&'a mut File>,
    columns: Vec<Column>,
    /// Of each column, those that are not written yet.
    waiting: Vec<Vec<f64>>,
    group: usize,
}

impl<'a> Rows<'a> {
    fn new(file: &'a mut File, scenario: &Scenario, model: &Model, rate_hz: f64) -> anyhow::Result<Self> {
        let columns = columns(model);
        let fields = columns
            .iter()
            .map(|(name, _)| format!("REQUIRED DOUBLE {name}; "));
        let fields: String = fields.collect();
        let schema = parse_message_type(&format!("message time_series {{ {fields} }}"))?;
        let metadata = vec![
            KeyValue::new("title".to_owned(), scenario.title.clone()),
            KeyValue::new("scenario".to_owned(), serde_json::to_string(scenario)?),
            KeyValue::new("rate_hz".to_owned(), rate_hz.to_string()),
        ];
        let properties = WriterProperties::builder()
            .set_compression(Compression::SNAPPY)
            .set_key_value_metadata(Some(metadata))
            .build();
        Ok(Self {
            writer: SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties))?,
            waiting: vec![Vec::new(); columns.len()],
            // A long chain has many columns.
            group: ROW_GROUP.min(VALUES / columns.len()).max(1),
            columns,
        })
    }

    fn push(&mut self, snapshot: &Snapshot<'_>) -> anyhow::Result<()> {
        for ((_, value), waiting) in self.columns.iter().zip(&mut self.waiting) {
            waiting.push(value(snapshot));
        }
        if self.waiting[0].len() == self.group {
            self.flush()?;
        }
        Ok(())
    }

    fn flush(&mut self) -> anyhow::Result<()> {
        let mut group = self.writer.next_row_group()?;
        for values in &mut self.waiting {
            let out = group.next_column()?;
            let mut out = out.context("the schema has too few columns")?;
            out.typed::<DoubleType>().write_batch(values, None, None)?;
            out.close()?;
            values.clear();
        }
        group.close()?;
        Ok(())
    }

    fn finish(mut self) -> anyhow::Result<()> {
        if !self.waiting[0].is_empty() {
            self.flush()?;
        }
        self.writer.close()?;
        Ok(())
    }
}

/// Runs a scenario and writes it on a regular grid of `rate_hz` rows a second, the first at 0, while it runs.
/// Gives its summary. Nothing but some rows is kept, so the chain may have any length.
///
/// # Errors
/// A rate that is no positive number or gives no second row, a scenario that cannot be run, or a file that
/// cannot be written.
pub fn write(
    scenario: &Scenario,
    options: &Options<'_>,
    rate_hz: f64,
    target: &Target,
) -> Result<Summary, TimeSeriesError> {
    let (clock, end) = (Instant::now(), scenario.duration);
    let rows = end * rate_hz;
    if !(rate_hz > 0.0 && (1.0..1e9).contains(&rows)) {
        return Err(TimeSeriesError::Rate { rate_hz, rows, end });
    }
    let mut run = Run::new(scenario, options.accuracy)?;
    run.check(end, options.accuracy.longest_step)?;
    let mut found = Summariser::new(&mut run);
    let mut snapshots = Snapshots::new(&mut run, rate_hz, end);
    let mut ran = Ok(ControlFlow::Continue(()));
    target
        .write(|file| {
            let mut table = Rows::new(file, scenario, run.model(), rate_hz)?;
            ran = run.watch_while(end, |step| {
                found.observe(step);
                if step.number().is_multiple_of(64) {
                    options.progress.iter().for_each(|told| told(step.to() / end));
                }
                let mut written = Ok(());
                snapshots.observe(step, |snapshot| {
                    if written.is_ok() {
                        written = table.push(snapshot);
                    }
                });
                written.map_or_else(ControlFlow::Break, ControlFlow::Continue)
            });
            match &mut ran {
                Ok(ControlFlow::Continue(())) => table.finish(),
                Ok(ControlFlow::Break(error)) => Err(std::mem::replace(error, anyhow::anyhow!("it is told"))),
                // The file is not kept, and the caller hears why.
                Err(_) => anyhow::bail!("the run has not ended"),
            }
        })
        .map_err(|error| match ran {
            Err(stuck) => TimeSeriesError::Simulate(stuck),
            Ok(_) => error.into(),
        })?;
    let mut summary = found.summary(&mut run);
    summary.solver.seconds = clock.elapsed().as_secs_f64();
    Ok(summary)
}

#[cfg(test)]
mod tests {
    use super::*;
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::Field;

    /// The first millisecond of the paper's strike: the wave does not reach the intruder.
    fn short_scenario() -> Scenario {
        let mut scenario = Scenario::paper();
        scenario.duration = 1e-3;
        scenario
    }

    #[test]
    fn a_file_read_back_holds_the_solution_bit_for_bit() {
        let scenario = short_scenario();
        let solution = hertz_chain::simulate(&scenario).unwrap();
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("strike.parquet");
        let summary = write(&scenario, &Options::default(), 1e5, &Target::new(&path)).unwrap();
        assert_eq!(summary.final_state, solution.summary().final_state);

        let reader = SerializedFileReader::new(std::fs::File::open(&path).unwrap()).unwrap();
        let metadata = reader.metadata().file_metadata();
        assert_eq!(metadata.num_rows(), 101);
        assert!(
            metadata
                .key_value_metadata()
                .unwrap()
                .iter()
                .any(|pair| pair.key == "rate_hz")
        );
        for (row, record) in reader.get_row_iter(None).unwrap().enumerate() {
            let time = row as f64 / 1e5;
            let at = solution.at(time.min(solution.end()));
            for (name, field) in record.unwrap().get_column_iter() {
                let Field::Double(value) = *field else {
                    panic!("{name} is no double")
                };
                let expected = match name.as_str() {
                    "time_s" => at.time(),
                    "contact_1_force_N" => at.force(1),
                    "body_0_velocity_m_per_s" => at.velocity(0),
                    "chain_energy_J" => at.energies().chain,
                    _ => continue,
                };
                assert_eq!(value.to_bits(), expected.to_bits(), "{name} in row {row}");
            }
        }
    }

    #[test]
    fn a_long_chain_is_written_while_it_runs() {
        let mut scenario = Scenario::paper();
        (scenario.chain.beads, scenario.chain.relaxation, scenario.duration) = (2000, 0.0, 0.4);
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("long.parquet");
        let draft = Options::with(hertz_chain::Accuracy::DRAFT);
        write(&scenario, &draft, 10.0, &Target::new(&path)).unwrap();
        let reader = SerializedFileReader::new(std::fs::File::open(&path).unwrap()).unwrap();
        assert_eq!(reader.metadata().file_metadata().num_rows(), 5);
    }

    #[test]
    fn a_rate_without_rows_is_refused() {
        let scenario = short_scenario();
        for rate in [0.0, -1.0, f64::NAN, f64::INFINITY, 1.0] {
            let error = write(
                &scenario,
                &Options::default(),
                rate,
                &Target::new("never.parquet"),
            )
            .unwrap_err();
            assert!(matches!(error, TimeSeriesError::Rate { .. }), "{error}");
        }
    }
}
