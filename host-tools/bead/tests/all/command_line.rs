//! The command line as scripts see it: help, exit status, one line of reason, results.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;

use crate::program::{
    DATA, PROGRAM, assert_says, bead, documents, done, json, refused, said, short_scenario, typed,
};
use crate::rows::{RowBead, record};
use bead_recording::file::{About, Recording, Writer};
use bead_tables::whole::Target;
use clap::CommandFactory;
use hertz_chain::Scenario;
use serde_json::Value;

#[test]
fn every_help_fits_a_terminal_of_80_columns_and_teaches_by_example() {
    fn check(command: &mut clap::Command, path: &str) {
        let mut help = Command::new(PROGRAM);
        let help = help
            .env("COLUMNS", "80")
            .args(path.split_whitespace())
            .arg("--help");
        let help = done(help.output().unwrap());
        assert!(help.contains("Usage: bead"), "{path}");
        // The line of usage does not wrap.
        for line in help.lines().filter(|line| !line.starts_with("Usage:")) {
            assert!(line.chars().count() <= 80, "{path}: {line}");
        }
        let is_command = path.split(' ').count() == 2 && path != " help" && !command.has_subcommands();
        assert!(
            !is_command || help.contains(&format!("  bead{path} ")),
            "{path} has no example"
        );
        // Another program answers for that one.
        for below in command
            .get_subcommands_mut()
            .filter(|below| below.get_name() != "figures")
        {
            let path = format!("{path} {}", below.get_name());
            check(below, &path);
        }
    }
    let mut command = bead::cli::Cli::command();
    command.clone().debug_assert();
    check(&mut command, "");
    let root = done(bead(Path::new("."), ["--help"]));
    assert!(root.contains("Exit status") && root.contains("Examples:"));
}

#[test]
fn optimise_writes_a_scenario_that_simulate_finds_as_good_as_it_said() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::write(folder.join("short.toml"), short_scenario()).unwrap();
    let search = "optimise short.toml --bead 7,8 --total-mass 0.01";
    let found = json(typed(
        folder,
        &format!("{search} --evaluations 400 --format json --out best.toml"),
    ));
    let share = found["optimum"]["share"].as_f64().unwrap();
    let own = &found["compared"][0];
    assert_eq!(own["name"], "the scenario's own");
    assert!(share < own["share"].as_f64().unwrap());

    let summary = json(typed(folder, "simulate best.toml --format json"));
    let energy = |name: &str| summary["energy"][name].as_f64().unwrap();
    let injected = energy("striker_initial") - energy("striker_final");
    let again = 1.0 - energy("dissipated_intruders") / injected;
    assert!((share - again).abs() < 1e-12, "{share} {again}");
    let intruders = summary["intruders"].as_array().unwrap().iter();
    assert!(intruders.map(|intruder| &intruder["bead"]).eq([7, 8]));

    // For people, alike intruders and the worst of two speeds.
    let table = done(typed(
        folder,
        &format!("{search} --alike --velocity 0.3,1 --worst"),
    ));
    for part in [
        "m (g)",
        "k (kN/m)",
        "c (N·s/m)",
        "ζ",
        "remains, worst (%)",
        "the scenario's own",
    ] {
        assert!(table.contains(part), "{part} is not in:\n{table}");
    }
    for bead in ["7 ", "8 "] {
        let row = table.lines().find(|line| line.starts_with(bead)).unwrap();
        assert_eq!(row.split_whitespace().nth(1), Some("5.000"));
    }
}

#[test]
fn a_recorded_strike_compares_with_a_page_and_figures_and_another_does_not() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let scenario = Scenario::paper();
    record(&folder.join("a.mcap"), &scenario, &[RowBead::at(8)], 1);
    let compare = "compare a.mcap --format json --report report.html";
    let compared = json(typed(folder, &format!("{compare} --figures figures")));
    assert_eq!(compared["pass"], true);
    let strike = &compared["strikes"][0];
    assert_eq!(strike["device"], strike["replay"]);
    let read = |name: &str| fs::read_to_string(folder.join(name)).unwrap();
    assert!(read("report.html").contains("Every check passed"));
    for figure in ["figures/strike.svg", "figures/residuals.svg"] {
        assert!(read(figure).starts_with("<svg"));
    }
    // The scenario that the recording carries need not be named.
    fs::write(folder.join("same.toml"), scenario.to_toml()).unwrap();
    let named = json(typed(
        folder,
        &format!("{compare} --overwrite --scenario same.toml"),
    ));
    assert_eq!(named, compared);

    let mut faster = scenario.clone();
    faster.striker.velocity = 0.46;
    fs::write(folder.join("faster.toml"), faster.to_toml()).unwrap();
    let other = typed(
        folder,
        "compare a.mcap --scenario faster.toml --report other.html",
    );
    refused(&other, 1, "A is");
    assert!(said(&other).contains("goal of 0.2 %") && read("other.html").contains("goal of 0.2 %"));
    let mut lossy = RowBead::at(8);
    (lossy.synced, lossy.frames_lost) = (false, 10);
    record(&folder.join("lossy.mcap"), &scenario, &[lossy], 1);
    let replayed = typed(folder, "replay lossy.mcap");
    refused(&replayed, 1, "replay differs");
    assert_says(
        &said(&replayed),
        "of its 672 samples were not received, from sample index",
    );
    refused(&typed(folder, "compare lossy.mcap"), 1, "replay differs");
}

#[test]
fn a_recording_without_receive_times_has_no_clock_and_one_with_them_has_host_times() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let old = Recording::open(&Path::new(DATA).join("recording-v1.mcap")).unwrap();
    // The same bytes without times, and one frame each millisecond.
    for (name, is_timed) in [("untimed.mcap", false), ("timed.mcap", true)] {
        let mut writer = Writer::create(&Target::new(folder.join(name)), &About::default()).unwrap();
        for (n, run) in (0..).zip(old.pieces().unwrap()) {
            let received_ns = 1_700_000_000_000_000_000 + 1_000_000 * n;
            writer
                .write(&run.bytes, is_timed.then_some(received_ns), |_| {})
                .unwrap();
        }
        writer.finish().unwrap();
    }
    refused(&typed(folder, "clock untimed.mcap"), 2, "has a receive time");
    refused(&typed(folder, "compare untimed.mcap"), 2, "carries no scenario");
    let report = json(typed(folder, "clock timed.mcap --format json"));
    assert_eq!(
        report["clocks"][0]["drift_ppm"],
        Value::Null,
        "a strike is too short to tell"
    );

    let lines = |name: &str| documents(done(typed(folder, &format!("decode {name}"))).as_bytes());
    let (timed, untimed) = (lines("timed.mcap"), lines("untimed.mcap"));
    assert_eq!(timed.len(), untimed.len());
    assert_eq!(timed[1]["received"], "2023-11-14T22:13:20.001000000Z");
    let host_times = timed.iter().map(|line| line["host_time"].as_str().unwrap());
    assert!(
        host_times
            .into_iter()
            .all(|time| time.starts_with("2023-11-14T22:13:"))
    );
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
        command
            .args(["figures", "2C", "--out", "x y", "--help"])
            .output()
            .unwrap()
    };
    refused(&run(), 3, "cargo build --release -p bead-figures");
    fs::write(&figures, "#!/bin/sh\necho \"$#:$*\"\nexit 1\n").unwrap();
    fs::set_permissions(&figures, fs::Permissions::from_mode(0o755)).unwrap();
    let found = run();
    assert_eq!(
        (found.status.code(), &found.stdout[..]),
        (Some(1), &b"4:2C --out x y --help\n"[..])
    );
}
