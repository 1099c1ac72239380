//! A simulation as a Parquet file. Each row is a time, each column a quantity with its unit in the name.
//!
//! The file's key-value metadata holds the scenario's title, the scenario itself (JSON) and the row rate.

use std::sync::Arc;

use anyhow::Context;
use hertz_chain::{Scenario, Snapshot, Solution};
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
    /// The file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

/// Rows held in memory at a time.
const ROW_GROUP: usize = 8192;

/// A column: its name, and its value at a time.
type Column = (String, Box<dyn Fn(&Snapshot<'_>) -> f64>);

fn column(name: impl Into<String>, value: impl Fn(&Snapshot<'_>) -> f64 + 'static) -> Column {
    (name.into(), Box::new(value))
}

fn columns(solution: &Solution) -> Vec<Column> {
    let model = solution.model();
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

/// Writes `solution` on a regular grid of `rate_hz` rows a second, the first at 0.
///
/// # Errors
/// A rate that is no positive number or gives no second row, or a file that cannot be written.
pub fn write(
    scenario: &Scenario,
    solution: &Solution,
    rate_hz: f64,
    target: &Target,
) -> Result<(), TimeSeriesError> {
    let rows = solution.end() * rate_hz;
    if !(rate_hz > 0.0 && (1.0..1e9).contains(&rows)) {
        let end = solution.end();
        return Err(TimeSeriesError::Rate { rate_hz, rows, end });
    }
    // Rounding must not lose a last row that falls on the end.
    let rows = (rows * (1.0 + 1e-12)).floor() as usize + 1;
    let columns = columns(solution);
    Ok(target.write(|file| {
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
        let mut writer = SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties))?;
        let mut sampler = solution.sampler();
        for first in (0..rows).step_by(ROW_GROUP) {
            let snapshots: Vec<Snapshot<'_>> = (first..rows.min(first + ROW_GROUP))
                .map(|row| sampler.at((row as f64 / rate_hz).min(solution.end())))
                .collect();
            let mut group = writer.next_row_group()?;
            for (_, value) in &columns {
                let values: Vec<f64> = snapshots.iter().map(value).collect();
                let out = group.next_column()?;
                let mut out = out.context("the schema has too few columns")?;
                out.typed::<DoubleType>().write_batch(&values, None, None)?;
                out.close()?;
            }
            group.close()?;
        }
        writer.close()?;
        Ok(())
    })?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::Field;

    /// The first millisecond of the paper's strike: the wave does not reach the intruder.
    fn short_scenario() -> Scenario {
        Scenario {
            duration: 1e-3,
            ..Scenario::paper()
        }
    }

    #[test]
    fn a_file_read_back_holds_the_solution_bit_for_bit() {
        let scenario = short_scenario();
        let solution = hertz_chain::simulate(&scenario).unwrap();
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("strike.parquet");
        write(&scenario, &solution, 1e5, &Target::new(&path)).unwrap();

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
    fn a_rate_without_rows_is_refused() {
        let scenario = short_scenario();
        let solution = hertz_chain::simulate(&scenario).unwrap();
        for rate in [0.0, -1.0, f64::NAN, f64::INFINITY, 1.0] {
            let error = write(&scenario, &solution, rate, &Target::new("never.parquet")).unwrap_err();
            assert!(matches!(error, TimeSeriesError::Rate { .. }), "{error}");
        }
    }
}
