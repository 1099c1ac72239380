//! `bead export`: what comes out is what the recording holds, in every bit, for whoever opens it.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::program::{bead, said};
use bead_recording::file::{About, Recording, Writer};
use bead_recording::frames::Item;
use bead_recording::signal::Signal;
use bead_recording::strikes::{RecordedStrike, assemble};
use bead_tables::whole::Target;
use bead_wire::{MAX_FRAME, Message, encode};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;
use serde_json::{Value, json};

const DATA: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data");

fn export(folder: &Path, arguments: &[&str]) -> Output {
    bead(folder, [&["export"], arguments].concat())
}

/// A recording of the old strike `times` times over, by today's program, received at the host's times.
fn recorded(path: &Path, times: u64) {
    let old = Recording::open(Path::new(&format!("{DATA}/recording-v1.mcap"))).unwrap();
    let mut writer = Writer::create(&Target::new(path), &About::default()).unwrap();
    for round in 0..times {
        for (n, piece) in (0..).zip(old.pieces().unwrap()) {
            let received_ns = 1_700_000_000_000_000_000 + round * 1_000_000_000 + n * 1_000_000;
            writer.write(&piece.bytes, Some(received_ns), |_| {}).unwrap();
        }
    }
    writer.finish().unwrap();
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

fn names(path: &Path) -> Vec<String> {
    let reader = SerializedFileReader::new(File::open(path).unwrap()).unwrap();
    let schema = reader.metadata().file_metadata().schema_descr();
    schema
        .columns()
        .iter()
        .map(|column| column.name().to_owned())
        .collect()
}

/// Expected contents of the tables for these strikes.
fn expected(strikes: &[RecordedStrike]) -> Value {
    let signals: Vec<Signal> = strikes
        .iter()
        .map(|strike| Signal::of(&strike.scans, &strike.settings.unwrap()).unwrap())
        .collect();
    let of_strikes = |of: fn(&RecordedStrike) -> Value| -> Value { strikes.iter().map(of).collect() };
    let of_scans = |of: &dyn Fn(&RecordedStrike, usize) -> Value| -> Value {
        let each = strikes
            .iter()
            .flat_map(|strike| (0..strike.scans.len()).map(|at| of(strike, at)));
        each.collect::<Vec<_>>().into()
    };
    json!({
        "strikes": {
            "strike": of_strikes(|strike| strike.said.strike.into()),
            "nth_boot": of_strikes(|strike| strike.nth_boot.into()),
            "trigger_index": of_strikes(|strike| strike.said.trigger_index.into()),
            "peak_force_n": of_strikes(|strike| strike.said.peak_force.newtons().into()),
            "peak_force_raw": of_strikes(|strike| strike.said.peak_force.bits().into()),
            "absorbed_measured_j": of_strikes(|strike| strike.said.absorbed_measured.joules().into()),
            "absorbed_predicted_j": of_strikes(|strike| strike.said.absorbed_predicted.joules().into()),
            "absorbed_predicted_raw": of_strikes(|strike| strike.said.absorbed_predicted.bits().into()),
            "impulse_n_s": of_strikes(|strike| strike.shape.unwrap().impulse.newton_seconds(100_000).into()),
            "ring_decay_per_s": of_strikes(|strike| strike.shape.unwrap().ring_decay.per_second().into()),
            "received_unix_ns": of_strikes(|strike| strike.received_ns.unwrap().into()),
            "settings_force_per_code_n": of_strikes(|_| (16.0 / 4096.0).into()),
            "settings_intruder_stiffness_n_per_m": of_strikes(|_| 3.95e5.into()),
        },
        "samples": {
            "force_n": signals.iter().flat_map(|signal| signal.force.clone()).collect::<Vec<_>>(),
            "acceleration_mps2": signals.iter().flat_map(|signal| signal.acceleration.clone()).collect::<Vec<_>>(),
            "force_code": of_scans(&|strike, at| strike.scans[at].sensitive[0].into()),
            "acceleration_code": of_scans(&|strike, at| strike.scans[at].sensitive[1].into()),
            "sample_index": of_scans(&|strike, at| (strike.said.first_index + at as u64).into()),
            "time_from_trigger_s": of_scans(&|strike, at| {
                let index = strike.said.first_index as f64 + at as f64;
                ((index - strike.said.trigger_index as f64) / 1e5).into()
            }),
        },
    })
}

/// The values of a column of a CSV file, as text.
fn csv(path: &Path, column: &str) -> Vec<String> {
    let text = fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let place = lines
        .next()
        .unwrap()
        .split(',')
        .position(|name| name == column)
        .unwrap();
    lines
        .map(|line| line.split(',').nth(place).unwrap().to_owned())
        .collect()
}

#[test]
fn tables_hold_the_recording_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let paths: [PathBuf; 2] = ["one.mcap", "more.mcap"].map(|name| folder.join(name));
    recorded(&paths[0], 1);
    recorded(&paths[1], 3);
    let all: Vec<_> = paths.iter().flat_map(|path| strikes(path)).collect();
    assert_eq!(all.len(), 4);
    for form in ["parquet", "csv", "uff"] {
        let output = export(
            folder,
            &["one.mcap", "more.mcap", "--out", "tables", "--format", form],
        );
        assert!(output.status.success(), "{}", said(&output));
        let lines = String::from_utf8(output.stdout.clone()).unwrap();
        assert!(
            lines.contains("MATLAB") && lines.contains(&format!(".{form}\"")),
            "{lines}"
        );
        assert!(said(&output).contains("4 strikes with 2688 samples, of 2 recordings, now in tables"));
    }
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
    // A strike and its samples have one id, and a recording its name.
    let samples = parquet(&tables.join("samples.parquet"));
    let rows = parquet(&tables.join("strikes.parquet"));
    assert_eq!(rows["id"], [0, 1, 2, 3].map(Value::from));
    assert_eq!(
        rows["recording"],
        ["one.mcap", "more.mcap", "more.mcap", "more.mcap"].map(Value::from)
    );
    for (n, id) in samples["id"].iter().enumerate() {
        assert_eq!(*id, json!(n / 672));
    }
    // The three strikes have one number: the bead began anew before each.
    assert_eq!(rows["nth_boot"], [0, 0, 1, 2].map(Value::from));
    for (id, nth) in samples["id"].iter().zip(&samples["nth_boot"]) {
        assert_eq!(rows["nth_boot"][id.as_u64().unwrap() as usize], *nth);
    }
    // Where the low gain had no part, its code is null.
    assert!(samples["force_wide_code"].contains(&Value::Null));

    let uff = fs::read_to_string(tables.join("strikes.uff")).unwrap();
    let data: Vec<Vec<f64>> = uff
        .split("    -1\n    -1\n")
        .filter(|set| set.trim_start_matches([' ', '\n', '-', '1']).starts_with("58"))
        .map(|set| {
            let lines = set.lines().skip_while(|line| line.trim() != "58").skip(12);
            let numbers = lines
                .flat_map(|line| line.split_whitespace())
                .filter(|number| *number != "-1");
            numbers.map(|number| number.parse().unwrap()).collect()
        })
        .collect();
    assert_eq!(data.len(), 8);
    assert!(uff.contains("boot 2 of the recording"), "{uff}");
    for (sensor, column, scale) in [(0, "force_n", 65536.0), (1, "acceleration_mps2", 4096.0)] {
        let told = data.iter().skip(sensor).step_by(2).flatten();
        let told: Vec<f64> = told.map(|value| (value * scale).round() / scale).collect();
        assert_eq!(json!(told), wanted["samples"][column], "{column}");
    }
}

#[test]
fn strikes_without_settings_are_codes_in_tables_and_left_out_of_universal_files() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let old = Recording::open(Path::new(&format!("{DATA}/recording-v1.mcap"))).unwrap();
    let mut writer = Writer::create(&Target::new(folder.join("bare.mcap")), &About::default()).unwrap();
    for frame in old.frames().unwrap().filter_map(Item::frame) {
        if !matches!(frame.message, Message::Settings(_)) {
            let bytes = encode(&frame.header, &frame.message, &mut [0; MAX_FRAME])
                .unwrap()
                .to_vec();
            writer.write(&bytes, None, |_| {}).unwrap();
        }
    }
    writer.finish().unwrap();
    for (form, wanted) in [
        (
            "csv",
            ["1 strike with 672 samples", "1 of them came without settings"],
        ),
        (
            "uff",
            ["0 strikes with 0 samples", "1 more strike is not written"],
        ),
    ] {
        let output = export(folder, &["bare.mcap", "--out", "tables", "--format", form]);
        assert!(output.status.success(), "{}", said(&output));
        let said = said(&output);
        assert!(wanted.iter().all(|wanted| said.contains(wanted)), "{said}");
        assert!(!said.contains("no strike in it"), "{said}");
    }
}

#[test]
fn the_columns_are_the_same_whatever_the_data() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    recorded(&folder.join("strike.mcap"), 1);
    Writer::create(&Target::new(folder.join("quiet.mcap")), &About::default())
        .unwrap()
        .finish()
        .unwrap();
    for name in ["strike", "quiet"] {
        let recording = format!("{name}.mcap");
        let output = export(folder, &[&recording, "--out", name]);
        assert!(output.status.success(), "{}", said(&output));
        assert_eq!(
            said(&output).contains("quiet.mcap: no strike in it"),
            name == "quiet"
        );
    }
    for table in ["strikes.parquet", "samples.parquet"] {
        let columns = names(&folder.join("strike").join(table));
        assert_eq!(columns, names(&folder.join("quiet").join(table)));
        let distinct: std::collections::BTreeSet<_> = columns.iter().collect();
        assert_eq!(distinct.len(), columns.len());
    }
    // Every column of the recorded strike is known but for those that say so.
    let rows = parquet(&folder.join("strike/strikes.parquet"));
    let unknown: Vec<_> = rows
        .iter()
        .filter(|(_, values)| values[0].is_null())
        .map(|(name, _)| name.as_str())
        .collect();
    assert_eq!(unknown, ["bead_name"]);
}

#[test]
fn nothing_is_replaced_and_nothing_counts_twice() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    recorded(&folder.join("strike.mcap"), 1);
    let refused = |arguments: &[&str], why: &str| {
        let output = export(folder, arguments);
        let said = said(&output);
        assert_eq!(
            (output.status.code(), said.lines().count()),
            (Some(2), 1),
            "{said}"
        );
        assert!(said.contains(why), "{said}");
    };
    refused(
        &["strike.mcap", "./strike.mcap", "--out", "t"],
        "./strike.mcap is given twice",
    );
    refused(&["missing.mcap", "--out", "t"], "missing.mcap");
    assert!(!folder.join("t").exists(), "nothing is begun before all is known");
    assert!(export(folder, &["strike.mcap", "--out", "t"]).status.success());
    let before = fs::read(folder.join("t/samples.parquet")).unwrap();
    refused(&["strike.mcap", "--out", "t"], "t/strikes.parquet");
    refused(&["strike.mcap", "--out", "strike.mcap"], "strike.mcap is a file");
    assert!(
        export(folder, &["strike.mcap", "--out", "t", "--overwrite"])
            .status
            .success()
    );
    // The same strikes give the same bytes.
    assert_eq!(fs::read(folder.join("t/samples.parquet")).unwrap(), before);
    fs::write(
        folder.join("future.bin"),
        fs::read(format!("{DATA}/frame-of-the-future.bin")).unwrap(),
    )
    .unwrap();
    let mut writer = Writer::create(&Target::new(folder.join("future.mcap")), &About::default()).unwrap();
    writer
        .write(&fs::read(folder.join("future.bin")).unwrap(), None, |_| {})
        .unwrap();
    writer.finish().unwrap();
    refused(
        &["strike.mcap", "future.mcap", "--out", "u"],
        "speaks version 9 of the protocol",
    );
    assert!(!folder.join("u/strikes.parquet").exists());
}

/// A Python with pandas, polars, pyuff, xarray and mcap, as `cargo xtask test` sets it up where it can.
fn python() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_BIN_EXE_bead")).ancestors().nth(2).unwrap();
    let own = std::env::var_os("BEAD_PYTHON").map(PathBuf::from);
    own.or_else(|| Some(folder.join("python/bin/python3")).filter(|path| path.exists()))
}

#[test]
fn pandas_polars_xarray_pyuff_and_mcap_read_the_same_bits() {
    let Some(python) = python() else {
        // Held by the tests above, with this program's own readers.
        eprintln!("SKIPPED: no Python with pandas, polars, pyuff and mcap; `cargo xtask python` sets one up");
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let path = folder.join("strikes.mcap");
    recorded(&path, 3);
    for form in ["parquet", "csv", "uff"] {
        let output = export(folder, &["strikes.mcap", "--out", "tables", "--format", form]);
        assert!(output.status.success(), "{}", said(&output));
    }
    let tables = folder.join("tables");
    let mut wanted = expected(&strikes(&path));
    for table in ["strikes", "samples"] {
        wanted["columns"][table] = names(&tables.join(format!("{table}.parquet"))).into();
    }
    fs::write(folder.join("expected.json"), wanted.to_string()).unwrap();
    let read = Command::new(python)
        .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/opened_elsewhere.py"))
        .args([&path, &tables, &folder.join("expected.json")])
        .output()
        .unwrap();
    print!("{}", String::from_utf8_lossy(&read.stdout));
    assert!(read.status.success(), "{}", said(&read));
    assert_eq!(read.stdout.iter().filter(|&&byte| byte == b'\n').count(), 7);
}
