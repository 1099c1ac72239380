//! The JSON of every command, held by a schema in docs/schemas.
//!
//! A schema is made of what the command prints of recordings and of frames with random fields. After a change that
//! is meant: `SCHEMAS=overwrite cargo test --release -p bead --test schemas`, and a new `schema_version` if a key
//! went away or means something else.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

use std::collections::BTreeSet;
use std::fs;
use std::process::Command;

use bead_wire::{Header, Kind, MAX_FRAME, Message, encode};
use serde_json::{Map, Value, json};

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");

/// What a command prints: a document, or one on each line.
fn printed(arguments: &[&str]) -> Vec<Value> {
    let output = Command::new(env!("CARGO_BIN_EXE_bead"))
        .current_dir(ROOT)
        .args(arguments)
        .output()
        .unwrap();
    // A check that says no prints its result too.
    assert!(
        output.status.code().is_some_and(|code| code < 2),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let documents = serde_json::Deserializer::from_slice(&output.stdout).into_iter();
    documents.map(Result::unwrap).collect()
}

/// The schema of one value.
fn schema(value: &Value) -> Value {
    let kind = match value {
        Value::Null => "null",
        Value::Bool(_) => "boolean",
        Value::Number(number) if number.is_f64() => "number",
        Value::Number(_) => "integer",
        Value::String(_) => "string",
        Value::Array(items) => {
            let items = items.iter().map(schema).reduce(|one, other| merged(&one, &other));
            return json!({ "type": ["array"], "items": items.unwrap_or(json!({})) });
        }
        Value::Object(entries) => {
            let properties: Map<_, _> = entries
                .iter()
                .map(|(key, value)| (key.clone(), schema(value)))
                .collect();
            let required: Vec<_> = entries.keys().cloned().collect();
            return json!({ "type": ["object"], "properties": properties, "required": required });
        }
    };
    json!({ "type": [kind] })
}

/// A schema that both hold.
fn merged(one: &Value, other: &Value) -> Value {
    let list = |schema: &Value, key: &str| -> Vec<String> {
        let list = schema[key].as_array().cloned().unwrap_or_default();
        list.iter()
            .filter_map(|item| item.as_str().map(str::to_owned))
            .collect()
    };
    let mut types: BTreeSet<_> = list(one, "type").into_iter().chain(list(other, "type")).collect();
    if types.contains("number") {
        types.remove("integer");
    }
    let mut all = json!({ "type": types });
    let of = |key: &str| [one, other].map(|schema| schema.get(key).cloned());
    match of("properties") {
        [Some(Value::Object(mut ours)), Some(Value::Object(theirs))] => {
            for (key, value) in theirs {
                let both = ours.get(&key).map_or(value.clone(), |mine| merged(mine, &value));
                ours.insert(key, both);
            }
            all["properties"] = ours.into();
            let theirs = list(other, "required");
            all["required"] = list(one, "required")
                .into_iter()
                .filter(|key| theirs.contains(key))
                .collect();
        }
        [ours, theirs] => {
            for (own, whose) in [(ours, one), (theirs, other)] {
                if let Some(own) = own {
                    all["properties"] = own;
                    all["required"] = whose["required"].clone();
                }
            }
        }
    }
    match of("items") {
        [Some(ours), Some(theirs)] if ours != json!({}) && theirs != json!({}) => {
            all["items"] = merged(&ours, &theirs)
        }
        [ours, theirs] => {
            let known = [ours, theirs]
                .into_iter()
                .flatten()
                .max_by_key(|items| items.to_string().len());
            if let Some(items) = known {
                all["items"] = items;
            }
        }
    }
    all
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

#[test]
fn every_result_is_what_its_schema_says() {
    let folder = tempfile::tempdir().unwrap();
    let raw = folder.path().join("frames.bin");
    fs::write(&raw, frames()).unwrap();
    let raw = raw.display().to_string();
    let recording = "tests/data/recording-v2.mcap";
    let scenario = "docs/scenarios/paper-strike.toml";
    let own = "docs/scenarios/own-chain.toml";
    let sweep = "docs/scenarios/stiffness-and-speed.toml";
    let [swept, plan] = ["a.parquet", "plan"].map(|name| folder.path().join(name).display().to_string());
    let json = ["--format", "json"];
    let commands: [(&str, Vec<Vec<&str>>); 9] = [
        (
            "simulate",
            vec![vec!["simulate", scenario], vec!["simulate", own]],
        ),
        ("replay", vec![vec!["replay", recording]]),
        (
            "compare",
            vec![
                vec!["compare", recording, "--scenario", scenario],
                vec!["compare", recording, "--scenario", scenario, "--velocity", "fit"],
            ],
        ),
        ("clock", vec![vec!["clock", recording]]),
        (
            "settings",
            vec![vec!["settings", "show", "tests/data/settings-v4.bin"]],
        ),
        ("decode", vec![vec!["decode", recording], vec!["decode", &raw]]),
        (
            "sweep-plan",
            vec![vec!["sweep", "plan", sweep, "--dir", &plan, "--chunks", "2"]],
        ),
        ("sweep-status", vec![vec!["sweep", "status", &plan]]),
        ("sweep", vec![vec!["sweep", sweep, "--out", &swept]]),
    ];
    for (name, lines) in commands {
        let mut documents = Vec::new();
        for line in lines {
            let line = if name == "decode" {
                line
            } else {
                [&line[..], &json].concat()
            };
            documents.extend(printed(&line));
        }
        assert!(
            documents.iter().all(|document| document["schema_version"] == 1),
            "{name}"
        );
        let title = format!("What `bead {}` prints as JSON", name.replace('-', " "));
        let mut found = json!({ "$schema": "https://json-schema.org/draft/2020-12/schema", "title": title });
        if name == "decode" {
            // A line is of one kind.
            let kinds: BTreeSet<_> = documents
                .iter()
                .map(|line| line["kind"].as_str().unwrap().to_owned())
                .collect();
            assert_eq!(kinds.len(), Kind::ALL.len());
            let of_kind = |kind: &String| {
                let lines = documents.iter().filter(|line| line["kind"] == **kind);
                let mut of = lines
                    .map(schema)
                    .reduce(|one, other| merged(&one, &other))
                    .unwrap();
                of["properties"]["kind"] = json!({ "const": kind });
                of
            };
            found["oneOf"] = kinds.iter().map(of_kind).collect();
        } else {
            let all = documents
                .iter()
                .map(schema)
                .reduce(|one, other| merged(&one, &other));
            found
                .as_object_mut()
                .unwrap()
                .extend(all.unwrap().as_object().unwrap().clone());
        }
        let found = serde_json::to_string_pretty(&found).unwrap() + "\n";
        let path = format!("{ROOT}/docs/schemas/{name}.json");
        if std::env::var("SCHEMAS").is_ok_and(|wish| wish == "overwrite") {
            fs::create_dir_all(format!("{ROOT}/docs/schemas")).unwrap();
            fs::write(&path, found).unwrap();
            continue;
        }
        let kept = fs::read_to_string(&path).unwrap_or_default();
        let first = kept
            .lines()
            .zip(found.lines())
            .find(|(kept, found)| kept != found);
        assert!(
            kept == found,
            "{path} says something else, first {first:?}; if that is meant, run this test with SCHEMAS=overwrite"
        );
    }
}
