//! The command line as scripts see it: exit status, one line of reason, keys of JSON.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::program;
use bead::bench::front_end::FrontEnd;
use bead::bench::sensed::{Sensed, Timing, bead_of, load_scenario, simulate_with_ring_down};
use bead::recording::file::{About, Origin, Part, Recording, Writer};
use bead::tables::whole::Target;
use bead_model::design::{Capture, derive};
use bead_model::settings::BLOCK_MAX;
use bead_model::{Chunk, Meter, Scan, Sink, StrikeReport};
use bead_wire::{Block, Header, Identity, MAX_FRAME, Message, ResetCauses, Settings, StrikeFlags, encode};
use serde_json::Value;
use tempfile::TempDir;

const SCENARIO: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/scenarios/paper-strike.toml");

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

/// Frames of a bead that runs the model on this computer.
struct Bead {
    stream: Vec<u8>,
    sequence: u32,
}

impl Bead {
    fn say(&mut self, sample_index: u64, message: &Message) {
        let header = Header {
            address: 0,
            boot: 0,
            sequence: self.sequence,
            sample_index,
        };
        self.sequence += 1;
        self.stream
            .extend(encode(&header, message, &mut [0; MAX_FRAME]).unwrap());
    }
}

impl Sink for Bead {
    fn chunk(&mut self, chunk: &Chunk) {
        self.say(chunk.first_index, &bead_telemetry::waveform(chunk).into());
    }

    fn report(&mut self, report: &StrikeReport) {
        self.say(
            report.trigger_index,
            &bead_telemetry::strike(report, StrikeFlags::NONE).into(),
        );
        self.say(report.trigger_index, &bead_telemetry::shape(report).into());
    }
}

/// What bead 8 sends of the paper's strike, and the scenario's text.
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
    let mut block = [0; BLOCK_MAX];
    let length = settings.encode(&mut block).unwrap();
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

    let mut bead = Bead {
        stream: Vec::new(),
        sequence: 0,
    };
    bead.say(
        0,
        &Message::Identity(Identity {
            firmware: "0.1.0".into(),
            git: "test".into(),
            uid: [7; 12],
            boot: 0,
            reset_cause: ResetCauses::from_bits(0),
            sample_rate_hz: 100_000,
            channels: 4,
        }),
    );
    bead.say(
        0,
        &Message::Settings(Settings {
            block: Block::try_from(&block[..length]).unwrap(),
        }),
    );
    let mut meter = Meter::new();
    let scans: Vec<Scan> = codes.scans.into_iter().map(Scan::new).collect();
    meter.process(&settings, 1, scans, &mut bead);
    assert_eq!(meter.strikes(), 1);
    (bead.stream, text)
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

#[test]
fn a_usage_error_ends_with_2() {
    for arguments in [
        &["simulat"][..],
        &["simulate"],
        &["emulate", SCENARIO],
        &["simulate", SCENARIO, "--rate", "1e6"],
    ] {
        assert_eq!(bead(arguments).status.code(), Some(2), "{arguments:?}");
    }
}

#[test]
fn a_typo_in_a_scenario_names_file_line_and_key() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("typo.toml");
    let text = fs::read_to_string(SCENARIO)
        .unwrap()
        .replace("radius = 0.019 ", "radios = 0.019 ");
    let line = text.lines().position(|line| line.contains("radios")).unwrap() + 1;
    fs::write(&path, text).unwrap();
    let path = path.to_str().unwrap();
    for arguments in [&["simulate", path][..], &["emulate", path, "--bead", "8"]] {
        refused(arguments, 2, &[&format!("typo.toml:{line}"), "radios", "radius"]);
    }
}

#[test]
fn a_missing_scenario_is_an_input_error() {
    refused(&["simulate", "no-such.toml"], 2, &["no-such.toml"]);
}

#[test]
fn simulate_has_the_keys_of_the_contract() {
    let summary = json(&["simulate", SCENARIO, "--format", "json"]);
    assert_eq!(
        keys(&summary),
        [
            "energy",
            "final",
            "intruders",
            "peak_force",
            "schema_version",
            "solver",
            "validity"
        ]
    );
    assert_eq!(
        keys(&summary["validity"][0]),
        ["contact", "periods", "pressure", "radius_ratio", "softer"]
    );
    assert_eq!(
        keys(&summary["peak_force"][0]),
        ["contact", "force", "fwhm", "time"]
    );
    assert_eq!(keys(&summary["final"]), ["displacement", "time", "velocity"]);
    assert_eq!(
        keys(&summary["energy"]),
        [
            "balance_error",
            "chain_final",
            "chain_max",
            "dissipated_contacts",
            "dissipated_intruders",
            "intruders_final",
            "striker_final",
            "striker_initial",
        ]
    );
    assert_eq!(
        keys(&summary["intruders"][0]),
        [
            "acceleration_max",
            "acceleration_min",
            "bead",
            "dissipated",
            "relative_displacement_max"
        ]
    );
    assert_eq!(keys(&summary["solver"]), ["evaluations", "seconds", "steps"]);
    assert_eq!(summary["final"]["displacement"].as_array().unwrap().len(), 17);
}

#[test]
fn simulate_writes_nothing_when_it_fails() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("strike.parquet");
    refused(
        &[
            "simulate",
            SCENARIO,
            "--out",
            out.to_str().unwrap(),
            "--rate",
            "0",
        ],
        2,
        &["--rate 0"],
    );
    let missing = directory.path().join("no/such/strike.parquet");
    refused(
        &["simulate", SCENARIO, "--out", missing.to_str().unwrap()],
        2,
        &["is the directory there"],
    );
    assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 0);
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
            "compared",
            "damping",
            "hosts",
            "mass",
            "optimum",
            "schema_version",
            "stiffness",
            "total_mass",
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
fn a_search_that_cannot_be_meant_is_refused_by_option() {
    let optimise = |options: &[&str], parts: &[&str]| {
        refused(&[&["optimise", SCENARIO], options].concat(), 2, parts);
    };
    optimise(
        &["--bead", "7-17", "--total-mass", "0.01"],
        &["--bead", "bead 17", "1 to 16"],
    );
    optimise(&["--bead", "7,7", "--total-mass", "0.01"], &["--bead", "twice"]);
    optimise(
        &["--bead", "7", "--total-mass", "0.06"],
        &["--total-mass", "less than 0.051"],
    );
    let with = |options: &[&str], parts: &[&str]| {
        optimise(
            &[&["--bead", "7", "--total-mass", "0.01"], options].concat(),
            parts,
        );
    };
    with(&["--mass", "0.01:0.001"], &["--mass", "lesser first"]);
    with(&["--velocity", "0"], &["--velocity", "m/s"]);
    with(&["--evaluations", "0"], &["--evaluations", "1000 or more"]);
    with(
        &["--evaluations", "126", "--out", "/no/such/best.toml"],
        &["is the directory there"],
    );
    for options in [["--mass", "3"], ["--bead", "9-7"], ["--bead", "seven"]] {
        let arguments = [&["optimise", SCENARIO, "--total-mass", "0.01"][..], &options].concat();
        assert_eq!(bead(&arguments).status.code(), Some(2), "{options:?}");
    }
}

#[test]
fn a_bead_without_an_intruder_is_refused_and_the_host_named() {
    refused(
        &["emulate", SCENARIO, "--bead", "5"],
        2,
        &["--bead 5", "no intruder", "one of: 8"],
    );
}

#[test]
fn a_missing_or_wrong_image_is_an_input_error_that_says_what_to_do() {
    refused(
        &["emulate", SCENARIO, "--bead", "8", "--firmware", "no-such-image"],
        2,
        &["no-such-image", "cargo xtask build"],
    );
    refused(
        &["emulate", SCENARIO, "--bead", "8", "--firmware", SCENARIO],
        2,
        &["not an ARM ELF"],
    );
}

#[test]
fn a_front_end_that_cannot_be_is_refused_by_option() {
    let emulate = |option: &'static str, value: &'static str| {
        refused(
            &["emulate", SCENARIO, "--bead", "8", option, value],
            2,
            &[option, value],
        );
    };
    emulate("--force-span", "0");
    emulate("--acceleration-noise", "NaN");
    emulate("--pole", "inf");
    emulate("--interval", "0");
    // 3 GB would be taken before anything else is said.
    let far = [
        "emulate",
        SCENARIO,
        "--bead",
        "8",
        "--firmware",
        SCENARIO,
        "--strikes",
        "2",
        "--interval",
        "1e15",
    ];
    refused(&far, 2, &["--interval", "a run 1200 s at most"]);
    let ten = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../docs/scenarios/ten-intruders.toml"
    );
    let many = [&["emulate", ten, "--bead", "all"], &far[4..6]].concat();
    let many = [&many[..], &["--strikes", "1301", "--interval", "0.1"]].concat();
    refused(&many, 2, &["--bead", "10 beads for 130.0 s each are 1300 s"]);
}

#[test]
fn files_without_end_and_files_that_are_no_text_are_refused_in_a_line() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str, bytes: &[u8]| {
        let path = directory.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path.display().to_string()
    };
    let long = at("long.toml", &b"# no end\n".repeat(2_000_000));
    let latin = at("latin.toml", b"title = \"Sto\xdf\"");
    let emulate = |faults: &str| ["emulate", SCENARIO, "--bead", "8", "--faults", faults].map(str::to_owned);
    for (file, why) in [
        ("/dev/zero", "has more than 16 MiB"),
        (&long, "has more than 16 MiB"),
        (&latin, "is no text in UTF-8"),
    ] {
        let lines = [
            vec!["simulate".to_owned(), file.to_owned()],
            vec!["settings".to_owned(), "make".to_owned(), file.to_owned()],
            emulate(file).to_vec(),
        ];
        for line in lines {
            let line: Vec<&str> = line.iter().map(String::as_str).collect();
            refused(&line, 2, &[file, why]);
        }
    }
    refused(
        &["settings", "show", "/dev/zero"],
        2,
        &["/dev/zero", "this is no settings block"],
    );
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
fn no_result_takes_the_place_of_an_input() {
    let directory = tempfile::tempdir().unwrap();
    let recording = recording(&directory, |_| {});
    let scenario = directory.path().join("strike.toml");
    fs::copy(SCENARIO, &scenario).unwrap();
    // Another name of the same file.
    let link = directory.path().join("link.toml");
    std::os::unix::fs::symlink(&scenario, &link).unwrap();
    let [recording, scenario, link] = [&recording, &scenario, &link].map(|path| path.to_str().unwrap());
    let before = [recording, scenario].map(|path| fs::read(path).unwrap());
    for arguments in [
        &["simulate", scenario, "--out", scenario][..],
        &[
            "optimise",
            scenario,
            "--bead",
            "8",
            "--total-mass",
            "0.01",
            "--out",
            link,
        ],
        &[
            "compare",
            recording,
            "--scenario",
            scenario,
            "--report",
            recording,
            "--overwrite",
        ],
        &["compare", recording, "--scenario", scenario, "--report", link],
        &["accuracy", scenario, "--bead", "8", "--table", link],
        &["spheres", scenario, "--bead", "8", "--table", scenario],
    ] {
        refused(
            arguments,
            2,
            &["is an input of this command", "give the output another name"],
        );
    }
    assert_eq!([recording, scenario].map(|path| fs::read(path).unwrap()), before);
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
    assert_eq!(clock["uid"], "07".repeat(12));
    assert_eq!(clock["drift_ppm"], Value::Null, "a strike is too short to tell");
    refused(
        &["clock", timed, timed],
        2,
        &["are both of the bead with UID 0707"],
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
fn bytes_without_a_frame_are_an_input_error() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("noise.bin");
    fs::write(&path, "this is no bead").unwrap();
    refused(&["decode", path.to_str().unwrap()], 2, &["no frame in 15 bytes"]);
    refused(&["replay", path.to_str().unwrap()], 2, &["not an MCAP file"]);
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
fn a_recording_cut_short_is_read_as_far_as_it_goes() {
    let directory = tempfile::tempdir().unwrap();
    let path = recording(&directory, |_| ());
    let whole = fs::read(&path).unwrap();
    // Within the waveform.
    let run = Recording::open(&path)
        .unwrap()
        .pieces()
        .unwrap()
        .nth(12)
        .unwrap()
        .bytes;
    let run = run.strip_suffix(b"\0").unwrap();
    let cut = whole.windows(run.len()).position(|bytes| bytes == run).unwrap() + run.len() / 2;
    fs::write(&path, &whole[..cut]).unwrap();
    let output = bead(&["replay", path.to_str().unwrap()]);
    let error = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{error}");
    assert!(
        error.contains("cut short") && error.contains("no strike"),
        "{error}"
    );
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
fn output_that_is_no_terminal_has_no_colour() {
    for arguments in [
        &["--help"][..],
        &["simulate", SCENARIO],
        &["simulate", "no-such.toml"],
        &["simulat"],
    ] {
        let output = bead(arguments);
        assert!(
            !output.stdout.contains(&0x1b) && !output.stderr.contains(&0x1b),
            "{arguments:?}"
        );
    }
}

#[test]
fn a_run_that_cannot_start_leaves_nothing_behind() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("run");
    refused(
        &[
            "emulate",
            SCENARIO,
            "--bead",
            "8",
            "--firmware",
            SCENARIO,
            "--out",
            out.to_str().unwrap(),
        ],
        2,
        &["not an ARM ELF"],
    );
    assert!(!out.exists());
}

#[test]
fn text_from_outside_never_steers_the_terminal() {
    let directory = TempDir::new().unwrap();
    // Writes into the clipboard, clears the screen, and does so with one character for both.
    let hostile = "\u{1b}]52;c;eA==\u{7}\u{1b}[2J\u{9b}2J";
    let file = |name: &str, text: &str| {
        let path = directory.path().join(name);
        fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let scenario = fs::read_to_string(SCENARIO).unwrap();
    let quoted = r"\u001b]52;c;eA==\u0007\u001b[2J\u009b2J";
    let key = file("key.toml", &format!("\"{quoted}\" = 1\n{scenario}"));
    let value = scenario.replacen("\"printed\"", &format!("\"{quoted}\""), 1);
    let value = file("value.toml", &format!("{value}\n[chain.{}]\n", "more"));
    let named = file(&format!("{hostile}.toml"), "no table");
    for arguments in [
        vec!["simulate", &key],
        vec!["simulate", &value],
        vec!["simulate", &named],
        vec!["decode", &named],
        vec!["replay", &named],
        vec!["recover", &named],
        vec!["settings", "show", &named],
    ] {
        let output = bead(&arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        for text in [output.stdout, output.stderr] {
            let text = String::from_utf8(text).unwrap();
            let steers = |c: char| c.is_control() && c != '\n' && c != '\t';
            assert!(!text.contains(steers), "{arguments:?}: {text:?}");
        }
    }
}

#[test]
fn a_fault_that_the_run_is_too_short_to_tell_is_refused() {
    let directory = TempDir::new().unwrap();
    let faults = directory.path().join("faults.toml");
    fs::write(&faults, "[[fault]]\nat = 0.03\nkind = \"hang\"\n").unwrap();
    refused(
        &[
            "emulate",
            SCENARIO,
            "--bead",
            "8",
            "--faults",
            faults.to_str().unwrap(),
        ],
        2,
        &["before the bead can tell of hang at 0.03 s", "--strikes"],
    );
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
