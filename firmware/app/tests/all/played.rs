//! A bead that plays to itself, on a bench.

use std::cell::RefCell;
use std::rc::Rc;

use bead_model::made_up::played;
use bead_testing::bodies;
use bead_wire::{Image, Message, Outcome, Played, Raw, Request, Strike, StrikeFlags};

use crate::bead::{TestBead, quiet, struck};

/// A bead whose outputs are wired to its inputs, with some noise. While the outputs are off, its inputs are
/// quiet, or struck at the scan in the cell.
fn wired() -> (TestBead, Rc<RefCell<Option<u64>>>) {
    let mut bead = TestBead::new();
    let hardware = bead.running.hardware;
    let strike = Rc::new(RefCell::new(None));
    let at = Rc::clone(&strike);
    bead.running.signal = Box::new(move |index| {
        let own = quiet(index);
        let Some([force, acceleration]) = hardware.outputs.borrow().at(index) else {
            return at.borrow().map_or(own, |start| struck(index, start));
        };
        let noise = own.map(|code| code & 1);
        [force + noise[0], own[1], acceleration + noise[2], own[3]]
    });
    bead.run(0.05);
    (bead, strike)
}

fn of_play(messages: &[Message]) -> (Vec<Played>, Vec<Strike>) {
    (
        bodies(messages).copied().collect(),
        bodies(messages).copied().collect(),
    )
}

#[test]
fn strikes_that_are_played_are_flagged_and_those_before_and_after_are_not() {
    let (mut bead, strike) = wired();
    let hit = |bead: &mut TestBead| {
        *strike.borrow_mut() = Some(bead.running.index + 1000);
        bead.run(0.06);
        *strike.borrow_mut() = None;
        let strikes = bead.running.strikes();
        strikes[strikes.len() - 1]
    };
    assert!(!hit(&mut bead).flags.has(StrikeFlags::PLAYED));
    let pulls = bead.running.hardware.line_pulls.borrow().len();
    let (said, reply) = bead.ask(&Request::Play {
        strikes: 3,
        interval_ms: 30,
    });
    assert_eq!(reply.outcome, Outcome::Done);
    let (played, strikes) = of_play(&said);
    assert_eq!((played.len(), strikes.len()), (3, 3));
    for (played, strike) in played.iter().zip(&strikes) {
        assert!(strike.flags.has(StrikeFlags::PLAYED) && played.complete);
        assert_eq!(
            strike.trigger_index,
            played.first_index + 1,
            "the second code is the first that rises"
        );
    }
    assert_eq!(
        bead.running.hardware.line_pulls.borrow().len(),
        pulls,
        "no other bead hears of it"
    );
    assert_eq!(bead.running.hardware.outputs.borrow().at(0), None, "off");
    assert!(!hit(&mut bead).flags.has(StrikeFlags::PLAYED));
}

#[test]
fn a_bead_is_armed_while_it_plays_and_then_again_as_before() {
    let (mut bead, strike) = wired();
    assert_eq!(bead.outcome(&Request::Disarm), Outcome::Done);
    let play = Request::Play {
        strikes: 1,
        interval_ms: 5,
    };
    assert_eq!(of_play(&bead.ask(&play).0).1.len(), 1);
    bead.run(0.05);
    *strike.borrow_mut() = Some(bead.running.index + 1000);
    bead.run(0.06);
    assert_eq!(bead.running.strikes().len(), 1, "disarmed");
}

#[test]
fn a_level_is_held_while_its_scans_are_sent_and_no_strike_comes_of_it() {
    let (mut bead, _) = wired();
    let hold = |force, acceleration| Request::Hold {
        force,
        acceleration,
        duration_ms: 20,
    };
    for codes in [[400, 3700], [3700, 400]] {
        let (said, reply) = bead.ask(&hold(codes[0], codes[1]));
        assert_eq!(reply.outcome, Outcome::Done);
        let (played, strikes) = of_play(&said);
        assert_eq!((played.len(), strikes), (1, vec![]));
        let scans = played[0].first_index..played[0].first_index + u64::from(played[0].scans);
        let mut seen = 0;
        for raw in bodies::<Raw>(&said) {
            for (index, found) in (raw.first_index..).zip(raw.codes.iter()) {
                assert!(scans.contains(&index), "{index} {scans:?}");
                assert_eq!([found[0] & !1, found[1] & !1], codes);
                seen += 1;
            }
        }
        assert!(seen > 500, "{seen}");
    }
    bead.run(0.05);
    assert_eq!(bead.running.strikes(), []);
}

#[test]
fn what_would_last_too_long_or_is_no_code_is_refused_and_nothing_is_switched_on() {
    let (mut bead, _) = wired();
    let hold = |force, acceleration, duration_ms| Request::Hold {
        force,
        acceleration,
        duration_ms,
    };
    let play = |strikes, interval_ms| Request::Play { strikes, interval_ms };
    for request in [
        hold(4096, 0, 1),
        hold(0, 4096, 1),
        hold(0, 0, 401),
        play(1, 4),
        play(5, 81),
        play(u32::MAX, u32::MAX),
    ] {
        assert_eq!(bead.outcome(&request), Outcome::OutOfRange, "{request:?}");
    }
    assert_eq!(bead.running.hardware.outputs.borrow().at(0), None);
}

#[test]
fn the_image_is_told_by_its_length_and_its_checksum() {
    let (mut bead, _) = wired();
    let (said, _) = bead.ask(&Request::Image);
    let image: &Image = bodies(&said).next().expect("it is told");
    // `printf 'an image' | gzip -c | tail -c8` prints both.
    assert_eq!((image.bytes, image.crc), (8, 0xa659_be80));
    assert_eq!(played().count(), 250);
}
