//! `bead analyse`: spectra as endaq and scipy have them, units, uncertainties, and what is left out.

use std::time::Instant;

use hertz_chain::Scenario;
use serde_json::Value;

use crate::budget::STATED;
use crate::program::{ROOT, TestFolder, assert_says, python, said};
use crate::rows::{ModelBead, record};

/// A folder with a recording of three strikes of a bead.
fn folder() -> TestFolder {
    let folder = TestFolder::new();
    record(&folder.join("x.mcap"), &Scenario::paper(), &[ModelBead::at(8)], 3);
    folder
}

fn points(report: &Value) -> &Vec<Value> {
    report["beads"][0]["points"].as_array().unwrap()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

#[test]
fn endaq_and_scipy_have_the_same_spectra() {
    let folder = folder();
    folder.done("export x.mcap --out tables --format csv");
    for line in [
        "srs x.mcap --out srs.csv",
        "psd x.mcap --of force --segment 128 --out psd-hann.csv",
        "psd x.mcap --of force --segment 128 --window flat-top --out psd-flat-top.csv",
        "psd x.mcap --of force --segment 128 --window rectangular --out psd-rectangular.csv",
        "fft x.mcap --out fft.csv",
        "transfer x.mcap",
    ] {
        let printed = folder.done(&format!("analyse {line} --format json"));
        let name = line.split(' ').next().unwrap();
        folder.write(&format!("{name}.json"), printed);
    }
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/spectra_by_scipy.py");
    if let Some(printed) = python(&folder, &[script, "tables/samples.csv"]) {
        assert_eq!(printed, "3 strikes, 67 lines\n");
    }
}

#[test]
fn responses_and_units_are_those_that_are_asked_for() {
    let folder = folder();
    let report = |options: &str| folder.json(&format!("analyse srs x.mcap --format json {options}"));
    let (si, g) = (report(""), report("--unit g"));
    let [velocity, way] =
        ["pseudo-velocity", "relative-displacement"].map(|of| report(&format!("--response {of}")));
    let units = [&si, &g, &velocity, &way].map(|report| report["beads"][0]["unit"].clone());
    assert_eq!(units, ["m/s²", "g", "m/s", "m"]);
    for (place, point) in points(&si).iter().enumerate() {
        let of = |report: &Value| number(&points(report)[place]["mean"]);
        let omega = std::f64::consts::TAU * number(&point["frequency_hz"]);
        assert!((of(&si) / of(&g) / 9.806_65 - 1.0).abs() < 1e-12);
        assert!((of(&velocity) / of(&way) / omega - 1.0).abs() < 1e-12);
    }
    let one = folder.json("analyse srs x.mcap --strike 1 --format json --per-octave 1 --from 400 --to 5000");
    let frequencies = points(&one).iter().map(|point| &point["frequency_hz"]);
    assert!(frequencies.eq([500.0, 1000.0, 2000.0, 4000.0].iter()));
    assert_eq!(one["beads"][0]["strikes"][0]["strike"], 1);
    assert!(points(&one)[0]["standard_deviation"].is_null());
}

#[test]
fn the_uncertainty_is_that_of_the_settings_and_of_the_scatter_or_unknown() {
    let folder = folder();
    let unknown = folder.json("analyse srs x.mcap --format json");
    assert!(points(&unknown).iter().all(|point| point["u"].is_null()));
    let printed = folder.done("analyse transfer x.mcap --strike 0");
    assert_says(&printed, "u: unknown");
    assert_says(&printed, "coherence needs at least two strikes");

    folder.done("settings make --template bead.toml");
    folder.write("bead.toml", folder.text("bead.toml") + STATED);
    let stated = folder.json("analyse srs x.mcap --uncertainty bead.toml --format json");
    // Gain, ratio, flatness and supply of the acceleration.
    let gain = [0.005, 0.001, 0.01, 0.002].into_iter().fold(0.0, f64::hypot);
    assert!((number(&stated["beads"][0]["gain_uncertainty"]) - gain).abs() < 1e-9);
    for point in points(&stated) {
        if number(&point["frequency_hz"]) > 5000.0 {
            // No calibration states how flat a sensor is there.
            assert!(point["u"].is_null());
            continue;
        }
        let of_mean = number(&point["standard_deviation"]) / 3_f64.sqrt();
        let u = f64::hypot(gain * number(&point["mean"]), of_mean);
        assert!((number(&point["u"]) / u - 1.0).abs() < 1e-9, "{point}");
    }
}

#[test]
fn a_density_has_twice_the_uncertainty_of_the_scale_and_a_transfer_none_of_the_supply() {
    let folder = folder();
    folder.done("settings make --template bead.toml");
    folder.write("bead.toml", folder.text("bead.toml") + STATED);
    let report = |line: &str| folder.json(&format!("analyse {line} --uncertainty bead.toml --format json"));
    let size = |parts: &[f64]| parts.iter().copied().fold(0.0, f64::hypot);
    let (force, acceleration) = ([0.0105, 0.001, 0.01], [0.005, 0.001, 0.01]);

    let density = report("psd x.mcap --strike 0 --to 5000");
    let gravities = report("psd x.mcap --strike 0 --to 5000 --unit g");
    let exact = 2.0 * size(&[&acceleration[..], &[0.002]].concat());
    for (point, in_g) in points(&density).iter().zip(points(&gravities)) {
        let part = number(&point["u"]) / number(&point["mean"]);
        assert!((part - exact).abs() < 1e-9, "{point}");
        let ratio = number(&point["mean"]) / number(&in_g["mean"]);
        assert!((ratio / 9.806_65_f64.powi(2) - 1.0).abs() < 1e-12, "{in_g}");
    }
    let transfer = report("transfer x.mcap --to 5000");
    for point in points(&transfer) {
        let coherence = number(&point["coherence"]);
        let scatter = ((1.0 - coherence) / (6.0 * coherence)).sqrt();
        let part = number(&point["u"]) / number(&point["magnitude"]);
        let exact = size(&[&force[..], &acceleration, &[scatter]].concat());
        assert!((part / exact - 1.0).abs() < 1e-6, "{point}");
    }
    assert!(number(&points(&transfer)[0]["coherence"]) > 0.999);
}

#[test]
fn what_is_left_out_is_named_and_the_others_go_on() {
    let folder = folder();
    let mut lossy = ModelBead::at(8);
    lossy.frames_lost = 6;
    record(&folder.join("lossy.mcap"), &Scenario::paper(), &[lossy], 2);
    let output = folder.run("analyse fft lossy.mcap x.mcap --format json --strike 0,1,2,9");
    let said = said(&output);
    assert_says(&said, "bead 8: 1 strike left out: lossy.mcap, strike 0: ");
    assert_says(&said, "--strike 9 does not exist: a bead has at most 5 strikes");
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let bead = &report["beads"][0];
    assert_eq!(bead["strikes"].as_array().unwrap().len(), 2);
    assert_eq!(bead["left_out"][0]["recording"], "lossy.mcap");
}

#[test]
fn a_picture_has_a_panel_for_each_bead_and_a_table_a_row_for_each_frequency_of_each_strike() {
    let folder = folder();
    let scenario = format!("{ROOT}/docs/scenarios/ten-intruders.toml");
    let scenario = Scenario::load(scenario).unwrap();
    record(&folder.join("row.mcap"), &scenario, &[7, 9].map(ModelBead::at), 2);
    let report = folder.json("analyse srs row.mcap --picture srs.svg --out srs.csv --format json");
    assert_eq!(report["beads"].as_array().unwrap().len(), 2);
    let picture = folder.text("srs.svg");
    assert!(picture.contains("bead 7") && picture.contains("bead 9") && picture.contains("envelope"));
    let rows = [0, 1].map(|bead| 2 * report["beads"][bead]["points"].as_array().unwrap().len());
    assert_eq!(folder.text("srs.csv").lines().count(), 1 + rows[0] + rows[1]);
    let one = folder.json("analyse srs row.mcap --bead 9 --format json");
    assert_eq!(one["beads"].as_array().unwrap().len(), 1);
    assert_eq!(one["beads"][0], report["beads"][1]);
}

/// `cargo test --release -p absorber-bead --test all thousand_strikes -- --ignored --nocapture`
#[test]
#[ignore = "a minute, most of it for the recording"]
fn a_thousand_strikes_take_less_than_ten_seconds() {
    let folder = TestFolder::new();
    for name in ["a.mcap", "b.mcap"] {
        record(&folder.join(name), &Scenario::paper(), &[ModelBead::at(8)], 505);
    }
    for spectrum in ["srs", "psd", "fft", "transfer"] {
        let started = Instant::now();
        let line =
            format!("analyse {spectrum} a.mcap b.mcap --out {spectrum}.parquet --picture {spectrum}.svg");
        let report = folder.json(&format!("{line} --format json"));
        let took = started.elapsed();
        let strikes = report["beads"][0]["strikes"].as_array().unwrap().len();
        println!("{spectrum} of {strikes} strikes, with table and picture: {took:.2?}");
        assert!(strikes >= 1000, "{strikes}");
        assert!(took.as_secs_f64() < 10.0, "{took:?}");
    }
}
