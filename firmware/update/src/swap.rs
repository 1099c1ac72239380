//! The swap of two images, and the state that it leaves: `embassy-boot`, over flash that may lose power.
//!
//! # Design
//! The loader swaps page by page, and notes each page that is done. Whenever the power fails, the next start
//! continues where this one ended. The image that came in is then on trial: unless it is
//! [confirmed](Images::confirm), the next start swaps back.
//!
//! `embassy-boot` expects a word of the state to be either written or not, as in flash that checks each one.
//! This part has no such check: a cut during a write or an erase leaves any mixture of old and new bits. So
//! each word has [`WIDE`] bytes, all equal, and a cut would have to change all of them alike to turn one mark
//! into another.

use core::cell::RefCell;

use embassy_boot::{
    AlignedBuffer, BlockingFirmwareState, BootError, BootLoader, BootLoaderConfig, FirmwareUpdaterError,
    State,
};
use embedded_storage::nor_flash::NorFlash;

use crate::layout::Layout;
use crate::partition::Partition;

/// Bytes of a word of the state.
pub const WIDE: usize = 32;
/// The state of a bead that has never been updated. A debug probe has to write it together with an image: a
/// state left by an earlier update would undo the image.
pub const SETTLED: [u8; WIDE] = [BOOT_MAGIC; WIDE];
/// Byte with which `embassy-boot` marks this state.
const BOOT_MAGIC: u8 = 0xd0;

/// Bytes that are copied at a time.
const COPIED: usize = 1024;

/// Swaps the images if another one is to be tried, and back if it was not confirmed. The loader calls it
/// before it starts the active image. `PAGE` is the size of the active image's sectors.
///
/// # Errors
/// The flash fails, for instance in a power cut. The next call continues.
pub fn prepare<F: NorFlash, const PAGE: usize>(flash: F, layout: &Layout) -> Result<(), BootError> {
    let flash = RefCell::new(flash);
    let config = BootLoaderConfig {
        active: Partition::<F, PAGE, 4>::new(&flash, layout.active.clone()),
        dfu: Partition::<F, PAGE, 4>::new(&flash, layout.spare.clone()),
        state: Partition::<F, PAGE, WIDE>::new(&flash, layout.state.clone()),
    };
    let mut buffer = AlignedBuffer([0; COPIED]);
    BootLoader::new(config).prepare_boot(buffer.as_mut()).map(drop)
}

/// Returns `true` if [`prepare`] is going to swap images.
pub fn is_pending<F: NorFlash>(flash: &mut F, layout: &Layout) -> bool {
    let mut word = [0; WIDE];
    flash.read(layout.state.start, &mut word).is_ok() && State::from(&word[..]) == State::Swap
}

/// Origin of the active image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Running {
    /// The image that a probe brought, or one that was confirmed.
    Settled,
    /// An image on trial: the next start swaps it back, unless it is confirmed.
    Trial,
    /// The image before: the one on trial was not confirmed.
    CameBack,
}

/// The images of a bead, as the active one sees them.
pub struct Images<F> {
    flash: RefCell<F>,
    layout: Layout,
}

impl<F: NorFlash> Images<F> {
    /// The images in this flash.
    pub const fn new(flash: F, layout: Layout) -> Self {
        Self {
            flash: RefCell::new(flash),
            layout,
        }
    }

    /// Longest image, bytes.
    pub fn capacity(&self) -> u32 {
        self.layout.capacity()
    }

    /// Origin of the image that runs.
    pub fn running(&self) -> Running {
        match self.with_state(|state| state.get_state()) {
            Ok(State::Swap) => Running::Trial,
            // A power cut in `confirm` leaves this state too, but then the new image runs.
            Ok(State::Revert) if !self.first_pages_are_equal() => Running::CameBack,
            _ => Running::Settled,
        }
    }

    /// Confirms the image on trial. It erases.
    ///
    /// # Errors
    /// The flash fails.
    pub fn confirm(&self) -> Result<(), FirmwareUpdaterError> {
        self.with_state(|state| state.mark_booted())
    }

    /// Lets the next start try the spare image. It erases.
    ///
    /// # Errors
    /// The flash fails.
    pub(crate) fn mark(&self) -> Result<(), FirmwareUpdaterError> {
        self.with_state(|state| state.mark_updated())
    }

    /// Reads bytes of the spare image.
    pub(crate) fn read(&self, offset: u32, bytes: &mut [u8]) -> Result<(), F::Error> {
        self.flash
            .borrow_mut()
            .read(self.layout.spare.start + offset, bytes)
    }

    /// Writes words of the spare image.
    pub(crate) fn write(&self, offset: u32, bytes: &[u8]) -> Result<(), F::Error> {
        self.flash
            .borrow_mut()
            .write(self.layout.spare.start + offset, bytes)
    }

    /// Erases room for this many bytes of the spare image.
    pub(crate) fn erase<const PAGE: usize>(&self, length: u32) -> Result<(), F::Error> {
        let start = self.layout.spare.start;
        let end = start + length.next_multiple_of(PAGE as u32);
        self.flash.borrow_mut().erase(start, end)
    }

    fn with_state<T>(
        &self,
        act: impl FnOnce(&mut BlockingFirmwareState<'_, Partition<'_, F, WIDE, WIDE>>) -> T,
    ) -> T {
        let partition = Partition::new(&self.flash, self.layout.state.clone());
        act(&mut BlockingFirmwareState::new(partition, &mut [0; WIDE]))
    }

    /// After a swap back the first page of the spare image is that of the image which was on trial.
    fn first_pages_are_equal(&self) -> bool {
        let [mut active, mut spare] = [[0; 256]; 2];
        let mut flash = self.flash.borrow_mut();
        (0..self.layout.spare.len() as u32 - self.layout.capacity())
            .step_by(active.len())
            .all(|offset| {
                flash.read(self.layout.active.start + offset, &mut active).is_ok()
                    && flash.read(self.layout.spare.start + offset, &mut spare).is_ok()
                    && active == spare
            })
    }
}
