//! Settings over the link: in force from the next strike on and after a reset. The tests of `bead-app` cover
//! refusals, those of `bead-store` the power cuts.

use crate::store::{STORE_RANGE, StoreFlash};
use bead_bench::emulation::Emulation;
use bead_compare::replay::replay;
use bead_store::{BURST, Store};
use bead_testing::{block, write};
use bead_tests::{Requests, RequestsRun, RunFrames, paper};
use bead_wire::{Health, Message, Outcome, Request, Settings, SettingsSource, StrikeFlags};

/// RCC_CSR bits 31..24 (RM0090 section 7.3.21).
const SOFTWARE: u8 = 1 << 4 | 1 << 2;

/// The settings of a run with windows of this many samples.
fn windows_of(run: &Emulation, length: u16) -> Vec<u8> {
    let settings = run
        .settings
        .with(|bead| bead.capture.length = f64::from(length) * 1e-5);
    block(&settings.unwrap_or_else(|error| panic!("{error}")))
}

/// The blocks that the bead sent, without repeats in a row.
fn told(received: &RunFrames) -> Vec<&[u8]> {
    let mut blocks: Vec<_> = received
        .all::<Settings>()
        .map(|settings| settings.block.bytes())
        .collect();
    blocks.dedup();
    blocks
}

/// Returns the settings in the store at the end of a run, as the next start would find them.
fn stored(answered: &RequestsRun) -> Option<Vec<u8>> {
    let (mut store, opened) = Store::open(StoreFlash::holding(answered.store().to_vec()), STORE_RANGE);
    assert!(!opened.lost);
    store.read().ok().flatten().map(<[u8]>::to_vec)
}

#[test]
fn settings_written_are_in_force_with_the_next_strike_and_after_a_reset() {
    // Strikes at 20, 120, 220 and 320 ms after the first scan.
    let run = paper(4, 0.1, Some(1));
    let mut requests = Requests::new(&run);
    let new = windows_of(&run, 300);
    requests.request(0.1, &write(&new));
    requests.request(0.17, &Request::Reboot);
    requests.request(0.3, &Request::EraseSettings);
    requests.request(0.31, &Request::Status);
    let answered = requests.run();
    let received = &answered.received;
    assert_eq!(received.answer(0), (Outcome::Done, String::new()));
    let strikes = received.strikes();
    let samples: Vec<_> = strikes.iter().map(|strike| strike.said.samples).collect();
    assert_eq!(
        samples,
        [672, 300, 300, 672],
        "the reset kept them, and erasing brought the others back"
    );
    for strike in &strikes {
        assert_eq!(replay(strike).first_difference, None);
        // A window of 300 samples ends while the intruder rings.
        let is_short = strike.said.samples == 300;
        let expected = StrikeFlags::NONE.with_if(is_short, StrikeFlags::RINGING_LEFT);
        assert_eq!(strike.said.flags, expected);
    }
    assert_eq!(told(received), [&answered.block[..], &new, &answered.block]);
    let sources: Vec<_> = received
        .frames
        .iter()
        .filter_map(|frame| match &frame.message {
            Message::Status(status) => Some((frame.header.boot, status.settings_source)),
            _ => None,
        })
        .collect();
    assert_eq!(sources[0], (0, SettingsSource::Flash));
    assert_eq!(sources[1], (1, SettingsSource::Stored), "at boot");
    assert_eq!(
        received.answer(2),
        (Outcome::Done, "put into flash by a probe".to_owned())
    );
    assert_eq!(sources[2], (1, SettingsSource::Flash));
    assert_eq!(received.causes(), []);
    assert_eq!((answered.outcome.overruns, received.counters.lost), (0, 0));
    assert_eq!(received.counters.rejected.total(), 0);
    // A reboot that was asked for is a reset by the firmware, which pulls the pin as well.
    assert_eq!(received.boots()[1..], [(1, SOFTWARE)]);
    assert_eq!(received.last::<Health>().frames_lost_by_reset, 0);
    assert_eq!(received.status().epoch, 0, "acquisition never paused");
    assert_eq!(answered.outcome.unmodelled, [""; 0]);
    assert_eq!(stored(&answered), None);
}

#[test]
fn a_write_while_a_strike_is_measured_changes_no_bit_of_it_and_holds_for_the_next() {
    let run = paper(2, 0.1, Some(1));
    let quiet = Requests::new(&run).run().received.strikes();
    let mut requests = Requests::new(&run);
    let during = requests.first_scan() + quiet[0].said.trigger_index as f64 / 100e3 + 0.0005;
    let new = windows_of(&run, 300);
    requests.request(during, &write(&new));
    let answered = requests.run();
    let words = answered.outcome.flash_operations.iter();
    let after_ms = words.map(|word| word.at_ns as f64 * 1e-6 - during * 1e3);
    println!(
        "words written, ms after the request: {:.2?}",
        after_ms.collect::<Vec<_>>()
    );
    assert!(!answered.outcome.flash_operations.is_empty());
    let strikes = answered.received.strikes();
    assert_eq!(strikes[0].said, quiet[0].said);
    assert_eq!(
        (&strikes[0].scans, &strikes[0].chunks),
        (&quiet[0].scans, &quiet[0].chunks)
    );
    assert_eq!(strikes[1].said.samples, 300);
    assert_eq!(replay(&strikes[1]).first_difference, None);
    let status = answered.received.status();
    assert_eq!((status.overruns, status.blocks_dropped, status.epoch), (0, 0, 0));
    assert_eq!(answered.received.counters.lost, 0);
}

#[test]
fn the_pace_of_writes_outlives_a_reset() {
    let run = paper(0, 0.1, Some(1));
    let mut requests = Requests::new(&run);
    requests.machine.tail_ns = 1_000_000_000;
    let block = |n: u16| write(&windows_of(&run, 300 + n));
    for n in 0..BURST as u16 {
        requests.request(0.05 + 0.03 * f64::from(n), &block(n));
    }
    let reboot = requests.request(0.6, &Request::Reboot);
    let late = requests.request(0.9, &block(100));
    let answered = requests.run();
    let done = (0..=reboot).all(|request| answered.received.answer(request).0 == Outcome::Done);
    assert!(done && answered.outcome.resets.len() == 1);
    assert_eq!(answered.received.answer(late).0, Outcome::TooSoon);
}
