//! `bead compare` of a recording of several beads, whole and with something missing.

use std::process::Output;

use crate::program::{ROOT, TestFolder, assert_says, documents, done, refused, said};
use crate::rows::{ModelBead, record};
use hertz_chain::Scenario;
use serde_json::Value;

/// Elastic beads with light intruders in these hosts. The wave has passed them all at the end.
pub(crate) fn light_intruders(hosts: &[usize]) -> Scenario {
    let mut scenario = Scenario::load(format!("{ROOT}/docs/scenarios/row-of-ten.toml")).unwrap();
    (scenario.chain.beads, scenario.duration) = (32, 0.007);
    scenario.intruders[0].beads = hosts.to_vec();
    scenario
}

/// A folder with a recording, `row.mcap`.
struct RecordedRow(TestFolder);

impl RecordedRow {
    fn of(scenario: &Scenario, beads: &[ModelBead], strikes: u32) -> Self {
        let folder = TestFolder::new();
        record(&folder.join("row.mcap"), scenario, beads, strikes);
        Self(folder)
    }

    fn write(&self, name: &str, scenario: &Scenario) {
        self.0.write(name, scenario.to_toml());
    }

    fn compare(&self, more: &str) -> Output {
        self.0.run(&format!("compare row.mcap {more}"))
    }

    /// Asserts the exit status of `bead compare`. Returns its result as JSON and its notes on standard error.
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
fn each(list: &Value, key: &str) -> Vec<Value> {
    let list = list.as_array().unwrap().iter();
    list.map(|object| object[key].clone()).collect()
}

/// Asserts that T by A and by B is that of the simulation, and that known arrivals are.
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
    let row = RecordedRow::of(&light_intruders(&hosts), &hosts.map(ModelBead::at), 1);
    let (compared, notes) = row.compared("--report row.html --figures figures", 0);
    assert_eq!(notes, "");
    assert_eq!(each(&compared["beads"], "bead"), hosts);
    assert!(compared["pass"] == true && compared["strikes"] == 1);
    assert_close(&compared);
    let speeds = compared["arrivals"]["speeds"].as_array().unwrap();
    assert_eq!(speeds.len(), 3);
    for speed in speeds {
        let off = number(&speed["device"]) / number(&speed["f64_chain"]) - 1.0;
        assert!(off.abs() < 3e-3, "{speed}");
    }
    assert_eq!(each(&compared["beads"], "replay_identical"), [true; 4]);
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

    let read = |name: &str| row.0.text(name);
    let (page, table) = (read("row.html"), done(row.compare("")));
    for part in ["Every check passed", "7 to 8", "energy left, E(n) (%)"] {
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
fn what_one_bead_lacks_is_said_in_a_line_and_the_others_go_on() {
    let hosts = [7, 8, 9, 10];
    let scenario = light_intruders(&hosts);
    // Bead 9 did not record: its energy is that of the simulation, and no line is fitted over the gap.
    let row = RecordedRow::of(&scenario, &[7, 8, 10].map(ModelBead::at), 1);
    let (compared, notes) = row.compared("", 0);
    assert_says(&notes, "bead 9 of the scenario did not record");
    assert_eq!(each(&compared["beads"], "bead"), [7, 8, 10]);
    assert_eq!(compared["energy"]["fit"]["by_a"], Value::Null);
    assert_eq!(compared["energy"]["not_measured"][0], 9);
    assert_close(&compared);

    // A bead carries another scenario, and one has no intruder.
    let mut beads = hosts.map(ModelBead::at);
    beads[1].carries = Some("title = \"another\"".to_owned());
    let row = RecordedRow::of(&scenario, &beads, 1);
    let (compared, notes) = row.compared("", 0);
    let part = "bead 8 (address 8) is left out: it has another scenario";
    assert_says(&notes, part);
    assert_eq!(each(&compared["beads"], "bead"), [7, 9, 10]);
    row.write("other.toml", &light_intruders(&[7, 8, 10]));
    let (compared, notes) = row.compared("--scenario other.toml", 1);
    let reason = "bead 9 (address 9) is left out: it has no intruder in this scenario";
    assert_says(&notes, reason);
    assert_eq!(each(&compared["beads"], "bead"), [7, 10]);

    // A bead never saw the strike, and one is not on the sync line.
    let mut beads = hosts.map(ModelBead::at);
    beads[1].lost = vec![0];
    beads[2].synced = false;
    let (compared, notes) = RecordedRow::of(&scenario, &beads, 1).compared("", 0);
    assert_says(&notes, "bead 8 never saw a strike");
    assert_says(&notes, "bead 9 is not on the common time");
    assert_eq!(each(&compared["arrivals"]["beads"], "bead"), [7, 10]);
    assert_eq!(compared["arrivals"]["speeds"], Value::Array(vec![]));

    // Without a common time there are energies and no arrivals.
    for bead in &mut beads {
        (bead.synced, bead.lost) = (false, Vec::new());
    }
    let (compared, notes) = RecordedRow::of(&scenario, &beads, 1).compared("--figures figures", 0);
    assert_says(&notes, "no common time");
    assert_eq!(notes.lines().count(), 1);
    assert_eq!(compared["arrivals"]["off_rms_s"], Value::Null);
    assert!(number(&compared["energy"]["fit"]["by_b"]["transmission"]) < 1.0);
    assert_close(&compared);
}

#[test]
fn strikes_are_judged_together_also_of_beads_in_any_order_and_where_a_bead_lost_one() {
    let mut beads = [12, 7, 9].map(ModelBead::at);
    beads[2].lost = vec![0];
    let row = RecordedRow::of(&light_intruders(&[12, 9, 7]), &beads, 3);
    let (compared, notes) = row.compared("", 0);
    assert_says(&notes, "bead 9 has 2 of 3 strikes");
    assert_eq!(each(&compared["beads"], "bead"), [7, 9, 12]);
    assert_eq!(compared["strikes"], 3);
    assert_close(&compared);
    let spread = &compared["beads"][1]["spread"][0];
    assert_eq!(spread["strikes"], 2);
    assert!(number(&spread["uncertainty"]) > 0.0);
    let speeds = &compared["arrivals"]["speeds"];
    assert_eq!(each(speeds, "from"), [7, 9]);
    assert_eq!(each(speeds, "to"), [9, 12]);
}

#[test]
fn a_check_that_says_no_names_its_bead_and_a_replay_that_differs_is_the_gravest() {
    let mut beads = [7, 8, 9].map(ModelBead::at);
    beads[0].frames_lost = 1;
    beads[2].wrong_by = 1;
    let mut scenario = light_intruders(&[7, 8, 9]);
    let (compared, notes) = RecordedRow::of(&scenario, &beads, 1).compared("", 1);
    assert_says(&notes, "bead 9: replay differs");
    assert_eq!(each(&compared["beads"], "pass"), [false, true, false]);
    let failure = compared["beads"][0]["failure"].as_str().unwrap();
    assert_says(failure, "1 frame lost");

    // The striker was faster than in the scenario: every A is off until the velocity is fitted.
    let row = RecordedRow::of(&scenario, &[7, 8, 9].map(ModelBead::at), 1);
    scenario.striker.velocity *= 0.99;
    row.write("slow.toml", &scenario);
    let (_, notes) = row.compared("--scenario slow.toml", 1);
    assert_says(&notes, "bead 7: A is");
    let (compared, _) = row.compared("--scenario slow.toml --velocity fit", 0);
    let velocity = number(&compared["striker_velocity"]["velocity"]);
    assert!((velocity / 0.45 - 1.0).abs() < 1e-3, "{velocity}");
    assert!(number(&compared["striker_velocity"]["uncertainty"]) < 1e-3);
    // One bead of a row is compared like a single bead.
    let (compared, _) = row.compared("--bead 8", 0);
    assert_eq!((&compared["bead"], &compared["pass"]), (&8.into(), &true.into()));
}

#[test]
fn beads_without_strikes_and_those_of_another_chain_cannot_be_compared() {
    let mut beads = [7, 8].map(ModelBead::at);
    beads.iter_mut().for_each(|bead| bead.lost = vec![0]);
    let row = RecordedRow::of(&light_intruders(&[7, 8, 9]), &beads, 1);
    refused(&row.compare(""), 2, "no strike among its");
    row.write("other.toml", &light_intruders(&[20, 21]));
    let other = row.compare("--scenario other.toml");
    assert_eq!(other.status.code(), Some(2));
    assert_says(&said(&other), "none of its beads belongs to this scenario");
}

#[test]
fn the_velocity_is_that_of_the_first_bead_whose_strikes_tell_it_and_one_alone_says_why_not() {
    let mut beads = [7, 8].map(ModelBead::at);
    // Bead 7 lost its first samples.
    (beads[0].synced, beads[0].frames_lost) = (false, 1);
    let row = RecordedRow::of(&light_intruders(&[7, 8]), &beads, 1);
    let (compared, notes) = row.compared("--velocity fit", 1);
    assert_says(&notes, "bead 7: incomplete: strike 0");
    let velocity = number(&compared["striker_velocity"]["velocity"]);
    assert!((velocity / 0.45 - 1.0).abs() < 1e-3, "{velocity}");

    // The comparison is printed although there is nothing to draw.
    let (compared, notes) = row.compared("--bead 7 --figures figures", 1);
    assert_eq!(compared["strikes"].as_array().unwrap().len(), 1);
    assert_says(&notes, "--figures has nothing to draw");
    let output = row.compare("--bead 7 --velocity fit");
    assert_says(&said(&output), "no strike came with its settings");
}

#[test]
fn echoes_are_not_held_against_the_chain_and_tell_no_velocity() {
    // The striker is so heavy that the beads part and meet again after the window.
    let mut scenario = Scenario::paper();
    (scenario.striker.radius, scenario.striker.velocity) = (0.009, 1.0);
    let struck = RecordedRow::of(&scenario, &[ModelBead::at(8)], 2);
    let (compared, notes) = struck.compared("--velocity fit", 0);
    assert_eq!(compared["strikes"].as_array().unwrap().len(), 2);
    assert_eq!(compared["striker_velocity"]["strikes"], 2);
    // The echo of the last strike comes after the recording.
    assert_says(&notes, "as a wave came again: 1");
}
