//! Settings over the link: in force from the next strike on and after a reset, refused by name, and never
//! half there.

use std::sync::LazyLock;

use crate::store::{STORE_RANGE, StoreFlash};
use bead_bench::emulation::{Emulation, SETTINGS_ADDRESS};
use bead_compare::replay::replay;
use bead_model::Settings;
use bead_model::design::Description;
use bead_model::settings::BLOCK_MAX;
use bead_recording::frames::Frame;
use bead_recording::strikes::assemble;
use bead_store::Store;
use bead_tests::{Answered, Requests, paper, settings_at};
use bead_wire::Message;
use bead_wire::{
    ANY, Block, FaultCause, MAX_REQUEST, Outcome, Request, SettingsSource, StrikeFlags, encode_request,
};
use crc::{CRC_32_ISO_HDLC, Crc};
use stm32f405_qemu::{Fault, FaultKind};

/// Where the bead keeps what came over the link (`memory.x`).
const STORE_ADDRESS: u32 = 0x080C_0000;

/// No strikes, and the first 150 ms of that.
static SHORT: LazyLock<Emulation> = LazyLock::new(|| paper(0, 0.1, Some(1)));

fn short() -> Requests {
    let mut requests = Requests::new(&SHORT);
    requests.machine.stimulus.truncate(15_000);
    requests.machine.count_instructions = false;
    requests
}

fn block(settings: &Settings) -> Vec<u8> {
    let mut block = [0; BLOCK_MAX];
    let length = settings
        .encode(&mut block)
        .unwrap_or_else(|error| panic!("{error}"));
    block[..length].to_vec()
}

/// The settings of the run with windows of so many samples.
fn windows_of(length: u16) -> Vec<u8> {
    block(&with(|bead| bead.capture.length = f64::from(length) * 1e-5))
}

/// The settings of the run after a change.
fn with(change: impl FnOnce(&mut Description)) -> Settings {
    let settings = SHORT.settings.with(change);
    settings.unwrap_or_else(|error| panic!("{error}"))
}

fn write(block: &[u8]) -> Request {
    Request::WriteSettings {
        block: Block::try_from(block).expect("the blocks of these tests fit a frame"),
    }
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
fn stored(answered: &Answered) -> Option<Vec<u8>> {
    let (address, bytes) = &answered.outcome.flash;
    assert_eq!(*address, STORE_ADDRESS);
    let (mut store, opened) = Store::open(StoreFlash::holding(bytes.clone()), STORE_RANGE);
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
    let heard = &answered.heard;
    assert_eq!(heard.answer(0), (Outcome::Done, String::new()));
    let strikes = assemble(heard.frames.clone(), None);
    let samples: Vec<_> = strikes.iter().map(|strike| strike.said.samples).collect();
    assert_eq!(
        samples,
        [672, 300, 300, 672],
        "the reset kept them, and erasing brought the others back"
    );
    for strike in &strikes {
        assert_eq!(replay(strike).first_difference, None);
        assert_eq!(strike.said.flags, StrikeFlags::NONE);
    }
    assert_eq!(told(&heard.frames), [&answered.block[..], &new, &answered.block]);
    let sources: Vec<_> = heard
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
        heard.answer(2),
        (Outcome::Done, "put into flash by a probe".to_owned())
    );
    assert_eq!(sources[2], (1, SettingsSource::Flash));
    assert_eq!(heard.faults().count(), 0);
    assert_eq!((answered.outcome.overruns, heard.counters.lost), (0, 0));
    assert_eq!(heard.status().epoch, 0, "acquisition never paused");
    assert_eq!(answered.outcome.unmodelled, [""; 0]);
    assert_eq!(stored(&answered), None);
}

#[test]
fn a_write_while_a_strike_is_measured_changes_no_bit_of_it_and_holds_for_the_next() {
    let run = paper(2, 0.1, Some(1));
    let quiet = assemble(Requests::new(&run).run().heard.frames, None);
    let mut requests = Requests::new(&run);
    let during = requests.first_scan() + quiet[0].said.trigger_index as f64 / 100e3 + 0.0005;
    let new = windows_of(300);
    requests.request(during, &write(&new));
    let answered = requests.run();
    let first = answered
        .outcome
        .flash_operations
        .first()
        .expect("a word was programmed");
    let last = answered.outcome.flash_operations.last().expect("and others");
    let trigger = during * 1e9;
    println!(
        "{} words from {:.2} to {:.2} ms after the request",
        answered.outcome.flash_operations.len(),
        (first.at_ns as f64 - trigger) * 1e-6,
        (last.at_ns as f64 - trigger) * 1e-6
    );
    let strikes = assemble(answered.heard.frames.clone(), None);
    assert_eq!(strikes[0].said, quiet[0].said);
    assert_eq!(
        (&strikes[0].scans, &strikes[0].chunks),
        (&quiet[0].scans, &quiet[0].chunks)
    );
    assert_eq!(strikes[1].said.samples, 300);
    assert_eq!(replay(&strikes[1]).first_difference, None);
    let status = answered.heard.status();
    assert_eq!((status.overruns, status.blocks_dropped, status.epoch), (0, 0, 0));
    assert_eq!(answered.heard.counters.lost, 0);
}

/// A block with other bytes where its header ends, and a checksum that holds.
fn forged(change: impl Fn(&mut Vec<u8>)) -> Vec<u8> {
    let mut bytes = windows_of(300);
    bytes.truncate(bytes.len() - 4);
    change(&mut bytes);
    let crc = Crc::<u32>::new(&CRC_32_ISO_HDLC).checksum(&bytes);
    bytes.extend(crc.to_le_bytes());
    bytes
}

#[test]
fn each_way_of_being_no_valid_settings_is_refused_by_name_and_leaves_flash_alone() {
    // The damping of the intruder and the place where a block has it: after the name, the address and four
    // numbers. With 0 in its place the checksum holds.
    const DAMPING: usize = 8 + 16 + 1 + 4 * 8;
    let undamped = forged(|bytes| {
        assert_eq!(bytes[DAMPING..DAMPING + 8], 12_f64.to_le_bytes());
        bytes[DAMPING..DAMPING + 8].fill(0);
    });
    let good = windows_of(300);
    let mut damaged = good.clone();
    damaged[20] ^= 1;
    let version = bead_model::settings::VERSION;
    let cases = [
        (
            forged(|bytes| bytes[4] = 7),
            Outcome::SettingsInvalid,
            format!("settings block of version 7, this program knows {version}"),
        ),
        (
            forged(|bytes| bytes[4] = 6),
            Outcome::SettingsInvalid,
            "settings block of version 6, unreleased: `bead settings make` makes it anew of its bead.toml"
                .to_owned(),
        ),
        (
            damaged,
            Outcome::SettingsInvalid,
            "settings block with a wrong checksum: half written or damaged".to_owned(),
        ),
        (
            good[..good.len() - 1].to_vec(),
            Outcome::SettingsInvalid,
            "settings block is shorter than its header says".to_owned(),
        ),
        (
            [&good[..], &[0]].concat(),
            Outcome::SettingsInvalid,
            "bytes follow the settings block".to_owned(),
        ),
        (
            b"not a settings block".to_vec(),
            Outcome::SettingsInvalid,
            "not a settings block: it does not start with \"BEAD\"".to_owned(),
        ),
        (
            Vec::new(),
            Outcome::SettingsInvalid,
            "settings block is shorter than its header says".to_owned(),
        ),
        (
            forged(|bytes| {
                bytes.pop();
                bytes[6] -= 1;
            }),
            Outcome::SettingsInvalid,
            "settings block whose body does not decode".to_owned(),
        ),
        (
            undamped,
            Outcome::SettingsInvalid,
            "settings that a bead cannot work with: intruder.damping must be above 0".to_owned(),
        ),
        (
            block(&settings_at(50_000)),
            Outcome::SampleRate,
            "settings for 50000 Hz; this image samples at 100000 Hz".to_owned(),
        ),
        (
            block(&settings_at(200_000)),
            Outcome::SampleRate,
            "settings for 200000 Hz; this image samples at 100000 Hz".to_owned(),
        ),
    ];
    let mut requests = short();
    for (n, (bytes, ..)) in cases.iter().enumerate() {
        requests.request(0.05 + 0.005 * n as f64, &write(bytes));
    }
    let status = requests.request(0.12, &Request::Status);
    requests.request(0.125, &Request::ReadSettings);
    let answered = requests.run();
    for (n, (_, outcome, detail)) in (0..).zip(&cases) {
        assert_eq!(answered.heard.answer(n), (*outcome, detail.clone()));
    }
    assert_eq!(answered.outcome.flash_operations, []);
    assert_eq!(told(&answered.heard.frames), [&answered.block[..]]);
    assert_eq!(answered.heard.answer(status).0, Outcome::Done);
    assert_eq!(answered.heard.status().settings_source, SettingsSource::Flash);
}

#[test]
fn without_a_block_of_a_probe_settings_are_stored_over_the_built_in_ones() {
    let new = windows_of(300);
    let mut requests = short();
    requests.machine.flash.clear();
    requests.request(0.05, &Request::Status);
    requests.request(0.06, &write(&new));
    requests.request(0.1, &Request::EraseSettings);
    requests.request(0.12, &Request::Status);
    let answered = requests.run();
    assert_eq!(answered.heard.answer(1).0, Outcome::Done);
    assert_eq!(
        answered.heard.answer(2),
        (Outcome::Done, "built in, as flash has none".to_owned())
    );
    assert_eq!(told(&answered.heard.frames).len(), 3);
    assert_eq!(told(&answered.heard.frames)[1], new);
    assert_eq!(answered.heard.status().settings_source, SettingsSource::BuiltIn);
}

/// A start with this in the store.
fn start_with(store: Vec<u8>) -> Answered {
    let mut requests = short();
    requests.machine.flash.push((STORE_ADDRESS, store));
    // Two sectors may have to be erased, 2 s each.
    requests.machine.sampling_deadline_ns = 5_000_000_000;
    requests.run()
}

#[test]
fn a_stored_block_that_this_image_does_not_know_is_refused_and_the_one_of_the_probe_holds() {
    let other = forged(|bytes| bytes[4] = 6);
    let (mut store, _) = Store::open(StoreFlash::blank(2), STORE_RANGE);
    store.write(&other).unwrap_or_else(|error| panic!("{error}"));
    let answered = start_with(store.into_flash().bytes);
    let refused = answered.heard.faults().next().expect("it is told");
    assert_eq!(
        (refused.cause, refused.detail.as_str()),
        (
            FaultCause::SettingsRefused,
            "a block from before the first release: make it anew of its bead.toml, or arm the bead by request"
        )
    );
    assert_eq!(told(&answered.heard.frames), [&answered.block[..]]);
    assert!(
        !answered.heard.status().armed,
        "its owner's bead measures with no other settings unasked"
    );
    assert_eq!(answered.heard.status().settings_source, SettingsSource::Flash);
    assert_eq!(answered.outcome.flash_operations, [], "another image may know it");
}

#[test]
fn a_strike_is_flagged_if_its_settings_are_not_the_owners() {
    let run = paper(1, 0.1, Some(1));
    let measured = |flash: Vec<(u32, Vec<u8>)>| {
        let mut requests = Requests::new(&run);
        requests.machine.flash = flash;
        let heard = requests.run().heard;
        let strikes = assemble(heard.frames.clone(), None);
        assert_eq!(strikes.len(), 1);
        assert_eq!(replay(&strikes[0]).first_difference, None);
        (
            strikes[0].said.flags.has(StrikeFlags::SETTINGS_NOT_OWNERS),
            strikes[0].said.absorbed_measured,
            heard.status().settings_source,
        )
    };
    let of = |block: Vec<u8>| vec![(SETTINGS_ADDRESS, block)];
    let (flagged, _, source) = measured(of(run.block.clone()));
    assert_eq!((flagged, source), (false, SettingsSource::Flash));
    let mut damaged = run.block.clone();
    damaged[20] ^= 1;
    let (flagged, _, source) = measured(of(damaged));
    assert_eq!((flagged, source), (true, SettingsSource::FlashRefused));
    let (flagged, _, source) = measured(Vec::new());
    assert_eq!((flagged, source), (true, SettingsSource::BuiltIn));
}

#[test]
fn a_bead_answers_its_own_address_and_every_beads_and_says_it_in_its_frames() {
    let settings = with(|bead| bead.address = 7);
    let mut requests = short();
    requests.machine.flash = vec![(SETTINGS_ADDRESS, block(&settings))];
    for (at, address, number) in [(0.05, 7, 100), (0.07, 8, 101), (0.09, ANY, 102)] {
        let mut buffer = [0; MAX_REQUEST];
        let sent = encode_request(address, number, &Request::Identity, &mut buffer);
        requests.send(at, sent.expect("the buffer is long enough"));
    }
    let heard = requests.run().heard;
    let replies = [100, 101, 102].map(|number| heard.replies(number).count());
    assert_eq!(replies, [1, 0, 1]);
    assert!(heard.frames.iter().all(|frame| frame.header.address == 7));
    assert_eq!(heard.counters.lost, 0);
}

#[test]
fn a_store_without_a_whole_block_is_erased_and_told_of() {
    let answered = start_with(
        (0..70_000u32)
            .map(|n| (n.wrapping_mul(2_654_435_761) >> 24) as u8)
            .collect(),
    );
    let refused = answered.heard.faults().next().expect("it is told");
    assert_eq!(
        (refused.cause, refused.detail.as_str()),
        (
            FaultCause::SettingsRefused,
            "what was stored is not whole, and was erased"
        )
    );
    assert_eq!(told(&answered.heard.frames), [&answered.block[..]]);
    let operations: Vec<_> = answered
        .outcome
        .flash_operations
        .iter()
        .map(|operation| (operation.address, operation.erase))
        .collect();
    assert_eq!(operations, [(STORE_ADDRESS, true)], "the other sector was blank");
    assert_eq!(stored(&answered), None);
    // A start that takes seconds is no hang.
    assert_eq!(answered.outcome.resets, []);
    println!(
        "first scan {:.2} s after power-up",
        answered.outcome.sampling.expect("the image samples").first_ns as f64 * 1e-9
    );
}

/// A store that has room for three more blocks of settings and no fourth, and how many it took before.
static NEARLY_FULL: LazyLock<(Vec<u8>, usize)> = LazyLock::new(|| {
    let block = windows_of(300);
    let (mut store, _) = Store::open(StoreFlash::blank(2), STORE_RANGE);
    let all = std::iter::repeat_with(|| store.write(&block))
        .take_while(Result::is_ok)
        .count();
    let (mut store, _) = Store::open(StoreFlash::blank(2), STORE_RANGE);
    for _ in 3..all {
        store.write(&block).unwrap_or_else(|error| panic!("{error}"));
    }
    (store.into_flash().bytes, all - 3)
});

/// The start of the bead, three writes, a fourth, a reset, and what `then` asks 4 s later, when a sector has
/// been erased.
fn fill_and_reset(then: impl Fn(&mut Requests)) -> (Requests, usize) {
    let (store, taken) = NEARLY_FULL.clone();
    let mut requests = short();
    requests.machine.flash.push((STORE_ADDRESS, store));
    for n in 0..4 {
        // The start reads the whole store, which takes 0.23 s.
        requests.request(0.4 + 0.1 * f64::from(n), &write(&windows_of(301 + n as u16)));
    }
    requests.request(0.8, &Request::Reboot);
    then(&mut requests);
    // The codes stand still then, and are told to be stuck.
    requests.machine.tail_ns = 6_000_000_000;
    (requests, taken)
}

#[test]
fn a_full_store_refuses_and_takes_more_after_a_reset() {
    let (requests, taken) = fill_and_reset(|requests| {
        requests.request(5.0, &write(&windows_of(305)));
    });
    let answered = requests.run();
    for n in 0..3 {
        assert_eq!(answered.heard.answer(n).0, Outcome::Done);
    }
    assert_eq!(answered.heard.answer(3).0, Outcome::StoreFull);
    assert_eq!(answered.heard.answer(4).0, Outcome::Done);
    assert_eq!(answered.heard.answer(5).0, Outcome::Done);
    let blocks = [300, 301, 302, 303, 305].map(windows_of);
    assert_eq!(told(&answered.heard.frames), blocks, "the fourth never");
    assert_eq!(stored(&answered), Some(windows_of(305)));
    let erased: Vec<_> = answered
        .outcome
        .flash_operations
        .iter()
        .filter(|operation| operation.erase)
        .map(|operation| operation.address)
        .collect();
    assert_eq!(erased, [STORE_ADDRESS], "once, and not while samples were taken");
    assert_eq!(
        (answered.outcome.overruns, answered.heard.status().overruns),
        (0, 0)
    );
    assert_eq!(answered.outcome.resets.len(), 1);
    println!("{taken} blocks of {} bytes before", windows_of(300).len());
    assert!(taken > 450, "{taken}");
}

/// The settings in force when a run of the image ended.
fn in_force(answered: &Answered) -> Vec<u8> {
    told(&answered.heard.frames)
        .last()
        .expect("the bead tells its settings")
        .to_vec()
}

#[test]
fn a_power_cut_in_any_operation_of_a_write_leaves_the_old_settings_or_the_new_ones() {
    let (old, new) = (windows_of(299), windows_of(301));
    let (mut store, _) = Store::open(StoreFlash::blank(2), STORE_RANGE);
    store.write(&old).unwrap_or_else(|error| panic!("{error}"));
    let before = store.into_flash().bytes;
    let requests = |cut: Option<(u32, u8)>| {
        let mut requests = short();
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
    for (operation, percent) in (0..operations).map(|n| (n, [20, 80][n as usize % 2])) {
        let cut = requests(Some((operation, percent)));
        assert_eq!(cut.outcome.resets.len(), 1);
        let holds = in_force(&cut);
        assert!(
            holds == old || holds == new,
            "operation {operation} cut at {percent} %"
        );
        // Not acknowledged unless it holds.
        assert!(holds == new || cut.heard.replies(0).count() == 0);
        assert_eq!(cut.heard.status().settings_source, SettingsSource::Stored);
        assert_eq!(cut.heard.faults().count(), 0);
        assert_eq!(stored(&cut), Some(holds.clone()));
        kept[usize::from(holds == new)] += 1;
    }
    println!(
        "{operations} operations: {} cuts left the old settings, {} the new ones",
        kept[0], kept[1]
    );
    assert!(kept[0] > 40, "{kept:?}");
}

#[test]
fn a_power_cut_in_any_operation_of_making_room_keeps_the_settings() {
    let requests = |cut: Option<(u32, u8)>| {
        let (mut requests, _) = fill_and_reset(|_| ());
        if let Some((after, percent)) = cut {
            // After the writes, before the reset.
            let kind = FaultKind::PowerCutInFlash { after, percent };
            requests
                .machine
                .faults
                .push(Fault::after_first_scan(520_000_000, kind));
            return requests.run_until_settings_after(1);
        }
        requests.run()
    };
    let whole = requests(None);
    let started = whole.outcome.resets[0].at_ns;
    let operations: Vec<_> = whole
        .outcome
        .flash_operations
        .iter()
        .filter(|operation| operation.at_ns > started)
        .collect();
    let mut cuts = 0;
    for (n, operation) in (0..).zip(&operations) {
        // Words of the block that moves along are all alike.
        let percents: &[u8] = match (operation.erase, n % 5) {
            (true, _) => &[1, 10, 30, 50, 70, 90, 99],
            (false, 0) => &[50],
            (false, _) => &[],
        };
        for percent in percents {
            let cut = requests(Some((n, *percent)));
            assert_eq!(cut.outcome.resets.len(), 2);
            assert_eq!(
                in_force(&cut),
                windows_of(303),
                "operation {n} cut at {percent} %"
            );
            assert_eq!(stored(&cut), Some(windows_of(303)));
            cuts += 1;
        }
    }
    println!("{cuts} cuts in {} operations", operations.len());
    assert!(cuts >= 17, "{cuts}");
}
