//! Two beads on one line: each is asked by its address, and a message says which one answered.

use std::fs;
use std::process::Output;

use crate::beads::{Bead as FakeBead, Line};
use bead_model::design::{Bead, Capture, FrontEnd, derive};
use bead_model::settings::{BLOCK_MAX, Settings};
use bead_wire::Request;
use serde_json::Value;

fn block(address: u8) -> Vec<u8> {
    let paper = derive(&Bead::paper(), &FrontEnd::reference(), &Capture::default()).unwrap();
    let mut block = [0; BLOCK_MAX];
    let settings = paper.with(|one| one.address = address).unwrap();
    let length = settings.encode(&mut block).unwrap();
    block[..length].to_vec()
}

fn name_of(block: &[u8]) -> String {
    let settings = Settings::decode(block).unwrap();
    settings.description().name.as_str().to_owned()
}

fn two() -> [FakeBead; 2] {
    [1, 2].map(|address| FakeBead::new(address, &block(address)))
}

fn words(line: &str) -> Vec<&str> {
    line.split_whitespace().collect()
}

/// Exit status and standard error.
fn ended(output: &Output) -> (i32, String) {
    let said = String::from_utf8(output.stderr.clone()).unwrap();
    assert!(said.lines().count() <= 1, "{said}");
    (output.status.code().unwrap(), said)
}

#[test]
fn without_an_address_the_replies_of_two_beads_collide_and_the_message_says_what_to_do() {
    let (status, said) = ended(&Line::new().run(&mut two(), &["command", "identity"]));
    assert_eq!(status, 3, "{said}");
    assert!(said.contains("--address N"), "{said}");
}

#[test]
fn each_of_two_beads_is_asked_by_its_address() {
    let line = Line::new();
    let mut beads = two();
    for address in [1_u8, 2] {
        let asked = format!("command identity --format json --address {address}");
        let output = line.run(&mut beads, &words(&asked));
        let identity: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(identity["uid"], format!("{address:02x}").repeat(12));
    }
    for action in ["status", "self-test", "arm", "disarm", "reset-counters", "reboot"] {
        let asked = format!("command {action} --address 2");
        assert_eq!(
            ended(&line.run(&mut beads, &words(&asked))),
            (0, String::new()),
            "{action}"
        );
    }
    let raw = "command raw --duration 0.01 --out raw.csv --address 2";
    assert_eq!(ended(&line.run(&mut beads, &words(raw))).0, 0);
    // The other one did nothing but say who it is.
    assert_eq!(beads[0].done, [Request::Identity]);
    assert_eq!((beads[0].boot, beads[1].boot), (1, 2));
}

#[test]
fn the_settings_of_one_of_two_beads_are_read_written_changed_and_reset() {
    let line = Line::new();
    let mut beads = two();
    let mut run = |asked: &str| ended(&line.run(&mut beads, &words(asked)));
    assert_eq!(run("settings read --out second.settings --address 2").0, 0);
    assert_eq!(fs::read(line.folder().join("second.settings")).unwrap(), block(2));
    assert_eq!(run("settings set name=right --address 2").0, 0);
    assert_eq!(run("settings reset --address 2").0, 0);
    assert_eq!(run("settings key --new second.key --address 2").0, 0);
    let (status, said) = run("settings set name=left --address 2");
    assert_eq!(status, 1);
    assert_eq!(
        said,
        "bead: the bead at address 2 refused: unsigned; as asked, by --key F.key\n"
    );
    let stored = format!(
        "bead: the {} bytes of second.settings are stored and in force\n",
        block(2).len()
    );
    // It moves to another address, signed. The file has the old one.
    let moved = "settings write second.settings --new-address 7 --key second.key --address 2";
    assert_eq!(run(moved), (0, stored));
    let renamed = run("settings set name=left --key second.key --address 7");
    assert_eq!(renamed, (0, "bead: stored and in force\n".to_owned()));
    let (status, said) = run("command arm --address 2");
    assert_eq!(status, 3);
    assert!(said.contains("no reply from the bead with address 2"), "{said}");
    assert_eq!((beads[0].address, beads[1].address), (1, 7));
    assert!(beads[0].done.is_empty());
    assert_eq!(name_of(&beads[1].block), "left");
}
