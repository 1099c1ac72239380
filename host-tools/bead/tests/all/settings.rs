//! `bead settings make` and `bead settings set`: from physical quantities to a bead.

use std::fs;
use std::process::Output;

use crate::program::{SCENARIO, asked, assert_says, done, json, refused, said, typed};
use bead_model::Settings;
use bead_model::design::{Bead, Capture, FrontEnd, derive};
use bead_model::name::Name;
use bead_testing::{Speaker, block_of, paper_settings};
use bead_wire::{Outcome, Request};

#[test]
fn a_bead_is_named_and_calibrated_from_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let run = |arguments: &str| done(typed(folder, &format!("settings {arguments}")));
    let read = |name: &str| Settings::decode(&fs::read(folder.join(name)).unwrap()).unwrap();
    run("make --template bead.toml");
    run("make bead.toml");
    // The template is the paper's bead, to the bit.
    assert_eq!(read("bead.settings"), paper_settings());

    let text = fs::read_to_string(folder.join("bead.toml")).unwrap();
    let text = text.replacen("name = \"\"", "name = \"left\"", 1);
    fs::write(folder.join("left.toml"), text.replacen("395000.0", "4e5", 1)).unwrap();
    run("make left.toml --out own.settings");
    let own = read("own.settings");
    let stated = own.description();
    assert_eq!((stated.name.as_str(), stated.intruder.stiffness), ("left", 4e5));
    for file in ["own.settings", "left.toml"] {
        let shown = json(typed(folder, &format!("settings show {file} --format json")));
        assert_eq!(shown["settings"]["intruder"]["stiffness"], 4e5);
        assert_eq!(shown["settings"]["force"]["per_code"], 3.90625e-3);
        assert_eq!(shown["settings_raw"], serde_json::to_value(own).unwrap());
    }

    // From a block to a file and back: the same bead.
    run("make --template again.toml --from own.settings");
    run("make again.toml");
    assert_eq!(read("again.settings"), own);

    // Of a scenario's bead.
    run(&format!(
        "make --template bead-8.toml --scenario {SCENARIO} --bead 8"
    ));
    run("make bead-8.toml");
    assert_eq!(read("bead-8.settings"), paper_settings());
}

#[test]
fn a_mistake_in_a_file_names_its_line_and_nothing_that_is_there_is_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    done(typed(folder, "settings make --template bead.toml"));
    let text = fs::read_to_string(folder.join("bead.toml")).unwrap();
    let line = 1 + text.lines().position(|line| line.starts_with("damping")).unwrap();
    fs::write(
        folder.join("bad.toml"),
        text.replacen("damping = 12.0", "damping = 0", 1),
    )
    .unwrap();
    let why = format!("bad.toml:{line}: intruder.damping: 0 is out of range");
    refused(&typed(folder, "settings make bad.toml"), 2, &why);
    refused(
        &typed(folder, "settings write bad.toml --port unix:nowhere"),
        2,
        &why,
    );
    done(typed(folder, "settings make bead.toml"));
    refused(
        &typed(folder, "settings make bead.toml"),
        2,
        "bead.settings is there already",
    );
    let onto_itself = typed(folder, "settings make bead.toml --out bead.toml --overwrite");
    refused(&onto_itself, 2, "is an input of this command");
}

/// Runs `bead settings set` at the paper's bead; gives what it printed and the settings that it sent.
fn set(changes: &str) -> (Output, Option<Settings>) {
    let (mut bead, mut sent) = (Speaker::default(), None);
    let folder = tempfile::tempdir().unwrap();
    let change = format!("settings set {changes} --timeout 2");
    let output = asked(folder.path(), &change, |bytes| {
        bead.answer(bytes, |bead, asked| {
            match &asked.request {
                Ok(Request::WriteSettings { block }) => sent = Some(Settings::decode(block.bytes()).unwrap()),
                Ok(Request::ReadSettings) => bead.say(0, block_of(&paper_settings())),
                _ => {}
            }
            bead.reply(asked.number, Outcome::Done);
        })
    });
    (output, sent)
}

#[test]
fn a_change_on_a_bead_is_told_before_it_is_sent_and_only_that_is_sent() {
    let named = paper_settings().with(|bead| (bead.name, bead.address) = (Name::new("left").unwrap(), 7));
    let bead = Bead {
        stiffness: 4e5,
        ..Bead::paper()
    };
    let stiffer = derive(&bead, &FrontEnd::reference(), &Capture::default());
    for (changes, printed, expected) in [
        (
            "name=left address=7",
            "name: \"\" -> \"left\"\naddress: 0 -> 7\n",
            named.ok(),
        ),
        (
            "k=4e5",
            "intruder.stiffness: 395000.0 -> 400000.0 N/m\n",
            stiffer.ok(),
        ),
    ] {
        let (output, sent) = set(changes);
        assert_eq!(done(output), printed);
        assert_eq!(sent, expected);
    }
    for (changes, status, why) in [
        ("k=395000.0 c=12", 0, "nothing is sent"),
        ("k=4e5 --dry-run", 0, "nothing is sent: --dry-run"),
        ("k=4e5 c=-1", 2, "intruder.damping: -1 is out of range"),
        ("k=4e5 stiffness=1", 2, "stiffness: no such key"),
    ] {
        let (output, sent) = set(changes);
        assert_eq!((output.status.code(), sent), (Some(status), None), "{changes}");
        assert_says(&said(&output), why);
    }
}
