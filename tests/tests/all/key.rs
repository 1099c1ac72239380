//! A bead with a key under a flood, without a crystal, after a reset and after a power cut. The tests of
//! `bead-app` have what it does and refuses.

use std::sync::LazyLock;

use crate::store::{STORE_RANGE, StoreFlash};
use bead_bench::emulation::Emulation;
use bead_store::{BURST, Secret, Store, Vault};
use bead_testing::block;
use bead_tests::{Requests, RequestsRun, paper, replied};
use bead_wire::{Key, Message, Outcome, Request, Ticket};
use stm32f405_qemu::{Fault, FaultKind};

/// Where the bead keeps settings and key (`memory.x`).
const STORE_ADDRESS: u32 = 0x080C_0000;

static QUIET: LazyLock<Emulation> = LazyLock::new(|| paper(0, 0.1, Some(1)));

/// The device id of the emulated bead.
static UID: LazyLock<[u8; 12]> = LazyLock::new(|| {
    let received = run_for(0.05).run().received;
    let identity = received.frames.iter().find_map(|frame| match &frame.message {
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

/// For any time in boot 0.
fn ticket(counter: u64) -> Ticket {
    Ticket {
        counter,
        boot: 0,
        until: u64::MAX,
    }
}

fn outcome(answered: &RequestsRun, request: u16) -> Outcome {
    answered.received.answer(request).0
}

fn write(length: u16) -> Request {
    let settings = QUIET
        .settings
        .with(|bead| bead.capture.length = f64::from(length) * 1e-5);
    bead_testing::write(&block(&settings.unwrap_or_else(|error| panic!("{error}"))))
}

#[test]
fn counter_and_pace_outlive_a_reset_and_the_counter_a_power_cut_too() {
    for power in [false, true] {
        let mut requests = keyed(1.3, 40);
        let mut ask = |at, request: &Request, counter, boot| {
            let ticket = Ticket {
                boot,
                ..ticket(counter)
            };
            requests.signed(at, request, &key(7), &UID, ticket)
        };
        // The first is a write to flash too: its counter.
        let first = ask(0.05, &Request::Arm, 41, 0);
        let written: Vec<_> = (0..BURST as u16)
            .map(|n| ask(0.1 + 0.03 * f64::from(n), &write(300 + n), 42 + u64::from(n), 0))
            .collect();
        if !power {
            ask(0.7, &Request::Reboot, 60, 0);
        }
        let boot = u32::from(!power);
        let replays = [
            ask(1.05, &Request::Arm, 41, 0),
            ask(1.1, &Request::Arm, 105, boot),
        ];
        let next = ask(1.15, &Request::Arm, 106, boot);
        let write = ask(1.2, &write(500), 107, boot);
        if power {
            let cut = Fault::after_first_scan(700_000_000, FaultKind::PowerCut);
            requests.machine.faults.push(cut);
        }
        let answered = requests.run();
        let outcome = |number| outcome(&answered, number);
        assert_eq!(answered.outcome.resets.len(), 1);
        assert_eq!(outcome(first), Outcome::Done);
        let mut written = written.into_iter().map(outcome);
        assert_eq!(written.next_back(), Some(Outcome::TooSoon));
        assert!(written.all(|outcome| outcome == Outcome::Done));
        assert_eq!(replays.map(outcome), [Outcome::Replayed; 2]);
        assert_eq!(outcome(next), Outcome::Done);
        let expected = if power { Outcome::Done } else { Outcome::TooSoon };
        assert_eq!(outcome(write), expected);
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
    let guard = answered.received.guard();
    println!("answered after {took:.3} s; {guard:?}");
    assert!(took < 0.1, "{took}");
    assert!(guard.refused_forged > 50 && guard.signed == 1);
    assert!(!answered.received.status().armed);
    assert_eq!(answered.received.status().overruns, 0);
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
