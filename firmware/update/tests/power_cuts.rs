//! Power cuts in an update: whatever is cut, the old or the new image runs, whole, and the next update comes.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::sync::OnceLock;

use bead_testing::PowerCutFlash;
use bead_update::layout::Layout;
use bead_update::manifest::{HASH, Manifest, hash};
use bead_update::reception::Reception;
use bead_update::swap::{Images, Running, prepare};

/// Sizes of a page.
const SMALL: usize = 1024;
const FULL: usize = 128 * 1024;

/// The power goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct PowerGone;

/// Flash of sectors of `PAGE` bytes: one for the state, two for the image that runs, three for the other.
/// Sectors before and behind belong to others: a write there panics.
fn layout<const PAGE: usize>() -> Layout {
    let place = |from: u32, to: u32| from * PAGE as u32..to * PAGE as u32;
    Layout {
        state: place(1, 2),
        active: place(2, 4),
        spare: place(4, 7),
    }
}

/// The two images, and the hash of the new one.
struct Fixture {
    /// It fills both pages.
    old: Vec<u8>,
    /// It ends within a word of the second.
    new: Vec<u8>,
    hash: [u8; HASH],
}

/// The images for pages of `PAGE` bytes. They are made once: a long run takes them hundreds of thousands of
/// times.
fn fixture<const PAGE: usize>() -> &'static Fixture {
    static ALL: OnceLock<[(usize, Fixture); 2]> = OnceLock::new();
    let bytes = |length: usize, factor: u32| {
        let bytes = (0..length as u32).map(|n| (n.wrapping_mul(factor) >> 13) as u8);
        bytes.collect::<Vec<u8>>()
    };
    let all = ALL.get_or_init(|| {
        [SMALL, FULL].map(|page| {
            let new = bytes(page + page / 3 + 1, 2_654_435_761);
            let fixture = Fixture {
                old: bytes(2 * page, 40_503),
                hash: hash(&new),
                new,
            };
            (page, fixture)
        })
    });
    let found = all.iter().find(|(page, _)| *page == PAGE);
    &found.unwrap().1
}

/// A bead with the old image, as a probe leaves it.
fn bead<const PAGE: usize>() -> PowerCutFlash<PAGE> {
    let Layout { state, active, spare } = layout::<PAGE>();
    let mut flash = PowerCutFlash::blank(8);
    flash.bytes[active.start as usize..active.end as usize].copy_from_slice(&fixture::<PAGE>().old);
    // Something of an update before.
    flash.bytes[spare.start as usize + 100..][..PAGE].fill(0x3C);
    flash.writable = state.start..spare.end;
    flash
}

/// Which image lies where the loader starts one; `None` for a mixture.
fn runs<const PAGE: usize>(flash: &PowerCutFlash<PAGE>) -> Option<bool> {
    let start = layout::<PAGE>().active.start as usize;
    let Fixture { old, new, .. } = fixture::<PAGE>();
    let images = [(false, old), (true, new)];
    let found = images
        .into_iter()
        .find(|(_, image)| flash.bytes[start..].starts_with(image));
    found.map(|(new, _)| new)
}

/// The bead receives the new image. It ends where the power goes.
fn receive<const PAGE: usize>(flash: &mut PowerCutFlash<PAGE>) -> Result<(), PowerGone> {
    let Fixture { new, hash, .. } = fixture::<PAGE>();
    let manifest = Manifest {
        board: "a board",
        version: "1.0.0",
        length: new.len() as u32,
        hash: *hash,
    };
    let images = Images::new(flash, layout::<PAGE>());
    let reception = Reception::begin::<_, PAGE>(&images, &manifest).map_err(|_| PowerGone)?;
    for (n, piece) in new.chunks(440).enumerate() {
        reception
            .take(&images, 440 * n as u32, piece)
            .map_err(|_| PowerGone)?;
    }
    reception.finish(&images).map_err(|_| PowerGone)
}

/// A start: the loader, then the image. An image on trial confirms itself if the new one is `good`. Breaks
/// where the power goes.
fn start<const PAGE: usize>(flash: &mut PowerCutFlash<PAGE>, good: bool) -> Result<Running, PowerGone> {
    prepare::<_, PAGE>(&mut *flash, &layout::<PAGE>()).map_err(|_| PowerGone)?;
    let new = runs(flash).expect("a whole image starts");
    let images = Images::new(flash, layout::<PAGE>());
    let running = images.running();
    if running == Running::Trial && (good || !new) {
        images.confirm().map_err(|_| PowerGone)?;
    }
    Ok(running)
}

/// An update and the starts after it, until nothing changes any more.
fn update<const PAGE: usize>(flash: &mut PowerCutFlash<PAGE>, good: bool) -> Result<(), PowerGone> {
    receive(flash)?;
    for _ in 0..3 {
        start(flash, good)?;
    }
    Ok(())
}

/// Operations that `act` takes of a flash.
fn operations<const PAGE: usize>(
    mut flash: PowerCutFlash<PAGE>,
    act: impl FnOnce(&mut PowerCutFlash<PAGE>) -> Result<(), PowerGone>,
) -> u32 {
    flash.power_left = Some(u32::MAX);
    assert!(act(&mut flash).is_ok());
    u32::MAX - flash.power_left.unwrap()
}

/// Cuts the power in the operation `at` of an update, and checks what the next starts make of it.
fn survives<const PAGE: usize>(at: u32, seed: u32, good: bool) -> PowerCutFlash<PAGE> {
    let mut flash = bead::<PAGE>();
    (flash.power_left, flash.seed) = (Some(at), seed);
    assert!(update(&mut flash, good).is_err(), "operation {at}");
    flash.power_left = None;
    let after_cut = flash.clone();
    // A cut may fall between an image on trial and its word that it is good: then the old one comes back. So
    // they may change; but each start is of a whole image.
    for _ in 0..4 {
        assert!(start(&mut flash, good).is_ok());
    }
    let settled = runs(&flash).unwrap();
    assert!(good || !settled, "a bad image does not stay: operation {at}");
    // The bead takes the next update in any case.
    assert!(update(&mut flash, true).is_ok(), "operation {at}");
    assert_eq!(runs(&flash), Some(true), "operation {at}");
    after_cut
}

#[test]
fn an_update_brings_the_new_image_and_a_bad_one_goes_back() {
    let mut flash = bead::<SMALL>();
    assert!(receive(&mut flash).is_ok());
    assert_eq!(runs(&flash), Some(false), "not before the reset");
    let seen = [(); 3].map(|()| (start(&mut flash, true), runs(&flash)));
    let settled = (Ok(Running::Settled), Some(true));
    assert_eq!(seen, [(Ok(Running::Trial), Some(true)), settled, settled]);

    let mut flash = bead::<SMALL>();
    assert!(receive(&mut flash).is_ok());
    let seen = [(); 3].map(|()| (start(&mut flash, false), runs(&flash)));
    let back = (Ok(Running::CameBack), Some(false));
    assert_eq!(seen, [(Ok(Running::Trial), Some(true)), back, back]);
}

#[test]
fn a_power_cut_in_any_operation_leaves_the_old_or_the_new_image() {
    for good in [true, false] {
        let all = operations(bead::<SMALL>(), |flash| update(flash, good));
        assert!(all > 5 * SMALL as u32 / 4, "{all}");
        for at in 1..=all {
            for seed in [1, 0x1357_9bdf] {
                survives::<SMALL>(at, seed + at, good);
            }
        }
    }
}

#[test]
fn a_second_power_cut_while_the_first_is_mended_changes_nothing_of_that() {
    let all = operations(bead::<SMALL>(), |flash| update(flash, true));
    let starts = |flash: &mut PowerCutFlash<SMALL>| {
        for _ in 0..3 {
            start(flash, true)?;
        }
        Ok(())
    };
    for first in (1..=all).step_by(23) {
        let after_cut = survives::<SMALL>(first, first, true);
        for second in (1..=operations(after_cut.clone(), starts)).step_by(37) {
            let mut flash = after_cut.clone();
            flash.power_left = Some(second);
            assert!(starts(&mut flash).is_err());
            flash.power_left = None;
            assert!(starts(&mut flash).is_ok(), "operations {first} and {second}");
            assert!(runs(&flash).is_some());
        }
    }
}

/// Each operation of an update of the part's own size: a quarter of an hour on two cores.
#[test]
#[ignore = "long: `cargo xtask campaign update` runs it"]
fn a_power_cut_in_any_operation_of_an_update_of_full_size() {
    let all = operations(bead::<FULL>(), |flash| update(flash, true));
    let workers = std::thread::available_parallelism().map_or(2, usize::from);
    std::thread::scope(|scope| {
        for worker in 0..workers {
            scope.spawn(move || {
                for at in (1 + worker as u32..=all).step_by(workers) {
                    survives::<FULL>(at, at, true);
                    if at % 4096 == 0 {
                        println!("{at} of {all} operations");
                    }
                }
            });
        }
    });
    println!("{all} operations, each cut: 0 beads that need BOOT0");
}
