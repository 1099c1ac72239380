//! The published JSON schemas in docs/schemas are those of the types, and what commands print holds them.
//!
//! After a change that is meant: `SCHEMAS=overwrite cargo test --release -p absorber-bead --test all
//! schemas::`, and a new `schema_version` if a key went away or means something else.

use std::collections::BTreeSet;
use std::fs;
use std::io::Write;
use std::os::unix::net::UnixListener;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use crate::beads::{Bead, Line};
use crate::program::bead;
use crate::rows::{self, Who};
use crate::schema;
use bead::cli::schemas::of_results;
use bead_recording::file::{Part, Recording};
use bead_wire::{Header, Kind, MAX_FRAME, Message, encode};
use hertz_chain::{Scenario, Start};
use serde_json::Value;

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
const SCHEMAS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/schemas");
const SCENARIO: &str = "docs/scenarios/paper-strike.toml";
const RECORDING: &str = "tests/data/recording-v1.mcap";

#[test]
fn the_published_schemas_are_those_of_the_types() {
    let schemas = of_results();
    for (name, schema) in &schemas {
        schema::hold(SCHEMAS, name, schema);
    }
    let published: BTreeSet<String> = fs::read_dir(SCHEMAS)
        .unwrap()
        .map(|entry| {
            entry
                .unwrap()
                .path()
                .file_stem()
                .unwrap()
                .to_string_lossy()
                .into_owned()
        })
        .collect();
    // `bead figures` is a program of its own, and its tests hold its schema.
    let known = schemas
        .keys()
        .copied()
        .chain(["figures"])
        .map(str::to_owned)
        .collect();
    assert_eq!(published, known);
}

/// A file with a pulse of force over microseconds.
fn force_alone(folder: &Path) -> PathBuf {
    let path = folder.join("force.csv");
    let row = |n: i32| format!("{n}0,{}\n", 5.0 * (-f64::from(n - 200).powi(2) / 400.0).exp());
    let rows: String = (0..400).map(row).collect();
    fs::write(&path, format!("t (us),F (N)\n{rows}")).unwrap();
    path
}

/// The documents on standard output: one, or one on each line.
fn documents(output: &Output) -> Vec<Value> {
    // A check that says no prints its result too.
    assert!(
        output.status.code().is_some_and(|code| code < 2),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let documents = serde_json::Deserializer::from_slice(&output.stdout).into_iter();
    documents.map(Result::unwrap).collect()
}

/// Runs a command and returns its output.
fn printed(arguments: &str) -> Vec<Value> {
    documents(&bead(Path::new(ROOT), arguments.split_whitespace()))
}

/// Asserts that all that a command prints as JSON holds the schema of this name, and returns it.
fn hold(name: &str, line: &str) -> Value {
    let mut printed = printed(&format!("{line} --format json"));
    assert_eq!(printed.len(), 1, "{line}");
    let document = printed.remove(0);
    schema::assert_valid(SCHEMAS, name, &document);
    document
}

/// Frames of every kind, with fields of all ones, of zeros, and drawn.
fn frames() -> Vec<u8> {
    let mut bytes = fs::read(format!("{ROOT}/tests/data/frame-of-the-future.bin")).unwrap();
    let mut state = 0x2545_f491_4f6c_dd1d_u64;
    let mut drawn = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state
    };
    let mut sequence = 0;
    for round in 0..24 {
        for &kind in Kind::ALL {
            let mut random: Box<dyn FnMut() -> u64> = match round {
                0 => Box::new(|| u64::MAX),
                1 => Box::new(|| 0),
                _ => Box::new(&mut drawn),
            };
            let message = Message::draw(kind, &mut random);
            let header = Header {
                address: 1,
                boot: 1,
                sequence,
                sample_index: 1000 * u64::from(sequence),
            };
            sequence += 1;
            bytes.extend(encode(&header, &message, &mut [0; MAX_FRAME]).unwrap());
        }
    }
    bytes
}

/// `bead compare` of rows: whole, struck twice with a bead lost meanwhile, without a time in common, and
/// against a wave from the far end.
fn compare_rows() {
    let folder = tempfile::tempdir().unwrap();
    let mut scenario = Scenario::load(format!("{ROOT}/docs/scenarios/row-of-ten.toml")).unwrap();
    (scenario.chain.beads, scenario.duration) = (32, 0.007);
    scenario.intruders[0].beads = vec![7, 8, 9, 10];
    let mut lossy = [7, 8, 9, 10].map(Who::at);
    lossy[1].lost = vec![0];
    lossy[2].wrong_by = 1;
    let mut apart = [7, 8, 10].map(Who::at);
    apart[2].lost = vec![0];
    apart.iter_mut().for_each(|who| who.synced = false);
    let mut lines = Vec::new();
    let mut whole = [7, 8, 9, 10].map(Who::at);
    let emulated = Recording::open(Path::new(&format!("{ROOT}/{RECORDING}"))).unwrap();
    whole[0].emulator = emulated
        .parts
        .get(&Part::EmulatorReport)
        .map(|part| part.to_vec());
    assert!(whole[0].emulator.is_some());
    for (name, beads, strikes) in [
        ("whole", &whole[..], 1),
        ("lossy", &lossy, 2),
        ("apart", &apart, 1),
    ] {
        let path = folder.path().join(format!("{name}.mcap"));
        rows::record(&path, &scenario, beads, strikes);
        lines.push(format!("compare {}", path.display()));
    }
    lines.push(format!("{} --velocity fit", lines[0]));
    // Against a wave from the far end, which brings the first bead no energy.
    let last = scenario.chain.beads;
    scenario.striker.velocity = 1e-3;
    scenario.starts = vec![Start::apart([last], 1e-6)];
    scenario.starts[0].velocity = -0.1;
    let far = folder.path().join("far.toml");
    fs::write(&far, scenario.to_toml()).unwrap();
    lines.push(format!("{} --scenario {}", lines[0], far.display()));
    for line in &lines {
        hold("compare-row", line);
    }
}

#[test]
fn results_of_simulations_hold_their_schemas() {
    let folder = tempfile::tempdir().unwrap();
    let own = "docs/scenarios/own-chain.toml";
    // The third run ends before a force has halved.
    let early = folder.path().join("early.toml");
    let text = fs::read_to_string(format!("{ROOT}/{SCENARIO}")).unwrap();
    fs::write(&early, text.replace("= 0.006", "= 0.0012")).unwrap();
    for scenario in [SCENARIO, own, early.to_str().unwrap()] {
        hold("simulate", &format!("simulate {scenario}"));
    }
    // A chain of twelve beads, and few tries: a search of half a second.
    let short = folder.path().join("short.toml");
    let text = text
        .replace("beads = 16", "beads = 12")
        .replace("= 0.006", "= 0.003");
    fs::write(&short, text).unwrap();
    let search = "--bead 7,8 --total-mass 0.01 --evaluations 400";
    hold("optimise", &format!("optimise {} {search}", short.display()));
    let sweep = "docs/scenarios/stiffness-and-speed.toml";
    let [swept, plan] = ["a.parquet", "plan"].map(|name| folder.path().join(name).display().to_string());
    hold(
        "sweep-plan",
        &format!("sweep plan {sweep} --dir {plan} --chunks 2"),
    );
    hold("sweep-status", &format!("sweep status {plan}"));
    hold("sweep", &format!("sweep {sweep} --out {swept}"));
}

#[test]
fn results_of_recordings_hold_their_schemas_whatever_the_verdict() {
    let folder = tempfile::tempdir().unwrap();
    let twice = folder.path().join("twice.mcap");
    rows::record(&twice, &Scenario::paper(), &[Who::at(8)], 2);
    let twice = twice.display();
    assert_eq!(hold("replay", &format!("replay {RECORDING}"))["identical"], true);
    assert_eq!(
        hold("replay", &format!("replay {}", lossy(folder.path()).display()))["identical"],
        false
    );
    let compare = format!("compare {RECORDING} --scenario {SCENARIO}");
    assert_eq!(hold("compare", &compare)["failure"], Value::Null);
    hold("compare", &format!("{compare} --velocity fit"));
    hold("compare", &format!("compare {twice}"));
    assert!(hold("compare", &format!("{compare} --velocity 0.6"))["failure"].is_string());
    compare_rows();
    // Against itself, and against a force alone.
    for reference in [PathBuf::from(RECORDING), force_alone(folder.path())] {
        hold(
            "compare-reference",
            &format!("compare {RECORDING} --reference {}", reference.display()),
        );
    }
    hold("clock", &format!("clock {RECORDING}"));
    hold("settings", "settings show tests/data/settings-v1.bin");
    let out = folder.path().join("whole.mcap");
    hold("recover", &format!("recover {RECORDING} --out {}", out.display()));
}

/// A recording of which a frame of samples was lost: its replay differs.
fn lossy(folder: &Path) -> PathBuf {
    let path = folder.join("lossy.mcap");
    let mut who = Who::at(8);
    who.wrong_by = 1;
    rows::record(&path, &Scenario::paper(), &[who], 1);
    path
}

#[test]
fn results_of_the_image_hold_their_schemas() {
    let folder = tempfile::tempdir().unwrap();
    let faults = folder.path().join("faults.toml");
    let of_port = "[[fault]]\nat = 0.06\nkind = \"uart_stall\"\nduration = 0.1\n";
    fs::write(
        &faults,
        format!("[[fault]]\nat = 0.05\nkind = \"adc_overrun\"\n{of_port}"),
    )
    .unwrap();
    let run = format!("emulate {SCENARIO} --bead 8");
    let out = folder.path().join("run");
    let force = force_alone(folder.path());
    for line in [
        format!("{run} --strikes 2 --out {}", out.display()),
        // A fault that the bead reports, and one that it must not notice.
        format!("{run} --strikes 4 --faults {}", faults.display()),
        // A waveform of both sensors, and one of the force alone.
        format!("{run} --stimulus {RECORDING}"),
        format!("{run} --stimulus {}", force.display()),
        // No strike is seen.
        format!("{run} --velocity 0.003"),
    ] {
        hold("emulate", &line);
    }
    hold(
        "emulate-several",
        "emulate docs/scenarios/ten-intruders.toml --bead 7-8",
    );
    // The bead does not see the slower striker.
    let strikers = "--radii 0.0045 --velocity 0.003,0.45 --strikes 2";
    hold(
        "proof-accuracy",
        &format!("proof accuracy {SCENARIO} --bead 8 {strikers}"),
    );
    // One sphere is measured, and one refused.
    let spheres = "--materials ptfe --diameters 0.002,0.02 --strikes 1";
    hold(
        "proof-spheres",
        &format!("proof spheres {SCENARIO} --bead 8 {spheres}"),
    );
}

#[test]
fn every_frame_holds_the_schema_of_its_kind() {
    let folder = tempfile::tempdir().unwrap();
    let raw = folder.path().join("frames.bin");
    fs::write(&raw, frames()).unwrap();
    let lines =
        [RECORDING.to_owned(), raw.display().to_string()].map(|file| printed(&format!("decode {file}")));
    let lines = lines.concat();
    let kinds: BTreeSet<_> = lines.iter().map(|line| line["kind"].to_string()).collect();
    assert_eq!(kinds.len(), Kind::ALL.len());
    for line in &lines {
        schema::assert_valid(SCHEMAS, "decode", line);
    }
    for line in printed(&format!("decode {RECORDING} {} --kind shape", raw.display())) {
        assert_eq!(line["kind"], "shape");
        assert!(line["file"].is_string());
        schema::assert_valid(SCHEMAS, "decode", &line);
    }
}

#[test]
fn strikes_and_faults_that_are_received_hold_their_schema() {
    let folder = tempfile::tempdir().unwrap();
    let listener = UnixListener::bind(folder.path().join("bead.sock")).unwrap();
    let recorder = Command::new(env!("CARGO_BIN_EXE_bead"))
        .current_dir(folder.path())
        .args("record --port unix:bead.sock --out a.mcap --wait 0 --format json".split(' '))
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let (mut bead, _) = listener.accept().unwrap();
    bead.write_all(&frames()).unwrap();
    // A bead that hangs up ends the recording, with status 3.
    drop(bead);
    let output = recorder.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(3), "{said}");
    let lines = serde_json::Deserializer::from_slice(&output.stdout).into_iter();
    let lines: Vec<Value> = lines.map(Result::unwrap).collect();
    assert!(!lines.is_empty() && lines.iter().all(|line| line["received"].is_string()));
    for line in &lines {
        schema::assert_valid(SCHEMAS, "record", line);
    }
}

#[test]
fn every_answer_of_a_bead_holds_its_schema() {
    let block = fs::read(format!("{ROOT}/tests/data/settings-v1.bin")).unwrap();
    let line = Line::new();
    let mut beads = [Bead::new(3, &block)];
    for (action, name) in [
        ("identity", "command-identity"),
        ("status", "command-status"),
        ("self-test", "command-self-test"),
        ("arm", "command-done"),
        ("disarm", "command-done"),
        ("raw --duration 0.01 --out raw.csv", "command-raw"),
        ("reset-counters", "command-done"),
        ("reboot", "command-reboot"),
    ] {
        let arguments = format!("command {action} --format json");
        for document in documents(&line.run(&mut beads, &arguments.split(' ').collect::<Vec<_>>())) {
            schema::assert_valid(SCHEMAS, name, &document);
        }
    }
    // `read` prints of a bead what `show` prints of a file.
    let read = documents(&line.run(&mut beads, &["settings", "read", "--format", "json"]));
    assert_eq!(
        read,
        printed("settings show tests/data/settings-v1.bin --format json")
    );
}
