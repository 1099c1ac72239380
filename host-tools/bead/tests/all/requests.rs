//! `bead command`, `bead settings` and `bead fetch` over lines that lose frames and at beads that misbehave.

use std::fs;
use std::os::unix::net::UnixListener;
use std::process::Output;

use crate::program::{self, TestFolder, asked, assert_says, refused, said, until};
use bead_testing::Speaker;
use bead_wire::{
    Block, Check, Codes, Identity, Kept, Link, Outcome, Raw, ReceivedRequest, Request, SelfTest, Settings,
};

/// Runs `bead` at a bead that answers each request by `answer`, which adds 1 to the bead's sequence to lose a
/// frame.
fn at_bead(arguments: &str, mut answer: impl FnMut(&mut Speaker, &ReceivedRequest) + Send) -> Output {
    let mut bead = Speaker::default();
    let folder = TestFolder::new();
    let arguments = format!("{arguments} --timeout 0.3");
    asked(&folder, &arguments, |bytes| bead.answer(bytes, &mut answer))
}

#[test]
fn a_bead_that_says_nothing_gets_one_line_and_status_3_after_three_tries() {
    let mut heard = Vec::new();
    let folder = TestFolder::new();
    let output = asked(&folder, "command arm --timeout 0.3", |bytes| {
        heard.extend_from_slice(bytes);
        Vec::new()
    });
    refused(&output, 3, "no reply");
    assert_says(&said(&output), "nothing came at all");
    // Each copy is the same, under the same number.
    let third = heard.len() / 3;
    assert!(third > 0 && heard == heard[..third].repeat(3));
}

#[test]
fn only_the_reply_to_its_own_request_ends_a_command() {
    // The bead sends, and never replies.
    let deaf = at_bead("command arm", |bead, _| {
        let block = Block::try_from(&[1][..]).unwrap();
        bead.say(0, Settings { block });
    });
    refused(&deaf, 3, "PA10");
    // A reply to somebody else comes first, and the answer to the first copy is lost.
    let mut copies = 0;
    let busy = at_bead("command arm", |bead, asked| {
        copies += 1;
        bead.reply(asked.number.wrapping_add(1), Outcome::Kind);
        if copies > 1 {
            bead.reply(asked.number, Outcome::Done);
        }
    });
    assert_eq!((said(&busy), copies), (String::new(), 2));
    program::done(busy);
    // The frame before the reply is lost.
    let lossy = at_bead("command status", |bead, asked| {
        bead.sequence += 1;
        bead.reply(asked.number, Outcome::Done);
    });
    refused(&lossy, 3, "status frame was lost");
    assert!(lossy.stdout.is_empty());
}

#[test]
fn a_key_that_the_bead_may_have_taken_is_kept() {
    let folder = TestFolder::new();
    let key = folder.join("new.key");
    let mut copies = 0;
    let give = format!("settings key --new {}", key.display());
    let output = at_bead(&give, |bead, asked| {
        let is_key = matches!(asked.request, Ok(Request::SetKey { .. }));
        copies += u32::from(is_key);
        if is_key && copies > 1 {
            // The bead refuses the unsigned copy.
            bead.reply(asked.number, Outcome::Unsigned);
        } else {
            // The bead takes the key, and its reply is lost. So is the bead's identity, which would show
            // that it has the key.
            bead.sequence += 1;
            if !is_key {
                bead.reply(asked.number, Outcome::Done);
            }
        }
    });
    assert_eq!(output.status.code(), Some(3));
    assert_says(&said(&output), "may have taken the key in");
    assert!(key.exists());
}

#[test]
fn a_key_that_is_being_given_when_the_command_is_interrupted_is_told() {
    let folder = TestFolder::new();
    let _silent = UnixListener::bind(folder.join("bead.sock")).unwrap();
    let give = "settings key --new new.key --port unix:bead.sock --timeout 60";
    let giving = folder.start(give);
    until("the key is made", || folder.join("new.key").exists());
    let said = giving.interrupt(130);
    let part = "interrupted; the bead may have taken the key in new.key: keep it";
    assert_says(&said, part);
}

#[test]
fn a_self_test_of_which_a_part_is_lost_is_asked_for_again() {
    // The check of the acceleration fails. Its result is lost in the first `lossy` answers.
    let tested = |lossy: u32| {
        let mut copies = 0;
        at_bead("command self-test", |bead, asked| {
            copies += 1;
            for check in (0..8).map(Check::from_number) {
                let (passed, value) = (check != Check::Acceleration, 1);
                let test = SelfTest { check, passed, value };
                let frame = bead.frame(0, &test.into());
                if passed || copies > lossy {
                    bead.bytes.extend(frame);
                }
            }
            bead.reply(asked.number, Outcome::Done);
        })
    };
    refused(&tested(1), 1, "failed: acceleration;");
    let output = tested(u32::MAX);
    refused(&output, 3, "was lost on the way");
    assert!(output.stdout.is_empty());
}

#[test]
fn a_list_of_which_a_part_is_lost_is_asked_for_again_and_names_each_strike_once() {
    // The first list lacks a frame, the second its reply, and the last comes twice.
    let mut lists = [&[1, 2][..], &[0, 1, 2], &[0, 1, 2], &[0, 1, 2, 0, 1, 2]].into_iter();
    let output = at_bead("fetch --format json", |bead, asked| {
        if asked.request != Ok(Request::ListKept) {
            bead.say(0, bead.identity());
            return bead.reply(asked.number, Outcome::Done);
        }
        let strikes = lists.next().unwrap();
        bead.sequence += u32::from(lists.len() == 3);
        let (boot, parts, bytes) = (0, 4, 100);
        let kept = |strike| Kept {
            boot,
            strike,
            parts,
            bytes,
        };
        strikes.iter().for_each(|&strike| bead.say(0, kept(strike)));
        if lists.len() == 2 {
            bead.sequence += 1;
        } else {
            bead.reply(asked.number, Outcome::Done);
        }
    });
    let listed = program::json(output);
    let strikes = listed["strikes"].as_array().unwrap().iter();
    assert!(strikes.map(|kept| &kept["strike"]).eq([0, 1, 2]));
    assert_eq!(lists.len(), 0);
}

#[test]
fn a_line_end_in_the_text_of_a_bead_begins_no_row() {
    let output = at_bead("command identity", |bead, asked| {
        let firmware = "1\nboot  7".into();
        let identity = bead.identity();
        bead.say(0, Identity { firmware, ..identity });
        bead.reply(asked.number, Outcome::Done);
    });
    assert_says(&program::done(output), "1\\u000aboot  7\n");
}

#[test]
fn of_a_raw_stream_without_end_so_much_is_kept_as_a_bead_may_send() {
    const SENT: u64 = (1 << 17) + 10;
    let folder = TestFolder::new();
    let scans = folder.join("scans.csv");
    let stream = format!("command raw --duration 0.001 --out {}", scans.display());
    let output = at_bead(&stream, |bead, asked| {
        let mut link = Link::default();
        match asked.request {
            Ok(Request::Identity) => bead.say(0, bead.identity()),
            Ok(Request::Raw { .. }) => link.raw_sent = SENT,
            _ => bead.say(0, link),
        }
        bead.reply(asked.number, Outcome::Done);
        let (first_index, codes) = (0, Codes::pack([[1, 2]]).unwrap());
        let raw = Raw { first_index, codes };
        (0..link.raw_sent).for_each(|_| bead.say(0, raw.clone()));
        if link.raw_sent > 0 {
            bead.say(0, link);
        }
    });
    let printed = program::done(output);
    let rows = fs::read_to_string(&scans).unwrap().lines().count();
    assert_eq!(rows, 1 + (1 << 17));
    assert_says(&printed, "131072 of 131082 scans received");
    assert_says(&printed, "10 were lost on it");
}
