//! Two beads on one line: each is asked by its address, and messages name the bead that answered.

use crate::answering::{AnsweringBead, at_line};
use crate::program::{self, TestFolder, refused, said};
use bead_model::Settings;
use bead_testing::{block_of, paper_settings};
use bead_wire::Request;

fn block(address: u8) -> Vec<u8> {
    let settings = paper_settings().with(|bead| bead.address = address).unwrap();
    block_of(&settings).block.bytes().to_vec()
}

fn two() -> [AnsweringBead; 2] {
    [1, 2].map(|address| AnsweringBead::new(address, &block(address)))
}

#[test]
fn without_an_address_the_replies_of_two_beads_collide_and_the_message_says_what_to_do() {
    let folder = TestFolder::new();
    let output = at_line(&folder, &mut two(), "command identity");
    refused(&output, 3, "--address N");
}

#[test]
fn each_of_two_beads_is_asked_by_its_address() {
    let folder = TestFolder::new();
    let mut beads = two();
    let mut run = |arguments: String| at_line(&folder, &mut beads, &arguments);
    for address in [1_u8, 2] {
        let identity = program::json(run(format!("command identity --format json --address {address}")));
        assert_eq!(identity["uid"], format!("{address:02x}").repeat(12));
    }
    for action in ["status", "self-test", "arm", "disarm", "reset-counters", "reboot"] {
        let output = run(format!("command {action} --address 2"));
        assert_eq!(said(&output), "", "{action}");
        program::done(output);
    }
    let raw = "command raw --duration 0.01 --out raw.csv --address 2";
    program::done(run(raw.to_owned()));
    // The other bead only gave its identity.
    assert_eq!(beads[0].done, [Request::Identity]);
    assert_eq!((beads[0].speaker.boot, beads[1].speaker.boot), (1, 2));
}

#[test]
fn the_settings_of_one_of_two_beads_are_read_written_changed_and_reset() {
    let folder = TestFolder::new();
    let mut beads = two();
    let mut run = |arguments: &str| at_line(&folder, &mut beads, arguments);
    program::done(run("settings read --out second.settings --address 2"));
    assert_eq!(folder.read("second.settings"), block(2));
    program::done(run("settings set name=right --address 2"));
    program::done(run("settings reset --address 2"));
    program::done(run("settings key --new second.key --address 2"));
    let unsigned = run("settings set name=left --address 2");
    let reason = "bead: the bead at address 2 refused: unsigned; as asked, by --key F.key\n";
    refused(&unsigned, 1, reason);
    // A signed write moves it to another address than that in the file.
    let moved = run("settings write second.settings --new-address 7 --key second.key --address 2");
    let bytes = block(2).len();
    let stored = format!("bead: the {bytes} bytes of second.settings are stored and in force\n");
    assert_eq!((moved.status.code(), said(&moved)), (Some(0), stored));
    let renamed = run("settings set name=left --key second.key --address 7");
    let stored = "bead: stored and in force\n".to_owned();
    assert_eq!((renamed.status.code(), said(&renamed)), (Some(0), stored));
    let gone = run("command arm --address 2");
    refused(&gone, 3, "no reply from the bead with address 2");
    assert_eq!(beads.each_ref().map(|bead| bead.speaker.address), [1, 7]);
    assert!(beads[0].done.is_empty());
    let settings = Settings::decode(&beads[1].block).unwrap();
    assert_eq!(settings.description().name.as_str(), "left");
}
