//! `bead identify`: values and errors as lmfit has them, settings that a bead takes, and lines for what goes
//! wrong.

use std::time::Instant;

use hertz_chain::{Scenario, Start};
use serde_json::Value;

use crate::budget::STATED;
use crate::program::{SCENARIO, TestFolder, assert_says, python, said};
use crate::rows::{ModelBead, record};

/// A bead that is tapped by a small sphere and flies free: the one behind it stands a millimetre away.
fn tapped(stiffness: f64) -> Scenario {
    let mut scenario = Scenario::paper();
    scenario.chain.beads = 2;
    scenario.intruders[0].beads = vec![1];
    scenario.intruders[0].stiffness = stiffness;
    scenario.striker.velocity = 0.1;
    scenario.starts = vec![Start::apart([2], 1e-3)];
    scenario
}

fn taps(folder: &TestFolder, name: &str, stiffness: f64, count: u32) {
    record(&folder.join(name), &tapped(stiffness), &[ModelBead::at(1)], count);
}

/// A quantity of the first bead, by its letter.
fn quantity<'v>(report: &'v Value, symbol: &str) -> &'v Value {
    let all = report["beads"][0]["quantities"].as_array().unwrap();
    all.iter().find(|one| one["symbol"] == symbol).unwrap()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("no number: {value}"))
}

/// The number behind a key of settings that has this place among the keys of its name.
fn stated_at(settings: &str, key: &str, place: usize) -> f64 {
    let begin = format!("{key} =");
    let values = settings.lines().filter_map(|line| line.strip_prefix(&begin));
    let value = values.map(|line| line.split('#').next().unwrap()).nth(place);
    value.unwrap().trim().parse().unwrap()
}

/// Asserts that a value is true within a part, and within four standard errors.
fn assert_found(report: &Value, symbol: &str, truth: f64, part: f64) {
    let one = quantity(report, symbol);
    let (value, error) = (number(&one["value"]), number(&one["standard_error"]));
    assert!((value / truth - 1.0).abs() < part, "{symbol}: {one}");
    assert!((value - truth).abs() < 4.0 * error, "{symbol}: {one}");
}

#[test]
fn lmfit_finds_the_same_values_errors_and_correlation() {
    let folder = TestFolder::new();
    taps(&folder, "taps.mcap", 3.95e5, 3);
    let printed = folder.done("identify taps.mcap --out samples.csv --format json");
    folder.write("identify.json", printed);
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/identify_by_lmfit.py");
    if let Some(printed) = python(&folder, &[script]) {
        let same = "3 taps: k, c, their errors and correlation as lmfit has them";
        assert_says(&printed, same);
    }
}

#[test]
fn taps_give_k_c_and_the_gains_and_settings_that_a_bead_takes() {
    let folder = TestFolder::new();
    taps(&folder, "taps.mcap", 3.95e5, 4);
    folder.done("settings make --template begin.toml");
    let begin = folder.text("begin.toml").replace("395000.0", "420000.0");
    folder.write("begin.toml", begin.replace("12.0", "10.0") + STATED);
    let line = "--from begin.toml --out-settings found.toml --picture fit.svg --format json";
    let report = folder.json(&format!("identify taps.mcap {line}"));
    assert_found(&report, "k", 3.95e5, 0.002);
    assert_found(&report, "c", 12.0, 0.01);
    assert_eq!(quantity(&report, "m")["fitted"], false);
    // The balance's uncertainty is in those of k and c, and they are correlated through it.
    let stated = folder.text("found.toml");
    assert!(stated_at(&stated, "stiffness_with_mass", 0) > 0.5, "{stated}");
    let u = number(&quantity(&report, "k")["relative_uncertainty"]);
    assert!(u > 0.5 * stated_at(&stated, "intruder_mass", 0), "{u}");
    folder.done("settings make found.toml");
    let shown = folder.json("settings show found.settings --format json");
    let found = number(&shown["settings"]["intruder"]["stiffness"]);
    let k = number(&quantity(&report, "k")["value"]);
    assert!((found / k - 1.0).abs() < 1e-9, "{shown}");
    let picture = folder.text("fit.svg");
    assert!(picture.contains("before the fit") && picture.contains("after the fit"));

    let pairs = folder.json("identify taps.mcap --method pairs --fit k,c,m,gF,ga --format json");
    for (symbol, truth, part) in [("k", 3.95e5, 0.002), ("c", 12.0, 0.01), ("ga", 1.0, 0.002)] {
        assert_found(&pairs, symbol, truth, part);
    }
    for symbol in ["m", "gF"] {
        let why = quantity(&pairs, symbol)["held_because"].as_str().unwrap();
        assert_says(why, "cannot be told apart");
    }
    let printed = folder.done("identify taps.mcap --method pairs --fit k,c,m,gF,ga");
    assert_says(&printed, "m is held at 0.00370000 kg: ");
}

#[test]
fn strikes_of_a_chain_give_k_c_young_and_tau() {
    let folder = TestFolder::new();
    record(&folder.join("x.mcap"), &Scenario::paper(), &[ModelBead::at(8)], 2);
    let text = std::fs::read_to_string(SCENARIO).unwrap();
    let mut begin = Scenario::from_toml(&text, "paper").unwrap();
    begin.intruders[0].stiffness *= 1.1;
    begin.intruders[0].damping *= 0.85;
    begin.chain.young *= 0.9;
    begin.chain.relaxation *= 1.15;
    begin.striker.velocity *= 1.1;
    folder.write("begin.toml", begin.to_toml());
    let report = folder.json("identify x.mcap --scenario begin.toml --out-settings found.toml --format json");
    let truth = Scenario::paper();
    assert_found(&report, "k", truth.intruders[0].stiffness, 0.005);
    assert_found(&report, "c", truth.intruders[0].damping, 0.02);
    assert_found(&report, "Y", truth.chain.young, 0.005);
    assert_found(&report, "tau", truth.chain.relaxation, 0.03);
    let probability = number(&report["beads"][0]["goodness"]["probability"]);
    assert!(probability > 0.001, "{report}");
    let kappa = stated_at(&folder.text("found.toml"), "stiffness", 1);
    assert!((kappa / 3.626_04e8 - 1.0).abs() < 0.005, "{kappa}");
}

#[test]
fn a_bead_that_has_changed_is_said_and_strikes_that_have_no_ringing_are_named() {
    let folder = TestFolder::new();
    taps(&folder, "monday.mcap", 3.95e5, 2);
    taps(&folder, "tuesday.mcap", 1.05 * 3.95e5, 2);
    let printed = folder.done("identify monday.mcap tuesday.mcap");
    assert_says(&printed, "doubt: k differs between recordings: 39");
    assert_says(&printed, "in tuesday.mcap, +");
    assert_says(&printed, "identify each recording by itself");
    // A chain's strike among the taps of a bead: its force goes on, or its ringing is not free.
    let mut lossy = ModelBead::at(1);
    lossy.frames_lost = 6;
    record(&folder.join("lossy.mcap"), &tapped(3.95e5), &[lossy], 2);
    let output = folder.run("identify lossy.mcap monday.mcap --format json");
    let line = "bead 1: 1 strike left out: lossy.mcap, strike 0: ";
    assert_says(&said(&output), line);
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["beads"][0]["strikes"].as_array().unwrap().len(), 3);
}

/// `cargo test --release -p absorber-bead --test all identify::a_thousand -- --ignored --nocapture`
#[test]
#[ignore = "minutes, most of them for the recordings"]
fn a_thousand_strikes_take_less_than_a_minute() {
    let folder = TestFolder::new();
    for name in ["a.mcap", "b.mcap"] {
        record(&folder.join(name), &Scenario::paper(), &[ModelBead::at(8)], 505);
    }
    taps(&folder, "taps.mcap", 3.95e5, 1005);
    for line in [
        "a.mcap b.mcap --scenario scenario.toml",
        "taps.mcap",
        "taps.mcap --method pairs",
    ] {
        folder.write("scenario.toml", Scenario::paper().to_toml());
        let started = Instant::now();
        let report = folder.json(&format!("identify {line} --format json"));
        let took = started.elapsed();
        let strikes = report["beads"][0]["strikes"].as_array().unwrap().len();
        println!("{line}: {strikes} strikes, {took:.2?}");
        assert!(strikes >= 1000, "{strikes}");
        assert!(took.as_secs_f64() < 60.0, "{took:?}");
    }
}
