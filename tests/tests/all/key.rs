//! A bead with a key, and without a crystal. The tests of `bead-app` cover what it does and refuses.

use crate::store::{STORE_ADDRESS, STORE_RANGE, StoreFlash};
use bead_store::{Secret, Store, Vault};
use bead_tests::{Requests, paper};
use bead_wire::{Identity, Key, Outcome, Request, Ticket};
use stm32f405_qemu::{Fault, FaultKind};

/// The key in the store.
const KEY: [u8; 16] = [7; 16];

/// A run of a bead that has the key.
fn keyed() -> Requests {
    let mut requests = Requests::new(&paper(0, 0.1, Some(1)));
    requests.machine.count_instructions = false;
    let mut vault = Vault::new(Store::open(StoreFlash::blank(2), STORE_RANGE).0);
    let secret = Secret { key: KEY, counter: 0 };
    vault.keep(Some(secret)).expect("there is room");
    requests
        .machine
        .flash
        .push((STORE_ADDRESS, vault.into_flash().bytes));
    requests
}

#[test]
fn a_signed_request_is_late_without_a_crystal_too() {
    let identified = keyed().run().received;
    let identity: &Identity = identified.all().next().expect("the bead says who it is at boot");
    let mut requests = keyed();
    let stops = Fault::after_power_up(0, FaultKind::CrystalStops);
    requests.machine.faults.push(stops);
    requests.machine.sampling_deadline_ns = 3_000_000_000;
    // The index is the time in sample periods: within 1 %, and less the start of 0.1 s.
    let key = Key::new(KEY).expect("it is not zero");
    let asked = [
        (Request::Disarm, 100_000, Outcome::Late),
        (Request::Disarm, 200_000, Outcome::Done),
        (Request::Keep { index: 1_000_000 }, 200_000, Outcome::OutOfRange),
    ];
    for ((request, until, _), counter) in asked.iter().zip(1..) {
        let ticket = Ticket {
            counter,
            boot: 0,
            until: *until,
        };
        requests.signed(1.4 + 0.1 * counter as f64, request, &key, &identity.uid, ticket);
    }
    let answered = requests.run();
    for ((request, _, outcome), number) in asked.iter().zip(0..) {
        assert_eq!(answered.received.answer(number).0, *outcome, "{request:?}");
    }
}
