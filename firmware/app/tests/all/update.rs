//! Another image over the line: what is refused before anything is erased, and how an update ends.

use bead_store::nor_flash::ReadNorFlash;
use bead_testing::{PowerCutFlash, bodies};
use bead_update::layout::Layout;
use bead_update::manifest::{DEVELOPMENT_SEED, Manifest, hash};
use bead_wire::{FaultCause, LastFault, MAX_PIECE, Outcome, Piece, Request, Standing, Update, UpdateStage};

use crate::bead::{StartState, TestBead};

fn image(length: usize) -> Vec<u8> {
    (0..length as u32)
        .map(|n| (n.wrapping_mul(2_654_435_761) >> 11) as u8)
        .collect()
}

/// A request to take this image, with its manifest changed by `change`.
fn begin(image: &[u8], change: impl FnOnce(&mut Manifest<'_>)) -> Request {
    let mut manifest = Manifest {
        board: "fake",
        version: "1.2.4",
        length: image.len() as u32,
        hash: hash(image),
    };
    change(&mut manifest);
    signed(&manifest, &DEVELOPMENT_SEED, false)
}

fn signed(manifest: &Manifest<'_>, seed: &[u8; 32], older: bool) -> Request {
    let manifest = manifest.signed(seed).expect("its names are short");
    Request::BeginUpdate {
        manifest: bead_wire::Manifest::try_from(&manifest[..]).expect("it fits"),
        older,
    }
}

fn pieces(image: &[u8]) -> impl Iterator<Item = Request> {
    image
        .chunks(MAX_PIECE)
        .enumerate()
        .map(|(n, bytes)| Request::UpdateData {
            offset: (n * MAX_PIECE) as u32,
            bytes: Piece::try_from(bytes).expect("it fits"),
        })
}

/// The stage that the bead reports.
fn stage(bead: &mut TestBead) -> UpdateStage {
    let (frames, _) = bead.ask(&Request::Identity);
    let told = bodies(&frames).map(|update: &Update| update.stage).next();
    told.unwrap_or(UpdateStage::Settled)
}

/// The bytes of the image that runs.
fn running(bead: &TestBead, length: usize) -> Vec<u8> {
    let mut bytes = vec![0; length];
    let mut flash = bead.images.0.borrow_mut();
    flash
        .read(Layout::BEAD.active.start, &mut bytes)
        .expect("flash is read");
    bytes
}

/// A bead that waits for this image and has made room.
fn begun(image: &[u8]) -> TestBead {
    let mut bead = TestBead::new().reboot(&begin(image, |_| {}));
    assert_eq!(stage(&mut bead), UpdateStage::Receiving);
    assert_eq!(bead.outcome(&begin(image, |_| {})), Outcome::Done);
    bead
}

/// A bead on trial with this image.
fn on_trial(image: &[u8]) -> TestBead {
    let mut bead = begun(image);
    for piece in pieces(image) {
        assert_eq!(bead.outcome(&piece), Outcome::Done);
    }
    let mut bead = bead.reboot(&Request::FinishUpdate);
    assert_eq!(stage(&mut bead), UpdateStage::OnTrial);
    assert_eq!(running(&bead, image.len()), image);
    bead
}

#[test]
fn an_image_that_passes_its_trial_stays_and_the_bead_measures_with_it() {
    let image = image(150_001);
    let mut bead = on_trial(&image);
    assert_eq!(bead.end_trial().as_deref(), Some("reset"));
    let mut bead = bead.restart(1 << 4);
    assert_eq!(stage(&mut bead), UpdateStage::Settled);
    assert_eq!(running(&bead, image.len()), image);
    assert_eq!(bead.strike().len(), 1);
    assert_eq!(bead.end_trial(), None, "the trial is over");
}

#[test]
fn an_image_that_fails_its_trial_goes_back_and_the_one_before_says_so() {
    let image = image(5_000);
    let mut bead = on_trial(&image);
    // No block comes: the check of acquisition fails.
    bead.running.acquires = false;
    let text = bead.end_trial().expect("it ends");
    assert_eq!(text, "the image on trial failed its self-test: acquisition");
    let mut record = bead.running.record;
    record.end(bead.running.boot.number, FaultCause::Panic, 0, &text);
    bead.running.record = record.sealed();
    let mut bead = bead.restart(1 << 4);
    assert_eq!(stage(&mut bead), UpdateStage::CameBack);
    assert_eq!(
        running(&bead, image.len()),
        vec![0xFF; image.len()],
        "what was there before"
    );
    bead.run(1.2);
    let mut last = bead.running.all::<LastFault>();
    assert!(last.any(|last| last.detail.as_str() == text), "why it came back");
}

#[test]
fn a_broken_sensor_is_not_the_fault_of_an_image() {
    let mut bead = on_trial(&image(5_000));
    bead.running
        .bead
        .update(|counters| counters.health.standing = Standing::FORCE_STUCK);
    assert_eq!(bead.end_trial().as_deref(), Some("reset"));
    assert_eq!(stage(&mut bead.restart(1 << 4)), UpdateStage::Settled);
}

#[test]
fn what_is_not_for_this_bead_is_refused_before_anything_is_erased() {
    let image = image(5_000);
    let ours = Manifest {
        board: "fake",
        version: "1.2.4",
        length: 5_000,
        hash: hash(&image),
    };
    let unsigned = "the image is not signed with the key that this bead was built with";
    let whole = ours.signed(&DEVELOPMENT_SEED).expect("its names are short");
    let cut = Request::BeginUpdate {
        manifest: bead_wire::Manifest::try_from(&whole[1..]).expect("it fits"),
        older: true,
    };
    for (request, why) in [
        (signed(&ours, &[1; 32], true), unsigned),
        (
            begin(&image, |manifest| manifest.board = "pyboard"),
            "the image is for pyboard, but this board is fake",
        ),
        (
            begin(&image, |manifest| manifest.version = "1.2.2"),
            "the image is 1.2.2, older than 1.2.3",
        ),
        (
            begin(&image, |manifest| manifest.length = 262_145),
            "the image has 262145 bytes; 1 to 262144 are allowed",
        ),
        (
            begin(&image, |manifest| manifest.length = 0),
            "the image has 0 bytes; 1 to 262144 are allowed",
        ),
        (cut, "the received bytes are not the manifest of an image"),
    ] {
        let mut bead = TestBead::new();
        assert_eq!(bead.answer(&request), (Outcome::ImageRefused, why.to_owned()));
        let mut waiting = begun(&image);
        assert_eq!(waiting.outcome(&request), Outcome::ImageRefused, "{why}");
        // The update that was begun goes on.
        let piece = pieces(&image).next().expect("there is one");
        assert_eq!(waiting.outcome(&piece), Outcome::Done);
    }
    // An older image is taken if the request allows that.
    let older = Manifest {
        version: "0.9.0",
        ..ours
    };
    let mut bead = TestBead::new().reboot(&signed(&older, &DEVELOPMENT_SEED, true));
    assert_eq!(stage(&mut bead), UpdateStage::Receiving);
}

#[test]
fn a_bead_on_a_low_supply_or_without_a_crystal_takes_no_image() {
    let request = begin(&image(5_000), |_| {});
    let mut bead = TestBead::new();
    bead.running.hardware.supply_is_low.set(true);
    assert_eq!(bead.outcome(&request), Outcome::FlashFailed);
    let mut bead = TestBead::new();
    bead.running
        .bead
        .update(|counters| counters.health.standing = Standing::CRYSTAL_FAILED);
    let (outcome, why) = bead.answer(&request);
    assert_eq!(outcome, Outcome::ImageRefused);
    assert!(
        why.starts_with("no image passes its trial without a crystal"),
        "{why}"
    );
}

#[test]
fn pieces_may_come_twice_and_in_any_order_but_not_elsewhere_and_not_instead_of_others() {
    let image = image(3_003);
    let mut bead = begun(&image);
    let mut all = Vec::from_iter(pieces(&image));
    all.reverse();
    for piece in all.iter().chain(&all[..3]) {
        assert_eq!(bead.outcome(piece), Outcome::Done);
    }
    let piece = |offset: u32, bytes: &[u8]| Request::UpdateData {
        offset,
        bytes: Piece::try_from(bytes).expect("it fits"),
    };
    let first: [u8; 8] = image[..8].try_into().expect("it is longer");
    for (request, outcome) in [
        (piece(2, &first), Outcome::OutOfRange),
        (piece(0, &first[..7]), Outcome::OutOfRange),
        (piece(3_000, &first), Outcome::OutOfRange),
        (piece(u32::MAX - 3, &first), Outcome::OutOfRange),
        (piece(8, &first), Outcome::ImageRefused),
        (piece(0, &first), Outcome::Done),
    ] {
        assert_eq!(bead.outcome(&request), outcome, "{request:?}");
    }
    let mut bead = bead.reboot(&Request::FinishUpdate);
    assert_eq!(stage(&mut bead), UpdateStage::OnTrial);
}

#[test]
fn what_is_not_whole_or_not_the_image_that_was_announced_is_not_tried() {
    let image = image(5_000);
    let mut bead = TestBead::new();
    for request in [
        Request::FinishUpdate,
        pieces(&image).next().expect("there is one"),
    ] {
        let (outcome, why) = bead.answer(&request);
        assert_eq!(outcome, Outcome::ImageRefused);
        assert!(why.starts_with("no update has begun"), "{why}");
    }
    // A piece is missing.
    let mut bead = begun(&image);
    for piece in pieces(&image).skip(1) {
        assert_eq!(bead.outcome(&piece), Outcome::Done);
    }
    let not_that = (
        Outcome::ImageRefused,
        "the received bytes are not the announced image: begin again".to_owned(),
    );
    assert_eq!(bead.answer(&Request::FinishUpdate), not_that);
    // One bit differs.
    let mut other = image.clone();
    other[4_999] ^= 1;
    let mut bead = begun(&image);
    for piece in pieces(&other) {
        assert_eq!(bead.outcome(&piece), Outcome::Done);
    }
    assert_eq!(bead.answer(&Request::FinishUpdate), not_that);
    assert_eq!(
        stage(&mut bead.restart(1 << 4)),
        UpdateStage::Settled,
        "nothing was tried"
    );
}

#[test]
fn a_bead_that_hears_nothing_more_of_an_update_goes_back_to_measuring() {
    let image = image(5_000);
    let mut bead = begun(&image);
    bead.run(9.5);
    assert_eq!(
        bead.outcome(&pieces(&image).next().expect("there is one")),
        Outcome::Done
    );
    bead.run(9.5);
    assert_eq!(bead.end_idle_update(), None, "it was heard");
    bead.run(1.0);
    assert_eq!(bead.end_idle_update().as_deref(), Some("reset"));
    let mut bead = bead.restart(1 << 4);
    assert_eq!(stage(&mut bead), UpdateStage::Settled);
    assert_eq!(
        bead.end_idle_update(),
        None,
        "a bead that measures waits for nothing"
    );
}

#[test]
fn flash_that_keeps_nothing_is_told() {
    let image = image(5_000);
    let mut bead = begun(&image);
    bead.images.0.borrow_mut().forgets = true;
    let first = pieces(&image).next().expect("there is one");
    assert_eq!(bead.outcome(&first), Outcome::FlashFailed);
    let start = StartState::default();
    *start.images.0.borrow_mut() = PowerCutFlash {
        refused_erases: 1,
        ..PowerCutFlash::blank(48)
    };
    let mut bead = TestBead::start(start).reboot(&begin(&image, |_| {}));
    assert_eq!(bead.outcome(&begin(&image, |_| {})), Outcome::FlashFailed);
    assert_eq!(bead.outcome(&first), Outcome::ImageRefused, "no room was made");
}
