//! The JSON of every command, held by a schema in docs/schemas.
//!
//! A schema is made of what the command prints of recordings, runs, and frames with random fields. After a
//! change that is meant: `SCHEMAS=overwrite cargo test --release -p absorber-bead --test all schemas::`, and a new
//! `schema_version` if a key went away or means something else. (`bead figures` has its own in
//! host-tools/figures-command.)

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
use bead::recording::file::{Part, Recording};
use bead_wire::{Header, Kind, MAX_FRAME, Message, encode};
use hertz_chain::{Scenario, Start};
use serde_json::{Value, json};

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");
const SCHEMAS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/schemas");
const SCENARIO: &str = "docs/scenarios/paper-strike.toml";
const RECORDING: &str = "tests/data/recording-v2.mcap";

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

/// What a command prints.
fn printed(arguments: &str) -> Vec<Value> {
    documents(&bead(Path::new(ROOT), arguments.split_whitespace()))
}

/// What a command prints as JSON, over all these lines.
fn hold(name: &str, lines: &[&str]) {
    let printed: Vec<_> = lines
        .iter()
        .flat_map(|line| printed(&format!("{line} --format json")))
        .collect();
    hold_documents(name, &printed);
}

fn hold_documents(name: &str, documents: &[Value]) {
    let objects = documents.iter().flat_map(|document| match document {
        Value::Array(items) => &items[..],
        one => std::slice::from_ref(one),
    });
    for object in objects {
        assert_eq!(object["schema_version"], 1, "{name}: {object}");
    }
    schema::hold(SCHEMAS, name, &schema::of_all(documents));
}

/// One of several schemas, each of the documents for which `key` gives one value; `mark` makes it tell
/// itself.
fn one_of(documents: &[Value], key: impl Fn(&Value) -> String, mark: impl Fn(&mut Value, &str)) -> Value {
    let keys: BTreeSet<_> = documents.iter().map(&key).collect();
    let of_key = |wanted: &String| {
        let mut of = schema::of_all(documents.iter().filter(|document| key(document) == *wanted));
        mark(&mut of, wanted);
        of
    };
    json!({ "oneOf": keys.iter().map(of_key).collect::<Vec<_>>() })
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

/// Of documents with frames: a schema for each kind.
fn of_frames(documents: &[Value]) -> Value {
    assert!(documents.iter().all(|line| line["schema_version"] == 1));
    one_of(
        documents,
        |line| line["kind"].as_str().unwrap().to_owned(),
        |schema, kind| schema["properties"]["kind"] = json!({ "const": kind }),
    )
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
    hold(
        "compare-row",
        &lines.iter().map(String::as_str).collect::<Vec<_>>(),
    );
}

#[test]
fn results_of_simulations_and_recordings_are_what_their_schemas_say() {
    let folder = tempfile::tempdir().unwrap();
    let own = "docs/scenarios/own-chain.toml";
    // The third run ends before a force has halved.
    let early = folder.path().join("early.toml");
    let text = fs::read_to_string(format!("{ROOT}/{SCENARIO}")).unwrap();
    fs::write(&early, text.replace("= 0.006", "= 0.0012")).unwrap();
    let simulate = [SCENARIO, own, early.to_str().unwrap()].map(|scenario| format!("simulate {scenario}"));
    hold("simulate", &simulate.each_ref().map(String::as_str));
    hold("replay", &[&format!("replay {RECORDING}")]);
    let compare = format!("compare {RECORDING} --scenario {SCENARIO}");
    let twice = folder.path().join("twice.mcap");
    rows::record(&twice, &Scenario::paper(), &[Who::at(8)], 2);
    let twice = format!("compare {}", twice.display());
    hold(
        "compare",
        &[&compare, &format!("{compare} --velocity fit"), &twice],
    );
    compare_rows();
    // Against itself, and against a force alone.
    let force = force_alone(folder.path());
    let against = format!("compare {RECORDING} --reference");
    let reference = [
        format!("{against} {RECORDING}"),
        format!("{against} {}", force.display()),
    ];
    hold("compare-reference", &reference.each_ref().map(String::as_str));
    hold("clock", &[&format!("clock {RECORDING}")]);
    hold("settings", &["settings show tests/data/settings-v4.bin"]);
    let out = folder.path().join("whole.mcap");
    hold(
        "recover",
        &[&format!("recover {RECORDING} --out {}", out.display())],
    );
    // A chain of twelve beads, and few tries: a search of half a second.
    let short = folder.path().join("short.toml");
    let text = text
        .replace("beads = 16", "beads = 12")
        .replace("= 0.006", "= 0.003");
    fs::write(&short, text).unwrap();
    let search = format!(
        "optimise {} --bead 7,8 --total-mass 0.01 --evaluations 400",
        short.display()
    );
    hold("optimise", &[&search]);
    let sweep = "docs/scenarios/stiffness-and-speed.toml";
    let [swept, plan] = ["a.parquet", "plan"].map(|name| folder.path().join(name).display().to_string());
    hold(
        "sweep-plan",
        &[&format!("sweep plan {sweep} --dir {plan} --chunks 2")],
    );
    hold("sweep-status", &[&format!("sweep status {plan}")]);
    hold("sweep", &[&format!("sweep {sweep} --out {swept}")]);
}

#[test]
fn results_of_the_image_are_what_their_schemas_say() {
    let folder = tempfile::tempdir().unwrap();
    let faults = folder.path().join("faults.toml");
    fs::write(&faults, "[[fault]]\nat = 0.05\nkind = \"adc_overrun\"\n").unwrap();
    let run = format!("emulate {SCENARIO} --bead 8");
    let out = folder.path().join("run");
    let long = format!("{run} --strikes 4 --faults {}", faults.display());
    let force = force_alone(folder.path());
    hold(
        "emulate",
        &[
            &format!("{run} --strikes 2 --out {}", out.display()),
            &long,
            // A waveform of both sensors, and one of the force alone.
            &format!("{run} --stimulus {RECORDING}"),
            &format!("{run} --stimulus {}", force.display()),
        ],
    );
    // The bead does not see the slower striker.
    hold(
        "accuracy",
        &[&format!(
            "accuracy {SCENARIO} --bead 8 --radii 0.0045 --velocity 0.003,0.45 --strikes 2"
        )],
    );
    // One sphere is measured, and one refused.
    let spheres = format!("spheres {SCENARIO} --bead 8 --materials ptfe --diameters 0.002,0.02 --strikes 1");
    hold("spheres", &[&spheres]);
}

#[test]
fn every_frame_is_what_its_schema_says() {
    let folder = tempfile::tempdir().unwrap();
    let raw = folder.path().join("frames.bin");
    fs::write(&raw, frames()).unwrap();
    let mut lines = printed(&format!("decode {RECORDING}"));
    lines.extend(printed(&format!("decode {}", raw.display())));
    let decode = of_frames(&lines);
    assert_eq!(decode["oneOf"].as_array().unwrap().len(), Kind::ALL.len());
    schema::hold(SCHEMAS, "decode", &decode);

    // The same, received live: strikes and faults.
    let listener = UnixListener::bind(folder.path().join("bead.sock")).unwrap();
    let recorder = Command::new(env!("CARGO_BIN_EXE_bead"))
        .current_dir(folder.path())
        .args([
            "record",
            "--port",
            "unix:bead.sock",
            "--out",
            "a.mcap",
            "--wait",
            "0",
            "--format",
            "json",
        ])
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
    assert!(lines.iter().all(|line| line["received"].is_string()));
    let record = of_frames(&lines);
    assert_eq!(record["oneOf"].as_array().unwrap().len(), 2, "strike and fault");
    schema::hold(SCHEMAS, "record", &record);
}

#[test]
fn every_answer_of_a_bead_is_what_its_schema_says() {
    let block = fs::read(format!("{ROOT}/tests/data/settings-v5.bin")).unwrap();
    let line = Line::new();
    let mut beads = [Bead::new(3, &block)];
    let mut answers = Vec::new();
    for action in [
        "identity",
        "status",
        "self-test",
        "arm",
        "disarm",
        "raw",
        "reset-counters",
        "reboot",
    ] {
        let mut arguments = vec!["command", action, "--format", "json"];
        if action == "raw" {
            arguments.extend(["--duration", "0.01", "--out", "raw.csv"]);
        }
        for document in documents(&line.run(&mut beads, &arguments)) {
            answers.push(json!({ "action": action, "document": document }));
        }
    }
    let versions = |answer: &Value| match &answer["document"] {
        Value::Array(items) => items.iter().all(|item| item["schema_version"] == 1),
        one => one["schema_version"] == 1,
    };
    assert!(answers.iter().all(versions), "{answers:?}");
    let mut command = one_of(
        &answers,
        |answer| answer["action"].as_str().unwrap().to_owned(),
        |schema, action| {
            *schema = schema["properties"]["document"].take();
            schema["title"] = format!("bead command {action}").into();
        },
    );
    assert_eq!(command["oneOf"].as_array_mut().unwrap().len(), 8);
    schema::hold(SCHEMAS, "command", &command);
    // What `read` prints of a bead is what `show` prints of a file.
    let read = documents(&line.run(&mut beads, &["settings", "read", "--format", "json"]));
    assert_eq!(
        read,
        printed("settings show tests/data/settings-v5.bin --format json")
    );
}
