//! `bead compare` of a recording of several beads: what it says of a row, and of a row in which something is
//! missing.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use crate::program::bead;
use crate::rows::{Who, record};
use hertz_chain::Scenario;
use serde_json::Value;
use tempfile::TempDir;

const SCENARIO: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../docs/scenarios/paper-strike.toml"
);

/// Elastic beads with light intruders in these hosts, of which the wave has passed all at the end.
fn scenario(hosts: &[usize]) -> Scenario {
    let file = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../docs/scenarios/row-of-ten.toml"
    );
    let mut scenario = Scenario::load(file).unwrap();
    (scenario.chain.beads, scenario.duration) = (32, 0.007);
    scenario.intruders[0].beads = hosts.to_vec();
    scenario
}

/// A recording in a folder of its own.
struct Recorded {
    folder: TempDir,
}

impl Recorded {
    fn of(hosts: &[usize], beads: &[Who], strikes: u32) -> Self {
        let folder = tempfile::tempdir().unwrap();
        record(&folder.path().join("row.mcap"), &scenario(hosts), beads, strikes);
        Self { folder }
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join("row.mcap")
    }

    fn compare(&self, more: &[&str]) -> Output {
        bead(self.folder.path(), [&["compare", "row.mcap"], more].concat())
    }

    /// The result as JSON, and the notes on standard error, after an end with this status.
    fn told(&self, more: &[&str], status: i32) -> (Value, String) {
        let output = self.compare(&[&["--format", "json"], more].concat());
        let notes = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(status), "{notes}");
        (serde_json::from_slice(&output.stdout).unwrap(), notes)
    }
}

fn write_scenario(path: &Path, scenario: &Scenario) {
    fs::write(path, scenario.to_toml()).unwrap();
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

fn beads(told: &Value) -> Vec<u64> {
    let beads = told["beads"].as_array().unwrap();
    beads.iter().map(|bead| bead["bead"].as_u64().unwrap()).collect()
}

/// Greatest difference of T by A and by B from the simulation's.
fn off(told: &Value) -> [f64; 2] {
    ["by_a", "by_b"].map(|side| {
        let after = told["energy"]["after"].as_array().unwrap();
        let through = after.iter().filter_map(|one| one["transmission"].as_object());
        let off = through.filter(|through| through[side].is_number());
        off.map(|through| (number(&through[side]) - number(&through["f64_chain"])).abs())
            .fold(0.0, f64::max)
    })
}

#[test]
fn a_row_is_compared_whole_with_a_page_and_figures() {
    let row = Recorded::of(&[7, 8, 9, 10], &[7, 8, 9, 10].map(Who::at), 1);
    let (told, notes) = row.told(&["--report", "row.html", "--figures", "figures"], 0);
    assert_eq!((beads(&told), &notes[..]), (vec![7, 8, 9, 10], ""));
    assert_eq!(
        (&told["pass"], &told["strikes"]),
        (&Value::Bool(true), &Value::from(1))
    );
    let [a, b] = off(&told);
    assert!(a < 0.002 && b < 0.005, "{a} {b}");
    assert!(
        number(&told["arrivals"]["off_rms_s"]) < 0.2e-6,
        "{}",
        told["arrivals"]
    );
    let speeds = told["arrivals"]["speeds"].as_array().unwrap();
    assert_eq!(speeds.len(), 3);
    for speed in speeds {
        let off = number(&speed["device"]) / number(&speed["f64_chain"]) - 1.0;
        assert!(off.abs() < 3e-3, "{speed}");
    }
    for bead in told["beads"].as_array().unwrap() {
        assert_eq!(
            (&bead["replay_identical"], &bead["flags"]),
            (&Value::Bool(true), &Value::Array(vec![]))
        );
    }
    // The line through E(n) has the same T by the beads as in the simulation.
    let fit = &told["energy"]["fit"];
    let difference = number(&fit["by_a"]["transmission"]) - number(&fit["f64_chain"]["transmission"]);
    assert!(difference.abs() < 1e-3, "{fit}");
    // Light intruders leave one another alone: the paper's rows of n say the same.
    for after in told["energy"]["after"].as_array().unwrap() {
        let left = &after["left"];
        assert!(
            (number(&left["f64_chain"]) - number(&left["rows_of_n"])).abs() < 2e-3,
            "{after}"
        );
    }

    let read = |name: &str| fs::read_to_string(row.folder.path().join(name)).unwrap();
    let page = read("row.html");
    for part in [
        "Every check passed",
        "7 to 8",
        "energy left, E(n) (%)",
        "place of the bead",
    ] {
        assert!(page.contains(part), "{part}");
    }
    for name in ["figures/row.svg", "figures/row-details.svg"] {
        assert!(read(name).contains("time since the striker hit (ms)"), "{name}");
    }
    let table = row.compare(&[]);
    let table = String::from_utf8_lossy(&table.stdout).into_owned();
    for part in ["arrivals are off by", "wave (m/s)", "rows of n", "identical"] {
        assert!(table.contains(part), "{part}: {table}");
    }
}

#[test]
fn beads_that_are_not_neighbours_may_come_in_any_order() {
    let row = Recorded::of(&[12, 9, 7], &[12, 7, 9].map(Who::at), 1);
    let (told, notes) = row.told(&[], 0);
    assert_eq!((beads(&told), &notes[..]), (vec![7, 9, 12], ""));
    let [a, b] = off(&told);
    assert!(a < 0.002 && b < 0.005, "{a} {b}");
    let speeds = told["arrivals"]["speeds"].as_array().unwrap();
    let ways: Vec<_> = speeds
        .iter()
        .map(|speed| (&speed["from"], &speed["to"]))
        .collect();
    assert_eq!(ways, [(&7.into(), &9.into()), (&9.into(), &12.into())]);
}

#[test]
fn what_one_bead_lacks_is_said_in_a_line_and_the_others_go_on() {
    let hosts = [7, 8, 9, 10];
    // A bead that did not record: its energy is the simulation's, and no line is fitted over the gap.
    let row = Recorded::of(&hosts, &[7, 8, 10].map(Who::at), 1);
    let (told, notes) = row.told(&[], 0);
    assert!(notes.contains("bead 9 of the scenario did not record"), "{notes}");
    assert_eq!(
        (beads(&told), &told["energy"]["fit"]["by_a"]),
        (vec![7, 8, 10], &Value::Null)
    );
    assert_eq!(told["energy"]["not_measured"], Value::from(vec![9]));
    assert!(off(&told)[0] < 0.002);

    // One of another scenario, and one where no intruder is.
    let mut others = [7, 8, 9, 10].map(Who::at);
    others[1].carries = Some("title = \"another\"".to_owned());
    let row = Recorded::of(&hosts, &others, 1);
    let (told, notes) = row.told(&[], 0);
    assert!(
        notes.contains("bead 8 (address 8) is left out: it carries another scenario"),
        "{notes}"
    );
    assert_eq!(beads(&told), [7, 9, 10]);
    let other = row.folder.path().join("other.toml");
    write_scenario(&other, &scenario(&[7, 8, 10]));
    let (told, notes) = row.told(&["--scenario", "other.toml"], 1);
    assert!(
        notes.contains("bead 9 (address 9) is left out: it has no intruder in this scenario"),
        "{notes}"
    );
    assert!(beads(&told).iter().all(|bead| *bead != 9));

    // One that never saw the strike, one that lost a frame of it, and one that is not on the sync line.
    let mut others = [7, 8, 9, 10].map(Who::at);
    others[1].lost = vec![0];
    others[2].synced = false;
    let row = Recorded::of(&hosts, &others, 1);
    let (told, notes) = row.told(&[], 0);
    assert!(notes.contains("bead 8 never saw a strike"), "{notes}");
    assert!(notes.contains("bead 9 is not on the common time"), "{notes}");
    let arrivals = told["arrivals"]["beads"].as_array().unwrap();
    let placed: Vec<_> = arrivals.iter().map(|arrival| &arrival["bead"]).collect();
    assert_eq!(placed, [&Value::from(7), &Value::from(10)]);
    assert_eq!(told["arrivals"]["speeds"], Value::Array(vec![]));
}

#[test]
fn without_a_common_time_there_are_energies_and_no_arrivals() {
    let beads: Vec<_> = [7, 8, 9]
        .map(|bead| Who {
            synced: false,
            ..Who::at(bead)
        })
        .into();
    let row = Recorded::of(&[7, 8, 9], &beads, 1);
    let (told, notes) = row.told(&["--figures", "figures"], 0);
    assert!(notes.contains("no common time"), "{notes}");
    assert_eq!(notes.lines().count(), 1, "{notes}");
    assert_eq!(told["arrivals"]["off_rms_s"], Value::Null);
    assert!(off(&told)[0] < 0.002 && number(&told["energy"]["fit"]["by_b"]["transmission"]) < 1.0);
}

#[test]
fn several_strikes_are_judged_together_also_where_a_bead_lost_one() {
    let mut beads = [7, 8, 9].map(Who::at);
    beads[1].lost = vec![0];
    let row = Recorded::of(&[7, 8, 9], &beads, 3);
    let (told, notes) = row.told(&[], 0);
    assert!(notes.contains("bead 8 has 2 of 3 strikes"), "{notes}");
    assert_eq!(told["strikes"], 3);
    assert!(
        number(&told["arrivals"]["off_rms_s"]) < 0.2e-6,
        "{}",
        told["arrivals"]
    );
    assert!(off(&told)[0] < 0.002);
    let spread = &told["beads"][1]["spread"][0];
    assert_eq!(spread["strikes"], 2);
    assert!(number(&spread["uncertainty"]) > 0.0);
}

#[test]
fn a_check_that_says_no_names_its_bead_and_a_replay_that_differs_is_the_gravest() {
    let hosts = [7, 8, 9];
    let mut beads = hosts.map(Who::at);
    beads[0].frames_lost = 1;
    beads[2].wrong_by = 1;
    let row = Recorded::of(&hosts, &beads, 1);
    let (told, notes) = row.told(&[], 1);
    assert!(notes.contains("bead 9: replay differs"), "{notes}");
    let passed: Vec<_> = told["beads"]
        .as_array()
        .unwrap()
        .iter()
        .map(|bead| &bead["pass"])
        .collect();
    assert_eq!(passed, [false, true, false].map(Value::Bool).each_ref());
    assert!(
        told["beads"][0]["failure"]
            .as_str()
            .unwrap()
            .contains("1 frame lost")
    );

    // A striker that was faster than the scenario says: every A is off, and the fitted velocity mends it.
    let row = Recorded::of(&hosts, &hosts.map(Who::at), 1);
    let mut slow = scenario(&hosts);
    slow.striker.velocity *= 0.99;
    write_scenario(&row.folder.path().join("slow.toml"), &slow);
    let (_, notes) = row.told(&["--scenario", "slow.toml"], 1);
    assert!(notes.contains("bead 7: A is"), "{notes}");
    let (told, _) = row.told(&["--scenario", "slow.toml", "--velocity", "fit"], 0);
    let velocity = number(&told["striker_velocity"]["velocity"]);
    assert!((velocity / 0.45 - 1.0).abs() < 1e-3, "{velocity}");
}

#[test]
fn one_bead_of_a_row_is_compared_as_a_bead_alone_and_beads_without_strikes_cannot_be() {
    let row = Recorded::of(&[7, 8, 9], &[Who::at(8)], 1);
    let (told, _) = row.told(&[], 0);
    assert_eq!(
        (&told["bead"], &told["pass"]),
        (&Value::from(8), &Value::Bool(true))
    );
    let refused = |row: &Recorded, more: &[&str], says: &str| {
        let output = row.compare(more);
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{error}");
        assert!(error.contains(says), "{error}");
    };
    refused(
        &row,
        &["--bead", "9"],
        "has the beads [8]; give --bead one of them",
    );
    let silent = [7, 8].map(|bead| Who {
        lost: vec![0],
        ..Who::at(bead)
    });
    let row = Recorded::of(&[7, 8, 9], &silent, 1);
    refused(&row, &[], "no strike among its");
    let other = scenario(&[20, 21]);
    write_scenario(&row.path().with_file_name("other.toml"), &other);
    refused(
        &row,
        &["--scenario", "other.toml"],
        "none of its beads is of this scenario",
    );
}

#[test]
fn the_velocity_is_that_of_the_first_bead_whose_strikes_tell_it_and_one_alone_says_why_not() {
    let hosts = [7, 8];
    let mut beads = hosts.map(Who::at);
    // Its first samples.
    (beads[0].synced, beads[0].frames_lost) = (false, 1);
    let row = Recorded::of(&hosts, &beads, 1);
    let (told, notes) = row.told(&["--velocity", "fit"], 1);
    assert!(notes.contains("bead 7: replay differs"), "{notes}");
    let velocity = number(&told["striker_velocity"]["velocity"]);
    assert!((velocity / 0.45 - 1.0).abs() < 1e-3, "{velocity}");

    // The comparison is told also where there is nothing to draw.
    let (told, notes) = row.told(&["--bead", "7", "--figures", "figures"], 1);
    assert_eq!(told["strikes"].as_array().unwrap().len(), 1);
    assert!(notes.contains("--figures has nothing to draw"), "{notes}");
    let output = row.compare(&["--bead", "7", "--velocity", "fit"]);
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(error.contains("no strike came with its settings"), "{error}");
}

#[test]
fn echoes_are_not_held_against_the_chain_and_tell_no_velocity() {
    // A striker so heavy that the beads part, and meet again after the window.
    let mut scenario = Scenario::load(SCENARIO).unwrap();
    (scenario.striker.radius, scenario.striker.velocity) = (0.009, 1.0);
    let folder = tempfile::tempdir().unwrap();
    record(&folder.path().join("row.mcap"), &scenario, &[Who::at(8)], 2);
    let struck = Recorded { folder };
    let (told, notes) = struck.told(&["--velocity", "fit"], 0);
    assert_eq!(told["strikes"].as_array().unwrap().len(), 2);
    assert_eq!(told["striker_velocity"]["strikes"], 2);
    // That of the last strike comes too late for the recording.
    assert!(notes.contains("as a wave came again: 1"), "{notes}");
}
