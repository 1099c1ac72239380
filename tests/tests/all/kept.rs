//! Strikes that the bead keeps: fetched later, they are bit for bit what was sent first, also after a reset.

use bead_bench::emulation::Emulation;
use bead_bench::faults;
use bead_tests::{Answered, Heard, Requests, paper};
use bead_wire::{Fetched, Kept, Message, Outcome, Request};

/// The frames of a strike as they were sent first, the settings before them.
fn sent(heard: &Heard, boot: u8, strike: u32) -> Vec<Message> {
    let of_strike = |message: &Message| match message {
        Message::Waveform(waveform) => waveform.strike == strike,
        Message::Strike(said) => said.strike == strike,
        Message::Shape(shape) => shape.strike == strike,
        _ => false,
    };
    let frames = heard.frames.iter().filter(|frame| frame.header.boot == boot);
    let settings = frames
        .clone()
        .map(|frame| &frame.message)
        .find(|message| matches!(message, Message::Settings(_)));
    let of_strike = frames.map(|frame| &frame.message).filter(|m| of_strike(m));
    settings.into_iter().chain(of_strike).cloned().collect()
}

/// The frames that came again of a strike, in the order in which they came.
fn fetched(heard: &Heard, boot: u32, strike: u32) -> Vec<Message> {
    let frames = heard.frames.iter().filter_map(|frame| match &frame.message {
        Message::Fetched(fetched) if (fetched.boot, fetched.strike) == (boot, strike) => Some(fetched),
        _ => None,
    });
    let frames: Vec<&Fetched> = frames.collect();
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

fn listed(answered: &Answered, request: u16) -> Vec<Kept> {
    let kept = |message: &Message| match message {
        Message::Kept(kept) => Some(*kept),
        _ => None,
    };
    answered
        .heard
        .answered(request)
        .into_iter()
        .filter_map(kept)
        .collect()
}

/// One fault of this kind at 0.5 s.
fn with_fault(run: &mut Emulation, kind: &str) {
    let text = format!("[[fault]]\nat = 0.5\nkind = \"{kind}\"\n");
    run.faults = faults::parse(&text, "faults").unwrap_or_else(|failure| panic!("{failure}"));
}

#[test]
fn a_strike_fetched_later_is_bit_for_bit_what_was_sent_first() {
    // As close as the line lets them be: what is fetched goes between them.
    let mut requests = Requests::new(&paper(16, 0.03, Some(1)));
    let fetch = |strike| Request::Fetch { boot: 0, strike };
    let early = requests.request(0.2, &fetch(1));
    let list = requests.request(0.6, &Request::ListKept);
    let late: Vec<_> = (0..17)
        .map(|strike| requests.request(0.65 + 0.04 * f64::from(strike), &fetch(strike)))
        .collect();
    let answered = requests.run();
    let heard = &answered.heard;
    assert_eq!(heard.status().strikes, 16);
    assert_eq!((heard.counters.lost, heard.guard().strikes_passed_over), (0, 0));
    assert_eq!(heard.answer(early).0, Outcome::Done);

    let kept = listed(&answered, list);
    let bytes: Vec<u32> = kept.iter().map(|kept| kept.bytes).collect();
    println!("{} strikes are kept, in {bytes:?} bytes", kept.len());
    assert!(kept.len() >= 10, "{}", kept.len());
    let oldest = 16 - kept.len() as u32;
    assert!(
        kept.iter()
            .map(|kept| (kept.boot, kept.strike))
            .eq((oldest..16).map(|strike| (0, strike)))
    );
    for (strike, number) in (0..).zip(late) {
        let there = (oldest..16).contains(&strike);
        let expected = if there { Outcome::Done } else { Outcome::NotKept };
        assert_eq!(heard.answer(number).0, expected, "strike {strike}");
        if there && strike != 1 {
            assert_eq!(
                fetched(heard, 0, strike),
                sent(heard, 0, strike),
                "strike {strike}"
            );
        }
    }
    assert_eq!(fetched(heard, 0, 15).len(), 24);
}

#[test]
fn strikes_outlive_a_reset_by_the_watchdog() {
    // One before the reset, one after it: both have the number 0.
    let mut run = paper(2, 2.8, Some(1));
    with_fault(&mut run, "hang");
    let mut requests = Requests::new(&run);
    let list = requests.request(2.95, &Request::ListKept);
    let numbers = [0, 1].map(|boot| {
        let fetch = Request::Fetch { boot, strike: 0 };
        requests.request(3.0 + 0.1 * f64::from(boot), &fetch)
    });
    let answered = requests.run();
    assert_eq!(answered.outcome.resets.len(), 1);
    assert_eq!(listed(&answered, list).len(), 2);
    for (boot, number) in (0..).zip(numbers) {
        assert_eq!(answered.heard.answer(number).0, Outcome::Done);
        let again = fetched(&answered.heard, boot, 0);
        assert_eq!(again, sent(&answered.heard, boot as u8, 0));
        assert_eq!(again.len(), 24);
    }
}

#[test]
fn a_power_cut_leaves_no_strike() {
    let mut run = paper(2, 0.9, Some(1));
    with_fault(&mut run, "power_cut");
    let mut requests = Requests::new(&run);
    let list = requests.request(0.8, &Request::ListKept);
    let fetch = requests.request(0.85, &Request::Fetch { boot: 0, strike: 0 });
    let answered = requests.run();
    assert_eq!(answered.outcome.resets.len(), 1);
    assert_eq!(listed(&answered, list), []);
    assert_eq!(answered.heard.answer(fetch).0, Outcome::NotKept);
}
