//! The command line as scripts see it: exit status, one line of reason, keys of JSON.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::program;
use bead_compare::front_end::FrontEnd;
use bead_compare::sensed::{Sensed, Timing, bead_of, load_scenario, simulate_with_ring_down};
use bead_model::design::{Capture, derive};
use bead_recording::file::{About, Origin, Part, Recording, Writer};
use bead_tables::whole::Target;
use bead_testing::Speaker;
use serde_json::Value;
use tempfile::TempDir;

const SCENARIO: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../docs/scenarios/paper-strike.toml"
);

fn bead(arguments: &[&str]) -> Output {
    program::bead(Path::new("."), arguments)
}

/// Standard error of a command that must end with `status`: one line, which holds every one of `parts`.
fn refused(arguments: &[&str], status: i32, parts: &[&str]) {
    let output = bead(arguments);
    let error = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(status), "{arguments:?}: {error}");
    assert_eq!(error.lines().count(), 1, "{arguments:?}: {error}");
    for part in parts {
        assert!(
            error.contains(part),
            "{arguments:?}: \"{part}\" is not in: {error}"
        );
    }
}

fn json(arguments: &[&str]) -> Value {
    program::json(&bead(arguments))
}

fn keys(value: &Value) -> Vec<&str> {
    let mut keys: Vec<&str> = value.as_object().unwrap().keys().map(String::as_str).collect();
    keys.sort_unstable();
    keys
}

/// Bytes of bead 8 for the paper's strike, and the scenario's text.
fn struck() -> (Vec<u8>, String) {
    let (scenario, text) = load_scenario(Path::new(SCENARIO)).unwrap();
    let solution = simulate_with_ring_down(&scenario).unwrap();
    let front_end = FrontEnd::default();
    let settings = derive(
        &bead_of(&solution, 8).unwrap(),
        &front_end.calibration(),
        &Capture::default(),
    )
    .unwrap();
    let timing = Timing {
        lead_in: 0.02,
        strikes: 1,
        interval: 0.1,
    };
    let codes = front_end.digitise(
        &Sensed::new(&solution, 8, timing),
        timing.scans(solution.end()),
        Some(1),
    );

    let mut bead = Speaker::at(0);
    assert_eq!(bead.measure(&settings, codes.scans), 1);
    (bead.bytes, text)
}

/// A recording of that strike. `spoil` changes its stream.
fn recording(directory: &TempDir, spoil: impl FnOnce(&mut Vec<u8>)) -> PathBuf {
    let (mut stream, text) = struck();
    spoil(&mut stream);
    let path = directory.path().join("bead-8.mcap");
    let mut writer = Writer::create(
        &Target::new(&path),
        &About {
            sample_rate_hz: 100_000,
            ..About::default()
        },
    )
    .unwrap();
    writer.attach(Part::Scenario, text.as_bytes()).unwrap();
    writer.write(&stream, None, |_| {}).unwrap();
    writer.finish().unwrap();
    path
}

#[test]
fn compare_takes_the_bead_that_is_asked_for_out_of_several() {
    let directory = tempfile::tempdir().unwrap();
    let alone = recording(&directory, |_| {});
    let (stream, text) = struck();
    let mut spoilt = stream.clone();
    lose(&mut spoilt, 5);
    let path = directory.path().join("chain.mcap");
    let mut writer = Writer::create_for_several(&Target::new(&path), &About::default()).unwrap();
    writer.attach(Part::Scenario, text.as_bytes()).unwrap();
    for (address, bead, stream) in [(1, 7, &spoilt), (0, 8, &stream), (2, 9, &spoilt)] {
        let origin = Origin {
            address,
            bead: Some(bead),
            port: None,
            clock: None,
        };
        let lane = writer.join(&origin).unwrap();
        writer.write_of(lane, stream, None, |_| {}).unwrap();
    }
    writer.finish().unwrap();
    let [alone, several] = [alone.to_str().unwrap(), path.to_str().unwrap()];
    assert_eq!(
        json(&["compare", several, "--bead", "8", "--format", "json"]),
        json(&["compare", alone, "--bead", "8", "--format", "json"])
    );
    refused(
        &["compare", several, "--bead", "3"],
        2,
        &["has the beads [8, 7, 9]"],
    );
}

/// Takes the frame number `number`, delimiters and all, out of a stream.
fn lose(stream: &mut Vec<u8>, number: usize) {
    let delimiters: Vec<usize> = (0..stream.len()).filter(|&at| stream[at] == 0).collect();
    stream.drain(delimiters[2 * number]..=delimiters[2 * number + 1]);
}

#[test]
fn the_command_line_is_consistent() {
    use clap::CommandFactory;
    bead::cli::Cli::command().debug_assert();
}

#[test]
fn every_command_teaches_by_example() {
    let root = String::from_utf8(bead(&["--help"]).stdout).unwrap();
    assert!(root.contains("Exit status") && root.contains("Examples:"));
    for command in [
        "simulate", "emulate", "decode", "clock", "replay", "compare", "optimise",
    ] {
        let help = String::from_utf8(bead(&[command, "--help"]).stdout).unwrap();
        assert!(
            help.contains(&format!("  bead {command} ")),
            "{command} has no example:\n{help}"
        );
    }
}

#[test]
fn every_help_fits_a_terminal_of_80_columns() {
    fn check(command: &mut clap::Command, path: &[String]) {
        let mut bead = Command::new(env!("CARGO_BIN_EXE_bead"));
        bead.env("COLUMNS", "80").args(path).arg("--help");
        let help = String::from_utf8(bead.output().unwrap().stdout).unwrap();
        assert!(help.contains("Usage: bead"), "{path:?}");
        // What wraps has one word at least, and the line of usage does not wrap.
        let wraps = |line: &&str| !line.starts_with("Usage:");
        for line in help.lines().filter(wraps) {
            assert!(line.chars().count() <= 80, "{path:?}: {line}");
        }
        // Another program answers for that one.
        let below = command
            .get_subcommands_mut()
            .filter(|below| below.get_name() != "figures");
        for below in below {
            let path = [path, &[below.get_name().to_owned()]].concat();
            check(below, &path);
        }
    }
    use clap::CommandFactory;
    check(&mut bead::cli::Cli::command(), &[]);
}

/// The paper's strike on a few beads: a search takes less than a second.
fn short_scenario(directory: &TempDir) -> String {
    let text = fs::read_to_string(SCENARIO).unwrap();
    let path = directory.path().join("short.toml");
    fs::write(
        &path,
        text.replace("beads = 16", "beads = 12")
            .replace("= 0.006", "= 0.003"),
    )
    .unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn optimise_writes_a_scenario_that_simulate_finds_as_good_as_it_said() {
    let directory = tempfile::tempdir().unwrap();
    let scenario = short_scenario(&directory);
    let out = directory.path().join("best.toml");
    let out = out.to_str().unwrap();
    let search = ["optimise", &scenario, "--bead", "7,8", "--total-mass", "0.01"];
    let few = ["--evaluations", "400", "--format", "json", "--out", out];
    let found = json(&[&search[..], &few].concat());
    assert_eq!(
        keys(&found),
        [
            "aim",
            "beads",
            "compared",
            "damping_n_s_per_m",
            "mass_kg",
            "optimum",
            "schema_version",
            "stiffness_n_per_m",
            "total_mass_kg",
        ]
    );
    let share = found["optimum"]["share"].as_f64().unwrap();
    let own = &found["compared"][0];
    assert_eq!(own["name"], "the scenario's own");
    assert!(share < own["share"].as_f64().unwrap());
    assert_eq!(found["compared"].as_array().unwrap().len(), 3);

    let summary = json(&["simulate", out, "--format", "json"]);
    let energy = |name: &str| summary["energy"][name].as_f64().unwrap();
    let injected = energy("striker_initial") - energy("striker_final");
    let again = 1.0 - energy("dissipated_intruders") / injected;
    assert!((share - again).abs() < 1e-12, "{share} {again}");
    let beads: Vec<u64> = summary["intruders"]
        .as_array()
        .unwrap()
        .iter()
        .map(|intruder| intruder["bead"].as_u64().unwrap())
        .collect();
    assert_eq!(beads, [7, 8]);
}

#[test]
fn optimise_prints_each_intruder_with_units_and_what_remains() {
    let directory = tempfile::tempdir().unwrap();
    let scenario = short_scenario(&directory);
    let search = ["optimise", &scenario, "--bead", "7-8", "--total-mass", "0.01"];
    let output = bead(&[&search[..], &["--alike", "--velocity", "0.3,1", "--worst"]].concat());
    let text = String::from_utf8(output.stdout).unwrap();
    for part in [
        "m (g)",
        "k (kN/m)",
        "c (N·s/m)",
        "f0 (Hz)",
        "ζ",
        "remains, worst (%)",
        "the scenario's own",
    ] {
        assert!(text.contains(part), "{part} is not in:\n{text}");
    }
    let masses: Vec<&str> = text
        .lines()
        .filter(|line| line.starts_with("7 ") || line.starts_with("8 "))
        .map(|line| line.split_whitespace().nth(1).unwrap())
        .collect();
    assert_eq!(masses, ["5.000", "5.000"]);
}

#[test]
fn a_striker_whose_velocity_is_not_known_is_fitted_and_the_rest_judged_against_that() {
    let directory = tempfile::tempdir().unwrap();
    let path = recording(&directory, |_| ());
    let path = path.to_str().unwrap();
    // As the scenario would be written by someone who thinks that the striker had 0.6 m/s.
    let text = std::fs::read_to_string(SCENARIO).unwrap();
    let wrong = directory.path().join("wrong.toml");
    std::fs::write(&wrong, text.replace("velocity = 0.45", "velocity = 0.6")).unwrap();
    let wrong = wrong.to_str().unwrap();
    let compare =
        |more: &[&str]| bead(&[&["compare", path, "--scenario", wrong, "--format", "json"], more].concat());
    assert_eq!(compare(&[]).status.code(), Some(1));
    assert_eq!(compare(&["--velocity", "0.45"]).status.code(), Some(0));
    let fitted = compare(&["--velocity", "fit"]);
    let found: Value = serde_json::from_slice(&fitted.stdout).unwrap();
    assert_eq!(fitted.status.code(), Some(0), "{found}");
    let of = |key: &str| found["striker_velocity"][key].as_f64().unwrap();
    assert!(
        (of("velocity") - 0.45).abs() < of("uncertainty").max(2e-4),
        "{found}"
    );
    assert!(of("uncertainty") < 1e-3 && of("scenario") == 0.6, "{found}");
    let wrong = bead(&["compare", path, "--velocity", "fast"]);
    assert_eq!(wrong.status.code(), Some(2));
    assert!(
        String::from_utf8(wrong.stderr)
            .unwrap()
            .contains("give m/s, above 0, or fit")
    );
}

#[test]
fn a_recorded_strike_decodes_replays_and_compares() {
    let directory = tempfile::tempdir().unwrap();
    let path = recording(&directory, |_| ());
    let path = path.to_str().unwrap();

    let decoded = bead(&["decode", path]);
    assert!(decoded.status.success());
    let lines: Vec<Value> = String::from_utf8(decoded.stdout)
        .unwrap()
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(lines.len(), 2 + 21 + 2);
    assert_eq!(lines[23]["kind"], "strike");
    let shape = &lines[24];
    assert_eq!(shape["kind"], "shape");
    assert!(
        (shape["width_s"].as_f64().unwrap() / 376.5e-6 - 1.0).abs() < 5e-3,
        "{shape}"
    );
    assert!(
        (shape["ring_frequency_hz"].as_f64().unwrap() / 1684.7 - 1.0).abs() < 6e-3,
        "{shape}"
    );

    let replayed = json(&["replay", path, "--format", "json"]);
    assert_eq!(replayed["identical"], true);
    assert_eq!(replayed["strikes"][0]["samples"], 672);

    let report = directory.path().join("report.html");
    let figures = directory.path().join("figures");
    let compared = json(&[
        "compare",
        path,
        "--scenario",
        SCENARIO,
        "--format",
        "json",
        "--report",
        report.to_str().unwrap(),
        "--figures",
        figures.to_str().unwrap(),
    ]);
    assert_eq!(compared["pass"], true);
    let strike = &compared["strikes"][0];
    for side in ["device", "replay", "f64_samples", "f64_chain", "deviation"] {
        assert_eq!(
            keys(&strike[side]),
            ["absorbed_measured", "absorbed_predicted", "peak_force"]
        );
    }
    assert_eq!(strike["device"], strike["replay"]);
    assert!(fs::read_to_string(report).unwrap().contains("Every check passed"));
    for figure in ["strike.svg", "residuals.svg"] {
        assert!(
            fs::read_to_string(figures.join(figure))
                .unwrap()
                .starts_with("<svg")
        );
    }
}

#[test]
fn a_recording_without_receive_times_has_no_clock_and_one_with_them_has_host_times() {
    let directory = tempfile::tempdir().unwrap();
    let untimed = recording(&directory, |_| {});
    let untimed = untimed.to_str().unwrap();
    refused(&["clock", untimed], 2, &["has a receive time", "record again"]);

    // The same bytes, one frame each millisecond.
    let timed = directory.path().join("timed.mcap");
    let mut writer = Writer::create(&Target::new(&timed), &About::default()).unwrap();
    let pieces = Recording::open(Path::new(untimed)).unwrap().pieces().unwrap();
    for (n, run) in (0..).zip(pieces) {
        let received_ns = 1_700_000_000_000_000_000 + 1_000_000 * n;
        writer.write(&run.bytes, Some(received_ns), |_| {}).unwrap();
    }
    writer.finish().unwrap();
    let timed = timed.to_str().unwrap();
    let report = json(&["clock", timed, "--format", "json"]);
    assert_eq!(
        keys(&report),
        [
            "alignments",
            "clocks",
            "left_out",
            "reference",
            "schema_version",
            "strikes"
        ]
    );
    let clock = &report["clocks"][0];
    assert_eq!(clock["uid"], "00".repeat(12));
    assert_eq!(clock["drift_ppm"], Value::Null, "a strike is too short to tell");
    refused(
        &["clock", timed, timed],
        2,
        &["are both of the bead with UID 0000"],
    );

    let lines = |path: &str| -> Vec<Value> {
        let out = String::from_utf8(bead(&["decode", path]).stdout).unwrap();
        out.lines()
            .map(|line| serde_json::from_str(line).unwrap())
            .collect()
    };
    let (timed, untimed) = (lines(timed), lines(untimed));
    assert_eq!(timed.len(), untimed.len());
    assert_eq!(timed[1]["received"], "2023-11-14T22:13:20.001000000Z");
    assert!(timed.iter().all(|line| {
        line["host_time"]
            .as_str()
            .unwrap()
            .starts_with("2023-11-14T22:13:")
    }));
    assert!(untimed.iter().all(|line| line.get("received").is_none()));
}

#[test]
fn raw_bytes_decode_from_standard_input_and_what_is_cut_is_said() {
    let directory = tempfile::tempdir().unwrap();
    let mut raw = Vec::new();
    recording(&directory, |stream| raw.clone_from(stream));
    raw.truncate(raw.len() - 5);
    let path = directory.path().join("cut.bin");
    fs::write(&path, raw).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_bead"))
        .args(["decode", "-"])
        .stdin(fs::File::open(path).unwrap())
        .output()
        .unwrap();
    assert!(output.status.success());
    assert_eq!(output.stdout.iter().filter(|&&byte| byte == b'\n').count(), 24);
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(
        error.contains("24 frames") && error.contains("cut short"),
        "{error}"
    );
}

#[test]
fn a_frame_lost_of_a_strike_fails_replay_and_says_from_where() {
    let directory = tempfile::tempdir().unwrap();
    let path = recording(&directory, |stream| lose(stream, 2 + 10));
    let path = path.to_str().unwrap();
    refused(
        &["replay", path],
        1,
        &["replay differs", "352 of its 672 samples", "sample index"],
    );
    refused(&["compare", path, "--scenario", SCENARIO], 1, &["replay differs"]);
}

#[test]
fn a_recording_of_another_strike_misses_its_goals_and_the_report_says_so() {
    let directory = tempfile::tempdir().unwrap();
    let path = recording(&directory, |_| ());
    let other = directory.path().join("faster.toml");
    let text = fs::read_to_string(SCENARIO)
        .unwrap()
        .replace("velocity = 0.45 ", "velocity = 0.46 ");
    fs::write(&other, text).unwrap();
    let report = directory.path().join("report.html");
    refused(
        &[
            "compare",
            path.to_str().unwrap(),
            "--scenario",
            other.to_str().unwrap(),
            "--report",
            report.to_str().unwrap(),
        ],
        1,
        &["A is", "goal of 0.2 %"],
    );
    assert!(fs::read_to_string(report).unwrap().contains("goal of 0.2 %"));
}

#[test]
fn the_scenario_that_a_recording_carries_need_not_be_named() {
    let directory = tempfile::tempdir().unwrap();
    let recording = recording(&directory, |_| {});
    let recording = recording.to_str().unwrap();
    let named = json(&["compare", recording, "--scenario", SCENARIO, "--format", "json"]);
    assert_eq!(json(&["compare", recording, "--format", "json"]), named);
    // One that was recorded from a bead carries none.
    let bare = directory.path().join("bare.mcap");
    let writer = Writer::create(&Target::new(&bare), &About::default()).unwrap();
    writer.finish().unwrap();
    let parts = ["carries no scenario", "--scenario S.toml"];
    refused(&["compare", bare.to_str().unwrap()], 2, &parts);
}

#[test]
fn figures_are_the_program_beside_this_one_with_its_arguments_and_its_status() {
    let built = Path::new(env!("CARGO_BIN_EXE_bead"));
    // A hard link: through a symbolic one the program would find what was built beside it.
    let directory = tempfile::tempdir_in(built.parent().unwrap()).unwrap();
    let [bead, figures] = ["bead", "bead-figures"].map(|name| directory.path().join(name));
    fs::hard_link(built, &bead).unwrap();
    let run = || {
        Command::new(&bead)
            .args(["figures", "2C", "--out", "x y", "--help"])
            .output()
            .unwrap()
    };
    let missing = run();
    let error = String::from_utf8(missing.stderr).unwrap();
    assert_eq!(
        (missing.status.code(), error.lines().count()),
        (Some(3), 1),
        "{error}"
    );
    assert!(error.contains("cargo build --release -p bead-figures"), "{error}");
    fs::write(&figures, "#!/bin/sh\necho \"$#:$*\"\nexit 1\n").unwrap();
    fs::set_permissions(&figures, fs::Permissions::from_mode(0o755)).unwrap();
    let found = run();
    assert_eq!(found.status.code(), Some(1));
    assert_eq!(
        String::from_utf8(found.stdout).unwrap(),
        "4:2C --out x y --help\n"
    );
}
