//! Waveforms in files: columns of CSV and Parquet, channels of WAV.

use std::fs::File;
use std::panic::catch_unwind;
use std::path::Path;

use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;
use serde::Deserialize;

/// Full scale of the converter, in codes and in volts.
const FULL_SCALE: f64 = 4095.0;
const REFERENCE_V: f64 = 3.3;

/// Unit of a waveform's values.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Unit {
    /// Codes of the converter, 0 to 4095.
    #[default]
    Codes,
    /// Volts at the pin, with 3.3 V as the reference.
    Volts,
}

/// Values at a constant interval.
#[derive(Debug)]
pub(super) struct Wave {
    values: Vec<f64>,
    /// Interval from the file, if it has one.
    pub(super) period_ns: Option<u64>,
}

impl Wave {
    /// Reads a column of a CSV or Parquet file, or a channel of a WAV file (1 is the first).
    pub(super) fn read(path: &Path, column: Option<&str>, channel: Option<u16>) -> Result<Self, String> {
        let kind = path.extension().and_then(|kind| kind.to_str()).unwrap_or("");
        match kind.to_ascii_lowercase().as_str() {
            "csv" => of_csv(path, column),
            // The reader panics on some damaged files.
            "parquet" => catch_unwind(|| of_parquet(path, column))
                .unwrap_or_else(|_| Err(format!("cannot read {}: it is damaged", path.display()))),
            "wav" => of_wav(path, channel.unwrap_or(1)),
            _ => Err(format!(
                "{} is neither .csv nor .parquet nor .wav",
                path.display()
            )),
        }
    }

    /// The wave's codes: of `offset` + `gain` times each value, in this unit.
    pub(super) fn codes(&self, unit: Unit, gain: f64, offset: f64) -> Result<Vec<u16>, String> {
        if self.values.is_empty() {
            return Err("the file has no values".into());
        }
        let code = |(n, value): (usize, &f64)| {
            let value = offset + gain * value;
            let code = match unit {
                Unit::Codes => value,
                Unit::Volts => value / REFERENCE_V * FULL_SCALE,
            };
            let rounded = code.round();
            let fits = (0.0..=FULL_SCALE).contains(&rounded);
            fits.then_some(rounded as u16)
                .ok_or_else(|| format!("value {n} gives {rounded}, which is not a code from 0 to 4095"))
        };
        self.values.iter().enumerate().map(code).collect()
    }
}

fn unreadable(path: &Path, error: impl std::fmt::Display) -> String {
    format!("cannot read {}: {error}", path.display())
}

/// Positions of two columns in a table with these names: the values, and the times in seconds, `t`, if there
/// is such a column.
fn columns(names: &[&str], column: Option<&str>) -> Result<(usize, Option<usize>), String> {
    let place = |wanted: &str| names.iter().position(|name| *name == wanted);
    let listed = || names.join(", ");
    let of_values = match column {
        Some(wanted) => {
            place(wanted).ok_or_else(|| format!("the file has no column {wanted:?}, only {}", listed()))?
        }
        None => {
            let others: Vec<usize> = (0..names.len()).filter(|place| names[*place] != "t").collect();
            match others[..] {
                [only] => only,
                _ => return Err(format!("the file has the columns {}: give one", listed())),
            }
        }
    };
    Ok((of_values, place("t")))
}

/// Reads a Parquet file. Its columns are those of the schema, and hold numbers without an inner structure.
fn of_parquet(path: &Path, column: Option<&str>) -> Result<Wave, String> {
    let refused = |error: parquet::errors::ParquetError| unreadable(path, error);
    let file = File::open(path).map_err(|error| unreadable(path, error))?;
    let reader = SerializedFileReader::new(file).map_err(refused)?;
    let schema = reader.metadata().file_metadata().schema().get_fields().to_vec();
    let names: Vec<&str> = schema.iter().map(|field| field.name()).collect();
    let (of_values, of_times) = columns(&names, column)?;
    let (mut values, mut times) = (Vec::new(), Vec::new());
    for (n, row) in reader.get_row_iter(None).map_err(refused)?.enumerate() {
        let fields = row.map_err(refused)?.into_columns();
        let number = |place: usize| {
            let (name, field) = &fields[place];
            let found = number_of(field).filter(|number| number.is_finite());
            found.ok_or_else(|| format!("row {n}: {name} is {field}, which is not a number"))
        };
        values.push(number(of_values)?);
        times.extend(of_times.map(&number).transpose()?);
    }
    let period_ns = period(&times)?;
    Ok(Wave { values, period_ns })
}

fn number_of(field: &Field) -> Option<f64> {
    Some(match *field {
        Field::Byte(number) => number.into(),
        Field::Short(number) => number.into(),
        Field::Int(number) => number.into(),
        Field::Long(number) => number as f64,
        Field::UByte(number) => number.into(),
        Field::UShort(number) => number.into(),
        Field::UInt(number) => number.into(),
        Field::ULong(number) => number as f64,
        Field::Float(number) => number.into(),
        Field::Double(number) => number,
        _ => return None,
    })
}

/// Reads a CSV file. The first line has the names of the columns. A column `t` has the times, in seconds.
fn of_csv(path: &Path, column: Option<&str>) -> Result<Wave, String> {
    let mut reader = csv::Reader::from_path(path).map_err(|error| unreadable(path, error))?;
    let header = reader.headers().map_err(|error| unreadable(path, error))?.clone();
    let names: Vec<&str> = header.iter().map(str::trim).collect();
    let (of_values, of_times) = columns(&names, column)?;
    let (mut values, mut times) = (Vec::new(), Vec::new());
    for record in reader.records() {
        let record = record.map_err(|error| unreadable(path, error))?;
        let number = |place: usize| {
            let text = record.get(place).unwrap_or("").trim();
            let found = text.parse::<f64>().ok().filter(|number| number.is_finite());
            let line = record.position().map_or(0, csv::Position::line);
            found.ok_or_else(|| format!("line {line}: {text:?} is not a number"))
        };
        values.push(number(of_values)?);
        times.extend(of_times.map(&number).transpose()?);
    }
    let period_ns = period(&times)?;
    Ok(Wave { values, period_ns })
}

/// Time from value to value. Each interval must be within a tenth of the mean.
fn period(times: &[f64]) -> Result<Option<u64>, String> {
    let [first, .., last] = times else { return Ok(None) };
    let period = (last - first) / (times.len() - 1) as f64;
    let odd = |pair: &[f64]| (pair[1] - pair[0] - period).abs() > 0.1 * period;
    if period <= 0.0 || times.windows(2).any(odd) {
        return Err("the times (column t) are not evenly spaced: give a file with even steps".into());
    }
    Ok(Some((period * 1e9).round() as u64))
}

/// Reads a channel of a WAV file. Full scale is 1.
fn of_wav(path: &Path, channel: u16) -> Result<Wave, String> {
    let refused = |error: hound::Error| unreadable(path, error);
    let mut reader = hound::WavReader::open(path).map_err(refused)?;
    let spec = reader.spec();
    if channel == 0 || channel > spec.channels {
        return Err(format!(
            "the file has {} channels, so there is no channel {channel}",
            spec.channels
        ));
    }
    let (skipped, step) = (usize::from(channel - 1), usize::from(spec.channels));
    let values: Result<Vec<f64>, hound::Error> = match spec.sample_format {
        hound::SampleFormat::Float => {
            let all = reader.samples::<f32>().skip(skipped).step_by(step);
            all.map(|sample| sample.map(f64::from)).collect()
        }
        hound::SampleFormat::Int => {
            let full = f64::from(1_u32 << (spec.bits_per_sample - 1));
            let all = reader.samples::<i32>().skip(skipped).step_by(step);
            all.map(|sample| sample.map(|sample| f64::from(sample) / full))
                .collect()
        }
    };
    Ok(Wave {
        values: values.map_err(refused)?,
        period_ns: Some((1e9 / f64::from(spec.sample_rate)).round() as u64),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_channel_of_a_wav_file_has_its_rate_and_full_scale_1() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("two.wav");
        let spec = hound::WavSpec {
            channels: 2,
            sample_rate: 50_000,
            bits_per_sample: 16,
            sample_format: hound::SampleFormat::Int,
        };
        let mut writer = hound::WavWriter::create(&path, spec).unwrap();
        for sample in [0_i16, 1, 16_384, 2, -32_768, 3] {
            writer.write_sample(sample).unwrap();
        }
        writer.finalize().unwrap();
        let wave = Wave::read(&path, None, None).unwrap();
        assert_eq!(wave.period_ns, Some(20_000));
        assert_eq!(wave.codes(Unit::Codes, 2000.0, 2048.0), Ok(vec![2048, 3048, 48]));
        let volts = Wave::read(&path, None, Some(1))
            .unwrap()
            .codes(Unit::Volts, 1.0, 1.65);
        assert_eq!(volts, Ok(vec![2048, 2668, 807]));
        let third = Wave::read(&path, None, Some(3)).unwrap_err();
        assert!(third.contains("2 channels"), "{third}");
    }

    #[test]
    fn a_column_of_a_parquet_file_has_the_times_of_its_column_t() {
        use parquet::data_type::{DoubleType, Int32Type};
        use parquet::file::writer::SerializedFileWriter;
        use parquet::schema::parser::parse_message_type;

        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("level.parquet");
        let schema = "message wave { REQUIRED DOUBLE t; REQUIRED INT32 code; REQUIRED DOUBLE volts; }";
        let schema = parse_message_type(schema).unwrap().into();
        let mut writer =
            SerializedFileWriter::new(File::create(&path).unwrap(), schema, Default::default()).unwrap();
        let mut rows = writer.next_row_group().unwrap();
        for values in [Some([0.0, 2e-5, 4e-5]), None, Some([0.0, 1.65, 3.3])] {
            let mut column = rows.next_column().unwrap().unwrap();
            match values {
                Some(values) => column.typed::<DoubleType>().write_batch(&values, None, None),
                None => column.typed::<Int32Type>().write_batch(&[5, 4095, 0], None, None),
            }
            .unwrap();
            column.close().unwrap();
        }
        rows.close().unwrap();
        writer.close().unwrap();

        let read = |column| Wave::read(&path, Some(column), None);
        let code = read("code").unwrap();
        assert_eq!(code.period_ns, Some(20_000));
        assert_eq!(code.codes(Unit::Codes, 1.0, 0.0), Ok(vec![5, 4095, 0]));
        let volts = read("volts").unwrap().codes(Unit::Volts, 1.0, 0.0);
        assert_eq!(volts, Ok(vec![0, 2048, 4095]));
        assert_eq!(
            read("x").unwrap_err(),
            "the file has no column \"x\", only t, code, volts"
        );
        let mut bytes = std::fs::read(&path).unwrap();
        bytes.truncate(bytes.len() - 9);
        std::fs::write(&path, bytes).unwrap();
        let damaged = read("code").unwrap_err();
        assert!(damaged.starts_with("cannot read"), "{damaged}");
    }

    #[test]
    fn times_that_are_not_even_are_refused() {
        assert_eq!(period(&[0.0, 1e-3, 2e-3]), Ok(Some(1_000_000)));
        assert_eq!(period(&[5.0]), Ok(None));
        assert!(period(&[0.0, 1e-3, 3e-3]).is_err());
        assert!(period(&[0.0, 0.0]).is_err());
    }
}
