//! Every command of docs/waveforms.md, and a recorded strike played again from every form of file.

use std::fmt::Write;
use std::fs;
use std::io::Write as _;
use std::path::Path;

use crate::first_strike::copy_scenario;
use crate::program::{DATA, ROOT, SCENARIO, TestFolder, python, shell};
use crate::rows::{ModelBead, record};
use bead_compare::replay::replay;
use bead_compare::sensed::{load_scenario, simulate_with_ring_down};
use bead_recording::file::Recording;
use bead_recording::signal::Signal;
use bead_recording::strikes::RecordedStrike;
use flate2::Compression;
use flate2::write::GzEncoder;
use hertz_chain::Scenario;
use hound::{SampleFormat, WavSpec, WavWriter};
use serde_json::Value;

/// Full scale of the channels of `drop.wav`: N and m/s².
const FULL: [f64; 2] = [16.0, 500.0];

/// Writes the force at bead 8 as an oscilloscope of eight bits saves it: at 1 MHz, with the trigger at time 0
/// and 8.9 N a volt.
fn scope(path: &Path) {
    let (scenario, _) = load_scenario(Path::new(SCENARIO)).unwrap();
    let mut force = simulate_with_ring_down(&scenario).unwrap().force_curve(8);
    let mut text = String::from("Model,SCOPE 8\nSample Interval,1e-6,\n\nTIME,CH1\n");
    for n in 0..8000 {
        let time = f64::from(n) * 1e-6;
        // A step of the converter is 8 mV; its noise is half of that.
        let noise = 0.5 * (f64::from(n) * 12.9898).sin();
        let volts = ((force.at(time) / 8.9 / 8e-3) + noise).round() * 8e-3;
        writeln!(text, "{:.7e},{volts:.4}", time - 1.5e-3).unwrap();
    }
    fs::write(path, text).unwrap();
}

/// Writes both signals of a strike as channels of a WAV file at the rate of the bead.
fn drop_rig(path: &Path, strike: &RecordedStrike) {
    let spec = WavSpec {
        channels: 2,
        sample_rate: strike.rate().unwrap(),
        bits_per_sample: 32,
        sample_format: SampleFormat::Float,
    };
    let signal = Signal::of(&strike.scans, &strike.settings.unwrap()).unwrap();
    let mut writer = WavWriter::create(path, spec).unwrap();
    for (force, acceleration) in signal.force.iter().zip(&signal.acceleration) {
        writer.write_sample((force / FULL[0]) as f32).unwrap();
        writer.write_sample((acceleration / FULL[1]) as f32).unwrap();
    }
    writer.finalize().unwrap();
}

fn strikes(path: &Path) -> Vec<RecordedStrike> {
    Recording::open_named(path).unwrap().strikes().unwrap().collect()
}

#[test]
fn every_command_of_the_page_works() {
    let folder = TestFolder::new();
    copy_scenario(&folder);
    scope(&folder.join("scope.csv"));
    let old = strikes(&Path::new(DATA).join("recording-v1.mcap"));
    drop_rig(&folder.join("drop.wav"), &old[0]);
    let page = fs::read_to_string(format!("{ROOT}/docs/waveforms.md")).unwrap();
    let lines = page.lines().filter_map(|line| line.strip_prefix("    "));
    let commands: Vec<_> = lines
        .filter(|line| line.starts_with("bead ") || line.ends_with("> quiet.toml"))
        .collect();
    assert_eq!(commands.len(), 9);
    for line in commands {
        shell(&folder, line);
    }
    let report = folder.text("against.html");
    assert!(report.contains("residual (N)") && report.contains("scope.csv"));
    // The oscilloscope and the bead agree within the resolution of eight bits.
    let against = "bead compare mine/bead-8.mcap --reference scope.csv --read force=CH1:8.9N --format json";
    let against: Value = serde_json::from_str(&shell(&folder, against)).unwrap();
    let force = &against["against"]["force"];
    let number = |key: &str| force[key].as_f64().unwrap();
    println!("{force}");
    assert!(number("correlation") > 0.9995 && (number("gain") - 1.0).abs() < 2e-3);
    assert!(number("arrival_off").abs() < 0.5e-6 && number("residual_part") < 0.01);
    assert_eq!(against["reference"]["was_played"], true);
    assert_eq!(against["against"]["acceleration"], Value::Null);
}

#[test]
fn a_strike_played_again_has_the_same_codes_from_every_form_of_file() {
    let folder = TestFolder::new();
    let scenario = fs::read_to_string(SCENARIO).unwrap();
    folder.write("quiet.toml", scenario + "\n[front_end]\nnoise = false\n");
    let emulate = "bead emulate quiet.toml --bead 8";
    shell(&folder, &format!("{emulate} --out run"));
    shell(&folder, "bead export run/bead-8.mcap --out tables");
    shell(&folder, "bead export run/bead-8.mcap --out tables --format csv");
    let mut packed = GzEncoder::new(Vec::new(), Compression::fast());
    packed.write_all(&folder.read("tables/samples.csv")).unwrap();
    folder.write("tables/samples.csv.gz", packed.finish().unwrap());
    let first = strikes(&folder.join("run/bead-8.mcap")).swap_remove(0);
    drop_rig(&folder.join("drop.wav"), &first);
    // Channels of a WAV file are sampled at one time, those of a bead one after another.
    let channels = "drop.wav --read force=1:16N --read acceleration=2:500m/s2";
    for (name, sensors, file) in [
        ("mcap", 2, "run/bead-8.mcap"),
        ("csv", 2, "tables/samples.csv"),
        ("gzip", 2, "tables/samples.csv.gz"),
        ("parquet", 2, "tables/samples.parquet"),
        ("wav", 1, channels),
    ] {
        shell(&folder, &format!("{emulate} --stimulus {file} --out {name}"));
        let again = strikes(&folder.join(name).join("bead-8.mcap")).swap_remove(0);
        assert_eq!(replay(&again).first_difference, None);
        assert_eq!(again.said.samples, first.said.samples);
        let mut scans = first.scans.iter().zip(&again.scans).skip(40).take(600);
        let is_same = scans.all(|(one, other)| one.sensitive[..sensors] == other.sensitive[..sensors]);
        assert!(is_same, "{name}: a code is another");
        let off = again.said.absorbed_measured.joules() / first.said.absorbed_measured.joules() - 1.0;
        println!("{name}: A off by {off:.1e}");
        assert!(off.abs() < 5e-4, "{name}: {off}");
    }
}

/// The comparison of a recorded strike with the same strike in another file.
fn against(folder: &TestFolder, reference: &str) -> Value {
    let line = format!("compare strike.mcap --reference {reference} --format json");
    folder.json(&line)["against"].take()
}

#[test]
fn files_of_numpy_matlab_and_polars_hold_the_same_waveform_as_the_table_that_they_were_made_of() {
    let folder = TestFolder::new();
    let path = folder.join("strike.mcap");
    record(&path, &Scenario::paper(), &[ModelBead::at(8)], 1);
    folder.done("export strike.mcap --out tables --format csv");
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/written_elsewhere.py");
    let Some(_) = python(&folder, &[script, "tables/samples.csv"]) else {
        return;
    };
    let times = "--read time=1:s --read force=2:N --read acceleration=3:m/s2";
    let wanted = against(&folder, "table.csv");
    println!("{wanted}");
    for reference in [
        format!("rows.npy {times}"),
        format!("columns.npy {times}"),
        "packed.mat".to_owned(),
        "zstd.parquet".to_owned(),
    ] {
        assert_eq!(against(&folder, &reference), wanted, "{reference}");
    }
    // Files without a column of time: by a rate, and by the interval in the file. Times count from the
    // first row.
    let no_times = against(&folder, "force.npy --read force=1:N --read rate=100000");
    let channels = "matrix.mat --read force=m_1:N --read acceleration=m_2:m/s2";
    let matrix = against(&folder, channels);
    for found in [&no_times["force"], &matrix["force"]] {
        is_as_great(&found["gain"], &wanted["force"]["gain"]);
    }
    is_as_great(&matrix["acceleration"]["gain"], &wanted["acceleration"]["gain"]);
}

/// Checks two numbers but for the rounding of times.
fn is_as_great(found: &Value, wanted: &Value) {
    let [found, wanted] = [found, wanted].map(|value| value.as_f64().unwrap());
    assert!((found / wanted - 1.0).abs() < 1e-6, "{found} for {wanted}");
}
