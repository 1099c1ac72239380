//! `bead command` and `bead settings` at a line where something is wrong.

use std::io::{Read, Write};
use std::os::unix::net::UnixListener;
use std::path::Path;
use std::process::{Command, Output};
use std::thread;

use crate::program::said;
use bead_wire::{Block, Header, MAX_FRAME, Message, Outcome, Reply, RequestDecoder, Settings, encode};

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
