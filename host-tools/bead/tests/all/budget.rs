//! `bead budget`: uncertainties as GTC combines them, by draws, of a row, and what is unknown.

use hertz_chain::Scenario;
use serde_json::Value;

use crate::program::{DATA, ROOT, TestFolder, assert_says, done, python, said};
use crate::rows::{ModelBead, record};

/// Uncertainties as a laboratory would state them.
pub(crate) const STATED: &str = r#"
[uncertainty]
calibration = "shaker 17"
calibrated = "2026-01-31"
valid_until = "2027-01-31"
force_gain = 0.0105
force_gain_ratio = 0.001
force_flatness = 0.01
acceleration_gain = 0.005
acceleration_gain_ratio = 0.001
acceleration_flatness = 0.01
supply = 0.002
bead_mass = 2e-4
intruder_mass = 0.003
stiffness = 0.005
damping = 0.02
contact_stiffness = 0.03
relaxation = 0.2
stiffness_with_damping = 0.2
stiffness_with_mass = 0.6
damping_with_mass = 0.15
"#;

/// A folder with a recording, a file of settings that states uncertainties, and one that states none.
fn folder() -> TestFolder {
    let folder = TestFolder::new();
    let recording = std::fs::read(format!("{DATA}/recording-v1.mcap"));
    folder.write("x.mcap", recording.unwrap());
    folder.done("settings make --template unknown.toml");
    folder.write("stated.toml", folder.text("unknown.toml") + STATED);
    folder
}

#[test]
fn gtc_combines_the_same_inputs_to_the_same_uncertainties() {
    let folder = folder();
    for (name, options) in [("stated", " --uncertainty stated.toml"), ("unknown", "")] {
        let printed = folder.done(&format!("budget x.mcap --format json{options}"));
        folder.write(&format!("{name}.json"), printed);
    }
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/budget_by_gtc.py");
    if let Some(printed) = python(&folder, &[script, "stated.json", "unknown.json"]) {
        let [stated, unknown] = [(17, 3), (4, 0)];
        let line =
            |(inputs, correlations)| format!("strike 0: {inputs} inputs, {correlations} correlations\n");
        assert_eq!(printed, line(stated) + &line(unknown));
    }
}

#[test]
fn draws_through_the_beads_code_confirm_the_linear_budget() {
    let folder = folder();
    let report = folder.json("budget x.mcap --uncertainty stated.toml --monte-carlo 20000 --format json");
    let bead = &report["beads"][0];
    for result in ["measured", "predicted", "difference"] {
        let (linear, drawn) = (&bead[result], &bead["monte_carlo"][result]);
        let part = drawn["u"].as_f64().unwrap() / linear["u"].as_f64().unwrap() - 1.0;
        // Of 20000 draws a standard deviation is known to 0.5 %; curvature adds 0.3 %.
        assert!(part.abs() < 0.02, "{result}: {part}");
        assert!(drawn["agrees_to_digits"].as_u64().is_some(), "{result}");
    }
}

#[test]
fn unknown_uncertainties_and_an_expired_calibration_are_said_in_a_line() {
    let folder = folder();
    let unknown = folder.run("budget x.mcap --page budget.html");
    assert_says(&said(&unknown), "the settings state no uncertainties");
    let printed = done(unknown);
    assert_says(&printed, "unknown uncertainties: force gain, force gain ratio,");
    assert_says(&folder.text("budget.html"), "A and B are not judged");
    // The strike of this recording has no day, so it is judged by today.
    let late = folder.text("stated.toml").replace("2027-01-31", "2026-02-01");
    folder.write("late.toml", late);
    let late = folder.run("budget x.mcap --uncertainty late.toml");
    assert_says(&said(&late), "the calibration shaker 17 expired on 2026-02-01");
    assert_says(&done(late), "simple acceptance (JCGM 106, 8.2)");
}

#[test]
fn the_ratio_of_two_beads_lacks_what_they_share_if_they_name_one_calibration() {
    let folder = folder();
    let scenario = format!("{ROOT}/docs/scenarios/ten-intruders.toml");
    let scenario = Scenario::load(scenario).unwrap();
    record(&folder.join("row.mcap"), &scenario, &[7, 8].map(ModelBead::at), 1);
    let name = "calibration = \"shaker 17\"\n";
    folder.write("unnamed.toml", folder.text("stated.toml").replace(name, ""));
    let ratio = |file: &str| -> Value {
        let mut report = folder.json(&format!("budget row.mcap --uncertainty {file} --format json"));
        assert_eq!(report["beads"].as_array().unwrap().len(), 2);
        report["ratios"][0].take()
    };
    let (shared, apart) = (ratio("stated.toml"), ratio("unnamed.toml"));
    let shares = [&shared, &apart].map(|one| &one["shares_calibration"]);
    assert_eq!(shares, [true, false]);
    let u = |ratio: &Value, result: &str| ratio[result]["u"].as_f64().unwrap();
    // Without the shared part, k, c and m of both beads are left: sqrt(2) times 2.1 % of A.
    for result in ["measured", "predicted"] {
        assert_eq!(shared[result]["value"], apart[result]["value"]);
        assert!(u(&shared, result) < 0.8 * u(&apart, result), "{shared} {apart}");
    }
}
