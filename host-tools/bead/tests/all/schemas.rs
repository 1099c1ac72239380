//! The JSON schemas in docs/schemas are those of the types, and the output of commands conforms to them.
//!
//! After a change that is meant: `SCHEMAS=overwrite cargo test --release -p absorber-bead --test all
//! schemas::`, and a new `schema_version` if a key went away or means something else.

use std::collections::BTreeSet;
use std::fs;
use std::io::Write;
use std::os::unix::net::UnixListener;
use std::path::Path;
use std::process::Output;

use crate::answering::{AnsweringBead, at_line};
use crate::budget::STATED;
use crate::program::{ROOT, TestFolder, documents, names, said, short_scenario};
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

#[test]
fn the_published_schemas_are_those_of_the_types() {
    let schemas = of_results();
    for (name, schema) in &schemas {
        schema::hold(SCHEMAS, name, schema);
    }
    // `bead figures` is a separate program, whose tests check its schema.
    let known: BTreeSet<_> = schemas.keys().copied().chain(["figures"]).collect();
    let published = names(Path::new(SCHEMAS));
    let published = published.iter().map(|name| name.trim_end_matches(".json"));
    assert_eq!(known, published.collect());
}

/// A folder with scenarios, a sweep, a recording, a settings block, and a pulse of force over microseconds.
fn folder() -> TestFolder {
    let folder = TestFolder::new();
    for (name, of) in [
        ("paper-strike.toml", "docs/scenarios/paper-strike.toml"),
        ("own.toml", "docs/scenarios/own-chain.toml"),
        ("trimer.toml", "docs/scenarios/driven-trimer.toml"),
        ("ten.toml", "docs/scenarios/ten-intruders.toml"),
        ("sweep.toml", "docs/scenarios/stiffness-and-speed.toml"),
        ("springs.toml", "docs/scenarios/springs.toml"),
        ("x.mcap", "tests/data/recording-v1.mcap"),
        ("bead.settings", "tests/data/settings-v1.bin"),
    ] {
        fs::copy(format!("{ROOT}/{of}"), folder.join(name)).unwrap();
    }
    let row = |n: i32| format!("{n}0,{}\n", 5.0 * (-f64::from(n - 200).powi(2) / 400.0).exp());
    let rows: String = (0..400).map(row).collect();
    folder.write("force.csv", format!("t (us),F (N)\n{rows}"));
    folder
}

/// Documents printed by a command, which may be a check that fails.
fn printed(output: &Output) -> Vec<Value> {
    let status = output.status.code().unwrap();
    assert!(status < 2, "{}", said(output));
    documents(&output.stdout)
}

/// Asserts that the document that a command prints conforms to a schema, and returns it.
fn hold(folder: &TestFolder, name: &str, line: &str) -> Value {
    let mut printed = printed(&folder.run(&format!("{line} --format json")));
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

#[test]
fn comparisons_of_rows_hold_their_schema() {
    let folder = folder();
    let mut scenario = light_intruders(&[7, 8, 9, 10]);
    // A bead lost one of two strikes, and another differs; two beads without a common time; a whole row.
    let mut lossy = [7, 8, 9, 10].map(ModelBead::at);
    lossy[1].lost = vec![0];
    lossy[2].wrong_by = 1;
    let mut apart = [7, 8, 10].map(ModelBead::at);
    apart[2].lost = vec![0];
    apart.iter_mut().for_each(|bead| bead.synced = false);
    let mut whole = [7, 8, 9, 10].map(ModelBead::at);
    let emulated = Recording::open(&folder.join("x.mcap")).unwrap();
    whole[0].emulator = Some(emulated.parts[&Part::EmulatorReport].to_vec());
    for (name, beads, strikes) in [
        ("lossy", &lossy[..], 2),
        ("apart", &apart, 1),
        ("whole", &whole, 1),
    ] {
        record(&folder.join(format!("{name}.mcap")), &scenario, beads, strikes);
        hold(&folder, "compare-row", &format!("compare {name}.mcap"));
    }
    hold(&folder, "compare-row", "compare whole.mcap --velocity fit");
    // Against a wave from the far end, which brings the first bead no energy.
    scenario.striker.velocity = 1e-3;
    scenario.starts = vec![Start::apart([scenario.chain.beads], 1e-6)];
    scenario.starts[0].velocity = -0.1;
    folder.write("far.toml", scenario.to_toml());
    hold(&folder, "compare-row", "compare whole.mcap --scenario far.toml");
}

#[test]
fn results_of_simulations_hold_their_schemas() {
    let folder = folder();
    // The third run ends before a force has halved.
    let early = folder.text("paper-strike.toml").replace("= 0.006", "= 0.0012");
    folder.write("early.toml", early);
    folder.write("short.toml", short_scenario());
    for (name, line) in [
        ("simulate", "simulate paper-strike.toml"),
        ("simulate", "simulate own.toml"),
        ("simulate", "simulate early.toml"),
        ("simulate", "simulate trimer.toml"),
        ("periodic", "periodic trimer.toml"),
        ("periodic", "periodic trimer.toml --along frequency --to 6190"),
        ("sweep-plan", "sweep plan sweep.toml --dir plan --chunks 2"),
        ("sweep-status", "sweep status plan"),
        ("sweep", "sweep sweep.toml --out a.parquet"),
    ] {
        hold(&folder, name, line);
    }
    let search = "optimise short.toml --bead 7,8 --total-mass 0.01 --evaluations 400";
    hold(&folder, "optimise", search);
    let chosen = search.replace(
        "7,8",
        "7,8,9 --hosts-at-most 2 --catalogue springs.toml --stroke 1e-4 --radii 9-12:0.015:0.02",
    );
    hold(&folder, "optimise", &chosen);
    hold(&folder, "optimise-front", &search.replace("0.01", "0.005,0.01"));
}

#[test]
fn results_of_recordings_hold_their_schemas_whatever_the_verdict() {
    let folder = folder();
    let [good, mut wrong] = [8, 8].map(ModelBead::at);
    wrong.wrong_by = 1;
    for (name, bead, strikes) in [("good", &good, 1), ("twice", &good, 2), ("wrong", &wrong, 1)] {
        let path = folder.join(format!("{name}.mcap"));
        record(&path, &Scenario::paper(), std::slice::from_ref(bead), strikes);
    }
    // One that is kept, and one that cannot be decided.
    let limits =
        "[[limit]]\nquantity = \"peak_force\"\nmax = 9\n[[limit]]\nquantity = \"row_share\"\nmin = 0.1\n";
    folder.write("limits.toml", limits);
    let hold = |name: &str, line: &str| hold(&folder, name, line);
    assert_eq!(hold("replay", "replay good.mcap")["identical"], true);
    assert_eq!(hold("replay", "replay wrong.mcap")["identical"], false);
    assert_eq!(hold("compare", "compare good.mcap")["failure"], Value::Null);
    assert!(hold("compare", "compare good.mcap --velocity 0.6")["failure"].is_string());
    let chain = "identify good.mcap twice.mcap --scenario paper-strike.toml";
    for (name, line) in [
        ("compare", "compare good.mcap --velocity fit"),
        ("compare", "compare twice.mcap"),
        // Against itself, and against only a force.
        ("compare-reference", "compare good.mcap --reference good.mcap"),
        ("compare-reference", "compare good.mcap --reference force.csv"),
        ("note", "note good.mcap operator=Ana"),
        ("list", "list"),
        ("trend", "trend --by strike"),
        ("judge", "judge good.mcap twice.mcap --limits limits.toml"),
        ("analyse", "analyse srs good.mcap"),
        ("analyse", "analyse psd good.mcap --of force"),
        ("analyse", "analyse fft good.mcap --unit g"),
        ("analyse", "analyse transfer good.mcap"),
        ("budget", "budget good.mcap --monte-carlo 1000"),
        ("identify", chain),
        ("identify", "identify good.mcap --fit k,c,m"),
        ("clock", "clock good.mcap"),
        ("settings", "settings show bead.settings"),
        ("recover", "recover good.mcap --out a.mcap"),
    ] {
        hold(name, line);
    }
}

#[test]
fn results_of_the_image_hold_their_schemas() {
    let folder = folder();
    // A fault that the bead reports, and one that it must not notice.
    let reported = "[[fault]]\nat = 0.05\nkind = \"adc_overrun\"\n";
    let unnoticed = "[[fault]]\nat = 0.06\nkind = \"uart_stall\"\nduration = 0.1\n";
    folder.write("faults.toml", format!("{reported}{unnoticed}"));
    folder.done("settings make --template stated.toml");
    folder.write("stated.toml", folder.text("stated.toml") + STATED);
    for more in [
        "--strikes 2 --out run --uncertainty stated.toml",
        "--strikes 4 --faults faults.toml",
        // A waveform of both sensors, and one of the force only.
        "--stimulus x.mcap",
        "--stimulus force.csv",
        // No strike is seen.
        "--velocity 0.003",
    ] {
        let emulate = format!("emulate paper-strike.toml --bead 8 {more}");
        hold(&folder, "emulate", &emulate);
    }
    hold(&folder, "emulate-several", "emulate ten.toml --bead 7-8");
    // The bead does not see the slower striker.
    let strikers = "--radii 0.0045 --velocity 0.003,0.45 --strikes 2";
    let accuracy = format!("proof accuracy paper-strike.toml --bead 8 {strikers}");
    hold(&folder, "proof-accuracy", &accuracy);
    // One sphere is measured, and one refused.
    let spheres = "--materials ptfe --diameters 0.002,0.02 --strikes 1";
    let spheres = format!("proof spheres paper-strike.toml --bead 8 {spheres}");
    hold(&folder, "proof-spheres", &spheres);
    hold(&folder, "proof-silent", "proof silent --group window,train");
    let proof = "proof calibrate --beads 10 --repeats 2";
    hold(&folder, "proof-calibrate", proof);
    let drop =
        "calibrate drop --from simulated --drops 3 --ball-mass 3g±1mg --height 0.1±3e-4 --tolerance 10%";
    hold(&folder, "calibrate", drop);
    hold(&folder, "proof-coverage", "proof coverage --beads 50 --strikes 1");
    hold(&folder, "proof-identify", "proof identify --beads 20");
}

#[test]
fn every_frame_holds_the_schema_of_its_kind_also_while_it_is_received() {
    let folder = folder();
    folder.write("frames.bin", frames());
    let decode = |arguments: &str| {
        let lines = documents(folder.done(&format!("decode {arguments}")).as_bytes());
        for line in &lines {
            schema::assert_valid(SCHEMAS, "decode", line);
        }
        lines
    };
    let decoded = decode("frames.bin");
    let kinds: BTreeSet<_> = decoded.iter().map(|line| line["kind"].to_string()).collect();
    assert_eq!(kinds.len(), Kind::ALL.len());
    for line in decode("frames.bin x.mcap --kind shape") {
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
    let folder = folder();
    let mut beads = [AnsweringBead::new(3, &folder.read("bead.settings"))];
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
    let shown = folder.run("settings show bead.settings --format json");
    assert_eq!(ask("settings read"), printed(&shown));
}
