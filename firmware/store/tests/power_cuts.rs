//! A power cut at any moment leaves the old block or the new one, and a store that works.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use bead_store::{MAX_BLOCK, MAX_SETTINGS, Opened, Secret, Store, StoreError, Vault};
use bead_testing::PowerCutFlash;
use proptest::prelude::*;

/// Small sectors, so that a few writes fill one.
const SECTOR: usize = 2048;
const SIZE: usize = 4 * SECTOR;
/// The store is neither at the start nor at the end of the flash.
const RANGE: std::ops::Range<u32> = SECTOR as u32..3 * SECTOR as u32;

/// Every case; under Miri, which takes seconds for a start, each 200th.
const STEP: usize = if cfg!(miri) { 200 } else { 1 };
/// Every operation in which the power may be cut; under Miri each 60th.
const CUTS: usize = if cfg!(miri) { 60 } else { 1 };
/// Writes that go through both sectors many times; under Miri once.
const WRITES: usize = if cfg!(miri) { 5 } else { 200 };

type CutFlash = PowerCutFlash<SECTOR>;

fn blank() -> CutFlash {
    CutFlash {
        writable: RANGE,
        ..CutFlash::blank(4)
    }
}

/// Flash with block 1 in the store.
fn held() -> CutFlash {
    let (mut store, _) = open(&blank());
    store.write(&block(1)).unwrap();
    store.into_flash()
}

/// Starts on disturbed flash, then on the same flash undisturbed: returns the first start, and the block at
/// the second.
fn disturbed(flash: CutFlash) -> (Opened, Option<Vec<u8>>) {
    let (store, opened) = Store::open(flash, RANGE);
    let (mut store, _) = open(&CutFlash {
        misread_after: None,
        refused_erases: 0,
        ..store.into_flash()
    });
    (opened, read(&mut store))
}

#[test]
fn a_block_survives_a_start_that_reads_it_wrongly_once() {
    for wrong in (0..200).step_by(STEP) {
        let (_, found) = disturbed(CutFlash {
            misread_after: Some(wrong),
            ..held()
        });
        assert_eq!(found, Some(block(1)), "read {wrong} was wrong");
    }
}

#[test]
#[cfg_attr(miri, ignore = "a start over a sector of rubbish takes long there")]
fn where_tidying_fails_a_block_that_can_be_read_is_kept_and_what_cannot_is_erased() {
    // The other sector holds rubbish, and does not let itself be erased at once.
    let mut flash = CutFlash {
        refused_erases: 1,
        ..held()
    };
    flash.bytes[2 * SECTOR..3 * SECTOR].fill(0x5A);
    for misread_after in std::iter::once(None).chain((0..1100).map(Some)) {
        let (opened, found) = disturbed(CutFlash {
            misread_after,
            ..flash.clone()
        });
        assert!(!opened.lost, "read {misread_after:?} was wrong");
        assert_eq!(found, Some(block(1)), "read {misread_after:?} was wrong");
    }
    flash.bytes[SECTOR..2 * SECTOR].fill(0x5A);
    let (opened, found) = disturbed(flash);
    assert!(opened.lost, "{opened:?}");
    assert_eq!(found, None);
}

#[test]
fn a_store_that_is_opened_as_it_is_changes_nothing() {
    for contents in [vec![0xFF; SIZE], vec![0x5A; SIZE]] {
        let ram = CutFlash {
            bytes: contents.clone(),
            ..blank()
        };
        let mut store = Store::open_as_it_is(ram, RANGE);
        assert!(!matches!(store.read(), Ok(Some(_))));
        assert_eq!(store.into_flash().bytes, contents);
    }
    let mut store = Store::open_as_it_is(held(), RANGE);
    assert_eq!(store.read().unwrap(), Some(&block(1)[..]));
}

fn open(ram: &CutFlash) -> (Store<CutFlash>, Opened) {
    Store::open(ram.clone(), RANGE)
}

/// Block number `n`: its length and bytes differ from those of its neighbours.
fn block(n: usize) -> Vec<u8> {
    (0..180 + 7 * (n % 5)).map(|i| (i * 31 + n * 17) as u8).collect()
}

fn read(store: &mut Store<CutFlash>) -> Option<Vec<u8>> {
    store.read().unwrap().map(<[u8]>::to_vec)
}

#[test]
fn a_start_of_a_store_in_order_writes_nothing_and_reads_the_last_block() {
    let (mut store, mut held) = (open(&blank()).0, None);
    for next in [None, Some(block(0)), Some(block(1)), Some(vec![]), Some(block(4))] {
        if let Some(next) = next {
            store.write(&next).unwrap();
            // An empty block stands for none.
            held = Some(next).filter(|block| !block.is_empty());
        }
        let bytes = store.into_flash().bytes;
        let opened;
        (store, opened) = open(&CutFlash {
            bytes: bytes.clone(),
            ..blank()
        });
        assert_eq!(opened, Opened::default());
        assert_eq!(read(&mut store), held);
        let flash = store.into_flash();
        assert!(flash.bytes == bytes, "{held:?}");
        store = open(&flash).0;
    }
}

#[test]
fn a_full_store_refuses_keeps_what_it_has_and_takes_more_after_the_next_start() {
    let (mut store, _) = open(&blank());
    let mut erased = 0;
    let mut starts = 0;
    for n in 0..WRITES {
        if let Err(error) = store.write(&block(n)) {
            assert_eq!(error, StoreError::Full);
            assert_eq!(store.write(&block(n)), Err(StoreError::Full), "however often");
            assert_eq!(read(&mut store), Some(block(n - 1)));
            let opened;
            (store, opened) = open(&store.into_flash());
            assert!(!opened.lost);
            erased += opened.erased;
            starts += 1;
            assert_eq!(read(&mut store), Some(block(n - 1)));
            store.write(&block(n)).unwrap();
        }
    }
    println!("{starts} starts and {erased} erases for {WRITES} writes");
    // A sector of 2 KiB takes eight to ten blocks. A start takes the room of two to three: the blocks that
    // fill the sector, the block that is moved, and the block that made it move.
    let writes = WRITES as u32;
    let range = writes / 10..=writes / 5;
    assert!(range.contains(&starts) || cfg!(miri), "{starts}");
    assert_eq!(erased, starts);
}

#[test]
fn a_start_leaves_room_for_the_longest_block_after_any_number_of_short_ones() {
    let (mut store, _) = open(&blank());
    for n in 0..WRITES {
        let mut starts = 0;
        while let Err(error) = store.write(&[7; 3][..n % 4]) {
            assert_eq!((error, starts), (StoreError::Full, 0), "write {n}");
            starts += 1;
            store = open(&store.into_flash()).0;
        }
        // A start between any two writes.
        let mut other = open(&store.into_flash()).0;
        let before = other.into_flash();
        other = open(&before).0;
        other.write(&[9; MAX_BLOCK]).unwrap();
        store = open(&before).0;
    }
}

#[test]
fn there_is_room_for_the_longest_settings_of_a_frame_beside_a_secret() {
    assert_eq!((MAX_SETTINGS, MAX_BLOCK), (448, 448 + 4 + 16 + 8));
}

#[test]
fn a_block_too_long_is_refused_and_the_longest_is_not() {
    let (mut store, _) = open(&blank());
    store.write(&[7; MAX_BLOCK]).unwrap();
    assert_eq!(store.write(&[8; MAX_BLOCK + 1]), Err(StoreError::TooLong));
    assert_eq!(read(&mut store), Some(vec![7; MAX_BLOCK]));
}

#[test]
fn a_flash_that_does_not_keep_what_is_written_is_found_out() {
    let (mut store, _) = open(&CutFlash {
        forgets: true,
        ..blank()
    });
    assert_eq!(store.write(&block(0)), Err(StoreError::Flash));
}

/// An owner's data on a bead: a key with its counter, and settings.
type Owned = (Option<([u8; 16], u64)>, Option<Vec<u8>>);

fn owned(ram: &CutFlash) -> (Vault<CutFlash>, Owned) {
    let (store, opened) = open(ram);
    assert!(!opened.lost);
    let mut vault = Vault::new(store);
    let secret = vault.secret().map(|secret| (secret.key, secret.counter));
    let block = vault.read().unwrap().map(<[u8]>::to_vec);
    (vault, (secret, block))
}

#[test]
fn a_vault_forgets_its_settings_keeps_its_secret_and_refuses_what_is_too_long() {
    let (mut vault, _) = owned(&blank());
    let secret = Secret {
        key: [3; 16],
        counter: 1 << 40,
    };
    vault.keep(Some(secret)).unwrap();
    for length in [MAX_SETTINGS + 1, MAX_SETTINGS + 2, 2 * MAX_BLOCK] {
        assert_eq!(vault.write(&vec![7; length]), Err(StoreError::TooLong));
    }
    vault.write(&[7; MAX_SETTINGS]).unwrap();
    let (mut vault, held) = owned(&vault.into_flash());
    assert_eq!(held, (Some(([3; 16], 1 << 40)), Some(vec![7; MAX_SETTINGS])));
    vault.clear().unwrap();
    let (_, held) = owned(&vault.into_flash());
    assert_eq!(held, (Some(([3; 16], 1 << 40)), None));
}

/// The operations of an owner on key and settings, in turn, so that a full sector is met in each.
fn change(vault: &mut Vault<CutFlash>, n: usize) -> Result<(), StoreError> {
    let secret = |key: usize| Secret {
        key: [key as u8 + 1; 16],
        counter: 64 * n as u64,
    };
    match n % 5 {
        // A key, the same key with a later counter, other settings, another key, no key.
        0 => vault.keep(Some(secret(n))),
        1 => vault.keep(vault.secret().map(|before| Secret {
            counter: 64 * n as u64,
            ..before
        })),
        2 => vault.write(&block(n)),
        3 => vault.keep(Some(secret(n))),
        _ => vault.keep(None),
    }
}

/// Makes a change like a bead that restarts when its store is full.
fn changed(mut vault: Vault<CutFlash>, n: usize) -> (Vault<CutFlash>, Result<(), StoreError>) {
    match change(&mut vault, n) {
        Err(StoreError::Full) => {
            let mut vault = Vault::new(open(&vault.into_flash()).0);
            let result = change(&mut vault, n);
            (vault, result)
        }
        result => (vault, result),
    }
}

/// Starts the store on flash whose power is cut after `power` operations, and does the change.
fn cut(before: &CutFlash, seed: u32, power: u32, n: usize) -> (CutFlash, Result<(), StoreError>) {
    let ram = CutFlash {
        power_left: Some(power),
        seed,
        ..before.clone()
    };
    let (vault, result) = changed(Vault::new(Store::open(ram, RANGE).0), n);
    (vault.into_flash(), result)
}

/// Starts the store on flash whose power is cut after `power` operations, if that is given.
fn started(mut ram: CutFlash, power: Option<u32>) -> CutFlash {
    ram.power_left = power;
    Store::open(ram, RANGE).0.into_flash()
}

#[test]
fn a_power_cut_in_any_operation_leaves_the_old_key_or_the_new_one_and_the_settings_with_it() {
    let mut cuts = 0;
    for seed in [1, 2, 3, 4].into_iter().step_by(STEP) {
        let mut vault = Vault::new(open(&blank()).0);
        vault.write(&block(0)).unwrap();
        // Some rounds through both sectors.
        for n in (0..25).step_by(STEP) {
            let before = vault.into_flash();
            let (_, old) = owned(&before);
            let (after, result) = changed(owned(&before).0, n);
            result.unwrap();
            let (_, new) = owned(&after.into_flash());
            assert_ne!(old, new, "change {n}");
            let settings_stay = old.1.is_some() && new.1.is_some();
            assert!(settings_stay, "there are settings before and after change {n}");
            let ends = (1..).step_by(CUTS).find(|&power| {
                let (ram, result) = cut(&before, seed * 977 + power, power, n);
                let finished = ram.power_left != Some(0);
                assert!(!finished || result.is_ok());
                // The next start may be cut too.
                let ram = started(started(ram, Some(1 + (seed + power) % 7)), None);
                let (vault, found) = owned(&ram);
                let which = format!("change {n} cut at {power}");
                assert!(found == new || !finished && found == old, "{which}: {found:?}");
                // And the owner goes on.
                assert_eq!(changed(vault, n + 5).1, Ok(()), "{which}");
                finished
            });
            cuts += ends.expect("a change ends");
            vault = changed(owned(&before).0, n).0;
        }
    }
    println!("{cuts} cuts");
    // A change is about 50 words.
    assert!(cuts > 4 * 25 * 45 || cfg!(miri), "{cuts}");
}

#[test]
fn a_store_opened_as_it_is_after_a_power_cut_has_its_key_or_is_unreadable_and_then_takes_nothing() {
    let mut unreadable = 0;
    let mut vault = Vault::new(open(&blank()).0);
    vault.write(&block(0)).unwrap();
    // A key at first, and a later counter for it each time.
    for n in (0..60).step_by(STEP).map(|n| if n == 0 { 0 } else { 5 * n + 1 }) {
        let before = vault.into_flash();
        for power in (1..).step_by(CUTS).take_while(|_| n > 0) {
            let (ram, _) = cut(&before, 977 + power, power, n);
            if ram.power_left != Some(0) {
                break;
            }
            // The next start is cut in its first operation: an erase, or a word of a move.
            let mut ram = started(ram, Some(1));
            ram.power_left = None;
            let held = ram.bytes.clone();
            let mut vault = Vault::new(Store::open_as_it_is(ram, RANGE));
            let is_safe = vault.secret().is_some() || vault.is_unreadable();
            assert!(is_safe, "change {n} cut at {power}: no key");
            if vault.is_unreadable() {
                assert_eq!(vault.keep(None), Err(StoreError::Flash));
                assert_eq!(vault.write(&block(1)), Err(StoreError::Flash));
                assert_eq!(vault.into_flash().bytes, held);
                unreadable += 1;
            }
        }
        let result;
        (vault, result) = changed(owned(&before).0, n);
        result.unwrap();
    }
    println!("{unreadable} stores cannot be read as they are");
    assert!(unreadable > 0 || cfg!(miri));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: if cfg!(miri) { 1 } else { 500 }, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    #[cfg_attr(miri, ignore = "what draws its garbage takes minutes there")]
    fn whatever_the_sectors_held_the_store_works_after_the_start(
        garbage in proptest::collection::vec(prop_oneof![3 => Just(0xFFu8), 1 => any::<u8>()], 2 * SECTOR),
        from in 0..2 * SECTOR, to in 0..2 * SECTOR,
    ) {
        let mut ram = blank();
        // Garbage in a part of the sectors; none if `to` is before `from`.
        if let Some(garbage) = garbage.get(from..to) {
            ram.bytes[SECTOR + from..SECTOR + to].copy_from_slice(garbage);
        }
        let (store, _) = open(&ram);
        prop_assert!(!store.is_unreadable());
        let (vault, result) = changed(Vault::new(store), 2);
        prop_assert_eq!(result, Ok(()));
        prop_assert_eq!(owned(&vault.into_flash()).1, (None, Some(block(2))));
    }
}
