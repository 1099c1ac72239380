//! `bead command`, `bead settings` and `bead fetch` at a line where something is wrong.

use std::fs;
use std::io::{Read, Write};
use std::os::unix::net::UnixListener;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::thread;
use std::time::Duration;

use crate::program::{self, said};
use bead_wire::{
    Block, Check, Codes, Header, Heard, Identity, Kept, Link, MAX_FRAME, Message, Outcome, Raw, Reply,
    Request, RequestDecoder, ResetCauses, SelfTest, Settings, encode,
};
use serde_json::{Value, json};

/// Runs `bead` with `--port` at a socket. The other end answers what it reads with `peer`, until `bead` hangs
/// up.
fn at(mut peer: impl FnMut(&[u8]) -> Vec<u8> + Send, arguments: impl FnOnce(&Path) -> Vec<String>) -> Output {
    let folder = tempfile::tempdir().unwrap();
    let socket = folder.path().join("bead.sock");
    let listener = UnixListener::bind(&socket).unwrap();
    thread::scope(|scope| {
        scope.spawn(move || {
            let (mut stream, _) = listener.accept().unwrap();
            let mut buffer = [0; 4096];
            while let Ok(length @ 1..) = stream.read(&mut buffer) {
                // A program that hung up meanwhile reads no more.
                let _ = stream.write_all(&peer(&buffer[..length]));
            }
        });
        Command::new(env!("CARGO_BIN_EXE_bead"))
            .args(arguments(folder.path()))
            .args([
                "--port",
                &format!("unix:{}", socket.display()),
                "--timeout",
                "0.3",
            ])
            .output()
            .unwrap()
    })
}

fn command(name: &str) -> impl FnOnce(&Path) -> Vec<String> + use<> {
    let arguments = ["command", name].map(str::to_owned).to_vec();
    |_| arguments
}

fn frame(sequence: u32, message: &Message) -> Vec<u8> {
    let header = Header {
        address: 0,
        boot: 0,
        sequence,
        sample_index: 0,
    };
    encode(&header, message, &mut [0; MAX_FRAME]).unwrap().to_vec()
}

/// A bead that gives each request the same outcome, under the request's number.
fn replying(outcome: Outcome, detail: &'static str) -> impl FnMut(&[u8]) -> Vec<u8> {
    let mut decoder = RequestDecoder::new();
    let mut sequence = 0;
    move |bytes| {
        let mut said = Vec::new();
        for &byte in bytes {
            if let Some(Ok(numbered)) = decoder.push(byte) {
                let reply = Reply {
                    request: numbered.number,
                    outcome,
                    detail: detail.into(),
                };
                said.extend(frame(sequence, &Message::Reply(reply)));
                sequence += 1;
            }
        }
        said
    }
}

#[test]
fn a_bead_that_says_nothing_gets_one_line_and_status_3_after_three_tries() {
    let mut heard = Vec::new();
    let output = at(
        |bytes| {
            heard.extend_from_slice(bytes);
            Vec::new()
        },
        command("arm"),
    );
    assert_eq!(output.status.code(), Some(3));
    let said = said(&output);
    assert_eq!(said.lines().count(), 1, "{said}");
    assert!(
        said.contains("no reply") && said.contains("nothing came at all"),
        "{said}"
    );
    // Each copy is the same, under the same number.
    let third = heard.len() / 3;
    assert!(third > 0 && heard.chunks(third).all(|request| request == &heard[..third]));
    assert_eq!(heard.len(), 3 * third);
}

#[test]
fn bytes_that_are_no_frames_are_told_from_a_bead_that_sends_and_does_not_reply() {
    let noise = at(|_| vec![0x55; 300], command("arm"));
    assert_eq!(noise.status.code(), Some(3));
    assert!(said(&noise).contains("--baud"), "{}", said(&noise));
    let deaf = at(
        |_| {
            frame(
                9,
                &Message::Settings(Settings {
                    block: Block::try_from(&[1][..]).unwrap(),
                }),
            )
        },
        command("arm"),
    );
    assert_eq!(deaf.status.code(), Some(3));
    assert!(said(&deaf).contains("PA10"), "{}", said(&deaf));
}

#[test]
fn a_reply_to_somebody_else_is_not_taken_for_ours() {
    let mut peer = replying(Outcome::Done, "");
    let output = at(
        move |bytes| {
            // The number of another request.
            let mut other = RequestDecoder::new();
            let mut said = Vec::new();
            for &byte in bytes {
                if let Some(Ok(numbered)) = other.push(byte) {
                    let reply = Reply {
                        request: numbered.number.wrapping_add(1),
                        outcome: Outcome::Kind,
                        detail: "not yours".into(),
                    };
                    said = frame(100, &Message::Reply(reply));
                }
            }
            said.extend(peer(bytes));
            said
        },
        command("arm"),
    );
    assert_eq!((output.status.code(), said(&output)), (Some(0), String::new()));
}

#[test]
fn a_lost_reply_is_asked_for_again() {
    let mut peer = replying(Outcome::Done, "");
    let mut asked = 0;
    let output = at(
        |bytes| {
            asked += 1;
            let said = peer(bytes);
            if asked == 1 { Vec::new() } else { said }
        },
        command("disarm"),
    );
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(asked, 2);
}

#[test]
fn a_refusal_prints_the_beads_reason_and_ends_with_status_1() {
    let output = at(replying(Outcome::FlashFailed, "worn out"), |folder| {
        let file = folder.join("some.settings");
        std::fs::write(&file, "anything").unwrap();
        ["settings", "write", &file.display().to_string()]
            .map(str::to_owned)
            .to_vec()
    });
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(
        said(&output),
        "bead: the bead at address 0 refused: flash failed; worn out\n"
    );
}

#[test]
fn an_answer_whose_frame_is_lost_is_no_answer() {
    let output = at(replying(Outcome::Done, ""), command("status"));
    assert_eq!(output.status.code(), Some(3));
    assert!(
        said(&output).contains("status frame was lost"),
        "{}",
        said(&output)
    );
    assert!(output.stdout.is_empty());
}

#[test]
fn a_file_that_is_no_settings_is_refused_before_any_bead_is_asked() {
    let folder = tempfile::tempdir().unwrap();
    let show = |bytes: &[u8]| {
        let file = folder.path().join("some.settings");
        std::fs::write(&file, bytes).unwrap();
        Command::new(env!("CARGO_BIN_EXE_bead"))
            .args(["settings", "show"])
            .arg(&file)
            .output()
            .unwrap()
    };
    for bytes in [&b""[..], b"no settings", &[0xFF; 64], &[0; 300]] {
        let output = show(bytes);
        assert_eq!(output.status.code(), Some(2));
        let said = said(&output);
        assert_eq!(said.lines().count(), 1, "{said}");
        assert!(said.contains("some.settings"), "{said}");
    }
}

/// A bead that answers each request with the messages that `answer` gives. Where it gives none, a frame is
/// lost on the way.
fn answering(mut answer: impl FnMut(&Heard) -> Vec<Option<Message>>) -> impl FnMut(&[u8]) -> Vec<u8> {
    let mut decoder = RequestDecoder::new();
    let mut sequence = 0;
    move |bytes| {
        let mut said = Vec::new();
        for &byte in bytes {
            if let Some(Ok(heard)) = decoder.push(byte) {
                for message in answer(&heard) {
                    said.extend(message.iter().flat_map(|message| frame(sequence, message)));
                    sequence += 1;
                }
            }
        }
        said
    }
}

fn reply(heard: &Heard, outcome: Outcome) -> Option<Message> {
    let reply = Reply {
        request: heard.number,
        outcome,
        detail: "".into(),
    };
    Some(reply.into())
}

fn identity(firmware: &str) -> Option<Message> {
    let identity = Identity {
        firmware: firmware.into(),
        git: "abc".into(),
        uid: [1; 12],
        boot: 0,
        reset_cause: ResetCauses::NONE,
        sample_rate_hz: 100_000,
        channels: 4,
    };
    Some(identity.into())
}

#[test]
fn a_key_that_the_bead_may_have_taken_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let key = folder.path().join("new.key");
    let mut given = 0;
    let output = at(
        answering(|heard| match heard.request {
            // The bead takes the key, and its reply is lost. Then it refuses what is not signed.
            Ok(Request::SetKey { .. }) => {
                given += 1;
                let unsigned = reply(heard, Outcome::Unsigned);
                vec![unsigned.filter(|_| given > 1)]
            }
            // Its identity is lost too: whether it has the key cannot be found out.
            _ => vec![None, reply(heard, Outcome::Done)],
        }),
        |_| {
            ["settings", "key", "--new", &key.display().to_string()]
                .map(str::to_owned)
                .to_vec()
        },
    );
    assert_eq!(output.status.code(), Some(3));
    let said = said(&output);
    assert!(said.contains("may have taken the key in"), "{said}");
    assert!(key.exists(), "{said}");
}

#[test]
fn a_key_that_is_being_given_when_the_command_is_interrupted_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let _silent = UnixListener::bind(folder.path().join("bead.sock")).unwrap();
    let giving = program::interruptible(folder.path())
        .args(["settings", "key", "--new", "new.key", "--port", "unix:bead.sock"])
        .args(["--timeout", "60"])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    while !folder.path().join("new.key").exists() {
        thread::sleep(Duration::from_millis(1));
    }
    let kill = format!("kill -INT {}", giving.id());
    assert!(Command::new("sh").args(["-c", &kill]).status().unwrap().success());
    let output = giving.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    let said = said(&output);
    assert!(
        said.contains("interrupted; the bead may have taken the key in new.key: keep it"),
        "{said}"
    );
}

/// A bead whose acceleration fails; of the first `lossy` answers that result is lost.
fn tested(lossy: u32) -> Output {
    let mut asked = 0;
    at(
        answering(|heard| {
            asked += 1;
            let check = |number| {
                let check = Check::from_number(number);
                let passed = check != Check::Acceleration;
                let test = SelfTest {
                    check,
                    passed,
                    value: 1,
                };
                Some(test.into()).filter(|_| passed || asked > lossy)
            };
            (0..8).map(check).chain([reply(heard, Outcome::Done)]).collect()
        }),
        command("self-test"),
    )
}

#[test]
fn a_self_test_of_which_a_part_is_lost_is_asked_for_again() {
    let output = tested(1);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        said(&output).contains("failed: acceleration;"),
        "{}",
        said(&output)
    );
    let output = tested(u32::MAX);
    assert_eq!(output.status.code(), Some(3));
    assert!(said(&output).contains("was lost on the way"), "{}", said(&output));
    assert!(output.stdout.is_empty());
}

#[test]
fn a_list_of_which_a_part_is_lost_is_asked_for_again_and_names_each_strike_once() {
    let mut lists = 0;
    let output = at(
        answering(|heard| {
            let kept = |strike| {
                let kept = Kept {
                    boot: 0,
                    strike,
                    parts: 4,
                    bytes: 100,
                };
                Some(kept.into())
            };
            let done = reply(heard, Outcome::Done);
            if heard.request != Ok(Request::ListKept) {
                return vec![identity("0.1.0"), done];
            }
            lists += 1;
            match lists {
                1 => vec![None, kept(1), kept(2), done],
                // The reply is lost: the next copy has the same number.
                2 => vec![kept(0), kept(1), kept(2), None],
                3 => vec![kept(0), kept(1), kept(2), done],
                // An answer to a copy came late.
                _ => vec![kept(0), kept(1), kept(2), kept(0), kept(1), kept(2), done],
            }
        }),
        |_| ["fetch", "--format", "json"].map(str::to_owned).to_vec(),
    );
    let listed: Value = program::json(&output);
    let strikes = listed["strikes"].as_array().unwrap();
    let strikes: Vec<_> = strikes.iter().map(|kept| &kept["strike"]).collect();
    assert_eq!(strikes, [&json!(0), &json!(1), &json!(2)]);
    assert_eq!(lists, 4);
}

#[test]
fn a_line_end_in_the_text_of_a_bead_begins_no_row() {
    let output = at(
        answering(|heard| vec![identity("1\nboot  7"), reply(heard, Outcome::Done)]),
        command("identity"),
    );
    let shown = String::from_utf8(output.stdout).unwrap();
    assert!(shown.contains("1\\u000aboot  7\n"), "{shown}");
}

#[test]
fn more_than_a_day_is_not_waited_for() {
    let folder = tempfile::tempdir().unwrap();
    let wait = [
        "command",
        "identity",
        "--port",
        "unix:none.sock",
        "--timeout",
        "1e19",
    ];
    let output = program::bead(folder.path(), wait);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        said(&output).contains("at most 86400, a day"),
        "{}",
        said(&output)
    );
}

#[test]
fn of_a_raw_stream_without_end_so_much_is_kept_as_a_bead_may_send() {
    const SENT: u32 = (1 << 17) + 10;
    let folder = tempfile::tempdir().unwrap();
    let scans = folder.path().join("scans.csv");
    let output = at(
        answering(|heard| {
            let link = |raw_sent| {
                let link = Link {
                    raw_sent,
                    ..Link::default()
                };
                Some(link.into())
            };
            let done = reply(heard, Outcome::Done);
            match heard.request {
                Ok(Request::Identity) => vec![identity("0.1.0"), done],
                Ok(Request::Raw { .. }) => {
                    let codes = Codes::pack([[1, 2]]).unwrap();
                    let raw = Raw {
                        first_index: 0,
                        codes,
                    };
                    let pieces = (0..SENT).map(|_| Some(raw.clone().into()));
                    [done]
                        .into_iter()
                        .chain(pieces)
                        .chain([link(SENT.into())])
                        .collect()
                }
                _ => vec![link(0), done],
            }
        }),
        |_| {
            let out = scans.display().to_string();
            ["command", "raw", "--duration", "0.001", "--out", &out]
                .map(str::to_owned)
                .to_vec()
        },
    );
    assert!(output.status.success(), "{}", said(&output));
    let rows = fs::read_to_string(&scans).unwrap().lines().count();
    assert_eq!(rows, 1 + (1 << 17));
    let told = String::from_utf8(output.stdout).unwrap();
    assert!(told.contains("131072 of 131082 scans received"), "{told}");
    assert!(told.contains("10 were lost on it"), "{told}");
}
