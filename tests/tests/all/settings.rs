//! Settings over the link: in force from the next strike on and after a reset, and never half there. The
//! tests of `bead-app` have what is refused.

use std::sync::LazyLock;

use crate::store::{STORE_RANGE, StoreFlash};
use bead_bench::emulation::Emulation;
use bead_compare::replay::replay;
use bead_recording::frames::Frame;
use bead_recording::strikes::assemble;
use bead_store::Store;
use bead_testing::{block, write};
use bead_tests::{Requests, RequestsRun, paper};
use bead_wire::{Message, Outcome, Request, SettingsSource, StrikeFlags};
use stm32f405_qemu::{Fault, FaultKind};

/// Where the bead keeps what came over the link (`memory.x`).
const STORE_ADDRESS: u32 = 0x080C_0000;

/// RCC_CSR bits 31..24 (RM0090 section 7.3.21).
const SOFTWARE: u8 = 1 << 4 | 1 << 2;

/// No strikes, and the first 150 ms of that.
static SHORT: LazyLock<Emulation> = LazyLock::new(|| paper(0, 0.1, Some(1)));

/// The settings of the run with windows of so many samples.
fn windows_of(length: u16) -> Vec<u8> {
    let settings = SHORT
        .settings
        .with(|bead| bead.capture.length = f64::from(length) * 1e-5);
    block(&settings.unwrap_or_else(|error| panic!("{error}")))
}

/// The blocks that the bead told, each once in a row.
fn told(frames: &[Frame]) -> Vec<&[u8]> {
    let mut blocks: Vec<_> = frames
        .iter()
        .filter_map(|frame| match &frame.message {
            Message::Settings(settings) => Some(settings.block.bytes()),
            _ => None,
        })
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
    let mut requests = Requests::new(&paper(4, 0.1, Some(1)));
    let new = windows_of(300);
    requests.request(0.1, &write(&new));
    requests.request(0.17, &Request::Reboot);
    requests.request(0.3, &Request::EraseSettings);
    requests.request(0.31, &Request::Status);
    let answered = requests.run();
    let received = &answered.received;
    assert_eq!(received.answer(0), (Outcome::Done, String::new()));
    let strikes = assemble(received.frames.clone(), None);
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
    assert_eq!(
        told(&received.frames),
        [&answered.block[..], &new, &answered.block]
    );
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
    assert_eq!(received.faults().count(), 0);
    assert_eq!((answered.outcome.overruns, received.counters.lost), (0, 0));
    assert_eq!(received.counters.rejected.total(), 0);
    // A reboot that was asked for is a reset by the firmware, which pulls the pin as well.
    assert_eq!(received.boots()[1..], [(1, SOFTWARE)]);
    assert_eq!(received.health().frames_lost_by_reset, 0);
    assert_eq!(received.status().epoch, 0, "acquisition never paused");
    assert_eq!(answered.outcome.unmodelled, [""; 0]);
    assert_eq!(stored(&answered), None);
}

#[test]
fn a_write_while_a_strike_is_measured_changes_no_bit_of_it_and_holds_for_the_next() {
    let run = paper(2, 0.1, Some(1));
    let quiet = assemble(Requests::new(&run).run().received.frames, None);
    let mut requests = Requests::new(&run);
    let during = requests.first_scan() + quiet[0].said.trigger_index as f64 / 100e3 + 0.0005;
    let new = windows_of(300);
    requests.request(during, &write(&new));
    let answered = requests.run();
    let words = answered.outcome.flash_operations.iter();
    let after_ms = words.map(|word| word.at_ns as f64 * 1e-6 - during * 1e3);
    println!(
        "words written, ms after the request: {:.2?}",
        after_ms.collect::<Vec<_>>()
    );
    assert!(!answered.outcome.flash_operations.is_empty());
    let strikes = assemble(answered.received.frames.clone(), None);
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

/// The settings in force when a run of the image ended.
fn in_force(answered: &RequestsRun) -> Vec<u8> {
    told(&answered.received.frames)
        .last()
        .expect("the bead tells its settings")
        .to_vec()
}

#[test]
fn a_power_cut_in_a_write_leaves_the_old_settings_or_the_new_ones() {
    let (old, new) = (windows_of(299), windows_of(301));
    let (mut store, _) = Store::open(StoreFlash::blank(2), STORE_RANGE);
    store.write(&old).unwrap_or_else(|error| panic!("{error}"));
    let before = store.into_flash().bytes;
    let requests = |cut: Option<(u32, u8)>| {
        let mut requests = Requests::new(&SHORT);
        requests.machine.stimulus.truncate(15_000);
        requests.machine.count_instructions = false;
        requests.machine.flash.push((STORE_ADDRESS, before.clone()));
        requests.request(0.05, &write(&new));
        if let Some((after, percent)) = cut {
            let kind = FaultKind::PowerCutInFlash { after, percent };
            requests.machine.faults.push(Fault::after_first_scan(0, kind));
        }
        requests.run()
    };
    let whole = requests(None);
    assert_eq!(in_force(&whole), new);
    let operations = whole.outcome.flash_operations.len() as u32;
    let mut kept = [0, 0];
    // The store's own tests cut each operation at several parts of it.
    for (n, operation) in (0..operations).step_by(5).chain([operations - 1]).enumerate() {
        let percent = [20, 80][n % 2];
        let cut = requests(Some((operation, percent)));
        assert_eq!(cut.outcome.resets.len(), 1);
        let holds = in_force(&cut);
        assert!(
            holds == old || holds == new,
            "operation {operation} cut at {percent} %"
        );
        // Not acknowledged unless it holds.
        assert!(holds == new || cut.received.replies(0).count() == 0);
        assert_eq!(cut.received.status().settings_source, SettingsSource::Stored);
        assert_eq!(cut.received.faults().count(), 0);
        assert_eq!(stored(&cut), Some(holds.clone()));
        kept[usize::from(holds == new)] += 1;
    }
    println!(
        "{operations} operations: {} cuts left the old settings, {} the new ones",
        kept[0], kept[1]
    );
    assert!(kept[0] > 8, "{kept:?}");
}
