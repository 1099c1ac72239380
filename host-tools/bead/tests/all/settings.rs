//! `bead settings make` and `bead settings set`: from physical quantities to the settings of a bead.

use crate::answering::{AnsweringBead, at_line};
use crate::program::{SCENARIO, TestFolder, assert_says, done, said};
use bead_model::Settings;
use bead_model::design::{Bead, Capture, FrontEnd, derive};
use bead_model::name::Name;
use bead_testing::{block_of, paper_settings};
use bead_wire::Request;

#[test]
fn a_bead_is_named_and_calibrated_from_a_file() {
    let folder = TestFolder::new();
    let run = |arguments: &str| folder.done(&format!("settings {arguments}"));
    let read = |name: &str| Settings::decode(&folder.read(name)).unwrap();
    run("make --template bead.toml");
    run("make bead.toml");
    // The template is the paper's bead, to the bit.
    assert_eq!(read("bead.settings"), paper_settings());

    let text = folder.text("bead.toml");
    let text = text.replacen("name = \"\"", "name = \"left\"", 1);
    folder.write("left.toml", text.replacen("395000.0", "4e5", 1));
    run("make left.toml --out own.settings");
    let own = read("own.settings");
    let stated = own.description();
    assert_eq!((stated.name.as_str(), stated.intruder.stiffness), ("left", 4e5));
    for file in ["own.settings", "left.toml"] {
        let shown = folder.json(&format!("settings show {file} --format json"));
        assert_eq!(shown["settings"]["intruder"]["stiffness"], 4e5);
        assert_eq!(shown["settings"]["force"]["per_code"], 3.90625e-3);
        assert_eq!(shown["settings_raw"], serde_json::to_value(own).unwrap());
    }

    // From a block to a file and back: the same bead.
    run("make --template again.toml --from own.settings");
    run("make again.toml");
    assert_eq!(read("again.settings"), own);

    // The template of a bead of a scenario.
    let bead_8 = format!("make --template bead-8.toml --scenario {SCENARIO} --bead 8");
    run(&bead_8);
    run("make bead-8.toml");
    assert_eq!(read("bead-8.settings"), paper_settings());
}

#[test]
fn a_change_on_a_bead_is_told_before_it_is_sent_and_only_that_is_sent() {
    let folder = TestFolder::new();
    let paper = block_of(&paper_settings()).block.bytes().to_vec();
    let set = |changes: &str| {
        let mut bead = [AnsweringBead::new(0, &paper)];
        let output = at_line(&folder, &mut bead, &format!("settings set {changes}"));
        let [bead] = bead;
        (output, bead)
    };
    let named = paper_settings()
        .with(|bead| (bead.name, bead.address) = (Name::new("left").unwrap(), 7))
        .ok();
    let mut bead = Bead::paper();
    bead.stiffness = 4e5;
    let stiffer = derive(&bead, &FrontEnd::reference(), &Capture::default()).ok();
    let printed = "name: \"\" -> \"left\"\naddress: 0 -> 7\n";
    for (changes, printed, expected) in [
        ("name=left address=7", printed, named),
        ("k=4e5", "intruder.stiffness: 395000.0 -> 400000.0 N/m\n", stiffer),
    ] {
        let (output, bead) = set(changes);
        assert_eq!(done(output), printed);
        assert_eq!(Settings::decode(&bead.block).ok(), expected);
    }
    for (changes, status, why) in [
        ("k=395000.0 c=12", 0, "nothing is sent"),
        ("k=4e5 --dry-run", 0, "nothing is sent: --dry-run"),
        ("k=4e5 c=-1", 2, "intruder.damping: -1 is out of range"),
        ("k=4e5 stiffness=1", 2, "stiffness: no such key"),
    ] {
        let (output, bead) = set(changes);
        assert_eq!(output.status.code(), Some(status), "{changes}");
        let is_write = |request: &Request| matches!(request, Request::WriteSettings { .. });
        assert!(!bead.done.iter().any(is_write), "{changes}");
        assert_says(&said(&output), why);
    }
}
