//! Power cuts in an update: wherever the power is cut, a whole image runs, old or new, and the next update
//! succeeds.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use bead_testing::PowerCutFlash;
use bead_update::layout::{Layout, PAGE};
use bead_update::manifest::{HASH, Manifest, hash};
use bead_update::reception::Reception;
use bead_update::swap::{Images, Running, prepare};

/// A bead whose flash has pages of `PAGE` bytes, and its images. An operation returns `None` if the power is
/// cut in it.
struct Bench<const PAGE: usize> {
    /// One page for the state, two for the image that runs, three for the other. Pages before and behind
    /// belong to others: a write there panics.
    layout: Layout,
    /// The old image, which fills both pages.
    old: Vec<u8>,
    /// The new image, which ends within a word of the second page.
    new: Vec<u8>,
    /// Hash of the new image.
    hash: [u8; HASH],
}

impl<const PAGE: usize> Bench<PAGE> {
    fn new() -> Self {
        let place = |from: u32, to: u32| from * PAGE as u32..to * PAGE as u32;
        let bytes = |length: usize, factor: u32| -> Vec<u8> {
            let bytes = (0..length as u32).map(|n| (n.wrapping_mul(factor) >> 13) as u8);
            bytes.collect()
        };
        let new = bytes(PAGE + PAGE / 3 + 1, 2_654_435_761);
        Self {
            layout: Layout {
                state: place(1, 2),
                active: place(2, 4),
                spare: place(4, 7),
            },
            old: bytes(2 * PAGE, 40_503),
            hash: hash(&new),
            new,
        }
    }

    /// The flash with the old image, as a probe leaves it.
    fn flash(&self) -> PowerCutFlash<PAGE> {
        let Layout { state, active, spare } = &self.layout;
        let mut flash = PowerCutFlash::blank(8);
        flash.bytes[active.start as usize..active.end as usize].copy_from_slice(&self.old);
        // Left by an earlier update.
        flash.bytes[spare.start as usize + 100..][..PAGE].fill(0x3C);
        flash.writable = state.start..spare.end;
        flash
    }

    /// True if the new image is where the loader starts one; `None` for a mixture.
    fn runs_new(&self, flash: &PowerCutFlash<PAGE>) -> Option<bool> {
        let active = &flash.bytes[self.layout.active.start as usize..];
        let images = [(false, &self.old), (true, &self.new)];
        let found = images.into_iter().find(|(_, image)| active.starts_with(image));
        found.map(|(new, _)| new)
    }

    /// The bead receives the new image.
    fn receive(&self, flash: &mut PowerCutFlash<PAGE>) -> Option<()> {
        let manifest = Manifest {
            board: "a board",
            version: "1.0.0",
            length: self.new.len() as u32,
            hash: self.hash,
        };
        let images = Images::new(flash, self.layout.clone());
        let reception = Reception::begin::<_, PAGE>(&images, &manifest).ok()?;
        for (n, piece) in self.new.chunks(440).enumerate() {
            reception.take(&images, 440 * n as u32, piece).ok()?;
        }
        reception.finish(&images).ok()
    }

    /// A start: the loader, then the image. An image on trial confirms itself if the new one is `good`.
    fn start(&self, flash: &mut PowerCutFlash<PAGE>, good: bool) -> Option<Running> {
        prepare::<_, PAGE>(&mut *flash, &self.layout).ok()?;
        let new = self.runs_new(flash).expect("a whole image starts");
        let images = Images::new(flash, self.layout.clone());
        let running = images.running();
        if running == Running::Trial && (good || !new) {
            images.confirm().ok()?;
        }
        Some(running)
    }

    /// As many starts as it takes until nothing changes any more.
    fn settle(&self, flash: &mut PowerCutFlash<PAGE>, good: bool) -> Option<()> {
        (0..3).try_for_each(|_| self.start(flash, good).map(drop))
    }

    /// An update and the starts after it.
    fn update(&self, flash: &mut PowerCutFlash<PAGE>, good: bool) -> Option<()> {
        self.receive(flash)?;
        self.settle(flash, good)
    }

    /// Cuts the power in the operation `at` of an update, and checks what the next starts make of it.
    fn survives(&self, at: u32, seed: u32, good: bool) -> PowerCutFlash<PAGE> {
        let mut flash = self.flash();
        (flash.power_left, flash.seed) = (Some(at), seed);
        assert!(self.update(&mut flash, good).is_none(), "operation {at}");
        flash.power_left = None;
        let after_cut = flash.clone();
        // A cut may fall between the start of an image on trial and its confirmation: then the old one comes
        // back. Images may change, but each start is of a whole one.
        for _ in 0..4 {
            assert!(self.start(&mut flash, good).is_some());
        }
        let settled = self.runs_new(&flash).unwrap();
        assert!(good || !settled, "a bad image does not stay: operation {at}");
        // The bead takes the next update in any case.
        assert!(self.update(&mut flash, true).is_some(), "operation {at}");
        assert_eq!(self.runs_new(&flash), Some(true), "operation {at}");
        after_cut
    }
}

/// Number of operations on the flash that `act` takes.
fn operations<const PAGE: usize>(
    mut flash: PowerCutFlash<PAGE>,
    act: impl FnOnce(&mut PowerCutFlash<PAGE>) -> Option<()>,
) -> u32 {
    flash.power_left = Some(u32::MAX);
    assert!(act(&mut flash).is_some());
    u32::MAX - flash.power_left.unwrap()
}

/// Size of a page of small images.
const SMALL: usize = 1024;

#[test]
fn an_update_brings_the_new_image_and_a_bad_one_goes_back() {
    let bench = Bench::<SMALL>::new();
    for (good, then) in [
        (true, (Some(Running::Settled), Some(true))),
        (false, (Some(Running::CameBack), Some(false))),
    ] {
        let mut flash = bench.flash();
        assert!(bench.receive(&mut flash).is_some());
        assert_eq!(bench.runs_new(&flash), Some(false), "not before the reset");
        let seen = [(); 3].map(|()| (bench.start(&mut flash, good), bench.runs_new(&flash)));
        assert_eq!(seen, [(Some(Running::Trial), Some(true)), then, then]);
    }
}

#[test]
fn a_power_cut_in_any_operation_leaves_the_old_or_the_new_image() {
    let bench = Bench::<SMALL>::new();
    for good in [true, false] {
        let all = operations(bench.flash(), |flash| bench.update(flash, good));
        assert!(all > 5 * SMALL as u32 / 4, "{all}");
        for at in 1..=all {
            for seed in [1, 0x1357_9bdf] {
                bench.survives(at, seed + at, good);
            }
        }
    }
}

#[test]
fn a_second_power_cut_while_the_first_is_mended_changes_nothing_of_that() {
    let bench = Bench::<SMALL>::new();
    let all = operations(bench.flash(), |flash| bench.update(flash, true));
    let starts = |flash: &mut PowerCutFlash<SMALL>| bench.settle(flash, true);
    for first in (1..=all).step_by(23) {
        let after_cut = bench.survives(first, first, true);
        for second in (1..=operations(after_cut.clone(), starts)).step_by(37) {
            let mut flash = after_cut.clone();
            flash.power_left = Some(second);
            assert!(starts(&mut flash).is_none());
            flash.power_left = None;
            assert!(starts(&mut flash).is_some(), "operations {first} and {second}");
            assert!(bench.runs_new(&flash).is_some());
        }
    }
}

/// Each operation of an update of the part's own size: a quarter of an hour on two cores.
#[test]
#[ignore = "long: `cargo xtask campaign update` runs it"]
fn a_power_cut_in_any_operation_of_an_update_of_full_size() {
    let bench = &Bench::<PAGE>::new();
    let all = operations(bench.flash(), |flash| bench.update(flash, true));
    let workers = std::thread::available_parallelism().map_or(2, usize::from);
    std::thread::scope(|scope| {
        for worker in 0..workers {
            scope.spawn(move || {
                for at in (1 + worker as u32..=all).step_by(workers) {
                    bench.survives(at, at, true);
                    if at % 4096 == 0 {
                        println!("{at} of {all} operations");
                    }
                }
            });
        }
    });
    println!("{all} operations, each cut: 0 beads that need BOOT0");
}
