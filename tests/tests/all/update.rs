//! Another image in place of the one that runs, through the loader in QEMU: over the line, and with power
//! cuts.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use std::time::Duration;

use bead_store::Store;
use bead_tests::{Requests, RequestsRun, image, paper};
use bead_update::file::{UpdateFile, sign};
use bead_update::layout::{FLASH, Layout};
use bead_update::manifest::{DEVELOPMENT_SEED, MANIFEST, Manifest, hash};
use bead_wire::{MAX_PIECE, Message, Outcome, Piece, Request, Status, UpdateStage};
use object::read::elf::{ElfFile32, ProgramHeader};
use rayon::prelude::*;
use stm32f405_qemu::{Fault, FaultKind, ResetCause};
use tempfile::TempDir;

use crate::store::{STORE_ADDRESS, STORE_RANGE, StoreFlash};

/// Commit of the new image, in the place of that of the old one.
pub(crate) const NEW: &[u8] = b"a-new-image!";

/// The ELF file of the new image: the old one but for its commit, signed by this key.
pub(crate) fn signed_file(board: &str, version: &str, seed: &[u8; 32]) -> Vec<u8> {
    let mut file = std::fs::read(image()).expect("the image is there");
    let mark = b"bead-image:0.1.0 ";
    let named = file.windows(mark.len()).position(|bytes| bytes == mark);
    let named = named.expect("its name lies behind its vectors") + mark.len();
    let commit: [u8; NEW.len()] = *file[named..].first_chunk().expect("it goes on");
    let places = file.windows(NEW.len()).enumerate();
    let places = Vec::from_iter(places.filter(|(_, bytes)| **bytes == commit).map(|(at, _)| at));
    assert!(places.len() > 1, "in the name, and in the identity");
    for at in places {
        file[at..][..NEW.len()].copy_from_slice(NEW);
    }
    sign(&file, board, version, seed).expect("it is an image")
}

static NEW_IMAGE: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let file = signed_file("stm32f405rg", "0.1.0", &DEVELOPMENT_SEED);
    UpdateFile::read(&file).expect("it is signed").image
});

fn manifest(board: &str) -> [u8; MANIFEST] {
    let manifest = Manifest {
        board,
        version: env!("CARGO_PKG_VERSION"),
        length: NEW_IMAGE.len() as u32,
        hash: hash(&NEW_IMAGE),
    };
    manifest.signed(&DEVELOPMENT_SEED).expect("its names are short")
}

/// A run of a bead without a strike, of this many seconds.
fn quiet(seconds: f64) -> Requests {
    let mut requests = Requests::new(&paper(0, 0.1, Some(1)));
    requests.machine.count_instructions = false;
    requests.machine.tail_ns = (seconds * 1e9) as u64;
    requests.machine.timeout = Duration::from_secs(300);
    requests
}

/// For each boot: true if it ran the new image, and its stage.
fn boots(run: &RequestsRun) -> Vec<(bool, UpdateStage)> {
    let mut boots = Vec::new();
    for frame in &run.received.frames {
        match &frame.message {
            Message::Identity(identity) if frame.header.sequence == 0 => {
                boots.push((
                    identity.git.as_str().as_bytes().starts_with(NEW),
                    UpdateStage::Settled,
                ));
            }
            Message::Update(update) => {
                if let Some((_, stage)) = boots.last_mut() {
                    *stage = update.stage;
                }
            }
            _ => {}
        }
    }
    boots
}

#[test]
fn an_image_that_comes_over_the_line_is_tried_and_stays() {
    let mut requests = quiet(16.0);
    let begin = |board| Request::BeginUpdate {
        manifest: bead_wire::Manifest::try_from(&manifest(board)[..]).expect("it fits"),
        older: false,
    };
    let other = requests.request(0.02, &begin("another-board"));
    requests.request(0.095, &Request::Status);
    let asked = [0.12, 0.62].map(|at| requests.request(at, &begin("stm32f405rg")));
    // An erase of two sectors takes two seconds.
    let mut at = 2.9;
    let mut sent = Vec::new();
    for (n, bytes) in NEW_IMAGE.chunks(MAX_PIECE).enumerate() {
        let piece = Request::UpdateData {
            offset: (n * MAX_PIECE) as u32,
            bytes: Piece::try_from(bytes).expect("it fits"),
        };
        sent.push(requests.request(at, &piece));
        at += 0.0055;
    }
    let finish = requests.request(at + 0.05, &Request::FinishUpdate);
    let run = requests.run();
    assert_eq!(run.received.answer(other).0, Outcome::ImageRefused);
    for number in asked.iter().chain(&sent).chain([&finish]) {
        assert_eq!(run.received.answer(*number).0, Outcome::Done, "request {number}");
    }
    assert_eq!(
        boots(&run),
        [
            (false, UpdateStage::Settled),
            (false, UpdateStage::Receiving),
            (true, UpdateStage::OnTrial),
            (true, UpdateStage::Settled)
        ]
    );
    let [.., last] = &run.outcome.resets[..] else {
        panic!("it resets to wait, to swap, and when the new image has passed its trial");
    };
    let took = last.at_ns as f64 * 1e-9 - 0.1;
    let free = run.received.all::<Status>().map(|status| status.stack_free_min);
    let free = free.min().expect("a bead sends its status");
    println!("from the first request to the last reset: {took:.1} s; {free} bytes of stack were never used");
    assert!(free >= 4096, "{free}");
    assert!(took < 15.0, "{took}");
}

/// Contents of the store: settings that came over the link.
static STORED: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let mut store = Store::open(StoreFlash::blank(2), STORE_RANGE).0;
    store.write(&paper(0, 0.1, None).block).expect("there is room");
    store.into_flash().bytes
});

/// The image without the state that a probe writes with it, so that a run can begin in another one.
fn without_state(folder: &TempDir) -> PathBuf {
    let mut file = std::fs::read(image()).expect("the image is there");
    let state = FLASH + Layout::BEAD.state.start;
    let (at, size) = {
        let elf = ElfFile32::<object::Endianness>::parse(&*file).expect("it is an ELF file");
        let headers = elf.elf_program_headers();
        let place = headers
            .iter()
            .position(|header| header.p_paddr(elf.endian()) == state);
        (place.expect("it has a state"), size_of_val(&headers[0]))
    };
    // e_phoff of an ELF header.
    let table = u32::from_le_bytes(file[28..32].try_into().expect("four bytes")) as usize;
    file[table + at * size..][..4].fill(0);
    let path = folder.path().join("image.elf");
    std::fs::write(&path, file).expect("the folder can be written to");
    path
}

/// A bead with this image that was told to try the new one, and whose power is cut in operation `cut` of the
/// flash; `None` for no cut.
fn swapped(image: &Path, cut: Option<u32>) -> RequestsRun {
    let mut requests = quiet(20.0);
    requests.machine.elf = image.to_owned();
    let Layout { state, spare, .. } = Layout::BEAD;
    requests.machine.flash.push((FLASH + state.start, vec![0xF0; 32]));
    requests.machine.flash.push((STORE_ADDRESS, STORED.to_vec()));
    requests
        .machine
        .flash
        .push((FLASH + spare.start, NEW_IMAGE.clone()));
    if let Some(after) = cut {
        let kind = FaultKind::PowerCutInFlash { after, percent: 40 };
        requests.machine.faults.push(Fault::after_power_up(0, kind));
    }
    requests.machine.sampling_deadline_ns = 20_000_000_000;
    requests.run()
}

/// A spread sample; `cargo xtask campaign update` cuts each operation, on a model of the flash alone.
#[test]
fn a_power_cut_in_a_swap_leaves_a_bead_that_starts_with_a_whole_image() {
    let folder = tempfile::tempdir().expect("there is room");
    // Written once: the runs share it.
    let image = without_state(&folder);
    let whole = swapped(&image, None);
    assert_eq!(
        boots(&whole),
        [(true, UpdateStage::OnTrial), (true, UpdateStage::Settled)]
    );
    let operations = &whole.outcome.flash_operations;
    // Four of the swap, and that of the state when the image is confirmed.
    let erases = (0..).zip(operations).filter(|(_, operation)| operation.erase);
    let erases = Vec::from_iter(erases.map(|(at, _)| at));
    assert_eq!(erases.len(), 5, "{} operations", operations.len());
    // A word of the third copy; a word of the last mark; the erase that confirms.
    let cuts = [erases[2] + 30_000, erases[4] - 12, erases[4]];
    cuts.into_par_iter().for_each(|cut: u32| {
        let run = swapped(&image, Some(cut));
        assert_eq!(
            run.outcome.resets[0].cause,
            ResetCause::PowerCut,
            "operation {cut}"
        );
        let boots = boots(&run);
        println!("operation {cut} of {}: {boots:?}", operations.len());
        let (is_new, stage) = boots[boots.len() - 1];
        assert_eq!(stage, UpdateStage::Settled, "operation {cut}: {boots:?}");
        let (start, flash) = &run.outcome.flash;
        let active = &flash[(FLASH + Layout::BEAD.active.start - start) as usize..];
        assert!(
            is_new && active.starts_with(&NEW_IMAGE),
            "operation {cut}: the image is whole"
        );
        assert_eq!(run.store(), *STORED, "operation {cut}: settings stay");
    });
}
