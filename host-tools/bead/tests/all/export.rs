//! `bead export`: tables hold the recording bit for bit, in this program and in others.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::path::Path;

use crate::channels::record_again;
use crate::program::{TestFolder, assert_says, done, python, said};
use crate::recover::{is_of, old_bytes};
use crate::rows::{ModelBead, record};
use bead_recording::file::{About, Recording, RecordingWriter};
use bead_recording::frames::Item;
use bead_recording::signal::Signal;
use bead_recording::strikes::{RecordedStrike, assemble};
use bead_tables::whole::Target;
use bead_wire::Kind;
use hertz_chain::Scenario;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;
use serde_json::{Value, json};

/// Exports to a folder `tables` in each form. Returns the notes on the last one.
fn export_each(folder: &TestFolder, recordings: &str) -> String {
    let forms = ["parquet", "csv", "uff"].map(|form| {
        let output = folder.run(&format!("export {recordings} --out tables --format {form}"));
        let said = said(&output);
        let printed = done(output);
        assert_says(&printed, "MATLAB");
        assert_says(&printed, &format!(".{form}\""));
        said
    });
    forms.into_iter().next_back().unwrap()
}

fn strikes(path: &Path) -> Vec<RecordedStrike> {
    let frames = Recording::open(path).unwrap().frames().unwrap();
    assemble(frames.filter_map(Item::frame).collect(), None)
}

/// The columns of a Parquet file, each with its values.
fn parquet(path: &Path) -> BTreeMap<String, Vec<Value>> {
    let reader = SerializedFileReader::new(File::open(path).unwrap()).unwrap();
    let mut columns = BTreeMap::<String, Vec<Value>>::new();
    for row in reader.get_row_iter(None).unwrap() {
        for (name, field) in row.unwrap().get_column_iter() {
            columns.entry(name.clone()).or_default().push(match field {
                Field::Null => Value::Null,
                Field::Long(value) => (*value).into(),
                Field::Double(value) => (*value).into(),
                Field::Str(value) => value.as_str().into(),
                other => panic!("{name}: {other:?}"),
            });
        }
    }
    columns
}

/// Names of the columns of a Parquet file.
fn columns(path: &Path) -> Vec<String> {
    let reader = SerializedFileReader::new(File::open(path).unwrap()).unwrap();
    let columns = reader.metadata().file_metadata().schema_descr().columns().iter();
    columns.map(|column| column.name().to_owned()).collect()
}

/// Expected contents of the tables for these strikes.
fn expected(strikes: &[RecordedStrike]) -> Value {
    let signal = |strike: &RecordedStrike| Signal::of(&strike.scans, &strike.settings.unwrap()).unwrap();
    let forces = |signal: Signal| signal.force;
    let accelerations = |signal: Signal| signal.acceleration;
    let of_strikes = |of: fn(&RecordedStrike) -> Value| -> Value { strikes.iter().map(of).collect() };
    let of_scans = |of: fn(&RecordedStrike, usize) -> Value| -> Value {
        let values = |strike: &RecordedStrike| (0..strike.scans.len()).map(|at| of(strike, at)).collect();
        strikes.iter().flat_map::<Vec<Value>, _>(values).collect()
    };
    json!({
        "strikes": {
            "strike": of_strikes(|strike| strike.said.strike.into()),
            "nth_boot": of_strikes(|strike| strike.nth_boot.into()),
            "peak_force_n": of_strikes(|strike| strike.said.peak_force.newtons().into()),
            "peak_force_raw": of_strikes(|strike| strike.said.peak_force.bits().into()),
            "absorbed_measured_j": of_strikes(|strike| strike.said.absorbed_measured.joules().into()),
            "trigger_index": of_strikes(|strike| strike.said.trigger_index.into()),
            "absorbed_predicted_j": of_strikes(|strike| strike.said.absorbed_predicted.joules().into()),
            "impulse_n_s": of_strikes(|strike| strike.shape.unwrap().impulse.newton_seconds(100_000).into()),
            "ring_decay_per_s": of_strikes(|strike| strike.shape.unwrap().ring_decay.per_second().into()),
            "received_unix_ns": of_strikes(|strike| strike.received_ns.unwrap().into()),
            "settings_intruder_stiffness_n_per_m": of_strikes(|_| 3.95e5.into()),
        },
        "samples": {
            "force_n": strikes.iter().map(signal).flat_map(forces).collect::<Value>(),
            "acceleration_mps2": strikes.iter().map(signal).flat_map(accelerations).collect::<Value>(),
            "force_code": of_scans(|strike, at| strike.scans[at].sensitive[0].into()),
            "acceleration_code": of_scans(|strike, at| strike.scans[at].sensitive[1].into()),
            "sample_index": of_scans(|strike, at| (strike.said.first_index + at as u64).into()),
            "time_from_trigger_s": of_scans(|strike, at| {
                let index = strike.said.first_index as f64 + at as f64;
                ((index - strike.said.trigger_index as f64) / 1e5).into()
            }),
        },
    })
}

/// The values of a column of a CSV file, as text.
fn csv(path: &Path, column: &str) -> Vec<String> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    let mut names = reader.headers().unwrap().iter();
    let place = names.position(|name| name == column).unwrap();
    let rows = reader.records().map(Result::unwrap);
    rows.map(|row| row[place].to_owned()).collect()
}

/// The numbers of the data sets of type 58 in a universal file.
fn universal(text: &str) -> Vec<Vec<f64>> {
    let sets = text.split("    -1\n    -1\n");
    let data = sets.filter(|set| set.trim_start_matches([' ', '\n', '-', '1']).starts_with("58"));
    let numbers = |set: &str| {
        let lines = set.lines().skip_while(|line| line.trim() != "58").skip(12);
        let words = lines.flat_map(str::split_whitespace).filter(|word| *word != "-1");
        words.map(|word| word.parse().unwrap()).collect()
    };
    data.map(numbers).collect()
}

#[test]
fn tables_hold_the_recording_bit_for_bit() {
    let folder = TestFolder::new();
    let paths = ["one.mcap", "more.mcap"].map(|name| folder.join(name));
    record_again(&paths[0], 1);
    record_again(&paths[1], 3);
    let all: Vec<_> = paths.iter().flat_map(|path| strikes(path)).collect();
    assert_eq!(all.len(), 4);
    let said = export_each(&folder, "one.mcap more.mcap");
    assert_says(&said, "4 strikes with 2688 samples, of 2 recordings");
    let tables = folder.join("tables");
    let wanted = expected(&all);
    for table in ["strikes", "samples"] {
        let found = parquet(&tables.join(format!("{table}.parquet")));
        for (column, values) in wanted[table].as_object().unwrap() {
            assert_eq!(&Value::from(found[column].clone()), values, "{column}");
            let text = csv(&tables.join(format!("{table}.csv")), column);
            for (text, value) in text.iter().zip(values.as_array().unwrap()) {
                let same = match value.as_i64() {
                    Some(whole) => text.parse() == Ok(whole),
                    None => text.parse() == Ok(value.as_f64().unwrap()),
                };
                assert!(same, "{column}: {text}, {value}");
            }
        }
    }
    // A strike and its samples have one id, and a recording its name. The last three strikes have one number,
    // as the bead restarted before each.
    let [rows, samples] = ["strikes.parquet", "samples.parquet"].map(|name| parquet(&tables.join(name)));
    let recordings = ["one.mcap", "more.mcap", "more.mcap", "more.mcap"];
    assert_eq!(rows["recording"], recordings.map(Value::from));
    let boots = [0, 0, 1, 2];
    for (id, boot) in boots.into_iter().enumerate() {
        assert!(rows["id"][id] == id && rows["nth_boot"][id] == boot);
        let scans = 672 * id..672 * (id + 1);
        assert!(samples["id"][scans.clone()].iter().all(|of| *of == id));
        assert!(samples["nth_boot"][scans].iter().all(|of| *of == boot));
    }
    // Codes of an unused low gain are null.
    assert!(samples["force_wide_code"].contains(&Value::Null));

    let uff = fs::read_to_string(tables.join("strikes.uff")).unwrap();
    assert_says(&uff, "boot 2 of the recording");
    let data = universal(&uff);
    assert_eq!(data.len(), 8);
    // Type 17 of a UFF axis is time.
    assert_says(&uff, "        17    0    0    0 Time");
    for (sensor, column, scale) in [(0, "force_n", 65536.0), (1, "acceleration_mps2", 4096.0)] {
        let values = data.iter().skip(sensor).step_by(2).flatten();
        let values: Vec<f64> = values.map(|value| (value * scale).round() / scale).collect();
        assert_eq!(json!(values), wanted["samples"][column], "{column}");
    }
}

#[test]
fn strikes_without_settings_are_codes_in_tables_and_left_out_of_universal_files() {
    let folder = TestFolder::new();
    let bytes = old_bytes();
    let runs = bytes.split_inclusive(|byte| *byte == 0);
    let bare: Vec<_> = runs.filter(|run| !is_of(run, Kind::Settings)).collect();
    folder.write("raw.bin", bare.concat());
    folder.done("recover raw.bin --out bare.mcap");
    for (form, count, reason) in [
        ("csv", "1 strike with 672 samples", "1 of them came without"),
        ("uff", "0 strikes with 0 samples", "1 more strike is not written"),
    ] {
        let output = folder.run(&format!("export bare.mcap --out tables --format {form}"));
        let said = said(&output);
        done(output);
        let is_told = said.contains(count) && said.contains(reason);
        assert!(is_told && !said.contains("no strike in it"), "{said}");
    }
}

#[test]
fn the_columns_and_the_bytes_are_the_same_every_time() {
    let folder = TestFolder::new();
    record_again(&folder.join("strike.mcap"), 1);
    let quiet = RecordingWriter::create(&Target::new(folder.join("quiet.mcap")), &About::default()).unwrap();
    quiet.finish().unwrap();
    for name in ["strike", "quiet"] {
        let output = folder.run(&format!("export {name}.mcap --out {name}"));
        let is_quiet = said(&output).contains("quiet.mcap: no strike in it");
        assert_eq!(is_quiet, name == "quiet");
        done(output);
    }
    for table in ["strikes.parquet", "samples.parquet"] {
        let names = columns(&folder.join("strike").join(table));
        assert_eq!(names, columns(&folder.join("quiet").join(table)));
        assert_eq!(names.iter().collect::<BTreeSet<_>>().len(), names.len());
    }
    // Empty are the name, values that the settings do not state, and values that the first image did not
    // send.
    let rows = parquet(&folder.join("strike/strikes.parquet"));
    let unknown = rows.iter().filter(|(_, values)| values[0].is_null());
    let groups = "bead_name conditions_ left_ settings_followers_ settings_sensor_end_ settings_supply_ \
                  settings_uncertainty_ u_ uncertainty_ waveform_";
    for (name, _) in unknown {
        let mut groups = groups.split_whitespace();
        assert!(groups.any(|group| name.starts_with(group)), "{name}");
    }
    // Tables are replaced only with --overwrite, by the same bytes.
    let read = || folder.read("strike/samples.parquet");
    let before = read();
    folder.refused("2 | strike/strikes.parquet | export strike.mcap --out strike");
    folder.done("export strike.mcap --out strike --overwrite");
    assert!(read() == before);
}

#[test]
fn pandas_polars_xarray_pyuff_and_mcap_read_the_same_bits() {
    let folder = TestFolder::new();
    let path = folder.join("strikes.mcap");
    record_again(&path, 3);
    export_each(&folder, "strikes.mcap");
    let tables = folder.join("tables");
    let mut wanted = expected(&strikes(&path));
    for table in ["strikes", "samples"] {
        wanted["columns"][table] = columns(&tables.join(format!("{table}.parquet"))).into();
    }
    folder.write("expected.json", wanted.to_string());
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/opened_elsewhere.py");
    let inputs = ["strikes.mcap", "tables", "expected.json"];
    if let Some(printed) = python(&folder, &[&[script][..], &inputs].concat()) {
        print!("{printed}");
        assert_eq!(printed.lines().count(), 7);
    }
}

#[test]
fn a_window_without_its_first_frames_is_exported_with_the_gap_as_null_and_what_came_is_counted() {
    let folder = TestFolder::new();
    let scenario = Scenario::paper();
    let [whole, lossy] = [("whole", 0), ("lossy", 1)].map(|(name, frames_lost)| {
        let mut bead = ModelBead::at(8);
        (bead.synced, bead.frames_lost) = (false, frames_lost);
        record(&folder.join(format!("{name}.mcap")), &scenario, &[bead], 1);
        folder.done(&format!("export {name}.mcap --out {name} --format csv"));
        let column = |table: &str, column| csv(&folder.join(format!("{name}/{table}.csv")), column);
        let received = column("strikes", "samples_received")[0].parse().unwrap();
        let [index, code] = ["sample_index", "force_code"].map(|name| column("samples", name));
        (received, index, code)
    });
    let first = 672usize.strict_sub(lossy.0);
    assert!((1..100).contains(&first) && whole.0 == 672, "{first}");
    // One row for each scan, even for lost ones, at the same index.
    assert_eq!(lossy.1, whole.1);
    assert!(lossy.2[..first].iter().all(String::is_empty));
    assert_eq!(lossy.2[first..], whole.2[first..]);
}
