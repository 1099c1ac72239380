//! Strikes that the bead keeps: fetched later, they are bit for bit what was sent first, also after a reset.

use bead_testing::bodies;
use bead_tests::{Requests, RunFrames, faults_at, paper};
use bead_wire::{Fetched, Kept, Message, Outcome, Request};

/// The frames of a strike as they were sent first, the settings before them.
fn sent(received: &RunFrames, boot: u8, strike: u32) -> Vec<Message> {
    let of_strike = |message: &Message| match message {
        Message::Waveform(waveform) => waveform.strike == strike,
        Message::Strike(said) => said.strike == strike,
        Message::Shape(shape) => shape.strike == strike,
        _ => false,
    };
    let frames = received.frames.iter().filter(|frame| frame.header.boot == boot);
    let settings = frames
        .clone()
        .map(|frame| &frame.message)
        .find(|message| matches!(message, Message::Settings(_)));
    let of_strike = frames.map(|frame| &frame.message).filter(|m| of_strike(m));
    settings.into_iter().chain(of_strike).cloned().collect()
}

/// The frames of a strike that were sent again, in the order in which they came.
fn fetched(received: &RunFrames, boot: u32, strike: u32) -> Vec<Message> {
    let of_strike = |frame: &&Fetched| (frame.boot, frame.strike) == (boot, strike);
    let frames: Vec<&Fetched> = received.all().filter(of_strike).collect();
    for (part, frame) in frames.iter().enumerate() {
        assert_eq!(
            (usize::from(frame.part), usize::from(frame.parts)),
            (part, frames.len())
        );
    }
    let messages = frames.into_iter().map(|frame| frame.message());
    messages
        .map(|message| message.unwrap_or_else(|cause| panic!("{cause}")))
        .collect()
}

#[test]
fn strikes_outlive_a_reset_by_the_watchdog() {
    // One before the reset, one after it: both have the number 0.
    let mut run = paper(2, 2.8, Some(1));
    run.faults = faults_at(&[(0.5, "hang")]);
    let mut requests = Requests::new(&run);
    let list = requests.request(2.95, &Request::ListKept);
    let numbers = [0, 1].map(|boot| {
        let fetch = Request::Fetch { boot, strike: 0 };
        requests.request(3.0 + 0.1 * f64::from(boot), &fetch)
    });
    let answered = requests.run();
    assert_eq!(answered.outcome.resets.len(), 1);
    let listed = answered.received.answered(list);
    assert_eq!(bodies::<Kept>(listed).count(), 2);
    for (boot, number) in (0..).zip(numbers) {
        assert_eq!(answered.received.answer(number).0, Outcome::Done);
        let again = fetched(&answered.received, boot, 0);
        assert_eq!(again, sent(&answered.received, boot as u8, 0));
        assert_eq!(again.len(), 24);
    }
}
