//! A bead with a key does what its owner signs, once and in time, and nothing else that changes its state.

use bead_store::{BURST, Secret, Store, Vault};
use bead_testing::{PowerCutFlash, write};
use bead_wire::{FaultCause, Outcome, Request, Standing, Ticket};

use crate::bead::{SECTOR, SharedFlash, StartState, TestBead, status, windows_of};

const RANGE: std::ops::Range<u32> = 0..2 * SECTOR as u32;

fn store_with(counter: u64) -> PowerCutFlash<SECTOR> {
    let mut vault = Vault::new(Store::open(PowerCutFlash::blank(2), RANGE).0);
    let secret = Secret {
        key: [7; 16],
        counter,
    };
    vault.keep(Some(secret)).expect("there is room");
    vault.into_flash()
}

/// A bead that has the key of sevens, and has let through requests up to `counter`.
fn keyed(counter: u64) -> TestBead {
    let start = StartState::default();
    *start.flash.0.borrow_mut() = store_with(counter);
    TestBead::start(start)
}

/// The key in flash, and its counter.
fn secret(flash: &SharedFlash) -> Option<([u8; 16], u64)> {
    let vault = Vault::new(Store::open(flash.0.borrow().clone(), RANGE).0);
    vault.secret().map(|secret| (secret.key, secret.counter))
}

/// A ticket for any time in boot 0.
fn ticket(counter: u64) -> Ticket {
    Ticket {
        counter,
        boot: 0,
        until: u64::MAX,
    }
}

fn set_key(byte: u8) -> Request {
    Request::SetKey { key: [byte; 16] }
}

#[test]
fn a_bead_that_is_given_a_key_does_what_is_signed_and_answers_whoever_asks() {
    let mut bead = TestBead::new();
    assert_eq!(bead.outcome(&Request::Disarm), Outcome::Done);
    assert_eq!(bead.signed(&Request::Arm, 7, ticket(1)), Outcome::NoKey);
    assert_eq!(bead.outcome(&set_key(7)), Outcome::Done);
    let block = write(&windows_of(300));
    for request in [
        Request::Arm,
        Request::Disarm,
        Request::EraseSettings,
        Request::ResetCounters,
        block.clone(),
        set_key(9),
        Request::Reboot,
    ] {
        assert_eq!(bead.outcome(&request), Outcome::Unsigned, "{request:?}");
    }
    for request in [Request::Identity, Request::Status, Request::ReadSettings] {
        assert_eq!(bead.outcome(&request), Outcome::Done, "{request:?}");
    }
    let signed = [
        (Request::Arm, 7, 1, Outcome::Done),
        (block, 7, 2, Outcome::Done),
        (set_key(9), 7, 3, Outcome::Done),
        (Request::Arm, 7, 4, Outcome::Forged),
        (Request::Disarm, 9, 4, Outcome::Done),
        (set_key(0), 9, 5, Outcome::Done),
    ];
    for (request, key, counter, outcome) in signed {
        assert_eq!(
            bead.signed(&request, key, ticket(counter)),
            outcome,
            "{request:?}"
        );
    }
    assert_eq!(bead.outcome(&Request::Arm), Outcome::Done);
    let guard = status(&mut bead).3;
    assert_eq!((guard.keyed, guard.counter, guard.signed), (false, 5, 5));
    assert_eq!((guard.refused_unsigned, guard.refused_forged), (7, 1));
    assert_eq!(secret(&bead.flash), None);
}

#[test]
fn a_request_is_done_once_in_time_and_in_its_boot_also_after_a_reset_and_after_a_power_cut() {
    for power in [false, true] {
        // Flash has 40: the last counter that may have been used.
        let mut bead = keyed(40);
        bead.run(0.1);
        let late = Ticket {
            until: 100,
            ..ticket(42)
        };
        let other_boot = Ticket {
            boot: 9,
            ..ticket(42)
        };
        for (ticket, outcome) in [
            (ticket(40), Outcome::Replayed),
            (ticket(41), Outcome::Done),
            (ticket(41), Outcome::Replayed),
            (late, Outcome::Late),
            (other_boot, Outcome::Late),
            (ticket(41 + (1 << 16) + 1), Outcome::Replayed),
            (ticket(42), Outcome::Done),
        ] {
            assert_eq!(bead.signed(&Request::Arm, 7, ticket), outcome, "{ticket:?}");
        }
        let mut bead = bead.restart(if power { 1 << 3 } else { 1 << 4 });
        let boot = u32::from(!power);
        // Earlier requests are sent again, with the number of their boot and of this one. One write to flash
        // covers 64 counters from the first on.
        for (counter, boot, outcome) in [
            (41, 0, Outcome::Replayed),
            (42, boot, Outcome::Replayed),
            (105, boot, Outcome::Replayed),
            (106, boot, Outcome::Done),
        ] {
            let ticket = Ticket {
                boot,
                ..ticket(counter)
            };
            assert_eq!(bead.signed(&Request::Arm, 7, ticket), outcome, "{ticket:?}");
        }
        assert_eq!(secret(&bead.flash), Some(([7; 16], 170)));
    }
}

#[test]
fn settings_are_written_sixteen_at_once_and_then_only_so_often_whoever_asks_and_over_a_reset() {
    let mut bead = TestBead::new();
    for n in 0..BURST as u16 {
        assert_eq!(bead.outcome(&write(&windows_of(300 + n))), Outcome::Done);
    }
    let (outcome, why) = bead.answer(&write(&windows_of(400)));
    assert_eq!(outcome, Outcome::TooSoon);
    assert!(
        why.starts_with("flash is written at most every 10 s in the long run; try again in "),
        "{why}"
    );
    assert_eq!(bead.outcome(&Request::EraseSettings), Outcome::TooSoon);
    assert_eq!(status(&mut bead).3.refused_too_soon, 2);
    let mut bead = bead.reboot(&Request::Reboot);
    assert_eq!(bead.outcome(&write(&windows_of(500))), Outcome::TooSoon);
    assert_eq!(bead.running.blocks(), [windows_of(315)]);
    bead.run(10.0);
    assert_eq!(bead.outcome(&write(&windows_of(500))), Outcome::Done);
}

#[test]
fn counters_that_leap_are_kept_only_so_often_and_their_requests_are_done() {
    const ASKED: u64 = BURST as u64 + 4;
    let mut bead = keyed(0);
    // Each is above what flash holds.
    for n in 1..=ASKED {
        assert_eq!(bead.signed(&Request::Arm, 7, ticket(65 * n)), Outcome::Done);
    }
    let stored = bead.signed(&write(&windows_of(300)), 7, ticket(65 * ASKED + 1));
    assert_eq!(stored, Outcome::TooSoon);
    assert_eq!(status(&mut bead).3.refused_too_soon, 1);
    assert_eq!(secret(&bead.flash), Some(([7; 16], 65 * u64::from(BURST) + 64)));
}

#[test]
fn a_store_that_cannot_be_read_makes_no_keyed_bead_an_open_one_and_a_reboot_brings_it_back() {
    // Power went while the other sector was erased: not all bits have risen yet. The supply stays low at the
    // start.
    let mut bytes = store_with(0).bytes;
    bytes.rotate_left(SECTOR);
    bytes[..4].fill(0);
    let start = StartState {
        supply_is_good: false,
        ..StartState::default()
    };
    start.flash.0.borrow_mut().bytes = bytes;
    let mut bead = TestBead::start(start);
    for request in [Request::Disarm, set_key(9)] {
        let (outcome, why) = bead.answer(&request);
        assert_eq!(outcome, Outcome::FlashFailed);
        assert!(why.starts_with("the supply is below 2.93 V"), "{why}");
    }
    assert_eq!(bead.outcome(&Request::ReadSettings), Outcome::Done);
    bead.running.hardware.supply_is_low.set(false);
    let (outcome, why) = bead.answer(&Request::Disarm);
    assert_eq!(outcome, Outcome::FlashFailed);
    assert!(why.starts_with("the store cannot be read"), "{why}");
    assert_eq!(bead.signed(&Request::Disarm, 7, ticket(1)), Outcome::FlashFailed);
    assert!(bead.running.causes().contains(&FaultCause::SettingsRefused));
    let mut bead = bead.reboot(&Request::Reboot);
    assert_eq!(bead.outcome(&Request::Disarm), Outcome::Unsigned);
    let owners = Ticket { boot: 1, ..ticket(1) };
    assert_eq!(bead.signed(&Request::Disarm, 7, owners), Outcome::Done);
}

#[test]
fn a_bead_that_cannot_write_flash_is_disarmed_and_reset_by_its_owner() {
    let mut bead = keyed(0);
    bead.running.hardware.supply_is_low.set(true);
    let flash = bead.flash.0.borrow().bytes.clone();
    assert_eq!(bead.signed(&Request::Disarm, 7, ticket(1)), Outcome::Done);
    assert_eq!(
        bead.signed(&write(&windows_of(300)), 7, ticket(2)),
        Outcome::FlashFailed
    );
    assert_eq!(bead.signed(&set_key(9), 7, ticket(3)), Outcome::FlashFailed);
    assert!(bead.running.causes().contains(&FaultCause::SupplyLow));
    assert_eq!(
        bead.flash.0.borrow().bytes,
        flash,
        "nothing is written with a low supply"
    );
}

#[test]
fn a_request_for_a_scan_is_refused_while_none_comes() {
    let mut bead = TestBead::new();
    let refused = |bead: &mut TestBead, index, why: &str| {
        let said = bead.answer(&Request::Keep { index });
        assert_eq!(said, (Outcome::OutOfRange, why.to_owned()));
    };
    for index in [0, 7_000_000] {
        refused(
            &mut bead,
            index,
            "the requested scan must come within the next minute",
        );
    }
    let state = bead.running.bead;
    state.update(|c| c.health.standing = c.health.standing.with(Standing::CRYSTAL_FAILED));
    refused(
        &mut bead,
        1000,
        "no scans come: the crystal does not run, or this is the wrong part",
    );
}
