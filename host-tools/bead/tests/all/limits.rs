//! `bead judge` as its users run it: every outcome, its exit status, XML and page.

use hertz_chain::Scenario;
use serde_json::Value;

use crate::budget::STATED;
use crate::program::{TestFolder, assert_says, fields, said};
use crate::row::light_intruders;
use crate::rows::{ModelBead, record};

/// A folder with six strikes of bead 8, of which A is 830 nJ and the force 6.3 N, and stated uncertainties.
fn folder() -> TestFolder {
    folder_of(&Scenario::paper(), &[ModelBead::at(8)], 6)
}

fn folder_of(scenario: &Scenario, beads: &[ModelBead], strikes: u32) -> TestFolder {
    let folder = TestFolder::new();
    record(&folder.join("x.mcap"), scenario, beads, strikes);
    folder.done("settings make --template bead.toml");
    folder.write("bead.toml", folder.text("bead.toml") + STATED);
    folder
}

/// The result of a file of limits, and the exit status.
fn judged(folder: &TestFolder, limits: &str, options: &str) -> (Value, i32, String) {
    folder.write("l.toml", limits);
    let output = folder.run(&format!("judge x.mcap --limits l.toml --format json {options}"));
    let report = serde_json::from_slice(&output.stdout).unwrap_or_default();
    (report, output.status.code().unwrap(), said(&output))
}

fn limit(quantity: &str, of: &str) -> String {
    format!("[[limit]]\nquantity = \"{quantity}\"\n{of}\n")
}

/// Holds a row: the quantity behind keys of the whole file, the keys of its limit, a file of uncertainties,
/// the outcome, and a part of the message.
fn hold(folder: &TestFolder, row: &str) {
    let [quantity, keys, stated, outcome, part] = fields(row);
    let (top, quantity) = quantity.rsplit_once("; ").unwrap_or(("", quantity));
    let limits = format!("{top}\n{}", limit(quantity, &keys.replace("; ", "\n")));
    let options = match stated {
        "" => String::new(),
        file => format!("--uncertainty {file}"),
    };
    let (report, status, told) = judged(folder, &limits, &options);
    assert_eq!(report["outcome"], outcome, "{limits}{told}");
    assert_eq!(status, i32::from(outcome != "pass"), "{told}");
    assert_says(&told, part);
    assert_eq!(told.lines().count(), usize::from(outcome != "pass"), "{told}");
    assert_eq!(report["failure"].is_null(), outcome == "pass");
}

#[test]
fn a_limit_is_kept_broken_or_not_decided_and_the_status_says_so() {
    let folder = folder();
    for row in [
        "absorbed_measured | min = 8.2e-7; max = 8.4e-7 | | pass |",
        "absorbed_measured | max = 8.2e-7 | | fail | above the limit 820.00 nJ",
        "peak_force | min = 7.0 | | fail | below the limit 7.0000 N",
        // U is some 39 nJ with the stated uncertainties, and unknown without.
        "absorbed_measured | rule = 'guarded-acceptance'; max = 8.4e-7 | bead.toml | fail | within U of the limit 840.00 nJ",
        "absorbed_measured | rule = 'guarded-rejection'; max = 8.2e-7 | bead.toml | pass |",
        "absorbed_measured | rule = 'guarded-acceptance'; max = 8.4e-7 | | undecided | its uncertainty is unknown, and the \
         rule needs it",
        "ring_frequency | rule = 'guarded-acceptance'; min = 1000 | bead.toml | undecided | the bead sends no \
         uncertainty of this frequency",
        // Over strikes, beads and frequency.
        "row_share | min = 0.1 | | undecided | a row has two or more",
        "ratio | max = 1.1; beads = [9] | | undecided | bead 9 is not in the recording (beads there: 8)",
        "drift | min = -0.01; max = 0.01 | | pass |",
        "drift | of = 'peak_force'; min = 0.01 | | fail | drift of peak_force",
        "strikes = 9; ratio | max = 1.1 | | fail | number of strikes is 6, below the limit 9",
        "srs | mask = [{ frequency = 500, max = 1e4 }, { frequency = 5000, max = 1e4 }] | | pass |",
        "srs | unit = 'g'; mask = [{ frequency = 500, max = 10 }, { frequency = 5000, max = 10 }] | | fail | above the limit 10.0",
        "srs | mask = [{ frequency = 20, max = 1e4 }, { frequency = 5000, max = 1e4 }] | | undecided | the mask begins at \
         20 Hz",
    ] {
        hold(&folder, row);
    }
}

#[test]
fn the_worst_strike_is_shown_and_others_go_on() {
    let folder = folder();
    let limits = limit("ratio", "max = 0.5") + &limit("peak_force", "max = 7.0");
    let (report, status, told) = judged(&folder, &limits, "");
    let limits = report["recordings"][0]["limits"].as_array().unwrap();
    assert_eq!((status, limits.len()), (1, 2), "{told}");
    let counts = ["passed", "undecided", "failed"].map(|key| limits[0][key].as_u64().unwrap());
    assert_eq!(counts, [0, 0, 6]);
    assert_eq!(limits[1]["outcome"], "pass");
    folder.done("export x.mcap --out tables --format csv");
    let mut rows = csv::Reader::from_path(folder.join("tables/strikes.csv")).unwrap();
    let heads = rows.headers().unwrap().clone();
    let [a, b, peak] = ["absorbed_measured_j", "absorbed_predicted_j", "peak_force_n"]
        .map(|name| heads.iter().position(|head| head == name).unwrap());
    let (mut ratio, mut force) = (0.0_f64, 0.0_f64);
    for row in rows.records().map(Result::unwrap) {
        let number = |place: usize| row[place].parse::<f64>().unwrap();
        ratio = ratio.max(number(a) / number(b));
        force = force.max(number(peak));
    }
    assert_eq!(limits[0]["value"].as_f64(), Some(ratio));
    assert_eq!(limits[1]["value"].as_f64(), Some(force));
}

#[test]
fn a_row_absorbs_the_share_that_its_beads_tell() {
    let hosts = [7, 8, 9, 10];
    let folder = folder_of(&light_intruders(&hosts), &hosts.map(ModelBead::at), 1);
    let limits = limit("row_share", "min = 0.05\nmax = 0.5");
    let (report, status, told) = judged(&folder, &limits, "--uncertainty bead.toml");
    let result = &report["recordings"][0]["limits"][0];
    assert_eq!((status, &result["bead"]), (0, &Value::Null), "{told}");
    // The comparison with the simulation has what is left after four.
    let row = folder.run("compare x.mcap --format json");
    let row: Value = serde_json::from_slice(&row.stdout).unwrap();
    let left = row["energy"]["after"][4]["left"]["by_a"].as_f64().unwrap();
    let share = result["value"].as_f64().unwrap();
    assert!((share / (1.0 - left) - 1.0).abs() < 0.02, "{share} {left}");
    let expanded = result["expanded"].as_f64().unwrap();
    assert!((0.02..0.2).contains(&(expanded / share)), "{result}");
}

#[test]
fn ci_and_people_get_their_files_and_the_recording_its_verdict() {
    let folder = folder();
    let mask = "mask = [{ frequency = 500, max = 1e4 }, { frequency = 5000, max = 1e4 }]";
    let limits = [
        "title = 'A & <B>'\n".to_owned(),
        limit("peak_force", "name = '<blow>'\nmax = 6.0"),
        limit("ratio", "min = 0.9\nmax = 1.1"),
        limit("srs", mask),
    ];
    let limits = limits.concat();
    let (_, status, told) = judged(&folder, &limits, "--report r.html --junit j.xml --note --by Lima");
    assert_eq!(status, 1, "{told}");
    let xml = folder.text("j.xml");
    assert_says(&xml, "tests=\"3\" skipped=\"0\" failures=\"1\" errors=\"0\"");
    let case = "<testcase name=\"&lt;blow&gt;, bead 8\" classname=\"A &amp; &lt;B&gt;\">";
    assert_says(&xml, case);
    assert_says(&xml, "above the limit 6.0000 N");
    let page = folder.text("r.html");
    for part in [
        "A &amp; &lt;B&gt;",
        "&lt;blow&gt;, bead 8",
        "<svg",
        "simple acceptance",
        "SHA-256",
    ] {
        assert_says(&page, part);
    }
    assert!(!page.contains("<blow>"));
    let found = folder.json("list --verdict fail --format json");
    assert_eq!(found["recordings"][0]["notes"]["limits"], "l.toml A & <B>");
    assert_says(&folder.done("note x.mcap"), "Lima");
    // The noted verdict does not change the strikes' bytes.
    folder.done("replay x.mcap");
    folder
        .refused("2 | is an input of this command | judge x.mcap --limits l.toml --junit x.mcap --overwrite");
}

#[test]
fn the_template_is_a_file_of_limits_that_the_paper_s_strike_keeps() {
    let folder = folder();
    let printed = folder.done("judge --template");
    folder.done("judge --template l.toml");
    assert_eq!(folder.text("l.toml"), printed.trim_end().to_owned() + "\n");
    folder.done("judge x.mcap --limits l.toml");
}
