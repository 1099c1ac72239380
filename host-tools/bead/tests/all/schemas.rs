//! The JSON schemas in docs/schemas are those of the types, and the output of commands conforms to them.
//!
//! After a change that is meant: `SCHEMAS=overwrite cargo test --release -p absorber-bead --test all
//! schemas::`, and a new `schema_version` if a key went away or means something else.

use std::collections::BTreeSet;
use std::fs;
use std::io::Write;
use std::os::unix::net::UnixListener;
use std::path::{Path, PathBuf};
use std::process::Output;

use crate::answering::{AnsweringBead, at_line};
use crate::program::{ROOT, TestFolder, documents, done, names, said, short_scenario, typed};
use crate::row::light_intruders;
use crate::rows::{ModelBead, record};
use crate::schema;
use bead::cli::schemas::of_results;
use bead_recording::file::{Part, Recording};
use bead_testing::{Speaker, xorshift};
use bead_wire::{Kind, Message};
use hertz_chain::{Scenario, Start};
use serde_json::Value;

const SCHEMAS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/schemas");
const SCENARIO: &str = "docs/scenarios/paper-strike.toml";
const RECORDING: &str = "tests/data/recording-v1.mcap";

#[test]
fn the_published_schemas_are_those_of_the_types() {
    let schemas = of_results();
    for (name, schema) in &schemas {
        schema::hold(SCHEMAS, name, schema);
    }
    // `bead figures` is a program of its own, and its tests hold its schema.
    let known: BTreeSet<_> = schemas.keys().copied().chain(["figures"]).collect();
    let published = names(Path::new(SCHEMAS));
    let published = published.iter().map(|name| name.trim_end_matches(".json"));
    assert_eq!(known, published.collect());
}

/// A file with a pulse of force over microseconds.
fn force_alone(folder: &Path) -> PathBuf {
    let path = folder.join("force.csv");
    let row = |n: i32| format!("{n}0,{}\n", 5.0 * (-f64::from(n - 200).powi(2) / 400.0).exp());
    let rows: String = (0..400).map(row).collect();
    fs::write(&path, format!("t (us),F (N)\n{rows}")).unwrap();
    path
}

/// Documents printed by a command, which may be a check that fails.
fn printed(output: &Output) -> Vec<Value> {
    let status = output.status.code().unwrap();
    assert!(status < 2, "{}", said(output));
    documents(&output.stdout)
}

/// Asserts that the document that a command prints conforms to a schema, and returns it.
fn hold(name: &str, line: &str) -> Value {
    let mut printed = printed(&typed(Path::new(ROOT), &format!("{line} --format json")));
    assert_eq!(printed.len(), 1, "{line}");
    let document = printed.remove(0);
    schema::assert_valid(SCHEMAS, name, &document);
    document
}

/// Frames of every kind, with fields of all ones, of zeros, and drawn.
fn frames() -> Vec<u8> {
    let mut bead = Speaker {
        boot: 1,
        bytes: fs::read(format!("{ROOT}/tests/data/frame-of-the-future.bin")).unwrap(),
        ..Speaker::at(1)
    };
    let mut random = xorshift(0x2545_f491_4f6c_dd1d);
    for round in 0..24 {
        for &kind in Kind::ALL {
            let message = Message::draw(kind, &mut || match round {
                0 => u64::MAX,
                1 => 0,
                _ => random(),
            });
            bead.say(1000 * u64::from(bead.sequence), message);
        }
    }
    bead.bytes
}

/// `bead compare` of rows: whole, struck twice with a bead lost meanwhile, without a time in common, and
/// against a wave from the far end.
fn compare_rows() {
    let folder = TestFolder::new();
    let path = |name: &str| folder.join(name);
    let mut scenario = light_intruders(&[7, 8, 9, 10]);
    let mut lossy = [7, 8, 9, 10].map(ModelBead::at);
    lossy[1].lost = vec![0];
    lossy[2].wrong_by = 1;
    let mut apart = [7, 8, 10].map(ModelBead::at);
    apart[2].lost = vec![0];
    apart.iter_mut().for_each(|bead| bead.synced = false);
    let mut whole = [7, 8, 9, 10].map(ModelBead::at);
    let emulated = Recording::open(&Path::new(ROOT).join(RECORDING)).unwrap();
    whole[0].emulator = Some(emulated.parts[&Part::EmulatorReport].to_vec());
    for (beads, strikes) in [(&lossy[..], 2), (&apart, 1), (&whole, 1)] {
        record(&path("row.mcap"), &scenario, beads, strikes);
        hold("compare-row", &format!("compare {}", path("row.mcap").display()));
        fs::rename(path("row.mcap"), path("last.mcap")).unwrap();
    }
    let compare = format!("compare {}", path("last.mcap").display());
    hold("compare-row", &format!("{compare} --velocity fit"));
    // Against a wave from the far end, which brings the first bead no energy.
    scenario.striker.velocity = 1e-3;
    scenario.starts = vec![Start::apart([scenario.chain.beads], 1e-6)];
    scenario.starts[0].velocity = -0.1;
    fs::write(path("far.toml"), scenario.to_toml()).unwrap();
    hold(
        "compare-row",
        &format!("{compare} --scenario {}", path("far.toml").display()),
    );
}

#[test]
fn results_of_simulations_hold_their_schemas() {
    let folder = TestFolder::new();
    let path = |name: &str| folder.join(name).display().to_string();
    // The third run ends before a force has halved.
    let text = fs::read_to_string(format!("{ROOT}/{SCENARIO}")).unwrap();
    fs::write(path("early.toml"), text.replace("= 0.006", "= 0.0012")).unwrap();
    for scenario in [SCENARIO, "docs/scenarios/own-chain.toml", &path("early.toml")] {
        hold("simulate", &format!("simulate {scenario}"));
    }
    fs::write(path("short.toml"), short_scenario()).unwrap();
    let search = "--bead 7,8 --total-mass 0.01 --evaluations 400";
    hold("optimise", &format!("optimise {} {search}", path("short.toml")));
    let sweep = "docs/scenarios/stiffness-and-speed.toml";
    let plan = path("plan");
    hold(
        "sweep-plan",
        &format!("sweep plan {sweep} --dir {plan} --chunks 2"),
    );
    hold("sweep-status", &format!("sweep status {plan}"));
    hold("sweep", &format!("sweep {sweep} --out {}", path("a.parquet")));
}

#[test]
fn results_of_recordings_hold_their_schemas_whatever_the_verdict() {
    let folder = TestFolder::new();
    let [twice, wrong, out] = ["twice.mcap", "wrong.mcap", "out.mcap"].map(|name| folder.join(name));
    record(&twice, &Scenario::paper(), &[ModelBead::at(8)], 2);
    let mut bead = ModelBead::at(8);
    bead.wrong_by = 1;
    record(&wrong, &Scenario::paper(), &[bead], 1);
    let replay = format!("replay {}", wrong.display());
    assert_eq!(hold("replay", &format!("replay {RECORDING}"))["identical"], true);
    assert_eq!(hold("replay", &replay)["identical"], false);
    let compare = format!("compare {RECORDING} --scenario {SCENARIO}");
    assert_eq!(hold("compare", &compare)["failure"], Value::Null);
    hold("compare", &format!("{compare} --velocity fit"));
    hold("compare", &format!("compare {}", twice.display()));
    assert!(hold("compare", &format!("{compare} --velocity 0.6"))["failure"].is_string());
    compare_rows();
    // Against itself, and against a force alone.
    for reference in [PathBuf::from(RECORDING), force_alone(&folder)] {
        let reference = reference.display();
        hold(
            "compare-reference",
            &format!("compare {RECORDING} --reference {reference}"),
        );
    }
    hold("clock", &format!("clock {RECORDING}"));
    hold("settings", "settings show tests/data/settings-v1.bin");
    hold("recover", &format!("recover {RECORDING} --out {}", out.display()));
}

#[test]
fn results_of_the_image_hold_their_schemas() {
    let folder = TestFolder::new();
    let [faults, out] = ["faults.toml", "run"].map(|name| folder.join(name));
    let of_port = "[[fault]]\nat = 0.06\nkind = \"uart_stall\"\nduration = 0.1\n";
    fs::write(
        &faults,
        format!("[[fault]]\nat = 0.05\nkind = \"adc_overrun\"\n{of_port}"),
    )
    .unwrap();
    let (faults, out, force) = (faults.display(), out.display(), force_alone(&folder));
    for more in [
        format!("--strikes 2 --out {out}"),
        // A fault that the bead reports, and one that it must not notice.
        format!("--strikes 4 --faults {faults}"),
        // A waveform of both sensors, and one of the force alone.
        format!("--stimulus {RECORDING}"),
        format!("--stimulus {}", force.display()),
        // No strike is seen.
        "--velocity 0.003".to_owned(),
    ] {
        hold("emulate", &format!("emulate {SCENARIO} --bead 8 {more}"));
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
fn every_frame_holds_the_schema_of_its_kind_also_while_it_is_received() {
    let folder = TestFolder::new();
    let raw = folder.join("frames.bin");
    fs::write(&raw, frames()).unwrap();
    let decode = |arguments: &str| {
        let decode = format!("decode {} {arguments}", raw.display());
        let lines = documents(done(typed(Path::new(ROOT), &decode)).as_bytes());
        lines
            .iter()
            .for_each(|line| schema::assert_valid(SCHEMAS, "decode", line));
        lines
    };
    let decoded = decode("");
    let kinds: BTreeSet<_> = decoded.iter().map(|line| line["kind"].to_string()).collect();
    assert_eq!(kinds.len(), Kind::ALL.len());
    for line in decode(&format!("{RECORDING} --kind shape")) {
        assert!(line["kind"] == "shape" && line["file"].is_string());
    }

    // `bead record` prints strikes and faults as `bead decode` does, with the time of receipt.
    let listener = UnixListener::bind(folder.join("bead.sock")).unwrap();
    let record = "record --port unix:bead.sock --out a.mcap --wait 0 --format json";
    let recorder = folder.start(record);
    let (mut bead, _) = listener.accept().unwrap();
    bead.write_all(&frames()).unwrap();
    // A bead that hangs up ends the recording, with status 3.
    drop(bead);
    let output = recorder.finish();
    assert_eq!(output.status.code(), Some(3), "{}", said(&output));
    let mut lines = documents(&output.stdout);
    assert!(!lines.is_empty());
    for line in &mut lines {
        schema::assert_valid(SCHEMAS, "record", line);
        let received = line.as_object_mut().unwrap().remove("received").unwrap();
        assert!(received.as_str().unwrap().ends_with('Z'), "{received}");
        assert!(decoded.contains(line), "{line}");
    }
}

#[test]
fn every_answer_of_a_bead_holds_its_schema() {
    let block = fs::read(format!("{ROOT}/tests/data/settings-v1.bin")).unwrap();
    let folder = TestFolder::new();
    let mut beads = [AnsweringBead::new(3, &block)];
    let mut ask = |asked: &str| printed(&at_line(&folder, &mut beads, &format!("{asked} --format json")));
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
        for document in ask(&format!("command {action}")) {
            schema::assert_valid(SCHEMAS, name, &document);
        }
    }
    // `read` prints for a bead the same as `show` for a file.
    let shown = typed(
        Path::new(ROOT),
        "settings show tests/data/settings-v1.bin --format json",
    );
    assert_eq!(ask("settings read"), printed(&shown));
}
