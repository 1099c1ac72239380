//! The command line as scripts use it: help, exit status, one line of reason, results.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;

use crate::channels::record_again;
use crate::program::{
    PROGRAM, TestFolder, assert_says, documents, done, refused, said, short_scenario, typed,
};
use crate::recover::old_bytes;
use crate::rows::{ModelBead, record};
use bead_recording::file::Recording;
use clap::CommandFactory;
use hertz_chain::Scenario;
use serde_json::Value;

#[test]
fn every_help_fits_a_terminal_of_80_columns_and_teaches_by_example() {
    fn check(command: &mut clap::Command, path: &str) {
        let mut help = Command::new(PROGRAM);
        help.env("COLUMNS", "80").args(path.split_whitespace());
        let help = done(help.arg("--help").output().unwrap());
        assert!(help.contains("Usage: bead"), "{path}");
        // The line of usage does not wrap.
        for line in help.lines().filter(|line| !line.starts_with("Usage:")) {
            assert!(line.chars().count() <= 80, "{path}: {line}");
        }
        let is_command = path.split(' ').count() == 2 && path != " help" && !command.has_subcommands();
        let example = format!("  bead{path} ");
        assert!(!is_command || help.contains(&example), "{path}");
        // The help of `bead figures` is that of another program.
        let is_own = |below: &&mut clap::Command| below.get_name() != "figures";
        for below in command.get_subcommands_mut().filter(is_own) {
            let path = format!("{path} {}", below.get_name());
            check(below, &path);
        }
    }
    let mut command = bead::cli::Cli::command();
    command.clone().debug_assert();
    check(&mut command, "");
    let root = done(typed(Path::new("."), "--help"));
    assert!(root.contains("Exit status") && root.contains("Examples:"));
}

#[test]
fn optimise_writes_a_scenario_that_simulate_finds_as_good_as_it_said() {
    let folder = TestFolder::new();
    folder.write("short.toml", short_scenario());
    let search = "optimise short.toml --bead 7,8 --total-mass 0.01";
    let few = "--evaluations 400 --format json --out best.toml";
    let found = folder.json(&format!("{search} {few}"));
    let share = found["optimum"]["share"].as_f64().unwrap();
    let own = &found["compared"][0];
    assert_eq!(own["name"], "the scenario's own");
    assert!(share < own["share"].as_f64().unwrap());

    let summary = folder.json("simulate best.toml --format json");
    let energy = |name: &str| summary["energy"][name].as_f64().unwrap();
    let injected = energy("striker_initial") - energy("striker_final");
    let again = 1.0 - energy("dissipated_intruders") / injected;
    assert!((share - again).abs() < 1e-12, "{share} {again}");
    let intruders = summary["intruders"].as_array().unwrap().iter();
    assert!(intruders.map(|intruder| &intruder["bead"]).eq([7, 8]));

    // The table, for equal intruders and the worst of two speeds.
    let table = folder.done(&format!("{search} --alike --velocity 0.3,1 --worst"));
    assert_says(&table, "m (g)");
    assert_says(&table, "remains, worst (%)");
    for bead in ["7 ", "8 "] {
        let row = table.lines().find(|line| line.starts_with(bead)).unwrap();
        assert_eq!(row.split_whitespace().nth(1), Some("5.000"));
    }
}

#[test]
fn a_branch_of_motions_that_repeat_is_written_and_drawn_with_its_fold() {
    let folder = TestFolder::new();
    let trimer = include_str!("../../../../docs/scenarios/driven-trimer.toml");
    folder.write("trimer.toml", trimer);
    let line = "periodic trimer.toml --along amplitude --to 3e-8 --out b.csv --picture b.svg --format json";
    let found = folder.json(line);
    assert_eq!(found["multipliers"].as_array().unwrap().len(), 42);
    let branch = &found["branch"];
    assert!(branch["parameter"] == "amplitude" && branch["end"] == "range");
    let points = branch["points"].as_array().unwrap();
    let fold = points.iter().find(|point| point["bifurcation"] == "fold");
    let amplitude = fold.unwrap()["amplitude"].as_f64().unwrap();
    // As another program found it (docs/periodic.md).
    assert!((amplitude / 2.8487540733e-8 - 1.0).abs() < 1e-8, "{amplitude:e}");
    // The table has the same points, with their units in the names.
    let text = folder.text("b.csv");
    let mut lines = text.lines();
    let names = lines.next().unwrap();
    assert!(names.starts_with("amplitude_m,stable,multiplier_re,"), "{names}");
    assert_eq!(lines.clone().count(), points.len());
    let fold = lines.find(|line| line.contains(",fold,")).unwrap();
    assert!(fold.starts_with(&format!("{amplitude:?},")), "{fold}");
    let picture = folder.text("b.svg");
    assert!(picture.contains("amplitude (m)") && picture.contains("unstable"));
    // Without a branch the table has the multipliers.
    let table = folder.done("periodic trimer.toml");
    assert_says(&table, "a motion that repeats, stable");
    assert_says(&table, "0.99979865             29.194");
}

#[test]
fn a_front_is_the_best_at_each_mass_and_more_mass_never_leaves_more() {
    let folder = TestFolder::new();
    folder.write("short.toml", short_scenario());
    let front = "optimise short.toml --bead 7,8 --total-mass 0.016,0.004,0.008 --loss-factor 0.3";
    let found = folder.json(&format!("{front} --format json --picture front.svg"));
    let points = found["front"].as_array().unwrap();
    let numbers = |key: &str| -> Vec<f64> {
        let numbers = points.iter().map(|point| point.pointer(key).unwrap());
        numbers.map(|number| number.as_f64().unwrap()).collect()
    };
    assert_eq!(numbers("/total_mass_kg"), [0.004, 0.008, 0.016]);
    let shares = numbers("/optimum/share");
    assert!(shares.windows(2).all(|pair| pair[1] < pair[0]), "{shares:?}");
    for (mass, most) in numbers("/mass_kg").into_iter().zip(numbers("/total_mass_kg")) {
        assert!(mass <= most * (1.0 + 1e-12));
    }
    let alone = front.replace("0.016,0.004,0.008", "0.008");
    let alone = folder.json(&format!("{alone} --format json"));
    assert_eq!(alone["optimum"], points[1]["optimum"]);
    assert!(folder.text("front.svg").contains("all intruders together"));
}

#[test]
fn a_recorded_strike_compares_with_a_page_and_figures_and_another_does_not() {
    let folder = TestFolder::new();
    let scenario = Scenario::paper();
    record(&folder.join("a.mcap"), &scenario, &[ModelBead::at(8)], 1);
    let compare = "compare a.mcap --format json --report report.html";
    let compared = folder.json(&format!("{compare} --figures figures"));
    assert_eq!(compared["pass"], true);
    let strike = &compared["strikes"][0];
    assert_eq!(strike["device"], strike["replay"]);
    let read = |name: &str| folder.text(name);
    assert!(read("report.html").contains("Every check passed"));
    for figure in ["figures/strike.svg", "figures/residuals.svg"] {
        assert!(read(figure).starts_with("<svg"));
    }
    // `compare` uses the scenario in the recording if none is named.
    folder.write("same.toml", scenario.to_toml());
    let named = folder.json(&format!("{compare} --overwrite --scenario same.toml"));
    assert_eq!(named, compared);

    let mut faster = scenario.clone();
    faster.striker.velocity = 0.46;
    folder.write("faster.toml", faster.to_toml());
    let other = folder.run("compare a.mcap --scenario faster.toml --report other.html");
    refused(&other, 1, "A is");
    assert!(said(&other).contains("goal of 0.2 %") && read("other.html").contains("goal of 0.2 %"));
    let mut lossy = ModelBead::at(8);
    (lossy.synced, lossy.frames_lost) = (false, 10);
    record(&folder.join("lossy.mcap"), &scenario, &[lossy], 1);
    let replayed = folder.run("replay lossy.mcap");
    refused(&replayed, 1, "replay is incomplete: strike 0");
    let part = "of its 672 samples were not received, the first at sample index";
    assert_says(&said(&replayed), part);
    folder.refused("1 | incomplete: strike 0 | compare lossy.mcap");
}

#[test]
fn a_recording_that_was_cut_short_is_no_pass_though_the_strikes_in_it_are_whole() {
    let folder = TestFolder::new();
    let scenario = Scenario::paper();
    record(&folder.join("whole.mcap"), &scenario, &[ModelBead::at(8)], 2);
    folder.done("compare whole.mcap");
    let file = folder.read("whole.mcap");
    let recording = Recording::open(&folder.join("whole.mcap")).unwrap();
    let runs: Vec<_> = recording.pieces().unwrap().map(|piece| piece.bytes).collect();
    // In the middle of the second window.
    let kept = runs.len() * 3 / 4;
    let run = &runs[kept][..runs[kept].len() - 1];
    let cut = file.windows(run.len()).position(|bytes| bytes == run).unwrap();
    folder.write("cut.mcap", &file[..cut]);
    folder.done("recover cut.mcap --out recovered.mcap");
    folder.write("raw.bin", runs[..kept].concat());
    folder.done("recover raw.bin --out ended.mcap");
    folder.write("paper.toml", scenario.to_toml());
    for (line, part) in [
        ("cut.mcap", "incomplete: the recording is cut short"),
        (
            "recovered.mcap",
            "incomplete: it was recovered from a recording with missing or damaged data: cut short",
        ),
        (
            "ended.mcap --scenario paper.toml --bead 8",
            "incomplete: the result of 1 strike was not received",
        ),
    ] {
        let compared = folder.run(&format!("compare {line}"));
        assert_eq!(compared.status.code(), Some(1), "{line}");
        assert_says(&said(&compared), part);
    }
    // An index that is cut costs nothing.
    folder.write("index.mcap", &file[..file.len() - 20]);
    folder.done("compare index.mcap");
}

#[test]
fn a_recording_without_receive_times_has_no_clock_and_one_with_them_has_host_times() {
    let folder = TestFolder::new();
    record_again(&folder.join("timed.mcap"), 1);
    folder.write("raw.bin", old_bytes());
    folder.done("recover raw.bin --out untimed.mcap");
    folder.refused("2 | has a receive time | clock untimed.mcap");
    folder.refused("2 | carries no scenario | compare untimed.mcap");
    let report = folder.json("clock timed.mcap --format json");
    // One strike is too short for a drift.
    assert_eq!(report["clocks"][0]["drift_ppm"], Value::Null);

    let lines = |name: &str| documents(folder.done(&format!("decode {name}")).as_bytes());
    let (timed, untimed) = (lines("timed.mcap"), lines("untimed.mcap"));
    assert_eq!(timed.len(), untimed.len());
    assert_eq!(timed[1]["received"], "2023-11-14T22:13:20.001000000Z");
    for line in &timed {
        assert_says(line["host_time"].as_str().unwrap(), "2023-11-14T22:13:");
    }
    assert!(untimed.iter().all(|line| line.get("received").is_none()));
}

#[test]
fn figures_are_the_program_beside_this_one_with_its_arguments_and_its_status() {
    let built = Path::new(PROGRAM);
    // A hard link: through a symbolic one the program would find what was built beside it.
    let directory = tempfile::tempdir_in(built.parent().unwrap()).unwrap();
    let [bead, figures] = ["bead", "bead-figures"].map(|name| directory.path().join(name));
    fs::hard_link(built, &bead).unwrap();
    let run = || {
        let mut command = Command::new(&bead);
        command.args(["figures", "2C", "--out", "x y", "--help"]);
        command.output().unwrap()
    };
    refused(&run(), 3, "cargo build --release -p bead-figures");
    fs::write(&figures, "#!/bin/sh\necho \"$#:$*\"\nexit 1\n").unwrap();
    fs::set_permissions(&figures, fs::Permissions::from_mode(0o755)).unwrap();
    let found = run();
    assert_eq!(found.status.code(), Some(1));
    assert_eq!(found.stdout, b"4:2C --out x y --help\n");
}
