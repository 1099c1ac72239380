//! Recordings of other versions, as `tests/data/README.md` tells of them: read, or refused by one line that
//! says what to do.

use std::fs;
use std::path::Path;
use std::process::Output;

use crate::program;
use bead_recording::file::{About, Writer};
use bead_tables::whole::Target;
use serde_json::Value;
use tempfile::TempDir;

const DATA: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data");

fn data(name: &str) -> String {
    format!("{DATA}/{name}")
}

fn bead(arguments: &[&str]) -> Output {
    program::bead(Path::new("."), arguments)
}

fn lines(bytes: &[u8]) -> Vec<Value> {
    let lines = bytes.split(|&byte| byte == b'\n').filter(|line| !line.is_empty());
    lines.map(|line| serde_json::from_slice(line).unwrap()).collect()
}

/// Every number of `then` whose key ends with `_raw` or that counts, and what `now` has in its place.
fn bits<'a>(then: &'a Value, now: &'a Value) -> Vec<(&'a str, &'a Value, &'a Value)> {
    let mut found = Vec::new();
    for (key, value) in then.as_object().unwrap() {
        if value.is_object() {
            found.extend(bits(value, &now[key]));
        } else if value.is_i64() || value.is_u64() {
            found.push((key.as_str(), value, &now[key]));
        }
    }
    found
}

#[test]
fn the_strike_of_the_first_recording_replays_to_the_same_bits() {
    let recording = data("recording-v1.mcap");
    let replayed = bead(&["replay", &recording, "--format", "json"]);
    assert!(
        replayed.status.success(),
        "{}",
        String::from_utf8_lossy(&replayed.stderr)
    );
    let mut now: Value = serde_json::from_slice(&replayed.stdout).unwrap();
    // It has a version since, and counts.
    for (key, value) in [
        ("schema_version", 1),
        ("strikes_differ", 0),
        ("strikes_left_out", 0),
    ] {
        assert_eq!(
            now.as_object_mut().unwrap().remove(key),
            Some(value.into()),
            "{key}"
        );
    }
    let then: Value = serde_json::from_slice(&fs::read(data("recording-v1.replay.json")).unwrap()).unwrap();
    assert_eq!(now, then);

    let decoded = bead(&["decode", &recording]);
    assert!(decoded.status.success());
    let today = lines(&decoded.stdout);
    assert_eq!(today.len(), 33);
    for then in lines(&fs::read(data("recording-v1.jsonl")).unwrap()) {
        let now = today.iter().find(|frame| frame["kind"] == then["kind"]).unwrap();
        let bits = bits(&then, now);
        assert!(bits.len() >= 10, "{bits:?}");
        for (key, then, now) in bits {
            assert_eq!(then, now, "{key}");
        }
    }
    // The absorbed energy by both estimates, 2⁻²⁴ nJ.
    let strike = today.iter().find(|frame| frame["kind"] == "strike").unwrap();
    assert_eq!(strike["absorbed_measured_raw"], 13_920_378_272_i64);
    assert_eq!(strike["absorbed_predicted_raw"], 13_922_639_057_i64);
}

#[test]
fn a_recording_of_the_future_says_who_speaks_and_what_to_do() {
    const WHO: &str = "bead 7 with firmware 9.0.0 (v9.0.0) speaks version 9 of the protocol, and this program \
                       knows version 1; use the `bead` that belongs to that firmware";
    let bytes = fs::read(data("frame-of-the-future.bin")).unwrap();
    let directory = TempDir::new().unwrap();
    let path = directory.path().join("future.mcap");
    let mut writer = Writer::create(&Target::new(&path), &About::default()).unwrap();
    writer.write(&bytes, None, |_| {}).unwrap();
    writer.finish().unwrap();
    let path = path.to_str().unwrap();

    let replayed = bead(&["replay", path]);
    assert_eq!(replayed.status.code(), Some(2));
    assert_eq!(
        String::from_utf8(replayed.stderr).unwrap(),
        format!("bead: {path}: {WHO}\n")
    );

    // What is frozen is shown: who it is, and what it replied. The status between them is refused and not
    // lost. A recording has one delimiter after each of the three frames.
    for (file, length) in [
        (path, bytes.len() - 3),
        (&data("frame-of-the-future.bin"), bytes.len()),
    ] {
        let decoded = bead(&["decode", file]);
        assert!(decoded.status.success());
        let frames = lines(&decoded.stdout);
        let [identity, reply] = &frames[..] else {
            panic!("{frames:?}");
        };
        assert_eq!(
            (&identity["kind"], &identity["version"]),
            (&"identity".into(), &9.into())
        );
        assert_eq!(
            (&identity["address"], &identity["firmware"]),
            (&7.into(), &"9.0.0".into())
        );
        assert_eq!(
            (&reply["request"], &reply["outcome"]),
            (&42.into(), &"done".into())
        );
        let told = String::from_utf8(decoded.stderr).unwrap();
        let told: Vec<_> = told.lines().collect();
        assert_eq!(
            told,
            [
                "bead: 49 bytes rejected: version 9 of the protocol is not known here; use the program that belongs to it",
                &format!("bead: 2 frames in {length} bytes; 0 lost, 1 refused, 0 late, 0 twice, 0 restarts"),
                &format!("bead: {WHO}"),
            ]
        );
    }
}
