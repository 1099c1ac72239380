//! docs/signed-result.md, followed word for word from an empty folder.

use std::fs;

use serde_json::Value;

use crate::first_strike::blocks;
use crate::program::{ROOT, TestFolder, assert_says, shell};

#[test]
fn a_result_is_calibrated_struck_identified_analysed_judged_and_signed_by_the_commands_of_the_page() {
    let page = fs::read_to_string(format!("{ROOT}/docs/signed-result.md")).unwrap();
    let folder = TestFolder::new();
    fs::create_dir_all(folder.join("docs/scenarios")).unwrap();
    let scenario = "docs/scenarios/simulated-bead.toml";
    fs::copy(format!("{ROOT}/{scenario}"), folder.join(scenario)).unwrap();
    let lines = blocks(&page).into_iter().map(|(_, line)| line);
    let typed: Vec<_> = lines.map(|line| (shell(&folder, &line), line)).collect();
    let printed = |command: &str| {
        let found = typed.iter().find(|(_, line)| line.contains(command));
        &found.unwrap_or_else(|| panic!("the page has no {command}")).0
    };
    assert_says(printed("ssh-keygen -Y verify"), "Good \"bead-result\" signature");
    assert_says(printed("bead replay"), "identical");
    assert_says(printed("bead list"), "A12");
    let sealed = folder.text("judged.html");
    let hash = shell(&folder, "sha256sum run/bead-8.mcap");
    assert_says(&sealed, hash.split_whitespace().next().unwrap());
    // A page that somebody changed is not the one that was signed.
    folder.write("judged.html", sealed.replacen("kept", "kent", 1));
    let mut lines = typed.iter().map(|(_, line)| line);
    let line = lines.find(|line| line.contains("-Y verify")).unwrap();
    let refused = shell(&folder, &format!("! {line}"));
    assert!(!refused.contains("Good"), "{refused}");
    // The calibration's errors are in the energies, and the uncertainties that the bead states cover the
    // chain's values.
    let compared =
        "bead compare run/bead-8.mcap --scenario docs/scenarios/simulated-bead.toml --format json || true";
    let compared: Value = serde_json::from_str(&shell(&folder, compared)).unwrap();
    let strike = &compared["strikes"][0];
    for of in ["absorbed_measured", "absorbed_predicted"] {
        let [device, chain] = ["device", "f64_chain"].map(|by| strike[by][of].as_f64().unwrap());
        let u = strike["uncertainty"][format!("u_{of}")].as_f64().unwrap();
        let is_covered = (device - chain).abs() < 2.0 * u && u < 0.02 * chain;
        assert!(is_covered, "{of}: {device} for {chain}, u {u}");
    }
}
