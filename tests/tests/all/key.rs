//! A bead with a key does what its owner signs, once and in time, and nothing else that changes its state.

use std::sync::LazyLock;

use crate::store::{STORE_RANGE, StoreFlash};
use bead_bench::emulation::Emulation;
use bead_model::settings::BLOCK_MAX;
use bead_store::{BURST, Secret, Store, Vault};
use bead_tests::{Answered, Requests, paper, replied};
use bead_wire::{Block, FaultCause, Key, Message, Outcome, Request, Ticket};
use stm32f405_qemu::{Fault, FaultKind};

/// Where the bead keeps settings and key (`memory.x`).
const STORE_ADDRESS: u32 = 0x080C_0000;

static QUIET: LazyLock<Emulation> = LazyLock::new(|| paper(0, 0.1, Some(1)));

/// The device id of the emulated bead.
static UID: LazyLock<[u8; 12]> = LazyLock::new(|| {
    let heard = run_for(0.05).run().heard;
    let identity = heard.frames.iter().find_map(|frame| match &frame.message {
        Message::Identity(identity) => Some(identity.uid),
        _ => None,
    });
    identity.expect("the bead says who it is at boot")
});

/// A quiet run.
fn run_for(seconds: f64) -> Requests {
    let mut requests = Requests::new(&QUIET);
    requests.machine.count_instructions = false;
    let rows = requests.machine.stimulus.clone();
    requests.machine.stimulus = rows
        .into_iter()
        .cycle()
        .take((seconds * 100e3) as usize)
        .collect();
    requests
}

fn key(byte: u8) -> Key {
    Key::new([byte; 16]).expect("it is not zero")
}

/// A run of a bead that has a key, and has let through requests up to `counter`.
fn keyed(seconds: f64, counter: u64) -> Requests {
    let mut requests = run_for(seconds);
    requests
        .machine
        .flash
        .push((STORE_ADDRESS, store_with(counter).into_flash().bytes));
    requests
}

fn store_with(counter: u64) -> Vault<StoreFlash> {
    let mut vault = Vault::new(Store::open(StoreFlash::blank(2), STORE_RANGE).0);
    let secret = Secret {
        key: [7; 16],
        counter,
    };
    vault.keep(Some(secret)).expect("there is room");
    vault
}

/// Returns the key in the store at the end of a run.
fn secret(answered: &Answered) -> Option<([u8; 16], u64)> {
    let (_, bytes) = &answered.outcome.flash;
    let vault = Vault::new(Store::open(StoreFlash::holding(bytes.clone()), STORE_RANGE).0);
    vault.secret().map(|secret| (secret.key, secret.counter))
}

/// For any time in boot 0.
fn ticket(counter: u64) -> Ticket {
    Ticket {
        counter,
        boot: 0,
        until: u64::MAX,
    }
}

fn outcome(answered: &Answered, request: u16) -> Outcome {
    answered.heard.answer(request).0
}

fn write(length: u16) -> Request {
    let settings = QUIET
        .settings
        .with(|bead| bead.capture.length = f64::from(length) * 1e-5)
        .unwrap_or_else(|error| panic!("{error}"));
    let mut block = [0; BLOCK_MAX];
    let bytes = settings.encode(&mut block).expect("there is room");
    Request::WriteSettings {
        block: Block::try_from(&block[..bytes]).expect("a block fits"),
    }
}

#[test]
fn a_bead_that_is_given_a_key_does_what_is_signed_and_answers_whoever_asks() {
    let mut requests = run_for(0.6);
    let open = requests.request(0.05, &Request::Disarm);
    let early = requests.signed(0.08, &Request::Arm, &key(7), &UID, ticket(1));
    let set = requests.request(0.1, &Request::SetKey { key: [7; 16] });
    let changing = [
        Request::Arm,
        Request::Disarm,
        Request::EraseSettings,
        Request::ResetCounters,
        write(300),
        Request::SetKey { key: [9; 16] },
        Request::Reboot,
    ];
    let unsigned: Vec<_> = (0..)
        .zip(&changing)
        .map(|(n, request)| requests.request(0.15 + 0.01 * f64::from(n), request))
        .collect();
    let reading: Vec<_> = (0..)
        .zip([Request::Identity, Request::Status, Request::ReadSettings])
        .map(|(n, request)| requests.request(0.25 + 0.02 * f64::from(n), &request))
        .collect();
    let arm = requests.signed(0.35, &Request::Arm, &key(7), &UID, ticket(1));
    let stored = requests.signed(0.4, &write(300), &key(7), &UID, ticket(2));
    let rekeyed = requests.signed(0.45, &Request::SetKey { key: [9; 16] }, &key(7), &UID, ticket(3));
    let old = requests.signed(0.5, &Request::Arm, &key(7), &UID, ticket(4));
    let new = requests.signed(0.52, &Request::Disarm, &key(9), &UID, ticket(4));
    let none = requests.signed(0.54, &Request::SetKey { key: [0; 16] }, &key(9), &UID, ticket(5));
    let open_again = requests.request(0.56, &Request::Arm);
    requests.request(0.58, &Request::Status);
    let answered = requests.run();
    let said = |number| outcome(&answered, number);
    assert_eq!(
        [open, early, set].map(said),
        [Outcome::Done, Outcome::NoKey, Outcome::Done]
    );
    assert!(unsigned.iter().all(|&number| said(number) == Outcome::Unsigned));
    assert!(reading.iter().all(|&number| said(number) == Outcome::Done));
    assert_eq!([arm, stored, rekeyed].map(said), [Outcome::Done; 3]);
    assert_eq!(
        [old, new, none, open_again].map(said),
        [Outcome::Forged, Outcome::Done, Outcome::Done, Outcome::Done]
    );
    let guard = answered.heard.guard();
    assert_eq!(
        (
            guard.keyed,
            guard.counter,
            guard.signed,
            guard.refused_unsigned,
            guard.refused_forged
        ),
        (false, 5, 5, 7, 1)
    );
    assert_eq!(secret(&answered), None);
    assert_eq!(answered.outcome.resets, []);
}

#[test]
fn a_request_is_done_once_also_after_a_reset_and_after_a_power_cut() {
    for power in [false, true] {
        let mut requests = keyed(1.2, 40);
        let arm = |counter, boot| {
            (
                Request::Arm,
                Ticket {
                    boot,
                    ..ticket(counter)
                },
            )
        };
        let mut ask =
            |at, (request, ticket): (Request, Ticket)| requests.signed(at, &request, &key(7), &UID, ticket);
        // Flash has 40: the last counter that may have been used.
        let stale = ask(0.1, arm(40, 0));
        let first = ask(0.15, arm(41, 0));
        let again = ask(0.2, arm(41, 0));
        let late = ask(
            0.25,
            (
                Request::Arm,
                Ticket {
                    counter: 42,
                    boot: 0,
                    until: 100,
                },
            ),
        );
        let other_boot = ask(0.3, arm(42, 9));
        let far = ask(0.35, arm(41 + (1 << 16) + 1, 0));
        let reboot = ask(
            0.4,
            (if power { Request::Disarm } else { Request::Reboot }, ticket(42)),
        );
        // What was heard before is sent again, with the boot of then and of now.
        let boot = u32::from(!power);
        let replays = [(0.7, arm(41, 0)), (0.75, arm(42, boot)), (0.8, arm(105, boot))]
            .map(|(at, request)| ask(at, request));
        let next = ask(0.85, arm(106, boot));
        if power {
            let kind = FaultKind::PowerCut;
            requests
                .machine
                .faults
                .push(Fault::after_first_scan(500_000_000, kind));
        }
        let answered = requests.run();
        let said = |number| outcome(&answered, number);
        assert_eq!(answered.outcome.resets.len(), 1);
        assert_eq!(
            [stale, first, again, late, other_boot, far, reboot].map(said),
            [
                Outcome::Replayed,
                Outcome::Done,
                Outcome::Replayed,
                Outcome::Late,
                Outcome::Late,
                Outcome::Replayed,
                Outcome::Done
            ]
        );
        // One write to flash covers 64 counters from the first on.
        assert_eq!(replays.map(said), [Outcome::Replayed; 3]);
        assert_eq!(said(next), Outcome::Done);
        assert_eq!(secret(&answered), Some(([7; 16], 170)));
        let words = |until: u64| {
            answered
                .outcome
                .flash_operations
                .iter()
                .filter(|word| word.at_ns < until)
                .count()
        };
        assert!(
            (8..20).contains(&words(500_000_000)),
            "one record before the reset"
        );
    }
}

#[test]
fn a_flood_of_forged_requests_is_refused_and_counted_and_the_owners_is_done() {
    let mut requests = keyed(0.6, 0);
    let forged = Request::Disarm.signed(&key(8), &UID, bead_wire::ANY, 9999, ticket(1));
    let mut buffer = [0; bead_wire::MAX_REQUEST];
    let bytes = bead_wire::encode_request(bead_wire::ANY, 9999, &forged, &mut buffer).expect("it fits");
    for _ in 0..300 {
        requests.send(0.1, bytes);
    }
    let owners = requests.signed(0.3, &Request::Disarm, &key(7), &UID, ticket(1));
    requests.request(0.4, &Request::Status);
    let answered = requests.run();
    assert_eq!(outcome(&answered, owners), Outcome::Done);
    let took = replied(&answered.outcome, owners).expect("it was answered") - 0.3;
    let guard = answered.heard.guard();
    println!("answered after {took:.3} s; {guard:?}");
    assert!(took < 0.1, "{took}");
    assert!(guard.refused_forged > 50 && guard.signed == 1);
    assert!(!answered.heard.status().armed);
    assert_eq!(answered.heard.status().overruns, 0);
}

#[test]
fn settings_are_written_sixteen_at_once_and_then_only_so_often_whoever_asks_and_over_a_reset() {
    let mut requests = run_for(2.6);
    let written: Vec<_> = (0..BURST + 2)
        .map(|n| requests.request(0.1 + 0.05 * f64::from(n), &write(300 + n as u16)))
        .collect();
    let erase = requests.request(1.2, &Request::EraseSettings);
    requests.request(1.3, &Request::Reboot);
    let after = requests.request(2.3, &write(500));
    requests.request(2.4, &Request::Status);
    let answered = requests.run();
    let said: Vec<_> = written.iter().map(|&number| outcome(&answered, number)).collect();
    let (done, refused) = said.split_at(BURST as usize);
    assert!(done.iter().all(|outcome| *outcome == Outcome::Done));
    assert_eq!(refused, [Outcome::TooSoon; 2]);
    let (_, why) = answered.heard.answer(written[BURST as usize]);
    assert!(
        why.starts_with("flash is written every 10 s in the long run; again in "),
        "{why}"
    );
    assert_eq!(outcome(&answered, erase), Outcome::TooSoon);
    assert_eq!(
        outcome(&answered, after),
        Outcome::TooSoon,
        "a reset is no way around it"
    );
    assert_eq!(answered.heard.guard().refused_too_soon, 1);
    let [Message::Settings(block)] = answered
        .heard
        .frames
        .iter()
        .filter_map(|frame| match &frame.message {
            settings @ Message::Settings(_) => Some(settings),
            _ => None,
        })
        .collect::<Vec<_>>()[..]
        .last_chunk()
        .expect("the bead tells its settings")
    else {
        panic!("settings");
    };
    let Request::WriteSettings { block: last } = write(300 + BURST as u16 - 1) else {
        panic!("a block");
    };
    assert_eq!(block.block, last);
}

#[test]
fn counters_that_leap_are_kept_only_so_often_and_their_requests_are_done() {
    const ASKED: u64 = BURST as u64 + 4;
    let mut requests = keyed(0.8, 0);
    // Each is above what flash holds.
    let leaps: Vec<_> = (0..ASKED)
        .map(|n| {
            let at = 0.1 + 0.02 * n as f64;
            requests.signed(at, &Request::Arm, &key(7), &UID, ticket(65 * (n + 1)))
        })
        .collect();
    let stored = requests.signed(0.6, &write(300), &key(7), &UID, ticket(65 * ASKED + 1));
    requests.request(0.65, &Request::Status);
    let answered = requests.run();
    assert!(
        leaps
            .iter()
            .all(|&leap| outcome(&answered, leap) == Outcome::Done)
    );
    assert_eq!(outcome(&answered, stored), Outcome::TooSoon);
    assert_eq!(answered.heard.guard().refused_too_soon, 1);
    // Words of a record: its header, and key, secret and padding.
    let words = (8 + (1 + 28_u32).next_multiple_of(4)) / 4;
    let written = answered.outcome.flash_operations.len() as u32;
    assert_eq!(written, BURST * words);
    assert_eq!(secret(&answered), Some(([7; 16], 65 * u64::from(BURST) + 64)));
}

#[test]
fn a_store_that_cannot_be_read_makes_no_keyed_bead_an_open_one_and_a_reboot_brings_it_back() {
    let mut requests = run_for(4.0);
    // Power went while the other sector was erased: not all bits have risen yet. The supply stays low at the
    // start.
    let mut bytes = store_with(0).into_flash().bytes;
    bytes.rotate_left(STORE_RANGE.end as usize / 2);
    bytes[..4].fill(0);
    assert!(
        Vault::new(Store::open_as_it_is(
            StoreFlash::holding(bytes.clone()),
            STORE_RANGE
        ))
        .is_unreadable()
    );
    requests.machine.flash.push((STORE_ADDRESS, bytes));
    requests.machine.sampling_deadline_ns = 10_000_000_000;
    requests.machine.timeout = std::time::Duration::from_secs(300);
    requests.machine.faults.extend(
        [(0, 2800), (5_500_000_000, 3300)]
            .map(|(at, millivolts)| Fault::after_power_up(at, FaultKind::Supply { millivolts })),
    );
    let low = requests.request(5.2, &Request::Disarm);
    let given = requests.request(5.25, &Request::SetKey { key: [9; 16] });
    let reading = requests.request(5.3, &Request::ReadSettings);
    let unread = requests.request(5.6, &Request::Disarm);
    let signed = requests.signed(5.65, &Request::Disarm, &key(7), &UID, ticket(1));
    let reboot = requests.request(5.7, &Request::Reboot);
    // An erase takes 2 s.
    let unsigned = requests.request(8.2, &Request::Disarm);
    let boot = Ticket { boot: 1, ..ticket(1) };
    let owners = requests.signed(8.3, &Request::Disarm, &key(7), &UID, boot);
    let answered = requests.run();
    let said = |number| outcome(&answered, number);
    assert_eq!([low, given, unread, signed].map(said), [Outcome::FlashFailed; 4]);
    let (_, why) = answered.heard.answer(unread);
    assert!(why.starts_with("the store cannot be read"), "{why}");
    assert_eq!([reading, reboot].map(said), [Outcome::Done; 2]);
    assert_eq!([unsigned, owners].map(said), [Outcome::Unsigned, Outcome::Done]);
    let causes: Vec<_> = answered.heard.faults().map(|fault| fault.cause).collect();
    assert!(causes.contains(&FaultCause::SettingsRefused), "{causes:?}");
}

#[test]
fn a_signed_request_is_late_without_a_crystal_too() {
    let mut requests = keyed(0.1, 0);
    let stops = Fault::after_power_up(0, FaultKind::CrystalStops);
    requests.machine.faults.push(stops);
    requests.machine.sampling_deadline_ns = 3_000_000_000;
    let until = |counter, until| Ticket {
        until,
        ..ticket(counter)
    };
    // The index is the time in sample periods: within 1 %, and less the start of 0.1 s.
    let late = requests.signed(1.5, &Request::Disarm, &key(7), &UID, until(1, 100_000));
    let early = requests.signed(1.6, &Request::Disarm, &key(7), &UID, until(2, 200_000));
    let keep = requests.signed(
        1.7,
        &Request::Keep { index: 1_000_000 },
        &key(7),
        &UID,
        until(3, 200_000),
    );
    let answered = requests.run();
    let said = |number| outcome(&answered, number);
    assert_eq!(
        [late, early, keep].map(said),
        [Outcome::Late, Outcome::Done, Outcome::OutOfRange]
    );
}

#[test]
fn a_bead_that_cannot_write_flash_is_disarmed_and_reset_by_its_owner() {
    let mut requests = keyed(0.6, 0);
    let kind = FaultKind::Supply { millivolts: 2700 };
    requests
        .machine
        .faults
        .push(Fault::after_first_scan(80_000_000, kind));
    let disarm = requests.signed(0.2, &Request::Disarm, &key(7), &UID, ticket(1));
    let stored = requests.signed(0.25, &write(300), &key(7), &UID, ticket(2));
    let rekeyed = requests.signed(0.3, &Request::SetKey { key: [9; 16] }, &key(7), &UID, ticket(3));
    let reboot = requests.signed(0.35, &Request::Reboot, &key(7), &UID, ticket(4));
    let answered = requests.run();
    assert_eq!(outcome(&answered, disarm), Outcome::Done);
    assert_ne!(outcome(&answered, stored), Outcome::Done);
    assert_ne!(outcome(&answered, rekeyed), Outcome::Done);
    assert_eq!(outcome(&answered, reboot), Outcome::Done);
    assert_eq!(
        answered.outcome.flash_operations,
        [],
        "nothing is written with a low supply"
    );
    assert_eq!(secret(&answered), Some(([7; 16], 0)));
    let causes: Vec<_> = answered.heard.faults().map(|fault| fault.cause).collect();
    assert!(causes.contains(&FaultCause::SupplyLow));
}

#[test]
fn a_lost_key_is_cured_by_a_probe_that_erases_the_store_and_by_nothing_on_the_line() {
    let mut requests = keyed(0.5, 0);
    let tries = [
        Request::SetKey { key: [9; 16] },
        Request::EraseSettings,
        Request::Reboot,
        write(300),
    ];
    let tried: Vec<_> = (0..)
        .zip(&tries)
        .flat_map(|(n, request)| {
            let at = 0.1 + 0.05 * f64::from(n);
            let unsigned = requests.request(at, request);
            [
                unsigned,
                requests.signed(at + 0.02, request, &key(9), &UID, ticket(1)),
            ]
        })
        .collect();
    let answered = requests.run();
    for pair in tried.chunks(2) {
        let said: Vec<_> = pair.iter().map(|&number| outcome(&answered, number)).collect();
        assert_eq!(said, [Outcome::Unsigned, Outcome::Forged]);
    }
    assert_eq!(secret(&answered), Some(([7; 16], 0)));
    // A probe has erased sectors 10 and 11.
    let mut requests = run_for(0.3);
    requests
        .machine
        .flash
        .push((STORE_ADDRESS, StoreFlash::blank(2).bytes));
    let set = requests.request(0.1, &Request::SetKey { key: [9; 16] });
    let answered = requests.run();
    assert_eq!(outcome(&answered, set), Outcome::Done);
    assert_eq!(secret(&answered), Some(([9; 16], 0)));
}
