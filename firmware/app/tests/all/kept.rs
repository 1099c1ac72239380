//! Strikes that the bead keeps: fetched later, they are bit for bit what was sent first.

use bead_testing::bodies;
use bead_wire::{ANY, Fetched, Kept, MAX_REQUEST, Message, Outcome, Request, encode_request};

use crate::bead::TestBead;

#[test]
fn strikes_are_listed_and_fetched_as_they_were_sent_until_newer_ones_take_their_place() {
    let mut bead = TestBead::new();
    for _ in 0..40 {
        bead.strike();
    }
    let (messages, reply) = bead.ask(&Request::ListKept);
    let kept: Vec<u32> = bodies(&messages).map(|kept: &Kept| kept.strike).collect();
    assert_eq!(reply.detail.as_str(), format!("{} strikes are kept", kept.len()));
    assert!(
        kept.len() >= 10 && kept.iter().copied().eq(40 - kept.len() as u32..40),
        "{kept:?}"
    );
    let fetch = |strike| Request::Fetch { boot: 0, strike };
    assert_eq!(bead.outcome(&fetch(kept[0] - 1)), Outcome::NotKept);
    assert_eq!(bead.outcome(&fetch(40)), Outcome::NotKept);
    for strike in [kept[0], 39] {
        let sent = bead.running.messages().filter(|message| match message {
            Message::Waveform(waveform) => waveform.strike == strike,
            Message::Strike(told) => told.strike == strike,
            Message::Shape(shape) => shape.strike == strike,
            _ => false,
        });
        let sent: Vec<_> = sent.cloned().collect();
        let (messages, reply) = bead.ask(&fetch(strike));
        assert_eq!(reply.outcome, Outcome::Done);
        let fetched = bodies(&messages).map(|fetched: &Fetched| fetched.message().expect("it decodes"));
        let fetched: Vec<_> = fetched.collect();
        assert!(matches!(fetched[0], Message::Settings(_)));
        assert_eq!(fetched[1..], sent);
    }
}

#[test]
fn a_fetch_that_strikes_leave_no_room_for_is_told_to_come_again() {
    let mut bead = TestBead::new();
    bead.strike();
    bead.running.line_is_free = false;
    // Frames that do not leave fill the outbox.
    for _ in 0..8 {
        bead.running.strike();
    }
    let before = bead.running.index;
    let mut buffer = [0; MAX_REQUEST];
    let fetch = Request::Fetch { boot: 0, strike: 0 };
    bead.receive(encode_request(ANY, 77, &fetch, &mut buffer).expect("it fits"));
    assert!(
        bead.running.index - before >= 50_000,
        "it waits for half a second"
    );
    bead.running.line_is_free = true;
    bead.run(0.2);
    assert_eq!(bead.running.replies(), [(77, Outcome::Busy)]);
}
