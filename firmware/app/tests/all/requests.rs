//! Requests are done or refused by name.

use bead_testing::{bodies, framed};
use bead_wire::{
    ANY, Check, Kind, Link, MAX_REQUEST, Message, Outcome, Raw, Request, SelfTest, Standing, VERSION,
    encode_request,
};

use crate::bead::{TestBead, status, struck};

#[test]
fn what_is_no_request_of_this_version_is_refused_by_name_and_nothing_else_happens() {
    let mut bead = TestBead::new();
    for payload in [
        &[VERSION + 1, 64, 1, 0, ANY][..],
        &[VERSION, 99, 2, 0, ANY],
        &[VERSION, 69, 3, 0, ANY, 7],
        &[VERSION, 72, 4, 0, ANY],
        &[VERSION, 67, 5, 0, ANY, 9, 1, 2],
    ] {
        bead.receive(&framed(payload));
    }
    let mut buffer = [0; MAX_REQUEST];
    let disarm = encode_request(ANY, 6, &Request::Disarm, &mut buffer).expect("it fits");
    let mut corrupt = disarm.to_vec();
    corrupt[3] ^= 1;
    bead.receive(&corrupt);
    bead.run(0.05);
    // A request whose number cannot be trusted gets no reply.
    let expected = [
        Outcome::Version,
        Outcome::Kind,
        Outcome::Body,
        Outcome::Body,
        Outcome::Body,
    ];
    assert!(bead.running.replies().into_iter().eq((1..).zip(expected)));
    let (status, _, link, _) = status(&mut bead);
    let expected = Link {
        bytes: link.bytes,
        rejected_version: 1,
        rejected_kind: 1,
        rejected_trailing: 1,
        rejected_body: 2,
        rejected_crc: 1,
        ..Link::default()
    };
    assert_eq!(link, expected);
    assert!(status.armed);
}

#[test]
fn each_request_is_answered_with_what_it_asks_for() {
    use Kind::{Board, Guard, Health, Identity, Image, Link, Load, SelfTest, Settings, Status};
    let mut bead = TestBead::new();
    bead.run(0.05);
    for (request, expected) in [
        (Request::Identity, &[Identity, Board][..]),
        (Request::Status, &[Status, Health, Link, Guard, Load]),
        (Request::ReadSettings, &[Settings]),
        (Request::SelfTest, &[SelfTest; 8]),
        (Request::Image, &[Image]),
    ] {
        let (messages, _) = bead.ask(&request);
        let kinds: Vec<_> = messages.iter().map(Message::kind).collect();
        assert_eq!(kinds, expected, "{request:?}");
    }
}

#[test]
fn a_disarmed_bead_measures_what_it_has_begun_and_no_other_strike_until_it_is_armed() {
    let mut quiet = TestBead::new();
    let expected = quiet.strike();
    let mut bead = TestBead::new();
    bead.running.signal = Box::new(|index| struck(index, 251));
    bead.run(0.004);
    assert_eq!(bead.outcome(&Request::Disarm), Outcome::Done);
    bead.run(0.05);
    assert_eq!(bead.running.strikes(), expected);
    assert_eq!(bead.strike(), []);
    assert!(!status(&mut bead).0.armed);
    assert_eq!(bead.outcome(&Request::Arm), Outcome::Done);
    bead.run(0.01);
    assert_eq!(bead.strike()[0].strike, 1);
    assert!(status(&mut bead).0.armed);
}

#[test]
fn a_raw_stream_ends_when_asked_leaves_room_for_strikes_and_is_refused_if_it_is_too_long() {
    let mut bead = TestBead::new();
    let raw = |duration_ms| Request::Raw { duration_ms };
    let refused = bead.answer(&raw(10_001));
    assert_eq!(
        refused,
        (Outcome::OutOfRange, "a raw stream lasts 10000 ms at most".into())
    );
    assert_eq!(bead.outcome(&raw(10_000)), Outcome::Done);
    bead.run(0.1);
    assert_eq!(bead.strike().len(), 1);
    bead.run(0.1);
    assert_eq!(bead.outcome(&raw(0)), Outcome::Done);
    let link = status(&mut bead).2;
    let scans = link.raw_sent + link.raw_dropped;
    assert!(
        (24_000..34_000).contains(&scans) && link.raw_dropped > 0,
        "{link:?}"
    );
    let told = bead.running.all::<Raw>().map(|raw| raw.codes.len() as u64);
    assert_eq!(told.sum::<u64>(), link.raw_sent);
    bead.run(0.1);
    assert_eq!(status(&mut bead).2.raw_sent, link.raw_sent);
    assert_eq!(bead.running.lost(), 0, "what is dropped of it takes no number");
}

#[test]
fn counters_are_reset_and_what_identifies_a_strike_is_not() {
    let mut bead = TestBead::new();
    bead.receive(&[9, 1, 0]);
    bead.strike();
    bead.running.bead.update(|c| c.overruns += 1);
    let (before, _, link, _) = status(&mut bead);
    assert_eq!((before.overruns, link.rejected_cobs), (1, 1));
    assert_eq!(bead.outcome(&Request::ResetCounters), Outcome::Done);
    let (after, health, link, _) = status(&mut bead);
    assert_eq!((after.overruns, link.rejected_cobs), (0, 0));
    assert_eq!((after.strikes, health.supply_mv), (1, 3300));
    assert_eq!(bead.strike()[0].strike, 1);
}

#[test]
fn a_self_test_passes_or_names_what_fails() {
    let mut bead = TestBead::new();
    let (messages, reply) = bead.ask(&Request::SelfTest);
    assert_eq!(reply.detail.as_str(), "8 of 8 checks passed");
    assert!(bodies(&messages).all(|test: &SelfTest| test.passed));
    bead.running.signal = Box::new(|index| {
        let [_, _, acceleration, wide] = crate::bead::quiet(index);
        [1000, 1000, acceleration, wide]
    });
    bead.running.hardware.supply_is_low.set(true);
    bead.run(0.1);
    let (messages, reply) = bead.ask(&Request::SelfTest);
    assert_eq!(reply.detail.as_str(), "6 of 8 checks passed");
    let failed = bodies(&messages).filter(|test: &&SelfTest| !test.passed);
    assert!(failed.map(|test| test.check).eq([Check::Supply, Check::Force]));
    let standing = Standing::SUPPLY_LOW.with(Standing::FORCE_STUCK);
    assert_eq!(status(&mut bead).1.standing, standing);
}

#[test]
fn a_reboot_sends_what_waits_or_gives_up_after_half_a_second() {
    let mut bead = TestBead::new();
    bead.running.signal = Box::new(|index| struck(index, 251));
    bead.run(0.008);
    let bead = bead.reboot(&Request::Reboot);
    assert_eq!(bead.running.boot.number, 1);
    let mut stalled = TestBead::new();
    stalled.running.line_is_free = false;
    let bead = stalled.reboot(&Request::Reboot);
    assert_eq!(bead.running.boot.number, 1);
}

#[test]
fn frames_are_numbered_past_2_to_the_32_and_none_is_lost() {
    let mut bead = TestBead::new();
    bead.run(0.05);
    bead.running.bead.update(|c| c.frames = u32::MAX - 5);
    bead.running.frames.clear();
    bead.strike();
    let frames = bead.running.frames.iter();
    let numbers: Vec<_> = frames.map(|(header, _)| header.sequence).collect();
    assert_eq!(numbers[0], u32::MAX - 5);
    assert!(numbers.is_sorted_by(|before, next| before.wrapping_add(1) == *next));
    assert!(numbers.len() > 10, "it wrapped");
}
