//! `bead note`, `bead list` and `bead trend` as their users run them.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{Cursor, Write};
use std::path::Path;
use std::time::{Duration, Instant, UNIX_EPOCH};

use hertz_chain::Scenario;
use serde_json::Value;

use crate::program::{DATA, TestFolder, assert_says, said, tcp};
use crate::rows::{ModelBead, record};
use bead_testing::Speaker;

/// Records strikes of bead 8 with this error of B, in bits.
fn strikes(folder: &TestFolder, name: &str, wrong_by: i64, count: u32) {
    let mut bead = ModelBead::at(8);
    bead.wrong_by = wrong_by;
    record(&folder.join(name), &Scenario::paper(), &[bead], count);
}

/// Sets the time of change of every file to one long ago, as of files that have settled.
fn settle(folder: &Path) {
    for entry in fs::read_dir(folder).unwrap().map(Result::unwrap) {
        if entry.path().is_file() {
            let long_ago = UNIX_EPOCH + Duration::from_secs(1_700_000_000);
            let file = File::options().append(true).open(entry.path()).unwrap();
            file.set_modified(long_ago).unwrap();
        }
    }
}

/// An MCAP file of a camera.
fn foreign() -> Vec<u8> {
    let mut writer = mcap::Writer::new(Cursor::new(Vec::new())).unwrap();
    writer.add_channel(0, "camera", "jpeg", &BTreeMap::new()).unwrap();
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

/// Names of the files in a list.
fn names(list: &Value) -> Vec<&str> {
    let recordings = list["recordings"].as_array().unwrap().iter();
    let paths = recordings.map(|one| one["recording"].as_str().unwrap());
    paths.map(|path| path.rsplit('/').next().unwrap()).collect()
}

#[test]
fn notes_are_added_replaced_and_withdrawn_and_what_was_recorded_stays() {
    let folder = TestFolder::new();
    strikes(&folder, "x.mcap", 0, 1);
    let decoded = folder.done("decode x.mcap");
    folder.done("note x.mcap operator=Ana specimen=A12 --by Lima");
    folder.done("note x.mcap specimen=A13 place=rig");
    folder.done("note x.mcap place=");
    let notes = folder.json("note x.mcap --format json");
    let notes = notes["recordings"][0]["notes"].as_array().unwrap();
    let found = notes.iter().map(|note| {
        let [key, value] = ["key", "value"].map(|key| note[key].as_str().unwrap());
        (key, value, note["counts"] == true)
    });
    let expected = [
        ("operator", "Ana", true),
        ("specimen", "A12", false),
        ("specimen", "A13", true),
        ("place", "rig", false),
        ("place", "", false),
    ];
    assert_eq!(found.collect::<Vec<_>>(), expected);
    assert_eq!(notes[0]["author"], "Lima");
    assert!(notes[0]["written"].as_str().unwrap().ends_with('Z'));
    assert_eq!(folder.done("decode x.mcap"), decoded);
    assert_eq!(folder.names(), "x.mcap");
    folder.done("replay x.mcap");

    // A recording that is cut gets no note, nor do others that are named with it.
    let whole = folder.read("x.mcap");
    folder.write("cut.mcap", &whole[..whole.len() / 2]);
    let output = folder.run("note x.mcap cut.mcap more=1");
    assert_eq!(output.status.code(), Some(2));
    assert_says(&said(&output), "bead recover cut.mcap");
    assert_eq!(folder.read("x.mcap"), whole);
    folder.done("recover cut.mcap --out whole.mcap");
    assert_says(&folder.done("note whole.mcap"), "no notes");
}

#[test]
fn a_recorder_writes_its_notes_into_each_file() {
    let (listener, port) = tcp();
    let folder = TestFolder::new();
    let line =
        format!("record --port {port} --out a.mcap --wait 0 --note operator=Ana specimen=A12 --by Lima");
    let recorder = folder.start(&line);
    let (mut bead, _) = listener.accept().unwrap();
    let mut speaker = Speaker::at(0);
    let identity = speaker.identity();
    speaker.say(0, identity);
    bead.write_all(&speaker.bytes).unwrap();
    drop(bead);
    recorder.end(3);
    let notes = folder.json("note a.mcap --format json");
    let notes = &notes["recordings"][0]["notes"];
    assert!(notes[0]["key"] == "operator" && notes[1]["value"] == "A12");
}

#[test]
fn recordings_are_found_by_note_date_bead_flag_and_verdict_and_foreign_files_cost_a_line() {
    let folder = TestFolder::new();
    fs::create_dir(folder.join("archive")).unwrap();
    for (name, beads) in [("a", &[8][..]), ("b", &[8]), ("c", &[7, 9])] {
        let beads: Vec<ModelBead> = beads.iter().map(|bead| ModelBead::at(*bead)).collect();
        let mut scenario = Scenario::paper();
        scenario.intruders[0].beads = vec![7, 8, 9];
        record(&folder.join(format!("archive/{name}.mcap")), &scenario, &beads, 1);
    }
    folder.done("note archive/a.mcap date=2026-11-01 specimen=A12 operator=Ana");
    folder.done("note archive/b.mcap date=2026-11-02T10:00 specimen=B1 operator=Ana verdict=fail");
    folder.done("note archive/c.mcap date=2026-11-03 specimen=A13 operator=Bo");
    folder.write("archive/foreign.mcap", foreign());
    folder.write("archive/text.mcap", "no recording");
    folder.write("archive/photo.jpg", "");
    folder.write("archive/x.settings", "");
    settle(&folder.join("archive"));

    let output = folder.run("list archive --format json");
    let told = said(&output);
    assert!(output.status.success() && told.lines().count() == 3, "{told}");
    for part in [
        "has no channel `frames` of a bead",
        "text.mcap is not an MCAP file",
        "are recordings: photo.jpg",
    ] {
        assert_says(&told, part);
    }
    let all: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(names(&all), ["a.mcap", "b.mcap", "c.mcap"]);
    assert_eq!((&all["of"], &all["files_read"]), (&3.into(), &5.into()));
    assert_eq!(all["recordings"][0]["date"], "2026-11-01T00:00:00Z");
    assert_eq!(all["recordings"][2]["beads"], serde_json::json!([7, 9]));
    for (options, found) in [
        ("--note specimen=a1*", &["a.mcap", "c.mcap"][..]),
        ("--note specimen=a1* --note operator=bo", &["c.mcap"]),
        ("--since 2026-11-02", &["b.mcap", "c.mcap"]),
        ("--until 2026-11-02", &["a.mcap", "b.mcap"]),
        ("--until 2026-11-02T10:00", &["a.mcap"]),
        ("--bead 9", &["c.mcap"]),
        ("--bead 7-8", &["a.mcap", "b.mcap", "c.mcap"]),
        ("--verdict fail", &["b.mcap"]),
        ("--verdict none", &["a.mcap", "c.mcap"]),
        ("--flag force_railed", &[]),
        ("--note nothing", &[]),
    ] {
        let list = folder.json(&format!("list archive {options} --format json"));
        assert_eq!(names(&list), found, "{options}");
        assert_eq!(list["files_read"], 0, "{options}");
    }
    let one = folder.done("list archive --note specimen=B1");
    assert_says(&one, "1 of 3 recordings");
}

#[test]
fn the_table_is_made_anew_where_a_file_has_changed_and_may_be_lost_at_any_time() {
    let folder = TestFolder::new();
    strikes(&folder, "x.mcap", 0, 1);
    strikes(&folder, "y.mcap", 0, 1);
    let read = || folder.json("list --format json")["files_read"].as_u64().unwrap();
    // A file that changed just now may change again at the same time.
    assert_eq!((read(), read()), (2, 2));
    settle(&folder);
    assert_eq!((read(), read()), (2, 0));
    let table = folder.read("bead-logbook.parquet");
    folder.done("note x.mcap specimen=A12");
    let found = folder.json("list --note specimen=A12 --format json");
    assert_eq!((names(&found), &found["files_read"]), (vec!["x.mcap"], &1.into()));
    settle(&folder);
    assert_eq!((read(), read()), (1, 0));
    fs::remove_file(folder.join("y.mcap")).unwrap();
    let left = folder.json("list --format json");
    assert_eq!((names(&left), &left["files_read"]), (vec!["x.mcap"], &0.into()));
    // Damaged, cut, empty: made anew. Another's file: left, and everything is read.
    for damaged in [
        &table[..table.len() / 2],
        b"",
        &[&table[..400], &[0x55; 300], &table[700..]].concat(),
    ] {
        folder.write("bead-logbook.parquet", damaged);
        let output = folder.run("list --format json");
        assert!(output.status.success(), "{}", said(&output));
        assert_eq!(read(), 0, "{}", said(&output));
    }
    for foreign in [
        &b"a text"[..],
        &fs::read(Path::new(DATA).join("recording-v1.mcap")).unwrap(),
    ] {
        folder.write("bead-logbook.parquet", foreign);
        let output = folder.run("list --format json");
        assert_says(&said(&output), "stays as it is");
        assert_eq!(folder.read("bead-logbook.parquet"), foreign);
    }
    fs::remove_file(folder.join("bead-logbook.parquet")).unwrap();
    folder.done("list --no-index");
    assert_eq!(folder.names(), "x.mcap");
}

#[test]
fn a_bead_that_changes_is_out_of_control_and_only_asked_for_an_exit_status() {
    let folder = TestFolder::new();
    for day in 1..=9 {
        // B is 5 % higher on the last day.
        let mut bead = ModelBead::at(8);
        bead.wrong_by = i64::from(day == 9) * (41 << 24);
        let name = format!("d{day}.mcap");
        let mut scenario = Scenario::paper();
        scenario.striker.velocity *= 1.0 + 0.002 * f64::from(day % 3);
        record(&folder.join(&name), &scenario, &[bead], 2);
        folder.done(&format!("note {name} date=2026-11-0{day}"));
    }
    let output = folder.run("trend --format json --base 8 --picture trend.svg --out trend.csv");
    let told = said(&output);
    assert_eq!(output.status.code(), Some(0), "{told}");
    assert_says(&told, "bead 8: A/B of 2026-11-09 00:00 (d9.mcap) is 0.95");
    assert_says(&told, "below the lower control limit");
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let quantities = report["beads"][0]["quantities"].as_array().unwrap();
    let beyond = quantities.iter().filter(|one| one["out_of_control"] != 0);
    let beyond = beyond.map(|one| &one["quantity"]);
    assert!(beyond.eq(["absorbed_predicted", "ratio"]));
    let ratio = quantities.iter().find(|one| one["quantity"] == "ratio").unwrap();
    assert_eq!(ratio["limits"]["base"], 8);
    assert_says(&folder.text("trend.svg"), "out of control");
    let rows = folder.text("trend.csv").lines().count();
    let points = quantities
        .iter()
        .map(|one| one["points"].as_array().unwrap().len());
    assert_eq!(rows, points.sum::<usize>() + 1);

    let output = folder.run("trend --base 8 --quantity ratio --check");
    assert_eq!(output.status.code(), Some(1));
    assert_says(&said(&output), "1 point beyond the control limits");
    folder.done("trend --base 8 --quantity ratio --check --until 2026-11-08");
    let by_strike = folder.json("trend --by strike --quantity ratio --format json");
    let points = by_strike["beads"][0]["quantities"][0]["points"].as_array();
    assert_eq!(points.unwrap().len(), 18);
}

#[test]
#[ignore = "measures time"]
fn thousand_recordings_are_listed_fast_from_the_table() {
    let folder = TestFolder::new();
    strikes(&folder, "x0.mcap", 0, 10);
    folder.done("note x0.mcap specimen=A12");
    (1..1000).for_each(|n| {
        fs::copy(folder.join("x0.mcap"), folder.join(format!("x{n}.mcap"))).unwrap();
    });
    settle(&folder);
    for (name, line) in [
        ("first search", "list --note specimen=A12 --format json"),
        ("from the table", "list --note specimen=A12 --format json"),
        ("trend", "trend --picture trend.svg --format json"),
    ] {
        let started = Instant::now();
        let done = folder.done(line);
        println!("{name}: {:.2} s", started.elapsed().as_secs_f64());
        assert!(done.len() > 1000);
    }
}
