//! `bead compare` of a recording of several beads: what it says of a row, and of a row in which something is
//! missing.

use std::fs;
use std::process::Output;

use crate::program::{ROOT, assert_says, documents, done, refused, said, typed};
use crate::rows::{RowBead, record};
use hertz_chain::Scenario;
use serde_json::Value;
use tempfile::TempDir;

/// Elastic beads with light intruders in these hosts, of which the wave has passed all at the end.
pub(crate) fn light_intruders(hosts: &[usize]) -> Scenario {
    let mut scenario = Scenario::load(format!("{ROOT}/docs/scenarios/row-of-ten.toml")).unwrap();
    (scenario.chain.beads, scenario.duration) = (32, 0.007);
    scenario.intruders[0].beads = hosts.to_vec();
    scenario
}

/// A folder with a recording, `row.mcap`.
struct RecordedRow(TempDir);

impl RecordedRow {
    fn of(scenario: &Scenario, beads: &[RowBead], strikes: u32) -> Self {
        let folder = tempfile::tempdir().unwrap();
        record(&folder.path().join("row.mcap"), scenario, beads, strikes);
        Self(folder)
    }

    fn write(&self, name: &str, scenario: &Scenario) {
        fs::write(self.0.path().join(name), scenario.to_toml()).unwrap();
    }

    fn compare(&self, more: &str) -> Output {
        typed(self.0.path(), &format!("compare row.mcap {more}"))
    }

    /// The result as JSON, and the notes on standard error, after an end with this status.
    fn compared(&self, more: &str, status: i32) -> (Value, String) {
        let output = self.compare(&format!("--format json {more}"));
        let notes = said(&output);
        assert_eq!(output.status.code(), Some(status), "{notes}");
        (documents(&output.stdout).remove(0), notes)
    }
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

/// The values of a key in each object of a list.
fn each(list: &Value, key: &str) -> Value {
    let list = list.as_array().unwrap().iter();
    list.map(|object| object[key].clone()).collect()
}

/// Asserts that T by A and by B is the simulation's, and that arrivals are, if they are known.
fn assert_close(compared: &Value) {
    for (side, most) in [("by_a", 0.002), ("by_b", 0.005)] {
        for after in compared["energy"]["after"].as_array().unwrap() {
            let through = &after["transmission"];
            if through[side].is_number() {
                let off = number(&through[side]) - number(&through["f64_chain"]);
                assert!(off.abs() < most, "{side}: {after}");
            }
        }
    }
    if let Some(off) = compared["arrivals"]["off_rms_s"].as_f64() {
        assert!(off < 0.2e-6, "{}", compared["arrivals"]);
    }
}

#[test]
fn a_row_is_compared_whole_with_a_page_and_figures() {
    let hosts = [7, 8, 9, 10];
    let row = RecordedRow::of(&light_intruders(&hosts), &hosts.map(RowBead::at), 1);
    let (compared, notes) = row.compared("--report row.html --figures figures", 0);
    assert_eq!(
        (&each(&compared["beads"], "bead"), &notes[..]),
        (&hosts[..].into(), "")
    );
    assert_eq!(
        (&compared["pass"], &compared["strikes"]),
        (&true.into(), &1.into())
    );
    assert_close(&compared);
    let speeds = compared["arrivals"]["speeds"].as_array().unwrap();
    assert_eq!(speeds.len(), 3);
    for speed in speeds {
        let off = number(&speed["device"]) / number(&speed["f64_chain"]) - 1.0;
        assert!(off.abs() < 3e-3, "{speed}");
    }
    assert_eq!(
        each(&compared["beads"], "replay_identical"),
        Value::from(vec![true; 4])
    );
    // The line through E(n) has the same T by the beads as in the simulation.
    let fit = &compared["energy"]["fit"];
    let difference = number(&fit["by_a"]["transmission"]) - number(&fit["f64_chain"]["transmission"]);
    assert!(difference.abs() < 1e-3, "{fit}");
    // Light intruders leave one another alone: the paper's rows of n say the same.
    for after in compared["energy"]["after"].as_array().unwrap() {
        let left = &after["left"];
        let difference = number(&left["f64_chain"]) - number(&left["rows_of_n"]);
        assert!(difference.abs() < 2e-3, "{after}");
    }

    let read = |name: &str| fs::read_to_string(row.0.path().join(name)).unwrap();
    let (page, table) = (read("row.html"), done(row.compare("")));
    for part in [
        "Every check passed",
        "7 to 8",
        "energy left, E(n) (%)",
        "place of the bead",
    ] {
        assert_says(&page, part);
    }
    for part in ["arrivals are off by", "wave (m/s)", "rows of n", "identical"] {
        assert_says(&table, part);
    }
    for name in ["figures/row.svg", "figures/row-details.svg"] {
        assert!(read(name).contains("time since the striker hit (ms)"), "{name}");
    }
}

#[test]
fn beads_that_are_not_neighbours_may_come_in_any_order() {
    let row = RecordedRow::of(&light_intruders(&[12, 9, 7]), &[12, 7, 9].map(RowBead::at), 1);
    let (compared, notes) = row.compared("", 0);
    assert_eq!(
        (each(&compared["beads"], "bead"), &notes[..]),
        (vec![7, 9, 12].into(), "")
    );
    assert_close(&compared);
    let speeds = &compared["arrivals"]["speeds"];
    assert_eq!(
        (each(speeds, "from"), each(speeds, "to")),
        (vec![7, 9].into(), vec![9, 12].into())
    );
}

#[test]
fn what_one_bead_lacks_is_said_in_a_line_and_the_others_go_on() {
    let hosts = [7, 8, 9, 10];
    let scenario = light_intruders(&hosts);
    // A bead that did not record: its energy is the simulation's, and no line is fitted over the gap.
    let row = RecordedRow::of(&scenario, &[7, 8, 10].map(RowBead::at), 1);
    let (compared, notes) = row.compared("", 0);
    assert_says(&notes, "bead 9 of the scenario did not record");
    assert_eq!(each(&compared["beads"], "bead"), Value::from(vec![7, 8, 10]));
    assert_eq!(compared["energy"]["fit"]["by_a"], Value::Null);
    assert_eq!(compared["energy"]["not_measured"], Value::from(vec![9]));
    assert_close(&compared);

    // One of another scenario, and one where no intruder is.
    let mut beads = hosts.map(RowBead::at);
    beads[1].carries = Some("title = \"another\"".to_owned());
    let row = RecordedRow::of(&scenario, &beads, 1);
    let (compared, notes) = row.compared("", 0);
    assert_says(
        &notes,
        "bead 8 (address 8) is left out: it carries another scenario",
    );
    assert_eq!(each(&compared["beads"], "bead"), Value::from(vec![7, 9, 10]));
    row.write("other.toml", &light_intruders(&[7, 8, 10]));
    let (compared, notes) = row.compared("--scenario other.toml", 1);
    let reason = "bead 9 (address 9) is left out: it has no intruder in this scenario";
    assert_says(&notes, reason);
    assert_eq!(each(&compared["beads"], "bead"), Value::from(vec![7, 10]));

    // One that never saw the strike, and one that is not on the sync line.
    let mut beads = hosts.map(RowBead::at);
    beads[1].lost = vec![0];
    beads[2].synced = false;
    let (compared, notes) = RecordedRow::of(&scenario, &beads, 1).compared("", 0);
    assert_says(&notes, "bead 8 never saw a strike");
    assert_says(&notes, "bead 9 is not on the common time");
    assert_eq!(
        each(&compared["arrivals"]["beads"], "bead"),
        Value::from(vec![7, 10])
    );
    assert_eq!(compared["arrivals"]["speeds"], Value::Array(vec![]));

    // Without a common time there are energies and no arrivals.
    beads
        .iter_mut()
        .for_each(|bead| (bead.synced, bead.lost) = (false, Vec::new()));
    let (compared, notes) = RecordedRow::of(&scenario, &beads, 1).compared("--figures figures", 0);
    assert!(
        notes.contains("no common time") && notes.lines().count() == 1,
        "{notes}"
    );
    assert_eq!(compared["arrivals"]["off_rms_s"], Value::Null);
    assert!(number(&compared["energy"]["fit"]["by_b"]["transmission"]) < 1.0);
    assert_close(&compared);
}

#[test]
fn several_strikes_are_judged_together_also_where_a_bead_lost_one() {
    let mut beads = [7, 8, 9].map(RowBead::at);
    beads[1].lost = vec![0];
    let row = RecordedRow::of(&light_intruders(&[7, 8, 9]), &beads, 3);
    let (compared, notes) = row.compared("", 0);
    assert_says(&notes, "bead 8 has 2 of 3 strikes");
    assert_eq!(compared["strikes"], 3);
    assert_close(&compared);
    let spread = &compared["beads"][1]["spread"][0];
    assert_eq!(spread["strikes"], 2);
    assert!(number(&spread["uncertainty"]) > 0.0);
}

#[test]
fn a_check_that_says_no_names_its_bead_and_a_replay_that_differs_is_the_gravest() {
    let mut beads = [7, 8, 9].map(RowBead::at);
    beads[0].frames_lost = 1;
    beads[2].wrong_by = 1;
    let mut scenario = light_intruders(&[7, 8, 9]);
    let (compared, notes) = RecordedRow::of(&scenario, &beads, 1).compared("", 1);
    assert_says(&notes, "bead 9: replay differs");
    assert_eq!(
        each(&compared["beads"], "pass"),
        Value::from(vec![false, true, false])
    );
    let failure = compared["beads"][0]["failure"].as_str().unwrap();
    assert_says(failure, "1 frame lost");

    // A striker that was faster than the scenario says: every A is off, and the fitted velocity mends it.
    let row = RecordedRow::of(&scenario, &[7, 8, 9].map(RowBead::at), 1);
    scenario.striker.velocity *= 0.99;
    row.write("slow.toml", &scenario);
    let (_, notes) = row.compared("--scenario slow.toml", 1);
    assert_says(&notes, "bead 7: A is");
    let (compared, _) = row.compared("--scenario slow.toml --velocity fit", 0);
    let velocity = number(&compared["striker_velocity"]["velocity"]);
    assert!((velocity / 0.45 - 1.0).abs() < 1e-3, "{velocity}");
    assert!(number(&compared["striker_velocity"]["uncertainty"]) < 1e-3);
    // One bead of a row is compared as a bead alone.
    let (compared, _) = row.compared("--bead 8", 0);
    assert_eq!((&compared["bead"], &compared["pass"]), (&8.into(), &true.into()));
    refused(
        &row.compare("--bead 3"),
        2,
        "has the beads [7, 8, 9]; give --bead one of them",
    );
}

#[test]
fn beads_without_strikes_and_those_of_another_chain_cannot_be_compared() {
    let mut beads = [7, 8].map(RowBead::at);
    beads.iter_mut().for_each(|bead| bead.lost = vec![0]);
    let row = RecordedRow::of(&light_intruders(&[7, 8, 9]), &beads, 1);
    refused(&row.compare(""), 2, "no strike among its");
    row.write("other.toml", &light_intruders(&[20, 21]));
    let other = row.compare("--scenario other.toml");
    assert_eq!(other.status.code(), Some(2));
    assert_says(&said(&other), "none of its beads is of this scenario");
}

#[test]
fn the_velocity_is_that_of_the_first_bead_whose_strikes_tell_it_and_one_alone_says_why_not() {
    let mut beads = [7, 8].map(RowBead::at);
    // Its first samples.
    (beads[0].synced, beads[0].frames_lost) = (false, 1);
    let row = RecordedRow::of(&light_intruders(&[7, 8]), &beads, 1);
    let (compared, notes) = row.compared("--velocity fit", 1);
    assert_says(&notes, "bead 7: replay differs");
    let velocity = number(&compared["striker_velocity"]["velocity"]);
    assert!((velocity / 0.45 - 1.0).abs() < 1e-3, "{velocity}");

    // The comparison is told also where there is nothing to draw.
    let (compared, notes) = row.compared("--bead 7 --figures figures", 1);
    assert_eq!(compared["strikes"].as_array().unwrap().len(), 1);
    assert_says(&notes, "--figures has nothing to draw");
    let output = row.compare("--bead 7 --velocity fit");
    assert_says(&said(&output), "no strike came with its settings");
}

#[test]
fn echoes_are_not_held_against_the_chain_and_tell_no_velocity() {
    // A striker so heavy that the beads part, and meet again after the window.
    let mut scenario = Scenario::paper();
    (scenario.striker.radius, scenario.striker.velocity) = (0.009, 1.0);
    let struck = RecordedRow::of(&scenario, &[RowBead::at(8)], 2);
    let (compared, notes) = struck.compared("--velocity fit", 0);
    assert_eq!(compared["strikes"].as_array().unwrap().len(), 2);
    assert_eq!(compared["striker_velocity"]["strikes"], 2);
    // That of the last strike comes too late for the recording.
    assert_says(&notes, "as a wave came again: 1");
}
