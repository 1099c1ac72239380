//! Receives another image over the line.
//!
//! # Design
//! The flash has one bank, which cannot be read while a sector is erased. The code is in it, so the core
//! stands still for a second or two. A bead that measures therefore erases nothing: it judges the manifest of
//! the image, and resets into a start that takes no samples ([`UpdateStage::Receiving`]), which erases and
//! receives the image. A reset ends the update, whatever its outcome.
//!
//! An image on trial that passes its self-test confirms itself, which takes another erase, and a reset
//! follows. If anything else ends the trial, such as a panic, the watchdog or a power cut, the loader returns
//! to the previous image.

use bead_update::manifest::Manifest;
use bead_update::nor_flash::NorFlash;
use bead_update::reception::{Expected, Reception, Refusal};
use bead_update::swap::Images;
use bead_wire::{Detail, Outcome, UpdateStage};

use crate::answer::{Answer, supply_low};
use crate::bead::BeadState;
use crate::block::SAMPLE_RATE_HZ;
use crate::device::Device;

/// Time without an update request after which a bead no longer waits for an image.
const PATIENCE: u64 = 10 * SAMPLE_RATE_HZ as u64;
/// Bytes that an erase makes room for at a time.
const PAGE: usize = bead_update::layout::PAGE;

/// The images in flash, and the one being received.
pub(crate) struct Updates<F> {
    images: Images<F>,
    reception: Option<Reception>,
    /// Time of the last request of the update.
    heard: u64,
}

impl<F> Updates<F> {
    pub(crate) const fn new(images: Images<F>) -> Self {
        Self {
            images,
            reception: None,
            heard: 0,
        }
    }
}

impl<F: NorFlash> Updates<F> {
    /// Judges an image by its manifest, and makes room for it. Returns `true` if the bead has to reset first,
    /// to stop acquisition; the host then repeats the request.
    #[inline(never)]
    pub(crate) fn begin<D: Device>(
        &mut self,
        bead: &BeadState<D>,
        manifest: &[u8],
        older: bool,
    ) -> Result<bool, Answer> {
        let device = bead.device();
        let board = device.board();
        let expected = Expected {
            key: &D::UPDATE_KEY,
            board: board.name.as_str(),
            version: D::FIRMWARE,
            capacity: self.images.capacity(),
        };
        let manifest = expected
            .judge(manifest, older)
            .map_err(|refusal| refused(refusal, &expected, manifest))?;
        if device.supply_is_low() {
            return Err(supply_low());
        }
        match device.update_stage() {
            UpdateStage::Receiving => {}
            UpdateStage::OnTrial => {
                let why = "an image is on trial: ask again in two seconds";
                return Err((Outcome::Busy, why.into()));
            }
            _ => {
                if !bead.has_scans() {
                    let why = "no image passes its trial without a crystal: repair the board, or use a probe";
                    return Err((Outcome::ImageRefused, why.into()));
                }
                device.receive_after_reset();
                return Ok(true);
            }
        }
        self.reception = None;
        let begun = Reception::begin::<_, PAGE>(&self.images, &manifest);
        self.heard = device.now();
        self.reception = Some(begun.map_err(said)?);
        Ok(false)
    }

    /// Takes bytes of the image.
    #[inline(never)]
    pub(crate) fn take<D: Device>(&mut self, device: &D, offset: u32, bytes: &[u8]) -> Result<(), Answer> {
        self.act(device, |reception, images| reception.take(images, offset, bytes))
    }

    /// Compares the image with its manifest, and lets the next start try it.
    #[inline(never)]
    pub(crate) fn finish<D: Device>(&mut self, device: &D) -> Result<(), Answer> {
        self.act(device, Reception::finish)
    }

    fn act<D: Device>(
        &mut self,
        device: &D,
        act: impl FnOnce(&Reception, &Images<F>) -> Result<(), Refusal>,
    ) -> Result<(), Answer> {
        if device.supply_is_low() {
            return Err(supply_low());
        }
        let done = match &self.reception {
            Some(reception) => act(reception, &self.images),
            None => Err(Refusal::NotBegun),
        };
        self.heard = device.now();
        done.map_err(said)
    }

    /// Returns `true` if the bead waits for an image, and no request of the update came for [`PATIENCE`].
    pub(crate) fn is_idle<D: Device>(&self, device: &D) -> bool {
        device.update_stage() == UpdateStage::Receiving && device.now() > self.heard + PATIENCE
    }

    /// Confirms the image on trial.
    ///
    /// # Panics
    /// The flash cannot be written: the loader returns to the previous image.
    pub(crate) fn confirm(&self) {
        if self.images.confirm().is_err() {
            panic!("the flash does not take that the image on trial is good");
        }
    }
}

/// The answer that refuses an image, with details from its manifest where they help.
#[inline(never)]
fn refused(refusal: Refusal, expected: &Expected<'_>, manifest: &[u8]) -> Answer {
    let Ok(image) = Manifest::read(manifest) else {
        return said(refusal);
    };
    let (board, version, capacity) = (expected.board, expected.version, expected.capacity);
    let why = match refusal {
        Refusal::Board => Detail::new(format_args!(
            "the image is for {}, but this board is {board}",
            image.board
        )),
        Refusal::Older => Detail::new(format_args!(
            "the image is {}, older than {version}",
            image.version
        )),
        Refusal::Length => Detail::new(format_args!(
            "the image has {} bytes; 1 to {capacity} are allowed",
            image.length
        )),
        _ => return said(refusal),
    };
    (Outcome::ImageRefused, why)
}

/// The answer to a refusal that needs no details.
fn said(refusal: Refusal) -> Answer {
    let outcome = match refusal {
        Refusal::Flash => Outcome::FlashFailed,
        Refusal::Place => Outcome::OutOfRange,
        _ => Outcome::ImageRefused,
    };
    let why = match refusal {
        Refusal::NoManifest => "the received bytes are not the manifest of an image",
        Refusal::Unsigned => "the image is not signed with the key that this bead was built with",
        Refusal::NotBegun => "no update has begun since the last start: begin again",
        Refusal::Place => "the piece is outside the image, or is not a whole number of words",
        Refusal::Differs => "other bytes have already been written there: begin again",
        Refusal::NotThatImage => "the received bytes are not the announced image: begin again",
        Refusal::Flash => "the flash does not keep what is written: begin again",
        Refusal::Board | Refusal::Older | Refusal::Length => "",
    };
    (outcome, why.into())
}
