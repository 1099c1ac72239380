//! Recordings of other versions, described in `tests/data/README.md`: read, or refused by one line with
//! advice.

use std::fs;
use std::path::Path;

use crate::program::{DATA, TestFolder, documents, done, refused, said, typed};
use serde_json::Value;

/// Whole numbers of `then`, and the values of `now` under the same keys.
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
fn the_first_recording_is_decoded_to_the_same_numbers_and_its_replay_says_that_its_estimates_are_no_longer_made()
 {
    let folder = Path::new(DATA);
    let replay = typed(folder, "replay recording-v1.mcap");
    assert_eq!(replay.status.code(), Some(1));
    let why = said(&replay);
    for part in [
        "strike 0: made by an image whose estimates this program no longer computes",
        "Its codes, settings and times are valid",
        " peak_index, acceleration_max, acceleration_min,",
    ] {
        assert!(why.contains(part), "{part}: {why}");
    }
    // The replay of that time found the same strike in the same samples.
    let replay = typed(folder, "replay recording-v1.mcap --format json");
    let now = &documents(&replay.stdout)[0]["strikes"][0];
    let then = fs::read(folder.join("recording-v1.replay.json")).unwrap();
    for key in ["strike", "sample_index", "samples", "chunks"] {
        assert_eq!(documents(&then)[0]["strikes"][0][key], now[key], "{key}");
    }

    let today = documents(done(typed(folder, "decode recording-v1.mcap")).as_bytes());
    assert_eq!(today.len(), 33);
    let of_kind = |kind: &Value| today.iter().find(|frame| frame["kind"] == *kind).unwrap();
    for then in documents(&fs::read(folder.join("recording-v1.jsonl")).unwrap()) {
        let bits = bits(&then, of_kind(&then["kind"]));
        assert!(bits.len() >= 10, "{bits:?}");
        for (key, then, now) in bits {
            assert_eq!(then, now, "{key}");
        }
    }
    // The absorbed energy by both estimates, 2⁻²⁴ nJ.
    let strike = of_kind(&"strike".into());
    assert_eq!(strike["absorbed_measured_raw"], 13_920_378_272_i64);
    assert_eq!(strike["absorbed_predicted_raw"], 13_922_639_057_i64);
}

#[test]
fn a_recording_of_the_future_says_who_speaks_and_what_to_do() {
    const WHO: &str = "bead 7 with firmware 9.0.0 (v9.0.0) speaks version 9 of the protocol, and this program \
                       knows version 1; use the `bead` that belongs to that firmware";
    let folder = TestFolder::new();
    let bytes = fs::read(format!("{DATA}/frame-of-the-future.bin")).unwrap();
    folder.write("future.bin", &bytes);
    folder.done("recover future.bin --out future.mcap");
    let replay = folder.run("replay future.mcap");
    refused(&replay, 2, &format!("bead: future.mcap: {WHO}\n"));

    // Identity and reply are frozen and shown. The status between them counts as refused, not as lost. A
    // recording has one delimiter less for each of the three frames.
    for (file, length) in [("future.mcap", bytes.len() - 3), ("future.bin", bytes.len())] {
        let decoded = folder.run(&format!("decode {file}"));
        assert_eq!(
            said(&decoded),
            format!(
                "bead: 49 bytes rejected: version 9 of the protocol is unknown here; use the program that belongs to it\n\
                 bead: 2 frames in {length} bytes; 0 lost, 1 refused, 0 late, 0 twice, 0 restarts\n\
                 bead: {WHO}\n"
            )
        );
        let frames = documents(done(decoded).as_bytes());
        assert_eq!(frames.len(), 2);
        let shown = |frame: usize, keys: [&str; 4]| keys.map(|key| frames[frame][key].to_string());
        let identity = shown(0, ["kind", "version", "address", "firmware"]);
        assert_eq!(identity, ["\"identity\"", "9", "7", "\"9.0.0\""]);
        let reply = shown(1, ["kind", "version", "request", "outcome"]);
        assert_eq!(reply, ["\"reply\"", "9", "42", "\"done\""]);
    }
}
