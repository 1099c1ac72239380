//! `bead settings make` and `bead settings set`: from physical quantities to a bead.

use std::fs;
use std::io::{Read, Write};
use std::os::unix::net::UnixListener;
use std::path::Path;
use std::process::Output;
use std::thread;

use crate::program::{self, said};
use bead_model::design::{Bead, Capture, FrontEnd, derive};
use bead_model::name::Name;
use bead_model::settings::{BLOCK_MAX, Settings};
use bead_wire::{
    Block, Header, MAX_FRAME, Message, Outcome, Reply, Request, RequestDecoder, Settings as Told, encode,
};
use serde_json::Value;

fn bead(folder: &Path, arguments: &str) -> Output {
    program::bead(folder, arguments.split(' '))
}

fn paper() -> Settings {
    derive(&Bead::paper(), &FrontEnd::reference(), &Capture::default()).unwrap()
}

fn block(settings: &Settings) -> Vec<u8> {
    let mut block = [0; BLOCK_MAX];
    let length = settings.encode(&mut block).unwrap();
    block[..length].to_vec()
}

#[test]
fn a_bead_is_named_and_calibrated_from_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let done = |arguments: &str| {
        let output = bead(folder, arguments);
        assert!(output.status.success(), "{arguments}: {}", said(&output));
        output.stdout
    };
    done("settings make --template bead.toml");
    done("settings make bead.toml");
    // The template is the paper's bead, to the bit.
    assert_eq!(fs::read(folder.join("bead.settings")).unwrap(), block(&paper()));

    let text = fs::read_to_string(folder.join("bead.toml")).unwrap();
    let text = text
        .replacen("name = \"\"", "name = \"left\"", 1)
        .replacen("395000.0", "4e5", 1);
    fs::write(folder.join("left.toml"), text).unwrap();
    done("settings make left.toml --out own.settings");
    let own = Settings::decode(&fs::read(folder.join("own.settings")).unwrap()).unwrap();
    let stated = own.description();
    assert_eq!((stated.name.as_str(), stated.intruder.stiffness), ("left", 4e5));
    for file in ["own.settings", "left.toml"] {
        let shown: Value =
            serde_json::from_slice(&done(&format!("settings show {file} --format json"))).unwrap();
        assert_eq!(shown["settings"]["intruder"]["stiffness"], 4e5);
        assert_eq!(shown["settings"]["force"]["per_code"], 3.90625e-3);
        assert_eq!(shown["settings_raw"], serde_json::to_value(own).unwrap());
    }

    // From a block to a file and back: the same bead.
    done("settings make --template again.toml --from own.settings");
    done("settings make again.toml");
    let again = Settings::decode(&fs::read(folder.join("again.settings")).unwrap()).unwrap();
    assert_eq!(again, own);

    // Of a scenario's bead.
    let scenario = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../docs/scenarios/paper-strike.toml"
    );
    done(&format!(
        "settings make --template bead-8.toml --scenario {scenario} --bead 8"
    ));
    done("settings make bead-8.toml");
    let eighth = Settings::decode(&fs::read(folder.join("bead-8.settings")).unwrap()).unwrap();
    assert_eq!(eighth, paper());
}

#[test]
fn nothing_that_is_there_is_replaced_and_a_mistake_names_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let refused = |arguments: &str, why: &str| {
        let output = bead(folder, arguments);
        let said = said(&output);
        assert_eq!(
            (output.status.code(), said.lines().count()),
            (Some(2), 1),
            "{said}"
        );
        assert!(said.contains(why), "{arguments}: {said}");
    };
    bead(folder, "settings make --template bead.toml");
    let text = fs::read_to_string(folder.join("bead.toml")).unwrap();
    refused("settings make --template bead.toml", "bead.toml is there already");
    refused(
        "settings make bead.toml --out bead.toml --overwrite",
        "is an input of this command",
    );
    refused("settings make missing.toml", "missing.toml: cannot be read");
    bead(folder, "settings make bead.toml");
    refused(
        "settings make bead.toml",
        "bead.settings is there already; give another name, or --overwrite",
    );
    assert!(
        bead(folder, "settings make bead.toml --overwrite")
            .status
            .success()
    );
    let line = 1 + text.lines().position(|line| line.starts_with("damping")).unwrap();
    fs::write(
        folder.join("bad.toml"),
        text.replacen("damping = 12.0", "damping = 0", 1),
    )
    .unwrap();
    refused(
        "settings make bad.toml",
        &format!("bad.toml:{line}: intruder.damping: 0 is out of range"),
    );
    refused(
        "settings write bad.toml --port unix:nowhere",
        &format!("bad.toml:{line}: "),
    );
    assert_eq!(fs::read_to_string(folder.join("bead.toml")).unwrap(), text);
}

/// Runs `bead settings set` at a bead with these settings; gives what it printed and the block that it sent.
fn set(settings: &Settings, changes: &[&str]) -> (Output, Option<Vec<u8>>) {
    let folder = tempfile::tempdir().unwrap();
    let socket = folder.path().join("bead.sock");
    let listener = UnixListener::bind(&socket).unwrap();
    let mut sent = None;
    let output = thread::scope(|scope| {
        let sent = &mut sent;
        scope.spawn(move || {
            let (mut stream, _) = listener.accept().unwrap();
            let (mut buffer, mut decoder, mut sequence) = ([0; 4096], RequestDecoder::new(), 0);
            while let Ok(length @ 1..) = stream.read(&mut buffer) {
                for &byte in &buffer[..length] {
                    let Some(Ok(asked)) = decoder.push(byte) else {
                        continue;
                    };
                    let mut say = |message: &Message| {
                        let header = Header {
                            address: 0,
                            boot: 0,
                            sequence,
                            sample_index: 0,
                        };
                        sequence += 1;
                        let _ = stream.write_all(encode(&header, message, &mut [0; MAX_FRAME]).unwrap());
                    };
                    match &asked.request {
                        Ok(Request::WriteSettings { block }) => *sent = Some(block.bytes().to_vec()),
                        Ok(Request::ReadSettings) => {
                            let block = Block::try_from(&block(settings)[..]).unwrap();
                            say(&Told { block }.into());
                        }
                        _ => {}
                    }
                    let (request, outcome) = (asked.number, Outcome::Done);
                    let detail = "".into();
                    say(&Reply {
                        request,
                        outcome,
                        detail,
                    }
                    .into());
                }
            }
        });
        let port = format!("unix:{}", socket.display());
        let arguments = ["settings", "set", "--timeout", "2", "--port", &port];
        program::bead(Path::new("."), arguments.iter().chain(changes))
    });
    (output, sent)
}

#[test]
fn a_change_on_a_bead_is_told_before_it_is_sent_and_only_that_is_sent() {
    let (output, sent) = set(&paper(), &["name=left", "address=7"]);
    assert!(output.status.success(), "{}", said(&output));
    let told = String::from_utf8(output.stdout).unwrap();
    assert_eq!(told, "name: \"\" -> \"left\"\naddress: 0 -> 7\n");
    let named = Settings::decode(&sent.unwrap()).unwrap();
    let expected = paper().with(|bead| (bead.name, bead.address) = (Name::new("left").unwrap(), 7));
    assert_eq!(Ok(named), expected);

    let (output, sent) = set(&paper(), &["k=4e5"]);
    let told = String::from_utf8(output.stdout).unwrap();
    assert_eq!(told, "intruder.stiffness: 395000.0 -> 400000.0 N/m\n");
    let stiffer = Settings::decode(&sent.unwrap()).unwrap();
    let bead = Bead {
        stiffness: 4e5,
        ..Bead::paper()
    };
    assert_eq!(
        Ok(stiffer),
        derive(&bead, &FrontEnd::reference(), &Capture::default())
    );

    for (changes, status, why) in [
        (["k=395000.0", "c=12"], 0, "nothing is sent"),
        (["k=4e5", "--dry-run"], 0, "nothing is sent: --dry-run"),
        (["k=4e5", "c=-1"], 2, "intruder.damping: -1 is out of range"),
        (["k=4e5", "stiffness=1"], 2, "stiffness: no such key"),
    ] {
        let (output, sent) = set(&paper(), &changes);
        assert_eq!((output.status.code(), sent), (Some(status), None), "{changes:?}");
        assert!(said(&output).contains(why), "{}", said(&output));
    }
}
