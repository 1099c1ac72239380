//! docs/waveforms.md: every command of the page, and a recorded strike played again from every form of file.

use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::process::Command;

use bead_compare::replay::replay;
use bead_compare::sensed::{load_scenario, simulate_with_ring_down};
use bead_recording::received::Received;
use bead_recording::signal::Signal;
use bead_recording::strikes::RecordedStrike;
use hound::{SampleFormat, WavSpec, WavWriter};
use serde_json::Value;

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
const SCENARIO: &str = "docs/scenarios/paper-strike.toml";
/// Full scale of the channels of `drop.wav`: N and m/s².
const FULL: [f64; 2] = [16.0, 500.0];

/// A folder with the scenario.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir_all(folder.path().join("docs/scenarios")).unwrap();
    fs::copy(format!("{ROOT}/{SCENARIO}"), folder.path().join(SCENARIO)).unwrap();
    folder
}

/// Runs a line of a shell with `bead` in its path; what it printed.
fn typed(folder: &Path, line: &str) -> String {
    let program = Path::new(env!("CARGO_BIN_EXE_bead"));
    let path = std::env::var("PATH").unwrap();
    let output = Command::new("sh")
        .args(["-ec", line])
        .current_dir(folder)
        .env("PATH", format!("{}:{path}", program.parent().unwrap().display()))
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{line}: {said}");
    String::from_utf8(output.stdout).unwrap()
}

/// Writes the force at bead 8 as an oscilloscope of eight bits saves it: 1 MHz, its trigger at time 0, 8.9 N
/// a volt.
fn scope(path: &Path) {
    let (scenario, _) = load_scenario(Path::new(&format!("{ROOT}/{SCENARIO}"))).unwrap();
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

/// Both signals of a strike as channels of a WAV file at the bead's rate, padded with rest.
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
    Received::open(path).unwrap().strikes().unwrap().collect()
}

#[test]
fn every_command_of_the_page_works() {
    let folder = folder();
    let folder = folder.path();
    scope(&folder.join("scope.csv"));
    let old = strikes(Path::new(&format!("{ROOT}/tests/data/recording-v1.mcap")));
    drop_rig(&folder.join("drop.wav"), &old[0]);
    let page = fs::read_to_string(format!("{ROOT}/docs/waveforms.md")).unwrap();
    let lines = page.lines().filter_map(|line| line.strip_prefix("    "));
    let mut commands = 0;
    for line in lines.filter(|line| line.starts_with("bead ")) {
        typed(folder, line);
        commands += 1;
    }
    assert_eq!(commands, 8);
    let report = fs::read_to_string(folder.join("against.html")).unwrap();
    assert!(report.contains("residual (N)") && report.contains("scope.csv"));
    // The oscilloscope and the bead that it was played to agree, as far as eight bits do.
    let against = "bead compare mine/bead-8.mcap --reference scope.csv --read force=CH1:8.9N --format json";
    let against: Value = serde_json::from_str(&typed(folder, against)).unwrap();
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
    let folder = folder();
    let folder = folder.path();
    let emulate = format!("bead emulate {SCENARIO} --bead 8 --noise off");
    typed(folder, &format!("{emulate} --out run"));
    typed(folder, "bead export run/bead-8.mcap --out tables");
    typed(folder, "bead export run/bead-8.mcap --out tables --format csv");
    let first = strikes(&folder.join("run/bead-8.mcap")).swap_remove(0);
    drop_rig(&folder.join("drop.wav"), &first);
    let wav = "drop.wav --read force=1:16N --read acceleration=2:500m/s2";
    for (name, file) in [
        ("mcap", "run/bead-8.mcap"),
        ("csv", "tables/samples.csv"),
        ("parquet", "tables/samples.parquet"),
        ("wav", wav),
    ] {
        typed(folder, &format!("{emulate} --stimulus {file} --out {name}"));
        let again = strikes(&folder.join(name).join("bead-8.mcap")).swap_remove(0);
        assert_eq!(replay(&again).first_difference, None);
        assert_eq!(again.said.samples, first.said.samples);
        // A WAV file's channels are of one time, a bead's are not: see the page.
        let sensors = if name == "wav" { 1 } else { 2 };
        let differs = first
            .scans
            .iter()
            .zip(&again.scans)
            .skip(40)
            .take(600)
            .any(|(one, other)| {
                (0..sensors).any(|sensor| one.sensitive[sensor].abs_diff(other.sensitive[sensor]) > 0)
            });
        assert!(!differs, "{name}: a code is another");
        let off = again.said.absorbed_measured.joules() / first.said.absorbed_measured.joules() - 1.0;
        println!("{name}: A off by {off:.1e}");
        assert!(off.abs() < 5e-4, "{name}: {off}");
    }
    // The estimate in f64 stands beside each, three times at three phases of the scans.
    let json = typed(
        folder,
        &format!("{emulate} --stimulus tables/samples.csv --strikes 3 --format json"),
    );
    let report: Value = serde_json::from_str(&json).unwrap();
    let played = report["strikes"].as_array().unwrap();
    assert_eq!(played.len(), 3);
    for strike in played {
        assert_eq!(strike.get("truth"), None);
        for (estimate, most) in [("absorbed_measured", 5e-4), ("absorbed_predicted", 1e-3)] {
            let [bead, given] = [strike, &strike["given"]].map(|of| of[estimate].as_f64().unwrap());
            let off = bead / given - 1.0;
            println!("{estimate}: {off:.1e}");
            assert!(off.abs() < most, "{estimate}: {off}");
        }
    }
}
