//! The flash that holds images, and the part of the running image in an update.

use core::sync::atomic::{AtomicU8, Ordering};

use bead_update::internal::{FlashError, InternalFlash};
use bead_update::layout::Layout;
use bead_update::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use bead_update::swap::{Images, Running};
use bead_wire::UpdateStage;

use crate::{storage, watchdog};

include!(concat!(env!("OUT_DIR"), "/update_key.rs"));

static STAGE: AtomicU8 = AtomicU8::new(0);

/// The part's flash. Acquisition does not run while it is erased, or a reset follows.
pub(crate) struct ImageFlash(InternalFlash);

impl ErrorType for ImageFlash {
    type Error = FlashError;
}

impl ReadNorFlash for ImageFlash {
    const READ_SIZE: usize = InternalFlash::READ_SIZE;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        self.0.read(offset, bytes)
    }

    fn capacity(&self) -> usize {
        self.0.capacity()
    }
}

impl NorFlash for ImageFlash {
    const WRITE_SIZE: usize = InternalFlash::WRITE_SIZE;
    const ERASE_SIZE: usize = InternalFlash::ERASE_SIZE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        storage::without_time(|| self.0.erase(from, to))
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        self.0.write(offset, bytes)
    }
}

/// The images in flash. Called once; `receiving` says that this start waits for one.
pub(crate) fn begin(receiving: bool) -> Images<ImageFlash> {
    let images = Images::new(ImageFlash(InternalFlash { feed: watchdog::feed }), Layout::BEAD);
    let stage = match images.running() {
        Running::Trial => UpdateStage::OnTrial,
        _ if receiving => UpdateStage::Receiving,
        Running::CameBack => UpdateStage::CameBack,
        Running::Settled => UpdateStage::Settled,
    };
    STAGE.store(stage.number(), Ordering::Relaxed);
    images
}

/// The stage of an update that the running image is in.
pub(crate) fn stage() -> UpdateStage {
    UpdateStage::from_number(STAGE.load(Ordering::Relaxed))
}
